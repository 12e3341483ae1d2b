//! Duplicate tracks of one person.

use std::collections::BTreeMap;
use std::ops::Bound;

use nalgebra::Point2;
use tagalong_core::TrackId;

/// Mask of the frames that are remembered for a pair, and least number of them in which it is near.
const WINDOW: u8 = 0b11111;
const NEAR_FRAMES: u32 = 3;

/// Finds pairs of tracks that were near each other in 3 of the last 5 frames, the rule of the
/// tracker of the SPENCER project.
#[derive(Default)]
pub(crate) struct DuplicateFinder {
    /// History of each pair that was near: one bit per frame, newest lowest.
    near: BTreeMap<(TrackId, TrackId), u8>,
}

impl DuplicateFinder {
    /// Returns (older, younger) pairs of one person; an ended track is in no further pair. Tracks
    /// that `is_hidden` are left out, because they may be predicted to the position of another
    /// person.
    pub(crate) fn find(
        &mut self,
        places: &BTreeMap<TrackId, Point2<f64>>,
        duplicate_m: f64,
        is_hidden: impl Fn(TrackId) -> bool,
    ) -> Vec<(TrackId, TrackId)> {
        let mut near = BTreeMap::new();
        let mut found: Vec<(TrackId, TrackId)> = Vec::new();
        for (older, a) in places {
            for (younger, b) in places.range((Bound::Excluded(*older), Bound::Unbounded)) {
                let pair = (*older, *younger);
                let before = self.near.get(&pair).copied().unwrap_or_default();
                // Most pairs are far apart along one axis already.
                let may_be_near = (a.x - b.x).abs() <= 1.01 * duplicate_m;
                let is_near = may_be_near
                    && (a - b).norm() < duplicate_m
                    && !is_hidden(*older)
                    && !is_hidden(*younger);
                if !is_near && self.near.is_empty() {
                    continue;
                }
                let now = before << 1 & WINDOW | u8::from(is_near);
                if now > 0 {
                    near.insert(pair, now);
                }
                let taken = found.iter().any(|(_, ended)| ended == older || ended == younger);
                if now.count_ones() >= NEAR_FRAMES && !taken {
                    found.push(pair);
                }
            }
        }
        self.near = near;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(ys: &[f64]) -> BTreeMap<TrackId, Point2<f64>> {
        (1..).map(TrackId).zip(ys.iter().map(|y| Point2::new(3.0, *y))).collect()
    }

    fn find(finder: &mut DuplicateFinder, ys: &[f64]) -> Vec<(TrackId, TrackId)> {
        finder.find(&places(ys), 0.2, |_| false)
    }

    const PAIR: [(TrackId, TrackId); 1] = [(TrackId(1), TrackId(2))];

    #[test]
    fn two_at_one_place_are_one_in_the_third_frame() {
        let mut finder = DuplicateFinder::default();
        assert_eq!(find(&mut finder, &[0.0, 0.1]), []);
        assert_eq!(find(&mut finder, &[0.0, 0.1]), []);
        assert_eq!(find(&mut finder, &[0.0, 0.1, 0.0]), PAIR, "the third came just now");
    }

    #[test]
    fn two_people_may_have_two_tracks_each() {
        let mut finder = DuplicateFinder::default();
        let pairs = [(TrackId(1), TrackId(2)), (TrackId(3), TrackId(4))];
        let frames: Vec<_> = (0..3).map(|_| find(&mut finder, &[0.0, 0.1, 1.0, 1.1])).collect();
        assert_eq!(frames, [vec![], vec![], pairs.to_vec()]);
        let mut finder = DuplicateFinder::default();
        let frames: Vec<_> = (0..3).map(|_| find(&mut finder, &[0.0, 0.1, 0.05])).collect();
        let both = vec![PAIR[0], (TrackId(1), TrackId(3))];
        assert_eq!(frames[2], both, "one that ended is in no further pair");
    }

    #[test]
    fn a_hidden_track_is_no_duplicate_of_the_one_in_front() {
        let mut finder = DuplicateFinder::default();
        for _ in 0..10 {
            assert_eq!(finder.find(&places(&[0.0, 0.0]), 0.2, |id| id == TrackId(1)), []);
        }
    }

    /// The two are near in every third frame only, then in three of four.
    #[test]
    fn two_people_who_pass_each_other_are_not_one() {
        let mut finder = DuplicateFinder::default();
        for apart in [[0.0, 0.21, 0.21]; 4].concat() {
            assert_eq!(find(&mut finder, &[0.0, apart]), []);
        }
        for apart in [0.0, 0.21, 0.0] {
            assert_eq!(find(&mut finder, &[0.0, apart]), []);
        }
        assert_eq!(find(&mut finder, &[0.0, 0.0]), PAIR);
    }
}
