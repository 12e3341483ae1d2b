use std::collections::{BTreeMap, BTreeSet};

use tagalong_config::Example;
use tagalong_math::mix;

/// Distributes the groups over `folds` parts, those with people and those without in turn, so that
/// each part has both. The distribution depends on the seed, not on the order of the examples.
pub fn parts(
    examples: impl Iterator<Item = Example>,
    folds: usize,
    seed: u64,
) -> BTreeMap<u64, usize> {
    let mut all = BTreeSet::new();
    let mut with_people = BTreeSet::new();
    for example in examples {
        // The set sorts by the mixed number first, which shuffles the groups reproducibly.
        let key = (mix(example.group ^ seed), example.group);
        all.insert(key);
        if example.is_person {
            with_people.insert(key);
        }
    }
    let without = &all - &with_people;
    let mut parts = BTreeMap::new();
    for set in [&with_people, &without] {
        for (k, (_, group)) in set.iter().enumerate() {
            parts.insert(*group, k % folds.max(1));
        }
    }
    parts
}

/// Purpose of a group of examples.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Use {
    /// Computation of the figures of the model card; no classifier is fitted to these examples.
    Figures,
    /// Calibration of a classifier that was not fitted to these examples.
    Calibration,
    /// Fit of the classifier.
    Fit,
}

/// Tenth of the groups that is used for calibration by default.
pub const CALIBRATION: u64 = 2;

/// Returns the pseudo-random tenth of all groups that a group is in, 0 to 9.
fn tenth_of(group: u64) -> u64 {
    mix(group) % 10
}

/// Returns the purpose of a group: two tenths are for the figures, the tenths of `calibration` for
/// the calibration, and the others for the fit. Cross-validation passes other tenths in turn and
/// never uses those of the figures.
pub fn use_of(group: u64, calibration: &[u64]) -> Use {
    match tenth_of(group) {
        0 | 1 => Use::Figures,
        tenth if calibration.contains(&tenth) => Use::Calibration,
        _ => Use::Fit,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_has_groups_with_and_without_people() {
        let examples: Vec<Example> =
            (0..80).map(|k| Example { group: k / 4, is_person: k / 4 % 5 == 0 }).collect();
        let parts = parts(examples.iter().copied(), 4, 3);
        for part in 0..4 {
            for people in [true, false] {
                let mut here = examples.iter().filter(|e| parts[&e.group] == part);
                assert!(here.any(|e| e.is_person == people), "part {part}, people {people}");
            }
        }
    }
}
