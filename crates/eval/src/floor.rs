//! CLEAR figures on the floor, scan by scan, counted as in the benchmark of leg trackers (A. Leigh,
//! J. Pineau, N. Olmedo, H. Zhang, ICRA 2015; K. Bernardin, R. Stiefelhagen, 2008).
//!
//! The count differs from [`crate::Clear`]: distances have a cutoff and are not turned into
//! similarities; a pair is kept while both are near each other, and is remembered while one of them
//! is missing; a match that is a switch is not valid.

use std::collections::BTreeMap;

use crate::{Edge, Interval, Matcher, clustered_share, mean_interval, ratio};

/// Weight larger than any distance, m, so that as many pairs as possible are assigned.
const FAR_M: f64 = 1e4;

/// Position of a person or a track on the floor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloorPoint {
    /// ID of the person or of the track.
    pub id: i64,
    /// Position, m.
    pub at_m: [f64; 2],
}

/// One scan: the people and the estimates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FloorScan {
    /// People that count.
    pub people: Vec<FloorPoint>,
    /// People that are neither a miss nor a false alarm: an estimate near one of them that matches
    /// no other person is left out.
    pub ignored: Vec<FloorPoint>,
    /// Estimates.
    pub estimates: Vec<FloorPoint>,
}

/// Counts of one or more scans.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct FloorClear {
    /// Number of scans.
    pub scans: u64,
    /// Number of people in all scans.
    pub objects: u64,
    /// Matches that are no switches.
    pub valid: u64,
    /// Matches of a person or an estimate that was last paired with another one.
    pub switches: u64,
    /// People without an estimate, over all scans.
    pub misses: u64,
    /// Estimates without a person, over all scans.
    pub false_positives: u64,
    /// Number of estimates in all scans.
    pub estimates: u64,
    /// Sum of the distances of all matches, m.
    pub distance_sum_m: f64,
    /// Valid matches and objects of each person.
    pub people: BTreeMap<i64, [u64; 2]>,
    /// False positives of each scan.
    pub false_by_scan: Vec<u64>,
    /// Valid matches and objects of each scan.
    pub found_by_scan: Vec<[u64; 2]>,
}

/// Counter for the scans of a log, in their order.
#[derive(Debug)]
pub struct FloorTally {
    cut_m: f64,
    matcher: Matcher,
    estimate_of: BTreeMap<i64, i64>,
    person_of: BTreeMap<i64, i64>,
    clear: FloorClear,
}

impl FloorTally {
    /// Creates a counter without scans. Pairs are at most `cut_m` apart, m.
    pub fn new(cut_m: f64) -> Self {
        Self {
            cut_m,
            matcher: Matcher::new(),
            estimate_of: BTreeMap::new(),
            person_of: BTreeMap::new(),
            clear: FloorClear::default(),
        }
    }

    /// Adds the next scan.
    pub fn add(&mut self, scan: &FloorScan) {
        let mut pairs = self.kept(scan);
        pairs.extend(self.assigned(scan, &pairs));
        let before = self.clear.valid;
        for &(person, estimate) in &pairs {
            self.count(&scan.people[person], &scan.estimates[estimate]);
        }
        let clear = &mut self.clear;
        for person in &scan.people {
            clear.people.entry(person.id).or_default()[1] += 1;
        }
        // An estimate near an ignored person is neither right nor wrong.
        let mut false_positives = 0;
        for (index, estimate) in scan.estimates.iter().enumerate() {
            let is_free = pairs.iter().all(|(_, other)| *other != index);
            let is_ignored = scan.ignored.iter().any(|it| apart(it, estimate) <= self.cut_m);
            false_positives += u64::from(is_free && !is_ignored);
        }
        let objects = scan.people.len() as u64;
        clear.scans += 1;
        clear.objects += objects;
        clear.misses += objects - pairs.len() as u64;
        clear.false_positives += false_positives;
        clear.estimates += scan.estimates.len() as u64;
        clear.false_by_scan.push(false_positives);
        clear.found_by_scan.push([clear.valid - before, objects]);
    }

    /// Returns the counts.
    pub fn finish(self) -> FloorClear {
        self.clear
    }

    /// Returns the pairs of earlier scans that are still near each other.
    fn kept(&self, scan: &FloorScan) -> Vec<(usize, usize)> {
        let people = scan.people.iter().enumerate();
        let kept = people.filter_map(|(index, person)| {
            let last = self.estimate_of.get(&person.id)?;
            let estimate = scan.estimates.iter().position(|e| e.id == *last)?;
            // If one side has been paired with another since, the old pair would undo that later
            // match.
            let is_mutual = self.person_of.get(last) == Some(&person.id);
            let is_near = apart(person, &scan.estimates[estimate]) <= self.cut_m;
            (is_mutual && is_near).then_some((index, estimate))
        });
        kept.collect()
    }

    /// Assigns the rest with the least sum of distances, and drops pairs that are too far apart.
    fn assigned(&mut self, scan: &FloorScan, kept: &[(usize, usize)]) -> Vec<(usize, usize)> {
        let mut edges = Vec::new();
        for (row, person) in scan.people.iter().enumerate() {
            for (col, estimate) in scan.estimates.iter().enumerate() {
                if kept.iter().all(|pair| pair.0 != row && pair.1 != col) {
                    // The matcher maximises weights, but distances are to be minimised.
                    let weight = FAR_M - apart(person, estimate);
                    edges.push(Edge { row: row as u32, col: col as u32, weight });
                }
            }
        }
        let mut chosen = Vec::new();
        self.matcher.best(scan.people.len(), scan.estimates.len(), &edges, &mut chosen);
        let chosen = chosen.iter().map(|index| edges[*index as usize]);
        let near = chosen.filter(|edge| FAR_M - edge.weight <= self.cut_m);
        near.map(|edge| (edge.row as usize, edge.col as usize)).collect()
    }

    /// Counts a match, and remembers the pair.
    fn count(&mut self, person: &FloorPoint, estimate: &FloorPoint) {
        let was = self.estimate_of.insert(person.id, estimate.id);
        let had = self.person_of.insert(estimate.id, person.id);
        let is_switch =
            was.is_some_and(|id| id != estimate.id) || had.is_some_and(|id| id != person.id);
        let clear = &mut self.clear;
        clear.distance_sum_m += apart(person, estimate);
        if is_switch {
            clear.switches += 1;
        } else {
            clear.valid += 1;
            clear.people.entry(person.id).or_default()[0] += 1;
        }
    }
}

fn apart(a: &FloorPoint, b: &FloorPoint) -> f64 {
    (a.at_m[0] - b.at_m[0]).hypot(a.at_m[1] - b.at_m[1])
}

impl FloorClear {
    /// Returns the multiple object tracking accuracy; `None` without objects.
    pub fn mota(&self) -> Option<f64> {
        let errors = self.misses + self.switches + self.false_positives;
        (self.objects > 0).then(|| 1.0 - errors as f64 / self.objects as f64)
    }

    /// Returns the mean distance of the matches, m; `None` without matches.
    pub fn motp_m(&self) -> Option<f64> {
        let matches = self.valid + self.switches;
        (matches > 0).then(|| self.distance_sum_m / matches as f64)
    }

    /// Returns the fraction of the objects with a valid match. Its interval comes from the spread
    /// between people or, with a single person, between blocks of `block` scans.
    pub fn recall(&self, block: usize) -> Option<Interval> {
        let blocks = self.found_by_scan.chunks(block.max(1)).map(|scans| {
            scans.iter().fold([0, 0], |sum, [found, of]| [sum[0] + found, sum[1] + of])
        });
        let clusters: Vec<[u64; 2]> = match self.people.len() {
            0 | 1 => blocks.filter(|[_, of]| *of > 0).collect(),
            _ => self.people.values().copied().collect(),
        };
        clustered_share(&clusters)
    }

    /// Returns the number of estimates per scan.
    pub fn estimates_per_scan(&self) -> f64 {
        ratio(self.estimates as f64, self.scans as f64)
    }

    /// Returns the number of false positives per minute. Its interval comes from the spread between
    /// blocks of `block` scans. The scans are `scan_s` seconds apart.
    pub fn false_per_minute(&self, block: usize, scan_s: f64) -> Option<Interval> {
        let blocks = self.false_by_scan.chunks(block.max(1));
        let rates: Vec<f64> = blocks.map(|scans| minute_rate(scans, scan_s)).collect();
        let whole = minute_rate(&self.false_by_scan, scan_s);
        let spread = mean_interval(&rates)?;
        Some(Interval { estimate: whole, ..spread.within(0.0, f64::INFINITY) })
    }
}

/// Returns the mean count per minute, from the counts of scans that take `scan_s` seconds each.
fn minute_rate(scans: &[u64], scan_s: f64) -> f64 {
    scans.iter().sum::<u64>() as f64 * 60.0 / (scans.len().max(1) as f64 * scan_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers with their places along a line, m.
    type Line<'a> = &'a [(i64, f64)];

    fn points(of: Line<'_>) -> Vec<FloorPoint> {
        of.iter().map(|&(id, x)| FloorPoint { id, at_m: [x, 1.0] }).collect()
    }

    fn tally(scans: &[(Line<'_>, Line<'_>)]) -> FloorClear {
        let mut tally = FloorTally::new(0.75);
        for (people, estimates) in scans {
            let people = points(people);
            let estimates = points(estimates);
            tally.add(&FloorScan { people, estimates, ignored: Vec::new() });
        }
        tally.finish()
    }

    #[test]
    fn a_pair_is_kept_while_it_is_near_even_if_another_estimate_is_nearer() {
        let clear = tally(&[(&[(1, 0.0)], &[(7, 0.1)]), (&[(1, 0.0)], &[(7, 0.7), (8, 0.0)])]);
        assert_eq!((clear.valid, clear.switches, clear.false_positives), (2, 0, 1));
        assert!((clear.motp_m().unwrap() - 0.4).abs() < 1e-12);
        let clear = tally(&[(&[(1, 0.0)], &[(7, 0.1)]), (&[(1, 0.0)], &[(7, 0.8), (8, 0.0)])]);
        assert_eq!((clear.valid, clear.switches, clear.false_positives), (1, 1, 1));
    }

    #[test]
    fn pairs_are_remembered_while_unseen_and_a_switch_is_not_valid() {
        let empty: &[(i64, f64)] = &[];
        let one: &[(i64, f64)] = &[(1, 0.0)];
        let back = tally(&[(one, &[(7, 0.0)]), (empty, empty), (one, &[(7, 0.0)])]);
        assert_eq!((back.valid, back.switches), (2, 0));
        let new = tally(&[(one, &[(7, 0.0)]), (one, empty), (one, &[(8, 0.0)])]);
        assert_eq!((new.valid, new.switches, new.misses), (1, 1, 1));
        assert_eq!(new.people[&1], [1, 3]);
        assert!((new.mota().unwrap() - 1.0 / 3.0).abs() < 1e-12);
        // An estimate that goes over to another person is a switch, too.
        let over = tally(&[(one, &[(7, 0.0)]), (&[(2, 0.0)], &[(7, 0.0)])]);
        assert_eq!((over.valid, over.switches), (1, 1));
    }

    #[test]
    fn the_rest_is_assigned_by_the_least_sum_and_then_cut() {
        // Greedily, 0.0 would take 0.3 and leave 0.7 without a partner.
        let clear = tally(&[(&[(1, 0.0), (2, 0.7)], &[(7, 0.3), (8, -0.4)])]);
        assert_eq!((clear.valid, clear.misses, clear.false_positives), (2, 0, 0));
        let clear = tally(&[(&[(1, 0.0)], &[(7, 0.76)])]);
        assert_eq!((clear.valid, clear.misses, clear.false_positives), (0, 1, 1));
        assert_eq!(clear.motp_m(), None);
    }

    #[test]
    fn an_estimate_of_an_ignored_person_is_not_false() {
        let mut tally = FloorTally::new(0.75);
        let ignored = points(&[(9, 0.0)]);
        let estimates = points(&[(7, 0.2), (8, 2.0)]);
        tally.add(&FloorScan { people: Vec::new(), ignored, estimates });
        let clear = tally.finish();
        assert_eq!((clear.false_positives, clear.objects, clear.estimates), (1, 0, 2));
        assert_eq!(clear.mota(), None);
    }

    #[test]
    fn rates_count_scans_and_seconds() {
        let scan: (Line<'_>, Line<'_>) = (&[(1, 0.0)], &[(7, 0.0), (8, 5.0)]);
        let clear = tally(&[scan; 6]);
        assert_eq!(clear.estimates_per_scan(), 2.0);
        assert!((clear.false_per_minute(2, 0.1).unwrap().estimate - 600.0).abs() < 1e-9);
        assert_eq!(clear.recall(2).unwrap().estimate, 1.0);
    }
}
