//! Fits a [`Model`] to labelled candidates: networks are trained with some groups held out, their
//! outputs on those groups calibrate the log-odds, and a network trained on all groups is the
//! model.

mod changes;

use tagalong_config::{Example, Fitted, Trainer};
use tagalong_core::{Detection, Error, Frame, Result};
use tagalong_learn::{Adam, Line, accepted, area, mix, pace, parts, platt, side_by_side};

use self::changes::{Draws, changed};
use crate::{Config, Model, Net, NetworkInput, Pass, Training};

/// A batch is always summed in so many parts, however many cores there are: the same
/// bytes on all machines.
const PARTS: usize = 4;
/// No label is quite certain.
const SURE: f32 = 0.99;
/// Weights are kept in so many steps a unit.
const STEPS: f32 = 1e4;

/// Collects views of candidates and fits models to them.
pub struct NetTrainer {
    training: Training,
    depth: bool,
    seed: u64,
    views: Vec<NetworkInput>,
    examples: Vec<Example>,
    /// Candidates that were not seen whole, or without depth.
    unseen: usize,
}

impl NetTrainer {
    /// A trainer without examples.
    ///
    /// # Errors
    /// [`Error::Settings`] for numbers that cannot work.
    pub fn new(config: Config, seed: u64) -> Result<Self> {
        let Config { training, depth, .. } = config;
        check(&training)?;
        Ok(Self { training, depth, seed, views: Vec::new(), examples: Vec::new(), unseen: 0 })
    }

    /// A network that has seen these examples.
    fn network(&self, chosen: &[usize], progress: &mut dyn FnMut(f64)) -> Result<Net> {
        let people = chosen.iter().filter(|k| self.examples[**k].is_person).count();
        if people == 0 || people == chosen.len() {
            let message = "people and others: both are needed, with depth, in several groups";
            return Err(Error::Other(message.into()));
        }
        let mut net = start(self.seed);
        let mut adam = Adam::default();
        let Training { epochs, batch, rate, decay, .. } = self.training;
        let batches = chosen.len().div_ceil(batch) * epochs as usize;
        let mut done = 0;
        for epoch in 0..epochs {
            let mut order = chosen.to_vec();
            let seed = mix(self.seed ^ mix(u64::from(epoch)));
            order.sort_by_key(|k| mix(seed ^ *k as u64));
            for few in order.chunks(batch) {
                let gradient =
                    self.gradient(&net, few, people as f32 / chosen.len() as f32, seed)?;
                let rate = rate * pace(done as f64 / batches as f64);
                adam.step(net.parts_mut(), &gradient.parts(), rate as f32, decay as f32);
                done += 1;
            }
            progress(f64::from(epoch + 1) / f64::from(epochs));
        }
        for value in net.parts_mut().into_iter().flatten() {
            *value = (*value * STEPS).round() / STEPS;
        }
        Ok(net)
    }

    /// Computes the gradient of the mean loss of a batch. People and others have the same weight;
    /// `share` is that of people.
    fn gradient(&self, net: &Net, batch: &[usize], share: f32, seed: u64) -> Result<Net> {
        let chunks: Vec<&[usize]> = batch.chunks(batch.len().div_ceil(PARTS)).collect();
        let gradients = side_by_side(
            &chunks,
            |part| {
                let mut gradient = Net::default();
                let mut pass = Pass::default();
                for &k in *part {
                    let is_person = self.examples[k].is_person;
                    let view = changed(&self.views[k], &mut Draws(mix(seed ^ !(k as u64))));
                    let said = net.look(&view, &mut pass);
                    let target = if is_person { SURE } else { 1.0 - SURE };
                    let weight = 0.5 / if is_person { share } else { 1.0 - share };
                    let of_output = (1.0 / (1.0 + (-said).exp()) - target) * weight;
                    net.learn(&pass, of_output / batch.len() as f32, &mut gradient);
                }
                Ok(gradient)
            },
            &mut |_| {},
        )?;
        let mut sum = Net::default();
        for part in gradients {
            let pairs =
                sum.parts_mut().into_iter().flatten().zip(part.parts().into_iter().flatten());
            pairs.for_each(|(sum, value)| *sum += value);
        }
        Ok(sum)
    }

    /// Returns the outputs of networks on candidates that they have not seen.
    fn held_out(&self, progress: &mut dyn FnMut(f64)) -> Result<Vec<(f64, bool)>> {
        let folds = self.training.folds;
        let parts = parts(self.examples.iter().copied(), folds, self.seed);
        let mut said = Vec::new();
        let mut pass = Pass::default();
        for fold in 0..folds {
            let (out, rest): (Vec<usize>, _) = (0..self.examples.len())
                .partition(|k| parts.get(&self.examples[*k].group) == Some(&fold));
            let net =
                self.network(&rest, &mut |part| progress((fold as f64 + part) / folds as f64))?;
            for k in out {
                let log_odds = f64::from(net.look(&self.views[k], &mut pass));
                said.push((log_odds, self.examples[k].is_person));
            }
        }
        Ok(said)
    }

    fn figures(&self, said: &[(f64, bool)], model: &Model) -> toml::Table {
        fn number(n: usize) -> toml::Value {
            toml::Value::Integer(n as i64)
        }
        let people = self.examples.iter().filter(|example| example.is_person).count();
        let groups: std::collections::BTreeSet<u64> =
            self.examples.iter().map(|example| example.group).collect();
        let log_odds: Vec<(f64, bool)> =
            said.iter().map(|(f, is)| (model.slope * f + model.offset, *is)).collect();
        toml::Table::from_iter([
            ("people".to_owned(), number(people)),
            ("others".to_owned(), number(self.examples.len() - people)),
            ("without_depth".to_owned(), number(self.unseen)),
            ("groups".to_owned(), number(groups.len())),
            ("slope".to_owned(), model.slope.into()),
            ("offset".to_owned(), model.offset.into()),
            ("area_under_roc".to_owned(), rounded(area(said), 1e4)),
            ("people_accepted".to_owned(), rounded(accepted(&log_odds, true), 1e4)),
            ("others_accepted".to_owned(), rounded(accepted(&log_odds, false), 1e4)),
        ])
    }
}

impl Trainer for NetTrainer {
    fn add(&mut self, frame: &Frame, candidate: &Detection, example: Example) -> Result<()> {
        match NetworkInput::new(frame, candidate, self.depth)? {
            Some(view) => {
                self.views.push(view);
                self.examples.push(example);
            }
            None => self.unseen += 1,
        }
        Ok(())
    }

    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted> {
        fn thousandths(value: f64) -> f64 {
            (value * 1e3).round() / 1e3
        }

        // A network that leaves a part out is trained a little faster than one of all.
        let folds = self.training.folds as f64;
        let first = (folds - 1.0) / folds;
        let said = self.held_out(&mut |part| progress(first * part))?;
        let everything: Vec<usize> = (0..self.examples.len()).collect();
        let net = self.network(&everything, &mut |part| progress(first + (1.0 - first) * part))?;
        let Line { slope, offset } = platt(&said);
        let model = Model { net, slope: thousandths(slope), offset: thousandths(offset) };
        Ok(Fitted::new(model.to_text(), self.figures(&said, &model)))
    }
}

/// Weights by chance, as large as keeps the signal (He, Zhang, Ren and Sun, ICCV 2015).
fn start(seed: u64) -> Net {
    let mut net = Net::default();
    let mut draws = Draws(mix(seed));
    for (part, inputs) in net.parts_mut().into_iter().zip(Net::INPUTS) {
        let limit = if inputs > 0 { (6.0 / inputs as f32).sqrt() } else { 0.0 };
        part.iter_mut().for_each(|value| *value = limit * draws.within());
    }
    net
}

fn rounded(value: f64, steps: f64) -> toml::Value {
    ((value * steps).round() / steps).into()
}

fn check(training: &Training) -> Result<()> {
    let rules = [
        (training.epochs >= 1, "epochs", "must be at least 1"),
        (training.rate > 0.0 && training.rate <= 1.0, "rate", "must be above 0 and at most 1"),
        ((0.0..1.0).contains(&training.decay), "decay", "must be from 0 to below 1"),
        (training.batch >= 1, "batch", "must be at least 1"),
        (training.folds >= 2, "folds", "must be at least 2"),
    ];
    match rules.iter().find(|(holds, ..)| !holds) {
        Some((_, key, why)) => Err(Error::setting(*key, *why)),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a trainer with so many people and then others, each in a group of its own.
    fn trainer(people: usize, others: usize) -> NetTrainer {
        let training = Training { epochs: 1, batch: 4, folds: 3, ..Training::default() };
        let mut trainer = NetTrainer::new(Config { training, ..Config::default() }, 1).unwrap();
        for k in 0..people + others {
            let grey = (0..80 * 36).map(|cell| (cell * (k + 7) % 251) as u8).collect();
            trainer.views.push(NetworkInput { grey, behind: vec![0; 40 * 18] });
            trainer.examples.push(Example { is_person: k < people, group: k as u64 });
        }
        trainer
    }

    /// A network that is undecided about all of them: its error is `SURE - 0.5`.
    #[test]
    fn people_and_others_weigh_the_same_whatever_their_number() {
        let trainer = trainer(3, 1);
        for (batch, share, expected) in [
            (&[0, 1, 2, 3][..], 0.75, 0.0),
            // A person.
            (&[0], 0.5, 0.5 - SURE),
            // Another thing.
            (&[3], 0.5, SURE - 0.5),
            (&[3], 0.75, 2.0 * (SURE - 0.5)),
        ] {
            let gradient = trainer.gradient(&Net::default(), batch, share, 1).unwrap();
            assert!((gradient.bias[0] - expected).abs() < 1e-6, "{batch:?} {share}");
        }
    }

    #[test]
    fn each_example_is_held_out_once() {
        let said = trainer(4, 5).held_out(&mut |_| ()).unwrap();
        assert_eq!(said.len(), 9);
        assert_eq!(said.iter().filter(|(_, is_person)| *is_person).count(), 4);
    }
}
