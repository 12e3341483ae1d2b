use tagalong_core::{Frame, HEAD_BELOW_TOP_M, Rect, Track, UPPER_BODY_SIDE_M};

/// Hues that are told apart.
const HUES: usize = 12;
/// Greys that are told apart.
const GREYS: usize = 4;
/// Colours: each hue dark and bright, and the greys.
const COLOURS: usize = 2 * HUES + GREYS;
/// Directions of edges that are told apart, and one bin for no edge.
const EDGES: usize = 9;
/// Pixels of a patch in each direction that are looked at.
const SAMPLES: usize = 24;
/// Fewer pixels say nothing.
const LEAST_PIXELS: usize = 24;
/// Pixels this far from the person's depth are not the person, m.
const BODY_DEPTH_M: f64 = 0.35;
/// From this saturation on a colour is a hue, and up to that a grey.
const SATURATION: [f64; 2] = [0.08, 0.3];
/// Weaker slopes of the intensity are no edge, grey values a pixel.
const EDGE: f64 = 6.0;
/// Upper body and legs: from and to below the centre of the head, and half the
/// width, m.
const TORSO: [f64; 3] = [0.25, 0.65, 0.17];
const LEGS: [f64; 3] = [0.9, 1.3, 0.15];

/// Relative frequencies.
type Histogram<const N: usize> = [f64; N];

/// What somebody looks like in one frame; what the images do not show is missing.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Looks {
    /// Height of the centre of the head, m.
    pub(crate) height_m: f64,
    torso: Option<Histogram<COLOURS>>,
    legs: Option<Histogram<COLOURS>>,
    texture: Option<Histogram<EDGES>>,
}

/// How two looks differ; Hellinger distances, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Difference {
    pub(crate) torso: Option<f64>,
    pub(crate) legs: Option<f64>,
    pub(crate) texture: Option<f64>,
}

impl Difference {
    /// The mean of what is known; `None` if nothing is.
    pub(crate) fn mean(&self) -> Option<f64> {
        let known = [self.torso, self.legs, self.texture];
        let (sum, count) =
            known.iter().flatten().fold((0.0, 0), |(sum, count), d| (sum + d, count + 1));
        (count > 0).then(|| sum / f64::from(count))
    }
}

impl Looks {
    /// What the person of a track looks like.
    pub(crate) fn of(track: &Track, frame: &Frame) -> Self {
        let height_m = track.estimate.person.position.z;
        let torso = Patch::of(track, frame, TORSO);
        Self {
            height_m,
            torso: torso.colours(),
            legs: Patch::of(track, frame, LEGS).colours(),
            texture: torso.edges(),
        }
    }

    pub(crate) fn difference(&self, other: &Self) -> Difference {
        Difference {
            torso: both(&self.torso, &other.torso),
            legs: both(&self.legs, &other.legs),
            texture: both(&self.texture, &other.texture),
        }
    }
}

fn both<const N: usize>(a: &Option<Histogram<N>>, b: &Option<Histogram<N>>) -> Option<f64> {
    Some(hellinger(a.as_ref()?, b.as_ref()?))
}

/// The Hellinger distance of two distributions, 0 to 1.
fn hellinger<const N: usize>(a: &Histogram<N>, b: &Histogram<N>) -> f64 {
    let overlap: f64 = a.iter().zip(b).map(|(a, b)| (a * b).sqrt()).sum();
    (1.0 - overlap).max(0.0).sqrt()
}

/// The pixels of a part of a person.
struct Patch<'f> {
    frame: &'f Frame,
    area: Rect,
    depth_m: f64,
}

impl<'f> Patch<'f> {
    fn of(track: &Track, frame: &'f Frame, [from_m, to_m, half_m]: [f64; 3]) -> Self {
        let region = &track.estimate.region;
        let px = region.height / UPPER_BODY_SIDE_M;
        let (centre, head_y) = (region.centre().x, region.y + HEAD_BELOW_TOP_M * px);
        let whole = Rect::new(
            centre - half_m * px,
            head_y + from_m * px,
            2.0 * half_m * px,
            (to_m - from_m) * px,
        );
        let camera = &frame.camera;
        let area = whole.clipped(camera.width, camera.height);
        let is_most = area.area() > 0.5 * whole.area();
        Self {
            frame,
            area: if is_most { area } else { Rect::default() },
            depth_m: camera.depth_of(&track.estimate.person.position),
        }
    }

    /// The pixels that are the person's.
    fn pixels(&self) -> impl Iterator<Item = (i64, i64)> {
        let step = |size: f64| (size / SAMPLES as f64).max(1.0);
        let (across, down) = (step(self.area.width), step(self.area.height));
        let columns = (self.area.width / across) as usize;
        let rows = (self.area.height / down) as usize;
        let at = move |i: usize| {
            let (row, column) = (i / columns.max(1), i % columns.max(1));
            let x = self.area.x + (column as f64 + 0.5) * across;
            (x as i64, (self.area.y + (row as f64 + 0.5) * down) as i64)
        };
        (0..rows * columns).map(at).filter(|(x, y)| self.is_body(*x, *y))
    }

    fn is_body(&self, x: i64, y: i64) -> bool {
        let Ok(depth) = self.frame.depth() else { return true };
        let off = |z: f32| (f64::from(z) - self.depth_m).abs();
        depth.get(x, y).is_some_and(|z| off(z) < BODY_DEPTH_M)
    }

    fn colours(&self) -> Option<Histogram<COLOURS>> {
        let colour = self.frame.colour().ok()?;
        let mut histogram = [0.0; COLOURS];
        let mut count = 0;
        for [r, g, b] in self.pixels().filter_map(|(x, y)| colour.get(x, y)) {
            vote(&mut histogram, [r, g, b].map(|v| f64::from(v) / 255.0));
            count += 1;
        }
        normalised(histogram, count)
    }

    fn edges(&self) -> Option<Histogram<EDGES>> {
        let grey = self.frame.grey().ok()?;
        let mut histogram = [0.0; EDGES];
        let mut count = 0;
        for (x, y) in self.pixels() {
            let at = |dx, dy| grey.get(x + dx, y + dy).map(f64::from);
            let slope = |a: Option<f64>, b: Option<f64>| Some(0.5 * (b? - a?));
            let across = slope(at(-1, 0), at(1, 0)).unwrap_or(0.0);
            let down = slope(at(0, -1), at(0, 1)).unwrap_or(0.0);
            histogram[edge(across, down)] += 1.0;
            count += 1;
        }
        normalised(histogram, count)
    }
}

/// A share of each of the two nearest hues and of the nearest greys.
fn vote(histogram: &mut Histogram<COLOURS>, [r, g, b]: [f64; 3]) {
    let (most, least) = (r.max(g).max(b), r.min(g).min(b));
    let saturation = if most > 0.0 { (most - least) / most } else { 0.0 };
    let [grey_below, hue_from] = SATURATION;
    let coloured = ((saturation - grey_below) / (hue_from - grey_below)).clamp(0.0, 1.0);
    let bright = ((most - 0.2) / 0.4).clamp(0.0, 1.0);
    let hue = hue(r, g, b, most, most - least) * HUES as f64;
    let (first, share) = (hue.floor(), hue - hue.floor());
    for (bin, share) in [(first as usize % HUES, 1.0 - share), ((first as usize + 1) % HUES, share)]
    {
        histogram[bin] += coloured * share * (1.0 - bright);
        histogram[HUES + bin] += coloured * share * bright;
    }
    let level = most.sqrt() * (GREYS - 1) as f64;
    let (first, share) = (level.floor(), level - level.floor());
    let first = (first as usize).min(GREYS - 1);
    histogram[2 * HUES + first] += (1.0 - coloured) * (1.0 - share);
    histogram[2 * HUES + (first + 1).min(GREYS - 1)] += (1.0 - coloured) * share;
}

/// The hue, 0 to 1, of a colour whose largest component is `most` and whose
/// components span `range`.
fn hue(r: f64, g: f64, b: f64, most: f64, range: f64) -> f64 {
    if range <= 0.0 {
        return 0.0;
    }
    let sixths = if most == r {
        (g - b) / range
    } else if most == g {
        2.0 + (b - r) / range
    } else {
        4.0 + (r - g) / range
    };
    (sixths / 6.0).rem_euclid(1.0)
}

/// The bin of a slope: its direction, of which the sign does not count.
fn edge(across: f64, down: f64) -> usize {
    if across.hypot(down) < EDGE {
        return EDGES - 1;
    }
    let half_turns = (down.atan2(across) / std::f64::consts::PI).rem_euclid(1.0);
    (half_turns * (EDGES - 1) as f64) as usize % (EDGES - 1)
}

fn normalised<const N: usize>(histogram: Histogram<N>, count: usize) -> Option<Histogram<N>> {
    let sum: f64 = histogram.iter().sum();
    (count >= LEAST_PIXELS && sum > 0.0).then(|| histogram.map(|v| v / sum))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn like_distributions_do_not_differ_and_disjoint_ones_wholly() {
        let (a, b) = ([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]);
        assert!(hellinger(&a, &a) < 1e-6);
        assert_eq!(hellinger(&a, &b), 1.0);
    }

    #[test]
    fn hues_go_round() {
        let of = |[r, g, b]: [f64; 3]| hue(r, g, b, r.max(g).max(b), 1.0);
        assert_eq!(of([1.0, 0.0, 0.0]), 0.0);
        assert!((of([0.0, 1.0, 0.0]) - 1.0 / 3.0).abs() < 1e-12);
        assert!((of([0.0, 0.0, 1.0]) - 2.0 / 3.0).abs() < 1e-12);
        assert!(of([1.0, 0.0, 0.01]) > 0.99);
    }

    proptest! {
        #[test]
        fn every_colour_has_one_vote(r in 0.0..=1.0f64, g in 0.0..=1.0f64, b in 0.0..=1.0f64) {
            let mut histogram = [0.0; COLOURS];
            vote(&mut histogram, [r, g, b]);
            prop_assert!((histogram.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            prop_assert!(histogram.iter().all(|share| *share >= 0.0));
        }

        #[test]
        fn every_slope_has_a_bin(across in -255.0..255.0f64, down in -255.0..255.0f64) {
            prop_assert!(edge(across, down) < EDGES);
            prop_assert_eq!(edge(across, down), edge(across, down));
        }
    }
}
