//! Trainer of a [`Model`] from labelled candidates: widths and penalties are chosen by
//! cross-validation over groups, the decision values of the held-out samples calibrate the
//! log-odds, and a final fit to more samples makes the model.

mod choose;
mod solver;

pub use choose::Trial;
use tagalong_config::{Example, Fitted, Trainer};
use tagalong_core::{Detection, Error, Frame, Result};
use tagalong_learn::{Line, platt};

use crate::{Model, Patch, Sampler, Training};

/// A labelled patch.
#[derive(Clone, Debug)]
pub struct Sample {
    /// Normalised grey values.
    pub patch: Box<Patch>,
    /// Its label and its group.
    pub example: Example,
}

/// Trainer that collects patches and fits models to them.
pub struct PatchTrainer {
    training: Training,
    sampler: Sampler,
    seed: u64,
    samples: Vec<Sample>,
}

/// Share of the progress that the final fit takes.
const LAST_FIT: f64 = 0.2;

/// Safety factor of the number of samples when a fit has too many support vectors: it is repeated
/// with the number that would give this part of the limit, were vectors proportional to samples.
const ALLOWED: f64 = 0.95;

impl PatchTrainer {
    /// Creates a trainer without samples.
    ///
    /// # Errors
    /// [`Error::Settings`] for settings outside their ranges.
    pub fn new(training: Training, seed: u64) -> Result<Self> {
        check(&training)?;
        let sampler = Sampler { grow: training.grow, scaling: training.scaling };
        Ok(Self { training, sampler, seed, samples: Vec::new() })
    }

    /// Tries the whole grid of widths and penalties.
    pub fn trials(&self, progress: &mut dyn FnMut(f64)) -> Result<Vec<Trial>> {
        let tried = choose::subset(&self.samples, self.training.max_tried, self.seed);
        choose::trials(&tried, self.sampler, &self.training, self.seed, progress)
    }

    /// Fits to as many samples as the limit on support vectors allows.
    fn last_fit(&self, gamma: f64, penalty: f64) -> Result<(Model, usize)> {
        let mut most = self.training.max_samples.min(self.samples.len());
        loop {
            let samples = choose::subset(&self.samples, most, self.seed);
            let model = solver::fit(&samples, self.sampler, gamma, penalty)?;
            if model.len() <= self.training.max_vectors {
                return Ok((model, samples.len()));
            }
            let part = ALLOWED * self.training.max_vectors as f64 / model.len() as f64;
            most = (part * samples.len() as f64) as usize;
        }
    }

    fn figures(&self, trials: &[Trial], best: &Trial, model: &Model, fitted: usize) -> toml::Table {
        let people = self.samples.iter().filter(|s| s.example.is_person).count();
        let groups: std::collections::BTreeSet<u64> =
            self.samples.iter().map(|s| s.example.group).collect();
        fn number(n: usize) -> toml::Value {
            toml::Value::Integer(n as i64)
        }
        let mut figures = toml::Table::new();
        figures.insert("people".into(), number(people));
        figures.insert("others".into(), number(self.samples.len() - people));
        figures.insert("groups".into(), number(groups.len()));
        figures.insert("fitted".into(), number(fitted));
        figures.insert("vectors".into(), number(model.len()));
        figures.insert("gamma".into(), best.gamma.into());
        figures.insert("penalty".into(), best.penalty.into());
        figures.insert("slope".into(), rounded(model.slope));
        figures.insert("offset".into(), rounded(model.offset));
        let rows = trials.iter().map(|trial| toml::Value::Table(row(trial)));
        figures.insert("cross_validation".into(), toml::Value::Array(rows.collect()));
        figures
    }
}

impl Trainer for PatchTrainer {
    fn add(&mut self, frame: &Frame, candidate: &Detection, example: Example) -> Result<()> {
        let patch = Box::new(self.sampler.patch(frame.grey()?, &candidate.rect_in(&frame.camera)));
        self.samples.push(Sample { patch, example });
        Ok(())
    }

    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted> {
        let Training { people, others, .. } = self.training;
        choose::keep(&mut self.samples, [others, people], self.seed);
        let trials = self.trials(&mut |part| progress((1.0 - LAST_FIT) * part))?;
        let best = trials
            .iter()
            .max_by(|a, b| a.area().total_cmp(&b.area()))
            .ok_or_else(|| Error::Other("nothing to try".into()))?;
        let (mut model, fitted) = self.last_fit(best.gamma, best.penalty)?;
        // Held-out decision values: those of fitted samples are too confident.
        let Line { slope, offset } = platt(&best.held_out);
        (model.slope, model.offset) = (slope, offset);
        progress(1.0);
        let figures = self.figures(&trials, best, &model, fitted);
        let text = model.to_text().map_err(Error::Other)?;
        Ok(Fitted::new(text, figures))
    }
}

fn row(trial: &Trial) -> toml::Table {
    toml::Table::from_iter([
        ("gamma".to_owned(), trial.gamma.into()),
        ("penalty".to_owned(), trial.penalty.into()),
        ("area_under_roc".to_owned(), rounded(trial.area())),
        ("people_accepted".to_owned(), rounded(trial.accepted(true))),
        ("others_accepted".to_owned(), rounded(trial.accepted(false))),
    ])
}

fn rounded(value: f64) -> toml::Value {
    ((value * 1e4).round() / 1e4).into()
}

fn check(training: &Training) -> Result<()> {
    fn positive(values: &[f64]) -> bool {
        !values.is_empty() && values.iter().all(|v| v.is_finite() && *v > 0.0)
    }

    let rules = [
        (positive(&training.gammas), "gammas", "must be positive numbers"),
        (positive(&training.penalties), "penalties", "must be positive numbers"),
        (training.folds >= 2, "folds", "must be at least 2"),
        (training.max_samples <= 5000, "max_samples", "must be at most 5000: memory is its square"),
        (training.max_tried <= 5000, "max_tried", "must be at most 5000: memory is its square"),
        (training.max_vectors >= 2, "max_vectors", "must be at least 2"),
        ((0.0..=2.0).contains(&training.grow), "grow", "must be in 0 to 2"),
    ];
    match rules.iter().find(|(holds, ..)| !holds) {
        Some((_, key, why)) => Err(Error::setting(*key, *why)),
        None => Ok(()),
    }
}
