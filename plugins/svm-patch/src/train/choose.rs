use std::collections::BTreeMap;

use tagalong_core::Result;
use tagalong_learn::{accepted, area, mix, parts, side_by_side};

use super::{Sample, solver};
use crate::{Sampler, Training};

/// One combination that was tried, and its result on held-out samples.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Width of the kernel.
    pub gamma: f64,
    /// Penalty of a training error.
    pub penalty: f64,
    /// Decision values of held-out samples, with the truth.
    pub held_out: Vec<(f64, bool)>,
}

impl Trial {
    /// Returns the probability that a person has a larger decision value than another candidate
    /// (area under the ROC curve).
    pub fn area(&self) -> f64 {
        area(&self.held_out)
    }

    /// Returns the fraction of a class with a positive decision value.
    pub fn accepted(&self, people: bool) -> f64 {
        accepted(&self.held_out, people)
    }
}

/// Tries every width with every penalty; samples of one group are always in the same part.
pub fn trials(
    samples: &[&Sample],
    sampler: Sampler,
    training: &Training,
    seed: u64,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Trial>> {
    // Frames of one group are near-duplicates: divided between parts they would leak the answer.
    let parts = parts(samples.iter().map(|s| s.example), training.folds, seed);
    let each = training.gammas.iter().flat_map(|g| training.penalties.iter().map(|c| (*g, *c)));
    let grid: Vec<(f64, f64)> = each.collect();
    side_by_side(
        &grid,
        |&(gamma, penalty)| {
            let held_out = hold_out(samples, &parts, training.folds, |fitted| {
                solver::fit(fitted, sampler, gamma, penalty)
            })?;
            Ok(Trial { gamma, penalty, held_out })
        },
        progress,
    )
}

fn hold_out(
    samples: &[&Sample],
    parts: &BTreeMap<u64, usize>,
    folds: usize,
    fit: impl Fn(&[&Sample]) -> Result<crate::Model>,
) -> Result<Vec<(f64, bool)>> {
    let mut values = Vec::with_capacity(samples.len());
    for fold in 0..folds {
        let (out, rest): (Vec<&Sample>, Vec<&Sample>) =
            samples.iter().partition(|s| parts.get(&s.example.group) == Some(&fold));
        let model = fit(&rest)?;
        values.extend(out.iter().map(|s| (model.decision(&s.patch), s.example.is_person)));
    }
    Ok(values)
}

/// Selects at most `most` samples, half of each class while there are enough, in the order of a
/// hash. A class with fewer leaves its share to the other.
pub fn subset(samples: &[Sample], most: usize, seed: u64) -> Vec<&Sample> {
    let [mut people, mut others] = [true, false].map(|is_person| {
        // Sorting by a hash is a random order that is the same on every machine.
        let mut class: Vec<(u64, &Sample)> = samples
            .iter()
            .enumerate()
            .filter(|(_, s)| s.example.is_person == is_person)
            .map(|(k, s)| (mix(k as u64 ^ seed), s))
            .collect();
        class.sort_by_key(|(key, _)| *key);
        class.into_iter().map(|(_, s)| s).collect::<Vec<_>>()
    });
    let half = most / 2;
    let spare_people = half.saturating_sub(people.len());
    let spare_others = half.saturating_sub(others.len());
    people.truncate(half + spare_others);
    others.truncate(half + spare_people);
    people.extend(others);
    people
}

/// Keeps at most the given numbers of other objects and of people, in the order of a hash; 0 keeps
/// all. The order of the samples stays.
pub fn keep(samples: &mut Vec<Sample>, most: [usize; 2], seed: u64) {
    let mut of_class = [Vec::new(), Vec::new()];
    for (k, sample) in samples.iter().enumerate() {
        of_class[usize::from(sample.example.is_person)].push((mix(k as u64 ^ seed), k));
    }
    let mut kept = vec![true; samples.len()];
    for (mut class, most) in of_class.into_iter().zip(most) {
        class.sort_unstable();
        let spare = if most == 0 { 0 } else { class.len().saturating_sub(most) };
        class.iter().rev().take(spare).for_each(|(_, k)| kept[*k] = false);
    }
    let mut kept = kept.into_iter();
    samples.retain(|_| kept.next().unwrap_or(true));
}

#[cfg(test)]
mod tests {
    use tagalong_config::Example;

    use super::*;
    use crate::PIXELS;

    fn sample(group: u64, is_person: bool) -> Sample {
        Sample { patch: Box::new([0.0; PIXELS]), example: Example { is_person, group } }
    }

    #[test]
    fn a_subset_has_both_classes_and_no_more_than_asked_for() {
        let samples: Vec<Sample> = (0..100).map(|k| sample(k, k < 10)).collect();
        let chosen = subset(&samples, 40, 1);
        assert_eq!(chosen.len(), 40);
        assert_eq!(chosen.iter().filter(|s| s.example.is_person).count(), 10);
    }

    #[test]
    fn so_many_of_each_class_are_left_by_chance() {
        let samples: Vec<Sample> = (0..100).map(|k| sample(k, k < 40)).collect();
        let cases = [([10, 25], 1), ([10, 25], 2), ([0, 5], 1), ([1000, 1000], 1)];
        let [some, others, without_limit, all] = cases.map(|(most, seed)| -> Vec<u64> {
            let mut left = samples.clone();
            keep(&mut left, most, seed);
            left.iter().map(|s| s.example.group).collect()
        });
        assert_eq!(some.iter().filter(|k| **k < 40).count(), 25);
        assert_eq!(some.len(), 35);
        assert!(some.is_sorted(), "the order stays");
        assert_ne!(some, others);
        assert_eq!(without_limit.len(), 65, "0 is all");
        assert_eq!(all.len(), 100);
    }

    #[test]
    fn a_subset_is_drawn_from_all_of_a_class() {
        let samples: Vec<Sample> = (0..100).map(|k| sample(k, k < 10)).collect();
        let [chosen, others] = [1, 2].map(|seed| -> Vec<u64> {
            let others = subset(&samples, 40, seed).into_iter().filter(|s| !s.example.is_person);
            others.map(|s| s.example.group).collect()
        });
        let odd = chosen.iter().filter(|k| **k % 2 == 1).count();
        assert!((5..=25).contains(&odd), "{odd} of 30");
        assert_ne!(chosen, others);
    }

    #[test]
    fn accepted_is_what_lies_above_zero() {
        let held_out = vec![(1.0, true), (-1.0, true), (2.0, false), (-1.0, false), (-2.0, false)];
        let trial = Trial { gamma: 1.0, penalty: 1.0, held_out };
        assert_eq!(trial.accepted(true), 0.5);
        assert!((trial.accepted(false) - 1.0 / 3.0).abs() < 1e-12);
        // Six pairs: the person at 1.0 is above two others, the one at -1.0 above one, and once
        // they are equal.
        assert!((trial.area() - 3.5 / 6.0).abs() < 1e-12);
    }
}
