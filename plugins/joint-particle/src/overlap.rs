use std::collections::{BTreeMap, BTreeSet};

use tagalong_core::{Estimate, TrackId};
use tagalong_geometry::Rect;

use crate::config::Config;

/// Pairs of people that are weighed together: their silhouettes overlap, or did so lately.
#[derive(Default)]
pub(crate) struct Overlaps {
    /// For each linked pair, the number of frames for which their squares were apart.
    links: BTreeMap<(TrackId, TrackId), u32>,
}

impl Overlaps {
    /// Updates the links with the predicted estimates, and returns the groups: the connected
    /// components of the linked pairs.
    pub(crate) fn groups(
        &mut self,
        people: &BTreeMap<TrackId, Estimate>,
        config: &Config,
    ) -> Vec<BTreeSet<TrackId>> {
        let mut links = BTreeMap::new();
        for (a, one) in people {
            for (b, other) in
                people.range((std::ops::Bound::Excluded(*a), std::ops::Bound::Unbounded))
            {
                let before = self.links.get(&(*a, *b)).copied();
                if let Some(apart) = link(one, other, before, config) {
                    links.insert((*a, *b), apart);
                }
            }
        }
        self.links = links;
        components(people.keys().copied(), self.links.keys())
    }
}

/// Returns the number of frames for which a linked pair has been apart; `None` if it is not linked
/// (any more).
fn link(a: &Estimate, b: &Estimate, before: Option<u32>, config: &Config) -> Option<u32> {
    let [one, other] = [a, b].map(|e| inflated(&e.region, config.inflate));
    if one.intersection(&other).area() > 0.0 {
        return Some(0);
    }
    // Hysteresis: a group that is split for one frame loses the correlations of its people.
    let frames = before? + 1;
    let away = (a.person.position.xy() - b.person.position.xy()).norm();
    (frames < config.split_frames || away <= config.split_m).then_some(frames)
}

fn inflated(region: &Rect, part: f64) -> Rect {
    let dx = 0.5 * part * region.width;
    let dy = 0.5 * part * region.height;
    Rect::new(region.x - dx, region.y - dy, region.width + 2.0 * dx, region.height + 2.0 * dy)
}

fn components<'a>(
    people: impl Iterator<Item = TrackId>,
    links: impl Iterator<Item = &'a (TrackId, TrackId)>,
) -> Vec<BTreeSet<TrackId>> {
    fn find(groups: &[BTreeSet<TrackId>], id: &TrackId) -> Option<usize> {
        groups.iter().position(|g| g.contains(id))
    }

    let mut groups: Vec<BTreeSet<TrackId>> = people.map(|id| BTreeSet::from([id])).collect();
    for (a, b) in links {
        if let (Some(one), Some(other)) = (find(&groups, a), find(&groups, b))
            && one != other
        {
            let moved = groups.swap_remove(one.max(other));
            groups[one.min(other)].extend(moved);
        }
    }
    groups.sort();
    groups
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix5, Point3, Vector2};
    use tagalong_core::Person;

    use super::*;

    fn people(places: &[(f64, f64)]) -> BTreeMap<TrackId, Estimate> {
        fn estimate((x, y): &(f64, f64)) -> Estimate {
            Estimate::new(
                Person { position: Point3::new(*x, *y, 1.6), velocity: Vector2::zeros() },
                Matrix5::identity(),
                Rect::new(300.0 - 250.0 * y / x, 100.0, 150.0 / x, 150.0 / x),
            )
        }

        (1..).map(TrackId).zip(places.iter().map(estimate)).collect()
    }

    #[test]
    fn people_whose_silhouettes_overlap_are_one_group_and_part_with_hysteresis() {
        let config = Config::default();
        let mut overlaps = Overlaps::default();
        for (y, expected) in [(1.5, 2), (0.2, 1), (1.5, 1), (1.5, 1), (1.5, 2), (1.5, 2)] {
            let found = overlaps.groups(&people(&[(2.0, 0.0), (3.0, y)]), &config);
            assert_eq!(found.len(), expected, "{y}");
        }
    }

    #[test]
    fn hysteresis_asks_for_frames_and_metres() {
        fn frames(config: &Config, y: f64) -> usize {
            let mut overlaps = Overlaps::default();
            assert_eq!(overlaps.groups(&people(&[(2.0, 0.0), (2.1, 0.1)]), config).len(), 1);
            let pair = people(&[(2.0, 0.0), (2.1, y)]);
            (0..20).filter(|_| overlaps.groups(&pair, config).len() == 1).count()
        }

        let usual = Config { split_frames: 3, split_m: 0.8, ..Config::default() };
        assert_eq!(frames(&usual, 1.2), 2);
        assert_eq!(frames(&usual, 0.75), 20, "still near");
        assert_eq!(frames(&Config { split_m: 0.7, ..usual.clone() }, 0.75), 2);
        assert_eq!(frames(&Config { split_frames: 6, ..usual }, 1.2), 5);
    }

    #[test]
    fn squares_are_enlarged_before_they_are_asked() {
        // Squares of 75 pixels, their left edges 80 pixels apart.
        fn meet(inflate: f64) -> bool {
            let config = Config { inflate, ..Config::default() };
            Overlaps::default().groups(&people(&[(2.0, 0.0), (2.0, 0.64)]), &config).len() == 1
        }

        assert_eq!([0.0, 0.06, 0.07, 0.1].map(meet), [false, false, true, true]);
        let up = inflated(&Rect::new(10.0, 20.0, 40.0, 60.0), 0.1);
        assert_eq!(up, Rect::new(8.0, 17.0, 44.0, 66.0));
    }

    #[test]
    fn a_chain_is_one_group() {
        let mut overlaps = Overlaps::default();
        let line = people(&[(2.0, 0.0), (3.0, 0.6), (2.0, 0.8), (3.0, -2.0)]);
        let groups = overlaps.groups(&line, &Config::default());
        assert_eq!(groups.iter().map(BTreeSet::len).collect::<Vec<_>>(), [3, 1]);
    }
}
