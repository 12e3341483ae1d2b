//! Trainer of a [`Model`] from scans with annotated legs.
//!
//! The legs of a scan come first, as candidates at their positions; a candidate that is no person
//! ends the scan, and its other segments are labelled as clutter. Simulated scans come as whole
//! frames with the heads in them; they are used for fitting and never held out.

use std::collections::BTreeMap;

use nalgebra::Point2;
use tagalong_config::{AnnotatedPerson, Example, Fitted, Trainer};
use tagalong_core::{Detection, Error, Frame, LaserScan, Result};
use tagalong_learn::boost::{Boosting, Levels, Next, Question};
use tagalong_learn::{Line, accepted, area, parts, platt};

use crate::config::Config;
use crate::model::{Node, Tree};
use crate::{Beams, COUNT, Features, Model, Segmentation, Training, features};

/// Farthest distance of the middle of a leg from the place below the head of its person, m.
const BELOW_M: f64 = 0.5;

/// Features of a segment with its label.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// The features.
    pub features: Features,
    /// Label and group.
    pub example: Example,
    /// False for a sample of a simulated scan, which is no measure of a model.
    pub is_real: bool,
}

impl Sample {
    /// Whether the sample is held out with a part of the groups.
    fn is_in(&self, parts: &BTreeMap<u64, usize>, fold: usize) -> bool {
        self.is_real && parts.get(&self.example.group) == Some(&fold)
    }
}

/// Places of legs in a scan, or of people, with the distance of a leg from them.
struct Labels<'a> {
    places: &'a [Point2<f64>],
    within_m: f64,
    is_real: bool,
}

/// Collector of segments that fits models to them.
pub struct LegTrainer {
    training: Training,
    segments: Segmentation,
    seed: u64,
    /// Legs of the scan that is not closed yet, robot frame, m.
    legs: Vec<Point2<f64>>,
    samples: Vec<Sample>,
}

/// A number of trees with the held-out sums.
struct Trial {
    trees: usize,
    held_out: Vec<(f64, bool)>,
}

impl LegTrainer {
    /// Creates a trainer without samples.
    ///
    /// # Errors
    /// [`Error::Settings`] for settings outside their ranges.
    pub fn new(config: &Config, seed: u64) -> Result<Self> {
        config.check()?;
        let Config { training, segments, .. } = config.clone();
        Ok(Self { training, segments, seed, legs: Vec::new(), samples: Vec::new() })
    }

    /// Adds the segments of a scan, as they are and with fewer rays. Segments between once and twice
    /// the distance of a leg are left out.
    fn add_scan(&mut self, scan: &LaserScan, group: u64, labels: &Labels<'_>) {
        let &Labels { places, within_m, is_real } = labels;
        let steps: Vec<u32> = std::iter::once(1).chain(self.training.every_ray.clone()).collect();
        let scanner = scan.robot_from_scanner.translation.vector.xy();
        for step in steps {
            let beams = Beams::new(scan, step);
            let segments = beams.segments(&self.segments);
            for segment in
                segments.iter().filter(|s| beams.width((*s).clone()) <= self.segments.max_width_m)
            {
                let at = beams.middle(segment.clone()) + scanner;
                let apart = places.iter().map(|place| (place - at).norm());
                let nearest = apart.fold(f64::INFINITY, f64::min);
                let is_person = nearest <= within_m;
                if is_person || nearest > 2.0 * within_m {
                    let features = features(&beams, segment, &segments);
                    let example = Example { is_person, group };
                    self.samples.push(Sample { features, example, is_real });
                }
            }
        }
    }

    /// Grows trees on the samples that `is_used`.
    fn grow(&self, count: usize, is_used: impl Fn(&Sample) -> bool) -> Vec<Tree> {
        let used: Vec<&Sample> = self.samples.iter().filter(|sample| is_used(sample)).collect();
        let mut table = Levels::new(used.len());
        (0..COUNT).for_each(|f| table.push(used.iter().map(move |sample| sample.features[f])));
        let mut boosting = Boosting::new(&table, used.iter().map(|s| s.example.is_person));
        let all: Vec<usize> = (0..COUNT).collect();
        (0..count).map(|_| tree(&boosting.grow(&all, self.training.depth))).collect()
    }

    /// Tries all numbers of trees on held-out groups.
    fn trials(&self, progress: &mut dyn FnMut(f64)) -> Vec<Trial> {
        let Training { trees: counts, folds, .. } = &self.training;
        let real = self.samples.iter().filter(|sample| sample.is_real);
        let parts = parts(real.map(|sample| sample.example), *folds, self.seed);
        let most = counts.iter().copied().max().unwrap_or(0);
        let mut trials: Vec<Trial> =
            counts.iter().map(|&trees| Trial { trees, held_out: Vec::new() }).collect();
        for fold in 0..*folds {
            let trees = self.grow(most, |sample| !sample.is_in(&parts, fold));
            for trial in &mut trials {
                let trees = trees[..trial.trees.min(trees.len())].to_vec();
                let model = Model { trees, slope: 1.0, offset: 0.0 };
                let out = self.samples.iter().filter(|sample| sample.is_in(&parts, fold));
                let judged = out.map(|s| (model.sum(&s.features), s.example.is_person));
                trial.held_out.extend(judged);
            }
            progress((fold + 1) as f64 / (folds + 1) as f64);
        }
        trials
    }

    fn figures(&self, trials: &[Trial], model: &Model) -> toml::Table {
        let legs = self.samples.iter().filter(|sample| sample.example.is_person).count();
        let simulated = self.samples.iter().filter(|sample| !sample.is_real).count();
        fn number(n: usize) -> toml::Value {
            toml::Value::Integer(n as i64)
        }
        let mut rows = Vec::with_capacity(trials.len());
        for trial in trials {
            rows.push(toml::Value::Table(toml::Table::from_iter([
                ("trees".to_owned(), number(trial.trees)),
                ("area_under_roc".to_owned(), rounded(area(&trial.held_out))),
                ("legs_accepted".to_owned(), rounded(accepted(&calibrated(trial), true))),
                ("others_accepted".to_owned(), rounded(accepted(&calibrated(trial), false))),
            ])));
        }
        toml::Table::from_iter([
            ("legs".to_owned(), number(legs)),
            ("others".to_owned(), number(self.samples.len() - legs)),
            ("of_them_simulated".to_owned(), number(simulated)),
            ("trees".to_owned(), number(model.trees.len())),
            ("slope".to_owned(), rounded(model.slope)),
            ("offset".to_owned(), rounded(model.offset)),
            ("cross_validation".to_owned(), toml::Value::Array(rows)),
        ])
    }
}

impl Trainer for LegTrainer {
    fn add(&mut self, frame: &Frame, candidate: &Detection, example: Example) -> Result<()> {
        if example.is_person {
            self.legs.push(candidate.position.xy());
            return Ok(());
        }
        let places = std::mem::take(&mut self.legs);
        let within_m = self.training.label_m;
        let labels = Labels { places: &places, within_m, is_real: true };
        self.add_scan(frame.scan()?, example.group, &labels);
        Ok(())
    }

    fn add_frame(
        &mut self,
        frame: &Frame,
        people: &[AnnotatedPerson],
        room: Option<&str>,
        group: u64,
    ) -> Result<()> {
        let places: Vec<Point2<f64>> = people.iter().map(|person| person.head.xy()).collect();
        let labels = Labels { places: &places, within_m: BELOW_M, is_real: room.is_some() };
        self.add_scan(frame.scan()?, group, &labels);
        Ok(())
    }

    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted> {
        let legs = self.samples.iter().filter(|sample| sample.example.is_person).count();
        if legs < 10 || self.samples.len() - legs < 10 {
            return Err(Error::Other("fewer than ten legs, or than ten other segments".into()));
        }
        let trials = self.trials(progress);
        let best = trials.iter().max_by(|a, b| area(&a.held_out).total_cmp(&area(&b.held_out)));
        let best = best.ok_or_else(|| Error::Other("nothing to try".into()))?;
        // Held-out sums: those of fitted samples are too confident.
        let Line { slope, offset } = platt(&best.held_out);
        let model = Model { trees: self.grow(best.trees, |_| true), slope, offset };
        progress(1.0);
        let text = model.to_text().map_err(Error::Other)?;
        Ok(Fitted::new(text, self.figures(&trials, &model)))
    }
}

/// Returns the held-out log-odds of a trial.
fn calibrated(trial: &Trial) -> Vec<(f64, bool)> {
    let Line { slope, offset } = platt(&trial.held_out);
    trial.held_out.iter().map(|(sum, is)| (slope * sum + offset, *is)).collect()
}

/// Converts a grown tree; its numbers are rounded so that a file is short.
fn tree(questions: &[Question]) -> Tree {
    fn short(value: f32) -> f32 {
        (value * 1e4).round() / 1e4
    }

    fn node(question: &Question) -> Node {
        let [(first, low), (second, high)] = question.next.each_ref().map(|next| match *next {
            Next::Question(index) => (index, 0.0),
            Next::Leaf(value) => (0, short(value)),
        });
        Node {
            feature: question.feature,
            below: short(question.below),
            next: [first, second],
            leaves: [low, high],
        }
    }

    questions.iter().map(node).collect()
}

fn rounded(value: f64) -> toml::Value {
    ((value * 1e4).round() / 1e4).into()
}

#[cfg(test)]
mod tests {
    use tagalong_math::{RandomSource, SplitMix64};

    use super::*;

    /// Returns a trainer with so many legs and others, of features that say nothing.
    fn trainer(legs: usize, others: usize) -> LegTrainer {
        let training = Training { trees: vec![30], ..Training::default() };
        let mut trainer = LegTrainer::new(&Config { training, ..Config::default() }, 1).unwrap();
        let mut random = SplitMix64::new(5);
        trainer.samples = (0..legs + others)
            .map(|k| Sample {
                features: std::array::from_fn(|_| random.uniform() as f32),
                example: Example { is_person: k < legs, group: k as u64 % 12 },
                is_real: true,
            })
            .collect();
        trainer
    }

    /// Fitted to what they are judged by, the trees would know all of it by heart.
    #[test]
    fn trials_are_judged_by_samples_that_they_were_not_fitted_to() {
        let mut parts = vec![0.0];
        let trainer = trainer(60, 60);
        let trials = trainer.trials(&mut |part| parts.push(part));
        assert_eq!(trials[0].held_out.len(), 120, "each sample once");
        let found = area(&trials[0].held_out);
        assert!((0.3..0.7).contains(&found), "{found}");
        assert!(parts.is_sorted() && parts.iter().all(|part| *part <= 1.0), "{parts:?}");
    }

    #[test]
    fn simulated_samples_are_fitted_and_never_held_out() {
        let mut both = trainer(60, 60);
        let alone = both.trials(&mut |_| ());
        let simulated = trainer(40, 20).samples;
        both.samples.extend(simulated.iter().map(|s| Sample { is_real: false, ..*s }));
        let trials = both.trials(&mut |_| ());
        assert_eq!(trials[0].held_out.len(), 120, "the real ones, each once");
        assert_ne!(trials[0].held_out, alone[0].held_out, "other trees");
    }

    #[test]
    fn ten_of_each_are_enough() {
        assert!(trainer(10, 10).fit(&mut |_| ()).is_ok());
        assert!(trainer(9, 20).fit(&mut |_| ()).is_err());
        assert!(trainer(20, 9).fit(&mut |_| ()).is_err());
    }
}
