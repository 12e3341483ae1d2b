//! Fits a [`Model`] to labelled candidates: trees are added one after the other, their number is
//! chosen by cross-validation over groups, and the sums of the held-out candidates calibrate the
//! log-odds.

mod boost;

pub use boost::Examples;
use tagalong_config::{Example, Fitted, Trainer};
use tagalong_core::{Detection, Error, Frame, Result};
use tagalong_learn::{Line, accepted, area, parts, platt, side_by_side};

use crate::{COUNT, Family, Features, Model, Stump, Training, Tree};

/// Collects the numbers of candidates and fits models to them.
pub struct TreeTrainer {
    training: Training,
    seed: u64,
    features: Features,
    /// [`COUNT`] numbers of each candidate, one after the other.
    values: Vec<f32>,
    examples: Vec<Labelled>,
}

#[derive(Clone, Copy)]
struct Labelled {
    example: Example,
    has_depth: bool,
}

/// A number of trees, judged by candidates that they were not fitted to.
struct Trial {
    trees: usize,
    /// Sums of held-out candidates, with the truth and the weight.
    held_out: Vec<Judged>,
}

struct Judged {
    sum: f64,
    is_person: bool,
    has_depth: bool,
    weight: f64,
}

impl TreeTrainer {
    /// A trainer without examples.
    ///
    /// # Errors
    /// [`Error::Settings`] for numbers that cannot work.
    pub fn new(training: Training, seed: u64) -> Result<Self> {
        check(&training)?;
        let features = Features::default();
        Ok(Self { training, seed, features, values: Vec::new(), examples: Vec::new() })
    }

    /// People and others weigh the same, with depth and without; together they
    /// weigh as much as there are candidates.
    fn weights(&self) -> Vec<f64> {
        fn cell(l: &Labelled) -> usize {
            usize::from(l.example.is_person) * 2 + usize::from(l.has_depth)
        }

        let mut counts = [0.0; 4];
        self.examples.iter().for_each(|l| counts[cell(l)] += 1.0);
        let without = if counts[1] * counts[3] > 0.0 { self.training.without_depth } else { 1.0 };
        let share = [without, 1.0 - without];
        let total = self.examples.len() as f64;
        self.examples
            .iter()
            .map(|l| 0.5 * total * share[usize::from(l.has_depth)] / counts[cell(l)])
            .collect()
    }

    fn trials(&self, examples: &Examples, progress: &mut dyn FnMut(f64)) -> Result<Vec<Trial>> {
        let Training { folds, trees: counts, .. } = &self.training;
        let parts = parts(self.examples.iter().map(|l| l.example), *folds, self.seed);
        let mut trials: Vec<Trial> =
            counts.iter().map(|&trees| Trial { trees, held_out: Vec::new() }).collect();
        let all: Vec<usize> = (0..*folds).collect();
        let fitted_part = *folds as f64 / (folds + 1) as f64;
        let fitted = side_by_side(
            &all,
            |fold| {
                let (out, rest): (Vec<usize>, Vec<usize>) = (0..self.examples.len())
                    .partition(|k| parts.get(&self.examples[*k].example.group) == Some(fold));
                Ok((out, self.boost(examples, &rest)?))
            },
            &mut |part| progress(part * fitted_part),
        )?;
        for (out, trees) in fitted {
            for trial in &mut trials {
                let found = &trees[..trial.trees.min(trees.len())];
                trial.held_out.extend(out.iter().map(|&k| self.judge(found, examples, k)));
            }
        }
        Ok(trials)
    }

    fn judge(&self, trees: &[Tree], examples: &Examples, index: usize) -> Judged {
        let Labelled { example, has_depth } = self.examples[index];
        let values = &self.values[index * COUNT..(index + 1) * COUNT];
        let sum = trees.iter().map(|tree| f64::from(tree.vote(values))).sum();
        Judged { sum, is_person: example.is_person, has_depth, weight: examples.weights[index] }
    }

    fn boost(&self, examples: &Examples, chosen: &[usize]) -> Result<Vec<Tree>> {
        let people = chosen.iter().filter(|k| self.examples[**k].example.is_person).count();
        if people == 0 || people == chosen.len() {
            return Err(Error::Other(
                "people and others: both are needed, in several groups".into(),
            ));
        }
        let most = self.training.trees.iter().copied().max().unwrap_or(0);
        Ok(boost::boost(examples, chosen, &self.training, most, self.seed))
    }

    /// Counts the examples that are wanted.
    fn count_of(&self, wanted: impl Fn(&Labelled) -> bool) -> toml::Value {
        toml::Value::Integer(self.examples.iter().filter(|l| wanted(l)).count() as i64)
    }

    fn figures(&self, trials: &[Trial], model: &Model) -> toml::Table {
        let groups: std::collections::BTreeSet<u64> =
            self.examples.iter().map(|l| l.example.group).collect();
        let rows = trials.iter().map(|trial| toml::Value::Table(trial.row()));
        toml::Table::from_iter([
            ("people".to_owned(), self.count_of(|l| l.example.is_person)),
            ("others".to_owned(), self.count_of(|l| !l.example.is_person)),
            ("people_with_depth".to_owned(), self.count_of(|l| l.example.is_person && l.has_depth)),
            (
                "others_with_depth".to_owned(),
                self.count_of(|l| !l.example.is_person && l.has_depth),
            ),
            ("groups".to_owned(), toml::Value::Integer(groups.len() as i64)),
            ("trees".to_owned(), toml::Value::Integer(model.trees.len() as i64)),
            ("slope".to_owned(), rounded(model.slope)),
            ("offset".to_owned(), rounded(model.offset)),
            ("influence".to_owned(), influence(model).into()),
            ("cross_validation".to_owned(), toml::Value::Array(rows.collect())),
        ])
    }
}

impl Trainer for TreeTrainer {
    fn add(&mut self, frame: &Frame, candidate: &Detection, example: Example) -> Result<()> {
        self.features.look(frame, candidate)?;
        self.values.extend(self.features.values());
        self.examples.push(Labelled { example, has_depth: self.features.has_depth() });
        Ok(())
    }

    fn fit(&mut self, progress: &mut dyn FnMut(f64)) -> Result<Fitted> {
        let people = self.examples.iter().map(|l| l.example.is_person);
        let examples = Examples::new(&self.values, people.collect(), self.weights());
        let trials = self.trials(&examples, progress)?;
        let best = trials
            .iter()
            .min_by(|a, b| a.loss().total_cmp(&b.loss()))
            .ok_or_else(|| Error::Other("nothing to try".into()))?;
        let everything: Vec<usize> = (0..self.examples.len()).collect();
        let mut trees = self.boost(&examples, &everything)?;
        trees.truncate(best.trees);
        let Line { slope, offset } = platt(&best.in_use());
        let model = Model { trees, slope: thousandths(slope), offset: thousandths(offset) };
        progress(1.0);
        let figures = self.figures(&trials, &model);
        let text = model.to_text().map_err(Error::Other)?;
        Ok(Fitted::new(text, figures))
    }
}

impl Trial {
    /// Weighted cross-entropy of the sums as log-odds.
    fn loss(&self) -> f64 {
        fn sign(judged: &Judged) -> f64 {
            if judged.is_person { 1.0 } else { -1.0 }
        }

        fn loss(judged: &Judged) -> f64 {
            let f = -sign(judged) * judged.sum;
            judged.weight * (f.max(0.0) + (-f.abs()).exp().ln_1p())
        }

        let weight: f64 = self.held_out.iter().map(|judged| judged.weight).sum();
        self.held_out.iter().map(loss).sum::<f64>() / weight
    }

    /// Returns the scores of the candidates that the model will judge in use: those with depth, if
    /// there are both kinds of them.
    fn in_use(&self) -> Vec<(f64, bool)> {
        let with_depth = self.held_out_sums(true);
        let people = with_depth.iter().filter(|(_, is_person)| *is_person).count();
        let has_both = people > 0 && people < with_depth.len();
        if has_both { with_depth } else { self.held_out_sums(false) }
    }

    /// Returns the sums of all candidates, or of those with depth, and whether they are people.
    fn held_out_sums(&self, depth_only: bool) -> Vec<(f64, bool)> {
        let asked = self.held_out.iter().filter(|j| j.has_depth || !depth_only);
        asked.map(|j| (j.sum, j.is_person)).collect()
    }

    fn row(&self) -> toml::Table {
        let with_depth = self.in_use();
        let all: Vec<(f64, bool)> = self.held_out.iter().map(|j| (j.sum, j.is_person)).collect();
        toml::Table::from_iter([
            ("trees".to_owned(), toml::Value::Integer(self.trees as i64)),
            ("loss".to_owned(), rounded(self.loss())),
            ("area_under_roc".to_owned(), rounded(area(&all))),
            ("area_under_roc_with_depth".to_owned(), rounded(area(&with_depth))),
            ("people_accepted_with_depth".to_owned(), rounded(accepted(&with_depth, true))),
            ("others_accepted_with_depth".to_owned(), rounded(accepted(&with_depth, false))),
        ])
    }
}

/// Returns the share of each family in the votes of the trees.
fn influence(model: &Model) -> toml::Table {
    fn first(tree: &Tree) -> (usize, f64) {
        fn mean(stump: &Stump) -> f32 {
            0.5 * (stump.below + stump.above)
        }
        let reach = f64::from((mean(&tree.above) - mean(&tree.below)).abs());
        (tree.feature, reach)
    }

    fn reach(stump: &Stump) -> f64 {
        f64::from((stump.above - stump.below).abs())
    }
    let stumps = model.trees.iter().flat_map(|tree| [tree.below, tree.above]);
    let all: Vec<(usize, f64)> =
        stumps.map(|s| (s.feature, reach(&s))).chain(model.trees.iter().map(first)).collect();
    let total: f64 = all.iter().map(|(_, reach)| reach).sum();
    let mut shares = toml::Table::new();
    for family in Family::ALL {
        let of = all.iter().filter(|(feature, _)| family.range().contains(feature));
        let reach = of.map(|(_, reach)| reach).sum::<f64>();
        shares.insert(family.name().to_owned(), rounded(reach / total.max(f64::MIN_POSITIVE)));
    }
    shares
}

fn thousandths(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

fn rounded(value: f64) -> toml::Value {
    ((value * 1e4).round() / 1e4).into()
}

fn check(training: &Training) -> Result<()> {
    let trees = &training.trees;
    let rules = [
        (
            !trees.is_empty() && trees.iter().all(|n| (1..=5000).contains(n)),
            "trees",
            "must be numbers from 1 to 5000",
        ),
        (training.rate > 0.0 && training.rate <= 1.0, "rate", "must be above 0 and at most 1"),
        (
            training.features > 0.0 && training.features <= 1.0,
            "features",
            "must be above 0 and at most 1",
        ),
        (training.caution.is_finite() && training.caution > 0.0, "caution", "must be positive"),
        (
            (0.0..1.0).contains(&training.without_depth),
            "without_depth",
            "must be from 0 to below 1",
        ),
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

    fn labelled(is_person: bool, has_depth: bool) -> Labelled {
        Labelled { example: Example { is_person, group: 1 }, has_depth }
    }

    fn weights(counts: [usize; 4]) -> Vec<f64> {
        let kinds = [(true, false), (true, true), (false, false), (false, true)];
        let each = kinds.into_iter().zip(counts);
        let examples = each.flat_map(|((is_person, has_depth), count)| {
            std::iter::repeat_n(labelled(is_person, has_depth), count)
        });
        let training = Training { without_depth: 0.25, ..Training::default() };
        let mut trainer = TreeTrainer::new(training, 1).unwrap();
        trainer.examples = examples.collect();
        trainer.weights()
    }

    #[test]
    fn people_and_others_weigh_the_same_and_depth_has_its_share() {
        let found = weights([3, 1, 2, 4]);
        let expected = [&[1.25 / 3.0; 3][..], &[3.75], &[0.625; 2], &[0.9375; 4]].concat();
        assert!(found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
        // Depth on one side alone would tell the classes apart: it has no share.
        assert_eq!(weights([2, 1, 3, 0]), [1.5, 1.5, 0.0, 1.0, 1.0, 1.0]);
        // Without depth there is nothing to share.
        assert_eq!(weights([3, 0, 1, 0]), [2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 2.0]);
    }

    #[test]
    fn the_loss_is_the_weighted_cross_entropy() {
        fn judged(sum: f64, is_person: bool, weight: f64) -> Judged {
            Judged { sum, is_person, has_depth: true, weight }
        }

        let held_out = vec![judged(2.0, true, 1.0), judged(1.0, false, 3.0)];
        let expected = ((1.0 + (-2.0_f64).exp()).ln() + 3.0 * (1.0 + 1.0_f64.exp()).ln()) / 4.0;
        let loss = Trial { trees: 1, held_out }.loss();
        assert!((loss - expected).abs() < 1e-12, "{loss} {expected}");
    }

    #[test]
    fn influence_is_the_share_of_the_votes() {
        fn stump(feature: usize, below: f32, above: f32) -> Stump {
            Stump { feature, threshold: 0.0, below, above }
        }

        let gradients = Family::Gradients.range().start;
        let texture = Family::Texture.range().start;
        let below = stump(texture, -1.0, 1.0);
        let above = stump(gradients, 0.0, 1.0);
        let tree = Tree { feature: gradients, threshold: 0.0, below, above };
        let model = Model { trees: vec![tree], slope: 1.0, offset: 0.0 };
        // 2 by texture, 1 and a half by gradients.
        let table = influence(&model);
        assert_eq!(table["texture"].as_float(), Some(0.5714));
        assert_eq!(table["gradients"].as_float(), Some(0.4286));
        assert_eq!(table["shape"].as_float(), Some(0.0));
    }
}
