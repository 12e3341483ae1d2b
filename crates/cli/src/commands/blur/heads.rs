//! Where the heads of tracked people are in an image.

use std::collections::BTreeMap;

use tagalong_app::scoring::{Reports, Shots};
use tagalong_eval::Region;

/// Half the width of the blurred area, in widths of the box of an upper body, which is 0.57 m wide: a
/// head is 0.2 m wide at most, and `[silhouette]` moves the box up to 0.175 widths beside it.
const HALF_WIDTH: f64 = 0.46;
/// Height of the area above the box, in heights of the box.
const ABOVE: f64 = 0.08;
/// Height of the area in the box: a head ends 0.25 m below the upper edge.
const BELOW: f64 = 0.58;
/// Boxes of the frames this near in time count, too: a person missed in one image was found in another,
/// and a moving one is at both places.
const WITHIN_NS: u64 = 350_000_000;

/// Boxes of upper bodies by the stamps of their frames.
pub(super) struct Heads {
    boxes: BTreeMap<u64, Vec<Region>>,
}

impl Heads {
    /// Takes the boxes of a run, by the number of the frame.
    pub(super) fn new(shots: &Shots, reports: Reports) -> Self {
        let mut boxes: BTreeMap<u64, Vec<Region>> = BTreeMap::new();
        for shot in shots.iter() {
            let found = reports.get(&shot.number).into_iter().flatten();
            boxes
                .entry(shot.stamp_ns)
                .or_default()
                .extend(found.filter_map(|report| report.region));
        }
        Self { boxes }
    }

    /// Returns the areas to blur in an image with this stamp; in a right image they reach `aside` widths
    /// farther to the left. Of a slow camera the nearest frames count.
    pub(super) fn at(&self, stamp_ns: u64, aside: f64) -> Vec<Region> {
        let first = stamp_ns.saturating_sub(WITHIN_NS);
        let last = stamp_ns.saturating_add(WITHIN_NS);
        let mut near: Vec<u64> = self.boxes.range(first..=last).map(|(stamp, _)| *stamp).collect();
        near.extend(self.boxes.range(..stamp_ns).next_back().map(|(stamp, _)| *stamp));
        near.extend(self.boxes.range(stamp_ns.saturating_add(1)..).next().map(|(stamp, _)| *stamp));
        near.sort_unstable();
        near.dedup();
        let boxes = near.iter().flat_map(|stamp| &self.boxes[stamp]);
        boxes.map(|region| head(region, aside)).collect()
    }
}

fn head(upper_body: &Region, aside: f64) -> Region {
    let Region { x, y, width, height } = *upper_body;
    let left = x + (0.5 - HALF_WIDTH - aside) * width;
    let top = y - ABOVE * height;
    Region::new(left, top, (2.0 * HALF_WIDTH + aside) * width, (ABOVE + BELOW) * height)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heads() -> Heads {
        let second = 1_000_000_000;
        let [left, right] = [0.0, 50.0].map(|x| vec![Region::new(x, 100.0, 100.0, 100.0)]);
        Heads { boxes: [(second, left), (2 * second, right), (9 * second, vec![])].into() }
    }

    #[test]
    fn a_head_is_blurred_around_the_upper_part_of_its_box() {
        let found = heads().at(1_000_000_000, 0.0);
        let whole = Region::new(4.0, 92.0, 92.0, 66.0);
        assert!((found[0].iou(&whole) - 1.0).abs() < 1e-9, "{found:?}");
        let right = heads().at(1_000_000_000, 0.2);
        assert!((right[0].x + 16.0).abs() < 1e-9 && (right[0].width - 112.0).abs() < 1e-9);
    }

    /// An image between two frames, or without a frame of its own, has the heads of both.
    #[test]
    fn images_near_a_frame_have_its_heads() {
        let heads = heads();
        // At 1 s the next frame counts, too.
        for (seconds, count) in [(1.5, 2), (1.0, 2), (0.2, 1), (9.5, 0)] {
            assert_eq!(heads.at((seconds * 1e9) as u64, 0.0).len(), count, "{seconds} s");
        }
    }
}
