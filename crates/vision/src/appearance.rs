//! Appearance of a person: colours of upper body and legs, and directions of edges; or the
//! embedding of a network.

use std::sync::Arc;

use nalgebra::Point3;
use tagalong_core::Frame;
use tagalong_geometry::{HEAD_BELOW_TOP_M, Rect, UPPER_BODY_SIDE_M};

/// Bins of hues.
const HUES: usize = 12;
/// Bins of grey levels.
const GREYS: usize = 4;
/// Bins of colours: each hue dark and bright, and the greys.
const COLOURS: usize = 2 * HUES + GREYS;
/// Bins of edge directions, with one for pixels without an edge.
const EDGES: usize = 9;
/// Number of sampled pixels of a patch along each axis.
const SAMPLES: usize = 24;
/// Minimum number of pixels in a histogram.
const LEAST_PIXELS: usize = 24;
/// Depth difference from which on a pixel does not belong to the person, m.
const BODY_DEPTH_M: f64 = 0.35;
/// Saturations between which a colour changes from a grey to a hue.
const SATURATION: [f64; 2] = [0.08, 0.3];
/// Slope of the intensity below which there is no edge, grey values per pixel.
const EDGE: f64 = 6.0;
/// Upper body and legs: start and end below the centre of the head, and half the width, m.
const TORSO: [f64; 3] = [0.25, 0.65, 0.17];
const LEGS: [f64; 3] = [0.9, 1.3, 0.15];

/// Relative frequencies.
type Histogram<const N: usize> = [f64; N];

/// Appearance of a person in one frame; parts that the images do not show are missing.
///
/// Hues are weighted by saturation and shared between neighbouring bins, so that a change of the
/// light changes a histogram only a little.
#[derive(Clone, Debug, PartialEq)]
pub struct Appearance {
    /// Height of the centre of the head, m.
    pub height_m: f64,
    torso: Option<Histogram<COLOURS>>,
    legs: Option<Histogram<COLOURS>>,
    texture: Option<Histogram<EDGES>>,
    /// Embedding of length 1, which replaces all histograms.
    vector: Option<Arc<[f32]>>,
}

/// Distances between two appearances, 0 to 1: Hellinger distances, and for embeddings 1 minus the
/// cosine.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct AppearanceDifference {
    /// Colours of the upper body.
    pub torso: Option<f64>,
    /// Colours of the legs.
    pub legs: Option<f64>,
    /// Directions of edges on the upper body.
    pub texture: Option<f64>,
    /// Embeddings of a network.
    pub vector: Option<f64>,
}

impl AppearanceDifference {
    /// Returns the mean of the known parts; `None` if there are none.
    pub fn mean(&self) -> Option<f64> {
        let known = [self.torso, self.legs, self.texture, self.vector];
        let (sum, count) =
            known.iter().flatten().fold((0.0, 0), |(sum, count), d| (sum + d, count + 1));
        (count > 0).then(|| sum / f64::from(count))
    }
}

impl Appearance {
    /// Returns the appearance of a person by colours and edges. The upper body is given as a region
    /// of the image, pixels, and the head as a position in the robot frame, m.
    pub(crate) fn at(upper_body: &Rect, head: &Point3<f64>, frame: &Frame) -> Self {
        let torso = Patch::of(upper_body, head, frame, TORSO);
        Self {
            height_m: head.z,
            torso: torso.colours(),
            legs: Patch::of(upper_body, head, frame, LEGS).colours(),
            texture: torso.edges(),
            vector: None,
        }
    }

    /// Returns the appearance of a person by the embedding of a network alone, of length 1.
    pub(crate) fn of_vector(height_m: f64, vector: Option<Arc<[f32]>>) -> Self {
        Self { height_m, torso: None, legs: None, texture: None, vector }
    }

    /// Returns the appearance of a person whose upper body has the colour of one bin, or of none:
    /// for tests of code that stores appearances.
    pub fn in_one_colour(height_m: f64, colour: Option<usize>) -> Self {
        let torso = colour.map(|bin| std::array::from_fn(|i| f64::from(i == bin)));
        Self { height_m, torso, legs: None, texture: None, vector: None }
    }

    /// Returns the distances to another appearance; `None` for parts that one of them lacks.
    pub fn difference(&self, other: &Self) -> AppearanceDifference {
        AppearanceDifference {
            torso: both(&self.torso, &other.torso),
            legs: both(&self.legs, &other.legs),
            texture: both(&self.texture, &other.texture),
            vector: self
                .vector
                .as_deref()
                .zip(other.vector.as_deref())
                .map(|(a, b)| cosine_distance(a, b)),
        }
    }
}

/// Returns 1 minus the cosine of the angle between two embeddings of length 1, at most 1.
fn cosine_distance(a: &[f32], b: &[f32]) -> f64 {
    let cosine: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
    // Embeddings of two people may point in opposite directions, but that is no more than
    // different.
    (1.0 - f64::from(cosine)).clamp(0.0, 1.0)
}

fn both<const N: usize>(a: &Option<Histogram<N>>, b: &Option<Histogram<N>>) -> Option<f64> {
    Some(hellinger(a.as_ref()?, b.as_ref()?))
}

/// Returns the Hellinger distance of two distributions, 0 to 1.
fn hellinger<const N: usize>(a: &Histogram<N>, b: &Histogram<N>) -> f64 {
    let overlap: f64 = a.iter().zip(b).map(|(a, b)| (a * b).sqrt()).sum();
    // Rounding can make the overlap of equal distributions exceed 1.
    (1.0 - overlap).max(0.0).sqrt()
}

/// Image patch of a part of a person.
struct Patch<'f> {
    frame: &'f Frame,
    area: Rect,
    depth_m: f64,
}

impl<'f> Patch<'f> {
    fn of(
        region: &Rect,
        head: &Point3<f64>,
        frame: &'f Frame,
        [from_m, to_m, half_m]: [f64; 3],
    ) -> Self {
        let px = region.height / UPPER_BODY_SIDE_M;
        let centre = region.centre().x;
        let head_y = region.y + HEAD_BELOW_TOP_M * px;
        let whole = Rect::new(
            centre - half_m * px,
            head_y + from_m * px,
            2.0 * half_m * px,
            (to_m - from_m) * px,
        );
        let camera = &frame.camera;
        let area = whole.clipped(camera.width, camera.height);
        // A part that is mostly outside of the image is not representative.
        let is_most = area.area() > 0.5 * whole.area();
        Self {
            frame,
            area: if is_most { area } else { Rect::default() },
            depth_m: camera.depth_of(head),
        }
    }

    /// Returns the pixels that belong to the person.
    fn pixels(&self) -> impl Iterator<Item = (i64, i64)> {
        fn step(size: f64) -> f64 {
            (size / SAMPLES as f64).max(1.0)
        }

        let across = step(self.area.width);
        let down = step(self.area.height);
        let columns = (self.area.width / across) as usize;
        let rows = (self.area.height / down) as usize;
        (0..rows * columns)
            .map(move |i| {
                let row = i / columns.max(1);
                let column = i % columns.max(1);
                let x = self.area.x + (column as f64 + 0.5) * across;
                (x as i64, (self.area.y + (row as f64 + 0.5) * down) as i64)
            })
            .filter(|(x, y)| self.is_body(*x, *y))
    }

    fn is_body(&self, x: i64, y: i64) -> bool {
        let Ok(depth) = self.frame.depth() else { return true };
        depth.get(x, y).is_some_and(|z| (f64::from(z) - self.depth_m).abs() < BODY_DEPTH_M)
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
        fn slope(a: Option<u8>, b: Option<u8>) -> Option<f64> {
            Some(0.5 * (f64::from(b?) - f64::from(a?)))
        }

        let grey = self.frame.grey().ok()?;
        let mut histogram = [0.0; EDGES];
        let mut count = 0;
        for (x, y) in self.pixels() {
            let across = slope(grey.get(x - 1, y), grey.get(x + 1, y)).unwrap_or(0.0);
            let down = slope(grey.get(x, y - 1), grey.get(x, y + 1)).unwrap_or(0.0);
            histogram[edge(across, down)] += 1.0;
            count += 1;
        }
        normalised(histogram, count)
    }
}

/// Adds a colour to the two nearest hues and the two nearest greys, each by its share.
fn vote(histogram: &mut Histogram<COLOURS>, [r, g, b]: [f64; 3]) {
    let most = r.max(g).max(b);
    let least = r.min(g).min(b);
    let saturation = if most > 0.0 { (most - least) / most } else { 0.0 };
    let [grey_below, hue_from] = SATURATION;
    let coloured = ((saturation - grey_below) / (hue_from - grey_below)).clamp(0.0, 1.0);
    let bright = ((most - 0.2) / 0.4).clamp(0.0, 1.0);
    // Soft votes, so that a small change of light does not move a pixel to another bin.
    let hue = hue(r, g, b, most, most - least) * HUES as f64;
    let first = hue.floor();
    let share = hue - hue.floor();
    for (bin, share) in [(first as usize % HUES, 1.0 - share), ((first as usize + 1) % HUES, share)]
    {
        histogram[bin] += coloured * share * (1.0 - bright);
        histogram[HUES + bin] += coloured * share * bright;
    }
    // Square root: dark greys are spread over more bins than on a linear scale.
    let level = most.sqrt() * (GREYS - 1) as f64;
    let first = level.floor();
    let share = level - level.floor();
    let first = (first as usize).min(GREYS - 1);
    histogram[2 * HUES + first] += (1.0 - coloured) * (1.0 - share);
    histogram[2 * HUES + (first + 1).min(GREYS - 1)] += (1.0 - coloured) * share;
}

/// Returns the hue, 0 to 1, of a colour whose largest component is `most` and whose components span
/// `range`.
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

/// Returns the bin of a slope: its direction without the sign.
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
        let a = [0.5, 0.5, 0.0];
        let b = [0.0, 0.0, 1.0];
        assert!(hellinger(&a, &a) < 1e-6);
        assert_eq!(hellinger(&a, &b), 1.0);
    }

    #[test]
    fn hues_go_round() {
        fn of([r, g, b]: [f64; 3]) -> f64 {
            hue(r, g, b, r.max(g).max(b), 1.0)
        }

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

    const SURE: f64 = 1e-9;

    /// Returns the bins of a colour and their shares.
    fn votes(colour: [f64; 3]) -> Vec<(usize, f64)> {
        let mut histogram = [0.0; COLOURS];
        vote(&mut histogram, colour);
        histogram.iter().copied().enumerate().filter(|(_, share)| *share > SURE).collect()
    }

    fn assert_votes(colour: [f64; 3], expected: &[(usize, f64)]) {
        let found = votes(colour);
        let fits = found.len() == expected.len()
            && found.iter().zip(expected).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < SURE);
        assert!(fits, "{colour:?}: {found:?}, not {expected:?}");
    }

    /// Twelve hues dark, twelve bright, four greys.
    #[test]
    fn colours_fall_into_bins_by_hue_and_brightness() {
        assert_votes([1.0, 0.0, 0.0], &[(HUES, 1.0)]);
        assert_votes([0.0, 1.0, 0.0], &[(HUES + 4, 1.0)]);
        assert_votes([0.0, 0.0, 1.0], &[(HUES + 8, 1.0)]);
        assert_votes([0.2, 0.0, 0.0], &[(0, 1.0)]);
        assert_votes([0.0, 0.4, 0.0], &[(4, 0.5), (HUES + 4, 0.5)]);
        // An eighth of the way from red to yellow is a quarter of a bin.
        assert_votes([1.0, 0.125, 0.0], &[(HUES, 0.75), (HUES + 1, 0.25)]);
        assert_votes([1.0, 0.0, 0.125], &[(HUES, 0.75), (2 * HUES - 1, 0.25)]);
    }

    #[test]
    fn what_has_no_hue_falls_into_a_grey_by_its_brightness() {
        assert_votes([0.0; 3], &[(2 * HUES, 1.0)]);
        assert_votes([1.0; 3], &[(2 * HUES + 3, 1.0)]);
        assert_votes([0.25; 3], &[(2 * HUES + 1, 0.5), (2 * HUES + 2, 0.5)]);
        assert_votes([1.0, 0.95, 0.95], &[(2 * HUES + 3, 1.0)]);
        // Of a pale red, half is red and half is grey.
        assert_votes([1.0, 0.81, 0.81], &[(HUES, 0.5), (2 * HUES + 3, 0.5)]);
    }

    #[test]
    fn edges_fall_into_eight_directions_whatever_their_sign() {
        let bins = [(9.0, 0.1), (9.0, 4.0), (0.1, 9.0), (-0.1, 9.0), (-9.0, 0.1)];
        let found = bins.map(|(across, down)| edge(across, down));
        assert_eq!(found, [0, 1, 3, 4, 7]);
        for (across, down) in bins {
            assert_eq!(edge(across, down), edge(-across, -down));
        }
        assert_eq!([edge(6.1, 0.0), edge(3.0, -5.0), edge(5.9, 0.0)], [0, EDGES - 1, EDGES - 1]);
    }

    #[test]
    fn distributions_that_share_a_quarter_are_so_far_apart() {
        let a = [0.75, 0.25];
        let b = [0.25, 0.75];
        let overlap = 2.0 * (0.75_f64 * 0.25).sqrt();
        assert!((hellinger(&a, &b) - (1.0 - overlap).sqrt()).abs() < 1e-12);
        assert_eq!(normalised([3.0, 1.0], LEAST_PIXELS), Some([0.75, 0.25]));
        assert_eq!(normalised([3.0, 1.0], LEAST_PIXELS - 1), None);
        assert_eq!(normalised([0.0, 0.0], 99), None);
    }

    #[test]
    fn vectors_differ_by_their_angle() {
        fn looks(x: f32, y: f32) -> Appearance {
            Appearance::of_vector(1.6, Some(Arc::new([x, y])))
        }

        fn difference(other: Appearance) -> f64 {
            looks(1.0, 0.0).difference(&other).mean().unwrap()
        }

        assert_eq!(difference(looks(1.0, 0.0)), 0.0);
        assert!((difference(looks(0.6, 0.8)) - 0.4).abs() < 1e-6);
        assert_eq!([difference(looks(0.0, 1.0)), difference(looks(-1.0, 0.0))], [1.0; 2]);
        let coloured = Appearance::in_one_colour(1.6, Some(1));
        assert_eq!(looks(1.0, 0.0).difference(&coloured).mean(), None);
    }

    #[test]
    fn the_mean_difference_is_that_of_what_is_known() {
        let none = AppearanceDifference::default();
        assert_eq!(none.mean(), None);
        let some = AppearanceDifference { torso: Some(0.2), texture: Some(0.6), ..none };
        assert!((some.mean().unwrap() - 0.4).abs() < 1e-12);
        assert_eq!(AppearanceDifference { legs: Some(0.3), ..none }.mean(), Some(0.3));
    }

    mod pictures {
        use std::sync::Arc;

        use nalgebra::{Point3, Vector2};
        use tagalong_conformance::target;
        use tagalong_core::{DepthImage, EgoMotion, Estimate, Images, RgbImage, Stamp};
        use tagalong_geometry::{Camera, Distortion, Pinhole};

        use super::*;

        const GREEN: [u8; 3] = [0, 255, 0];
        const RED: [u8; 3] = [255, 0, 0];
        const BLUE: [u8; 3] = [0, 0, 255];

        fn camera() -> Camera {
            let lens =
                Pinhole { fx: 200.0, fy: 200.0, cx: 160.0, cy: 60.0, distortion: Distortion::None };
            Camera::mounted(lens, 320, 240, 1.6, 0.0, 0.0)
        }

        /// A person whose face is 2 m away, where a metre is 100 pixels: a head at row 60, a shirt
        /// from row 85 to 125, trousers from row 150 to 190.
        fn person(y_m: f64) -> Estimate {
            let mut track = target(2.08, y_m, Vector2::zeros());
            track.estimate.person.position = Point3::new(2.08, y_m, 1.6);
            track.estimate.region = camera().upper_body(&track.estimate.person.position);
            track.estimate
        }

        fn frame(colour: impl Fn(usize, usize) -> [u8; 3], depth: Option<DepthImage>) -> Frame {
            let images = Images {
                colour: Some(Arc::new(RgbImage::from_fn(320, 240, colour))),
                depth: depth.map(Arc::new),
                ..Images::default()
            };
            let motion = EgoMotion::at_rest(0.1);
            Frame::new(1, Stamp::default(), Arc::new(camera()), motion, images)
        }

        fn looks_of(estimate: &Estimate, frame: &Frame) -> Appearance {
            Appearance::at(&estimate.region, &estimate.person.position, frame)
        }

        fn dressed(x: usize, y: usize) -> [u8; 3] {
            match (x, y) {
                (143..=176, 85..125) => RED,
                (145..=174, 150..190) => BLUE,
                _ => GREEN,
            }
        }

        /// Returns the share of a bright hue.
        fn share(histogram: &Option<Histogram<COLOURS>>, hue: usize) -> f64 {
            histogram.unwrap()[HUES + hue]
        }

        #[test]
        fn a_shirt_and_trousers_are_looked_at_and_nothing_beside_them() {
            fn naked(x: usize, y: usize) -> [u8; 3] {
                match (x, y) {
                    (144..=175, 86..124) | (146..=173, 151..189) => GREEN,
                    _ => RED,
                }
            }

            let looks = looks_of(&person(0.0), &frame(dressed, None));
            assert!((share(&looks.torso, 0) - 1.0).abs() < 1e-9, "{looks:?}");
            assert!((share(&looks.legs, 8) - 1.0).abs() < 1e-9, "{looks:?}");
            assert_eq!(looks.height_m, 1.6);
            let looks = looks_of(&person(0.0), &frame(naked, None));
            let part = share(&looks.torso, 0);
            assert!((0.01..0.3).contains(&part), "nor is less looked at: {part}");
            let part = share(&looks.legs, 0);
            assert!((0.01..0.3).contains(&part), "nor is less looked at: {part}");
        }

        #[test]
        fn what_is_before_or_behind_the_person_is_not_the_person() {
            // To the left of the middle there is a wall, and something near to the right.
            fn depth(metres: f32) -> DepthImage {
                DepthImage::from_fn(320, 240, move |x, _| match x {
                    0..155 => 4.0,
                    155..165 => metres,
                    _ => 1.5,
                })
            }

            fn red_person(x: usize, _: usize) -> [u8; 3] {
                if (155..165).contains(&x) { RED } else { GREEN }
            }

            for (metres, is_person) in [
                (2.0, true),
                (2.4, true),
                (1.75, true),
                (2.45, false),
                (1.7, false),
                (f32::NAN, false),
            ] {
                let torso = looks_of(&person(0.0), &frame(red_person, Some(depth(metres)))).torso;
                assert_eq!(torso.is_some(), is_person, "{metres}");
                if metres == 2.0 {
                    assert!((share(&torso, 0) - 1.0).abs() < 1e-9);
                }
            }
        }

        #[test]
        fn who_is_half_outside_of_the_image_is_not_looked_at() {
            let plain = frame(|_, _| RED, None);
            // A metre to the left is 96 pixels: the shirt reaches 17 to both sides.
            assert!(looks_of(&person(1.6), &plain).torso.is_some());
            assert!(looks_of(&person(1.7), &plain).torso.is_none());
            let seen = looks_of(&person(0.0), &plain);
            assert_eq!(
                seen.difference(&seen),
                AppearanceDifference {
                    torso: Some(0.0),
                    legs: Some(0.0),
                    texture: Some(0.0),
                    vector: None
                }
            );
        }

        #[test]
        fn stripes_are_told_from_hoops() {
            fn grey(value: usize) -> [u8; 3] {
                [(value % 256) as u8; 3]
            }

            let across = frame(|x, _| grey(16 * (x % 8)), None);
            let down = frame(|_, y| grey(16 * (y % 8)), None);
            let [across, down, even] = [across, down, frame(|_, _| GREEN, None)]
                .map(|frame| looks_of(&person(0.0), &frame).texture.unwrap());
            assert!(across[0] > 0.99, "{across:?}");
            assert!(down[4] > 0.99, "{down:?}");
            assert!(even[EDGES - 1] > 0.99, "{even:?}");
        }

        #[test]
        fn without_colour_nothing_is_seen() {
            let bare = Frame::new(
                1,
                Stamp::default(),
                Arc::new(camera()),
                EgoMotion::at_rest(0.1),
                Images::default(),
            );
            let looks = looks_of(&person(0.0), &bare);
            assert_eq!((looks.torso, looks.legs, looks.texture), (None, None, None));
        }
    }
}
