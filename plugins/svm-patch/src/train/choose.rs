use std::collections::{BTreeMap, BTreeSet};
use std::thread::available_parallelism;

use tagalong_core::{Error, Result};

use super::{Sample, solver};
use crate::{Sampler, Training};

/// One combination that was tried, judged by samples that it was not fitted to.
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
    /// Chance that a person has a larger decision value than another candidate
    /// (area under the ROC curve).
    pub fn area(&self) -> f64 {
        let mut sorted = self.held_out.clone();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (mut below, mut others, mut people) = (0.0, 0.0, 0.0);
        for ties in sorted.chunk_by(|a, b| a.0 == b.0) {
            let here = ties.iter().filter(|(_, is_person)| *is_person).count() as f64;
            let not = ties.len() as f64 - here;
            below += here * (others + 0.5 * not);
            people += here;
            others += not;
        }
        if people * others > 0.0 { below / (people * others) } else { 0.5 }
    }

    /// Fraction of a class whose decision value is positive.
    pub fn accepted(&self, people: bool) -> f64 {
        let of_class = || self.held_out.iter().filter(|(_, is_person)| *is_person == people);
        of_class().filter(|(f, _)| *f > 0.0).count() as f64 / of_class().count().max(1) as f64
    }
}

/// Tries every width with every penalty; samples of one group are always in one
/// part.
///
/// # Errors
/// As [`solver::fit`].
pub fn trials(
    samples: &[&Sample],
    sampler: Sampler,
    training: &Training,
    seed: u64,
    progress: &mut dyn FnMut(f64),
) -> Result<Vec<Trial>> {
    let parts = parts(samples, training.folds, seed);
    let each = training.gammas.iter().flat_map(|g| training.penalties.iter().map(|c| (*g, *c)));
    let grid: Vec<(f64, f64)> = each.collect();
    let attempt = |gamma, penalty| {
        let fit = |fitted: &[&Sample]| solver::fit(fitted, sampler, gamma, penalty);
        let held_out = hold_out(samples, &parts, training.folds, fit)?;
        Ok(Trial { gamma, penalty, held_out })
    };
    let mut all = Vec::with_capacity(grid.len());
    for few in grid.chunks(available_parallelism().map_or(1, usize::from)) {
        all.extend(side_by_side(few, &attempt)?);
        progress(all.len() as f64 / grid.len() as f64);
    }
    Ok(all)
}

/// Each combination in a thread of its own; the results in their order.
fn side_by_side(
    grid: &[(f64, f64)],
    attempt: &(impl Fn(f64, f64) -> Result<Trial> + Sync),
) -> Result<Vec<Trial>> {
    let died = |_| Err(Error::Other("the solver panicked".into()));
    std::thread::scope(|scope| {
        let running: Vec<_> =
            grid.iter().map(|(g, c)| scope.spawn(move || attempt(*g, *c))).collect();
        running.into_iter().map(|thread| thread.join().unwrap_or_else(died)).collect()
    })
}

fn hold_out(
    samples: &[&Sample],
    parts: &BTreeMap<u64, usize>,
    folds: usize,
    fit: impl Fn(&[&Sample]) -> Result<crate::Model>,
) -> Result<Vec<(f64, bool)>> {
    let mut values = Vec::with_capacity(samples.len());
    for fold in 0..folds {
        let is_out = |s: &&&Sample| parts.get(&s.example.group) == Some(&fold);
        let (out, rest): (Vec<&Sample>, Vec<&Sample>) = samples.iter().partition(|s| is_out(s));
        let model = fit(&rest)?;
        values.extend(out.iter().map(|s| (model.decision(&s.patch), s.example.is_person)));
    }
    Ok(values)
}

/// Deals the groups out to the parts, those with people and those without in
/// turn, so that each part has both.
fn parts(samples: &[&Sample], folds: usize, seed: u64) -> BTreeMap<u64, usize> {
    let groups = |wanted: &dyn Fn(&Sample) -> bool| -> BTreeSet<(u64, u64)> {
        let of = samples.iter().filter(|s| wanted(s)).map(|s| s.example.group);
        of.map(|group| (mix(group ^ seed), group)).collect()
    };
    let with_people = groups(&|s| s.example.is_person);
    let without = &groups(&|_| true) - &with_people;
    let deal = |set: &BTreeSet<(u64, u64)>| -> Vec<(u64, usize)> {
        set.iter().enumerate().map(|(k, (_, group))| (*group, k % folds)).collect()
    };
    deal(&with_people).into_iter().chain(deal(&without)).collect()
}

/// At most `most` samples, as many of each class as there are up to half, in
/// the order of a hash.
pub fn subset(samples: &[Sample], most: usize, seed: u64) -> Vec<&Sample> {
    let of_class = |is_person: bool| {
        let mut class: Vec<(u64, &Sample)> = samples
            .iter()
            .enumerate()
            .filter(|(_, s)| s.example.is_person == is_person)
            .map(|(k, s)| (mix(k as u64 ^ seed), s))
            .collect();
        class.sort_by_key(|(key, _)| *key);
        class.into_iter().map(|(_, s)| s).collect::<Vec<_>>()
    };
    let (mut people, mut others) = (of_class(true), of_class(false));
    let half = most / 2;
    let (spare_people, spare_others) =
        (half.saturating_sub(people.len()), half.saturating_sub(others.len()));
    people.truncate(half + spare_others);
    others.truncate(half + spare_people);
    people.extend(others);
    people
}

/// SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
fn mix(seed: u64) -> u64 {
    let z = seed.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use tagalong_core::Example;

    use super::*;
    use crate::PIXELS;

    fn sample(group: u64, is_person: bool) -> Sample {
        Sample { patch: Box::new([0.0; PIXELS]), example: Example { is_person, group } }
    }

    #[test]
    fn every_part_has_groups_with_and_without_people() {
        let samples: Vec<Sample> = (0..80).map(|k| sample(k / 4, k / 4 % 5 == 0)).collect();
        let all: Vec<&Sample> = samples.iter().collect();
        let parts = parts(&all, 4, 3);
        for part in 0..4 {
            for people in [true, false] {
                let here =
                    |s: &&Sample| parts[&s.example.group] == part && s.example.is_person == people;
                assert!(samples.iter().any(|s| here(&s)), "part {part}, people {people}");
            }
        }
    }

    #[test]
    fn a_subset_has_both_classes_and_no_more_than_asked_for() {
        let samples: Vec<Sample> = (0..100).map(|k| sample(k, k < 10)).collect();
        let chosen = subset(&samples, 40, 1);
        assert_eq!(chosen.len(), 40);
        assert_eq!(chosen.iter().filter(|s| s.example.is_person).count(), 10);
    }

    #[test]
    fn the_area_counts_ordered_pairs() {
        let held_out = vec![(0.1, false), (0.2, true), (0.2, false), (0.9, true)];
        let trial = Trial { gamma: 1.0, penalty: 1.0, held_out };
        assert_eq!(trial.area(), (1.5 + 2.0) / 4.0);
        assert_eq!((trial.accepted(true), trial.accepted(false)), (1.0, 1.0));
    }
}
