use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Point3;
use tagalong_core::{Frame, RgbImage, TrackId};

/// Number of shades per channel.
const SHADES: usize = 6;
/// Weight of a new frame in the colours of a person.
const RATE: f64 = 0.2;
/// Extent of the chest: upper and lower end below the centre of the head, and half its width, m.
const CHEST_M: [f64; 3] = [0.22, 0.5, 0.13];

/// Frequency of each colour on a chest; sums to 1.
type Histogram = Vec<f64>;

/// Colours of people's clothes, learned outside of groups, and compared again after people were too
/// close for their silhouettes to tell them apart.
#[derive(Default)]
pub(crate) struct Wardrobe {
    known: BTreeMap<TrackId, Histogram>,
    /// Pairs that left a group and were not compared since.
    parted: BTreeSet<(TrackId, TrackId)>,
}

impl Wardrobe {
    pub(crate) fn forget(&mut self, id: TrackId) {
        self.known.remove(&id);
        self.parted.retain(|(a, b)| *a != id && *b != id);
    }

    /// Marks the people of a group that is split for a comparison.
    pub(crate) fn part(&mut self, ids: &[TrackId]) {
        for a in ids {
            self.parted.extend(ids.iter().filter(|b| *b > a).map(|b| (*a, *b)));
        }
    }

    /// Learns the colours of the seen people outside of groups; returns the pairs that have
    /// exchanged their colours.
    pub(crate) fn look(
        &mut self,
        frame: &Frame,
        alone: &BTreeMap<TrackId, Point3<f64>>,
        margin: f64,
    ) -> Vec<(TrackId, TrackId)> {
        let Ok(image) = frame.colour() else { return Vec::new() };
        let seen: BTreeMap<TrackId, Histogram> = alone
            .iter()
            .filter_map(|(id, head)| Some((*id, colours(frame, image, head)?)))
            .collect();
        let asked: Vec<(TrackId, TrackId)> = self
            .parted
            .iter()
            .copied()
            .filter(|(a, b)| seen.contains_key(a) && seen.contains_key(b))
            .collect();
        let swapped: Vec<_> =
            asked.iter().copied().filter(|pair| self.is_swapped(pair, &seen, margin)).collect();
        self.parted.retain(|pair| !asked.contains(pair));
        // In a frame with a swap the colours belong to the wrong tracks, so none are learned.
        if swapped.is_empty() {
            seen.into_iter().for_each(|(id, colours)| self.learn(id, colours));
        }
        swapped
    }

    fn learn(&mut self, id: TrackId, seen: Histogram) {
        // Until the pair is compared, the track may have the other person's colours.
        if self.parted.iter().any(|(a, b)| *a == id || *b == id) {
            return;
        }
        let known = self.known.entry(id).or_insert_with(|| seen.clone());
        known.iter_mut().zip(&seen).for_each(|(k, s)| *k += RATE * (s - *k));
    }

    fn is_swapped(
        &self,
        (a, b): &(TrackId, TrackId),
        seen: &BTreeMap<TrackId, Histogram>,
        margin: f64,
    ) -> bool {
        let looks = [(a, b), (b, a), (a, a), (b, b)]
            .map(|(known, now)| Some(coefficient(self.known.get(known)?, seen.get(now)?)));
        let [Some(a_as_b), Some(b_as_a), Some(own_a), Some(own_b)] = looks else { return false };
        a_as_b + b_as_a - own_a - own_b > margin
    }
}

/// Returns the Bhattacharyya coefficient: 1 for the same colours, 0 for none in common.
fn coefficient(a: &Histogram, b: &Histogram) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a * b).sqrt()).sum()
}

/// Returns the colours of the chest below a head; `None` outside of the image.
fn colours(frame: &Frame, image: &RgbImage, head: &Point3<f64>) -> Option<Histogram> {
    let [from, to, half] = CHEST_M;
    let centre = frame.camera.project(head)?;
    let scale = frame.camera.focal_px() / frame.camera.depth_of(head).max(0.1);
    let mut histogram = vec![0.0; SHADES * SHADES * SHADES];
    let mut sum = 0.0;
    let rows = ((centre.y + from * scale) as i64..(centre.y + to * scale) as i64).step_by(2);
    for y in rows.take(MAX_PIXELS) {
        let columns = (centre.x - half * scale) as i64..(centre.x + half * scale) as i64;
        for pixel in columns.step_by(2).take(MAX_PIXELS).filter_map(|x| image.get(x, y)) {
            let index = pixel.iter().fold(0, |i, v| i * SHADES + usize::from(*v) * SHADES / 256);
            histogram[index] += 1.0;
            sum += 1.0;
        }
    }
    (sum >= MIN_PIXELS).then(|| histogram.into_iter().map(|count| count / sum).collect())
}

/// Fewest pixels of a histogram.
const MIN_PIXELS: f64 = 12.0;
/// Most rows and columns of a chest that are read, pixels.
const MAX_PIXELS: usize = 2000;

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use tagalong_core::{EgoMotion, Images, Stamp};
    use tagalong_geometry::{Camera, Pinhole};

    use super::*;

    const IDS: [TrackId; 2] = [TrackId(1), TrackId(2)];

    /// Red on the left half of the image and blue on the right one, or mirrored.
    fn frame(mirrored: bool, with_colour: bool) -> Frame {
        let camera =
            Arc::new(Camera::mounted(Pinhole::centred(80.0, 100, 80), 100, 80, 1.5, 0.0, 0.0));
        let image = RgbImage::from_fn(100, 80, |x, _| {
            if (x < 50) != mirrored { [200, 20, 20] } else { [20, 20, 200] }
        });
        let colour = with_colour.then(|| Arc::new(image));
        let images = Images { colour, ..Images::default() };
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), images)
    }

    fn people() -> BTreeMap<TrackId, Point3<f64>> {
        let heads = [Point3::new(2.0, 0.6, 1.6), Point3::new(2.0, -0.6, 1.6)];
        IDS.into_iter().zip(heads).collect()
    }

    fn learned() -> Wardrobe {
        let mut wardrobe = Wardrobe::default();
        assert!(wardrobe.look(&frame(false, true), &people(), 0.15).is_empty());
        wardrobe.part(&IDS);
        wardrobe
    }

    #[test]
    fn people_who_come_out_with_each_others_colours_are_swapped() {
        assert_eq!(learned().look(&frame(true, true), &people(), 0.15), [(IDS[0], IDS[1])]);
        assert!(learned().look(&frame(false, true), &people(), 0.15).is_empty());
    }

    #[test]
    fn the_margin_is_asked_and_each_pair_once() {
        let mut wardrobe = learned();
        assert!(wardrobe.look(&frame(true, true), &people(), 2.0).is_empty(), "2 is never");
        assert!(wardrobe.look(&frame(true, true), &people(), 0.15).is_empty(), "asked already");
        let mut forgotten = learned();
        forgotten.forget(IDS[0]);
        assert!(forgotten.look(&frame(true, true), &people(), 0.15).is_empty());
    }

    #[test]
    fn colours_are_those_of_the_chest_and_are_learned_slowly() {
        let head = people()[&IDS[0]];
        let [red, blue] = [false, true].map(|mirrored| {
            let frame = frame(mirrored, true);
            colours(&frame, frame.colour().unwrap(), &head).unwrap()
        });
        assert!((red.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        // In six shades, 200 and 20 of 256 are 4 and 0.
        assert_eq!((red[4 * 36], blue[4]), (1.0, 1.0));
        assert_eq!((coefficient(&red, &red), coefficient(&red, &blue)), (1.0, 0.0));
        let mut wardrobe = Wardrobe::default();
        wardrobe.learn(IDS[0], red);
        wardrobe.learn(IDS[0], blue);
        let known = &wardrobe.known[&IDS[0]];
        assert!((known[4 * 36] - 0.8).abs() < 1e-12 && (known[4] - 0.2).abs() < 1e-12);
    }

    #[test]
    fn where_the_chest_is_out_of_the_image_there_is_no_colour() {
        let frame = frame(false, true);
        let image = frame.colour().unwrap();
        for (place, expected) in [
            (Point3::new(2.0, 0.6, 1.6), true),
            (Point3::new(2.0, 3.0, 1.6), false),
            (Point3::new(-2.0, 0.0, 1.6), false),
            // Below.
            (Point3::new(2.0, 0.0, 0.2), false),
        ] {
            assert_eq!(colours(&frame, image, &place).is_some(), expected, "{place}");
        }
    }

    #[test]
    fn without_colour_nobody_is_swapped() {
        assert!(learned().look(&frame(true, false), &people(), 0.15).is_empty());
    }
}
