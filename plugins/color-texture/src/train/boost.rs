use tagalong_learn::mix;

use crate::{COUNT, Stump, Training, Tree};

/// Thresholds of a feature.
const THRESHOLDS: usize = 31;
/// The bin of a number that is not known.
const UNKNOWN: u8 = 255;

/// Candidates, with every number sorted into bins.
pub struct Examples {
    /// Thresholds of each feature, rising.
    thresholds: Vec<Vec<f32>>,
    /// The bin of each candidate, feature by feature.
    bins: Vec<Vec<u8>>,
    /// The truth.
    is_person: Vec<bool>,
    /// Weight of each candidate.
    pub weights: Vec<f64>,
}

impl Examples {
    /// From [`COUNT`] numbers of each candidate.
    pub fn new(values: &[f32], is_person: Vec<bool>, weights: Vec<f64>) -> Self {
        fn bin(value: f32, thresholds: &[f32]) -> u8 {
            if value.is_nan() {
                return UNKNOWN;
            }
            thresholds.partition_point(|t| *t <= value) as u8
        }

        let mut bins = Vec::with_capacity(COUNT);
        let mut all_thresholds = Vec::with_capacity(COUNT);
        for feature in 0..COUNT {
            let column: Vec<f32> = values.iter().skip(feature).step_by(COUNT).copied().collect();
            let thresholds = thresholds(column.iter().copied());
            bins.push(column.iter().map(|value| bin(*value, &thresholds)).collect());
            all_thresholds.push(thresholds);
        }
        Self { bins, thresholds: all_thresholds, is_person, weights }
    }
}

/// Quantiles, rounded so that a model file is short.
fn thresholds(column: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut sorted: Vec<f32> = column.filter(|v| v.is_finite()).collect();
    sorted.sort_by(f32::total_cmp);
    let mut thresholds: Vec<f32> = (1..=THRESHOLDS)
        .filter_map(|k| sorted.get(sorted.len() * k / (THRESHOLDS + 1)).copied())
        .map(|v| (v * 1e4).round() / 1e4)
        .collect();
    thresholds.dedup();
    thresholds
}

/// Slopes and curvatures of the loss, summed up.
#[derive(Clone, Copy, Default)]
struct Sums {
    slope: f64,
    curvature: f64,
}

impl Sums {
    fn add(&mut self, other: Self) {
        self.slope += other.slope;
        self.curvature += other.curvature;
    }

    fn minus(self, other: Self) -> Self {
        Self { slope: self.slope - other.slope, curvature: self.curvature - other.curvature }
    }

    /// Returns the best step, and twice its gain.
    fn step(self, caution: f64) -> (f64, f64) {
        let step = self.slope / (self.curvature + caution);
        (step, step * self.slope)
    }
}

/// Finds `count` trees, each by a Newton step of the weighted logistic loss
/// (gradient boosting: Friedman, Annals of Statistics 29, 2001), among a random
/// part of the features.
pub fn boost(
    examples: &Examples,
    chosen: &[usize],
    training: &Training,
    count: usize,
    seed: u64,
) -> Vec<Tree> {
    let mut sums = vec![0.0; examples.is_person.len()];
    let mut trees = Vec::with_capacity(count);
    for round in 0..count {
        let losses: Vec<Sums> =
            sums.iter().enumerate().map(|(k, s)| loss(examples, k, *s)).collect();
        let order = mix(seed ^ (round as u64) << 32);
        let tried: Vec<usize> = (0..COUNT)
            .filter(|feature| {
                (mix(order ^ *feature as u64) >> 11) as f64 / (1u64 << 53) as f64
                    <= training.features
            })
            .collect();
        let grower = Grower { examples, losses: &losses, tried: &tried, training };
        trees.extend(grower.tree(chosen, &mut sums));
    }
    trees
}

/// Grows one tree.
struct Grower<'a> {
    examples: &'a Examples,
    losses: &'a [Sums],
    tried: &'a [usize],
    training: &'a Training,
}

/// The best stump of some candidates: the last bin below its threshold, and its gain.
struct Split {
    gain: f64,
    bin: u8,
    stump: Stump,
}

impl Grower<'_> {
    /// Grows the best stump, whose halves get stumps of their own, and adds the votes of the tree
    /// to the sums.
    fn tree(&self, chosen: &[usize], sums: &mut [f64]) -> Option<Tree> {
        let Split { bin, stump: root, .. } = self.best(chosen)?;
        let bins = &self.examples.bins[root.feature];
        let known = chosen.iter().copied().filter(|k| bins[*k] != UNKNOWN);
        let (low, high): (Vec<usize>, Vec<usize>) = known.partition(|k| bins[*k] <= bin);
        let below = self.leaf(&low, root, root.below, sums);
        let above = self.leaf(&high, root, root.above, sums);
        Some(Tree { feature: root.feature, threshold: root.threshold, below, above })
    }

    /// The stump of one half; where nothing divides it, all of it gets `value`.
    fn leaf(&self, half: &[usize], root: Stump, value: f32, sums: &mut [f64]) -> Stump {
        let whole =
            Split { gain: 0.0, bin: 0, stump: Stump { below: value, above: value, ..root } };
        let Split { bin, stump, .. } = self.best(half).unwrap_or(whole);
        let bins = &self.examples.bins[stump.feature];
        for &k in half {
            sums[k] += f64::from(match bins[k] {
                UNKNOWN => 0.0,
                at if at <= bin => stump.below,
                _ => stump.above,
            });
        }
        stump
    }

    fn best(&self, chosen: &[usize]) -> Option<Split> {
        let splits = self.tried.iter().filter_map(|feature| self.split(chosen, *feature));
        splits.reduce(|a, b| if b.gain > a.gain { b } else { a })
    }

    /// The best threshold of a feature.
    fn split(&self, chosen: &[usize], feature: usize) -> Option<Split> {
        let Self { examples, losses, training, .. } = *self;
        let mut histogram = [Sums::default(); THRESHOLDS + 1];
        let bins = &examples.bins[feature];
        for &k in chosen {
            if let Some(bin) = histogram.get_mut(usize::from(bins[k])) {
                bin.add(losses[k]);
            }
        }
        let mut total = Sums::default();
        histogram.iter().for_each(|bin| total.add(*bin));
        let mut below = Sums::default();
        let splits = examples.thresholds[feature].iter().zip(&histogram).enumerate();
        let each = splits.map(|(bin, (threshold, here))| {
            below.add(*here);
            let (low, gain) = below.step(training.caution);
            let (high, other) = total.minus(below).step(training.caution);
            let [below, above] =
                [low, high].map(|step| ((training.rate * step * 1e4).round() / 1e4) as f32);
            let stump = Stump { feature, threshold: *threshold, below, above };
            Split { gain: gain + other, bin: bin as u8, stump }
        });
        each.reduce(|a, b| if b.gain > a.gain { b } else { a })
    }
}

fn loss(examples: &Examples, index: usize, sum: f64) -> Sums {
    let weight = examples.weights[index];
    let target = f64::from(u8::from(examples.is_person[index]));
    let p = 1.0 / (1.0 + (-sum).exp());
    Sums { slope: weight * (target - p), curvature: weight * p * (1.0 - p) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Few candidates with numbers from a hash; feature 5 tells people apart.
    fn examples(seed: u64, count: usize) -> (Vec<f32>, Examples) {
        let is_person: Vec<bool> =
            (0..count).map(|k| mix(seed ^ k as u64).is_multiple_of(2)).collect();
        let values: Vec<f32> = (0..count * COUNT)
            .map(|k| match (k % COUNT, mix(seed ^ (k as u64) << 8) % 100) {
                (_, 0..5) => f32::NAN,
                (5, n) => n as f32 / 400.0 + if is_person[k / COUNT] { 1.0 } else { 0.0 },
                (_, n) => n as f32 / 100.0,
            })
            .collect();
        let weights = vec![1.0; count];
        (values.clone(), Examples::new(&values, is_person, weights))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        /// Every threshold of a feature, tried one by one on the numbers
        /// themselves, gains no more than the split that was found.
        #[test]
        fn the_split_is_the_best_one(seed: u64, feature in 0..COUNT) {
            let (values, examples) = examples(seed, 40);
            let training = Training::default();
            let chosen: Vec<usize> = (0..40).collect();
            let losses: Vec<Sums> = chosen.iter().map(|k| loss(&examples, *k, 0.3)).collect();
            let grower =
                Grower { examples: &examples, losses: &losses, tried: &[], training: &training };
            let Split { gain, stump, .. } = grower.split(&chosen, feature).unwrap();
            let thresholds = &examples.thresholds[feature];
            let mut gains = Vec::new();
            for threshold in thresholds {
                let mut below = Sums::default();
                let mut above = Sums::default();
                for k in 0..40 {
                    let value = values[k * COUNT + feature];
                    if value < *threshold { below.add(losses[k]) } else if value >= *threshold { above.add(losses[k]) }
                }
                gains.push(below.step(training.caution).1 + above.step(training.caution).1);
            }
            let best = gains.iter().copied().fold(0.0, f64::max);
            let found = thresholds.iter().position(|t| *t == stump.threshold).unwrap();
            prop_assert!((gains[found] - best).abs() < 1e-9);
            prop_assert!((gain - best).abs() < 1e-9);
        }
    }

    #[test]
    fn it_finds_the_number_that_tells_people_apart() {
        let (values, examples) = examples(3, 60);
        let chosen: Vec<usize> = (0..60).collect();
        let training = Training { features: 1.0, ..Training::default() };
        let trees = boost(&examples, &chosen, &training, 20, 1);
        assert_eq!(trees[0].feature, 5);
        let right = (0..60).filter(|&k| {
            let votes = trees.iter().map(|t| t.vote(&values[k * COUNT..(k + 1) * COUNT]));
            (votes.sum::<f32>() > 0.0) == examples.is_person[k]
        });
        let right = right.count();
        assert!(right >= 57, "{right}");
    }

    #[test]
    fn slope_and_curvature_are_those_of_the_weighted_logistic_loss() {
        let mut examples = examples(3, 2).1;
        (examples.weights, examples.is_person) = (vec![2.0, 2.0], vec![true, false]);
        let [person, other] = [0, 1].map(|k| loss(&examples, k, 3.0_f64.ln()));
        // The probability is 3/4.
        assert!((person.slope - 0.5).abs() < 1e-12 && (other.slope + 1.5).abs() < 1e-12);
        assert!((person.curvature - 0.375).abs() < 1e-12);
    }

    #[test]
    fn a_tree_adds_its_votes_to_the_sums() {
        let (values, examples) = examples(3, 60);
        let chosen: Vec<usize> = (0..60).collect();
        let losses: Vec<Sums> = chosen.iter().map(|k| loss(&examples, *k, 0.0)).collect();
        let training = Training::default();
        let tried = [5, 7, 9];
        let grower =
            Grower { examples: &examples, losses: &losses, tried: &tried, training: &training };
        let mut sums = vec![0.0; 60];
        let tree = grower.tree(&chosen, &mut sums).unwrap();
        for (k, sum) in sums.iter().enumerate() {
            let vote = f64::from(tree.vote(&values[k * COUNT..(k + 1) * COUNT]));
            assert!((sum - vote).abs() < 1e-6, "{k}: {sum} {vote}");
        }
    }
}
