//! Gentle AdaBoost: small regression trees, each fitted to the residual of the sum of those before
//! it (J. Friedman, T. Hastie and R. Tibshirani, *Additive logistic regression*, Annals of
//! Statistics 28, 2000, algorithm 4).

/// Number of levels to which the values of a feature are quantised.
const LEVELS: usize = 256;
/// Fraction of the total weight that weight trimming keeps; samples with less weight do not take
/// part in the choice of a question.
const DECISIVE: f32 = 0.98;

/// Quantised values of features, feature by feature.
#[derive(Clone, Debug, Default)]
pub struct Levels {
    samples: usize,
    levels: Vec<u8>,
    /// Value of level 0, and width of a level.
    scale: Vec<(f32, f32)>,
}

impl Levels {
    /// Creates a table of so many samples and no features.
    pub fn new(samples: usize) -> Self {
        Self { samples, ..Self::default() }
    }

    /// Returns the number of features so far.
    pub fn features(&self) -> usize {
        self.scale.len()
    }

    /// Returns the number of samples.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Adds a feature, given by its value in each sample. The levels span three standard deviations
    /// on either side of the mean; values beyond are clamped to the ends.
    pub fn push(&mut self, values: impl Iterator<Item = f32> + Clone) {
        let count = self.samples.max(1) as f32;
        let mean = values.clone().sum::<f32>() / count;
        let variance = values.clone().map(|v| (v - mean).powi(2)).sum::<f32>() / count;
        // The addend keeps the levels of a constant feature from having no width.
        let spread = 3.0 * variance.sqrt() + 1e-6;
        let least = mean - spread;
        let step = 2.0 * spread / LEVELS as f32;
        self.scale.push((least, step));
        // The cast saturates, so that outliers land in the first or last level.
        self.levels.extend(values.take(self.samples).map(|v| ((v - least) / step) as u8));
        self.levels.resize(self.scale.len() * self.samples, 0);
    }

    fn row(&self, feature: usize) -> &[u8] {
        &self.levels[feature * self.samples..(feature + 1) * self.samples]
    }

    /// Returns the upper bound of the values in a level.
    fn threshold(&self, feature: usize, level: usize) -> f32 {
        let (least, step) = self.scale[feature];
        least + step * (level + 1) as f32
    }
}

/// Branch of a tree after a question.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Index of another question of the tree.
    Question(usize),
    /// Leaf with this value, -1 to 1.
    Leaf(f32),
}

/// Node of a tree: a comparison of one feature with a threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Question {
    /// Index of the feature.
    pub feature: usize,
    /// Threshold: the answer is yes for values below it.
    pub below: f32,
    /// Branches for yes and for no.
    pub next: [Next; 2],
}

/// State of the boosting: the weights of the samples, and the sums of the trees so far.
pub struct Boosting<'a> {
    table: &'a Levels,
    truth: Vec<f32>,
    weights: Vec<f32>,
    sums: Vec<f32>,
}

impl<'a> Boosting<'a> {
    /// Starts with equal total weights of both classes. `is_person` is the class of each sample of
    /// the table.
    pub fn new(table: &'a Levels, is_person: impl Iterator<Item = bool>) -> Self {
        let truth: Vec<f32> = is_person
            .map(|is| if is { 1.0 } else { -1.0 })
            .chain(std::iter::repeat(-1.0))
            .take(table.samples)
            .collect();
        let counts = [-1.0, 1.0]
            .map(|class: f32| truth.iter().filter(|t| **t == class).count().max(1) as f32);
        let weights = truth.iter().map(|t| 0.5 / counts[usize::from(*t > 0.0)]).collect();
        Self { table, weights, sums: vec![0.0; truth.len()], truth }
    }

    /// Returns the sum of the trees so far, for each sample.
    pub fn sums(&self) -> &[f32] {
        &self.sums
    }

    /// Adds a tree with `depth` questions from its root to a leaf, over the given `features`. The
    /// first question is the root.
    pub fn grow(&mut self, features: &[usize], depth: usize) -> Vec<Question> {
        let everyone: Vec<u32> = (0..self.truth.len() as u32).collect();
        let decisive = self.decisive();
        let mut growing =
            Growing { of: self, features, tree: Vec::new(), values: vec![0.0; self.truth.len()] };
        growing.node(&decisive, &everyone, depth.max(1));
        let Growing { tree, values, .. } = growing;
        for (i, value) in values.iter().enumerate() {
            self.sums[i] += value;
            self.weights[i] *= (-self.truth[i] * value).exp();
        }
        let total: f32 = self.weights.iter().sum();
        self.weights.iter_mut().for_each(|weight| *weight /= total);
        tree
    }

    /// Returns the samples with the largest weights, in the order of the table.
    fn decisive(&self) -> Vec<u32> {
        let mut sorted = self.weights.clone();
        sorted.sort_by(|a, b| b.total_cmp(a));
        let mut sum = 0.0;
        let least = sorted.iter().find(|weight| {
            sum += **weight;
            sum >= DECISIVE
        });
        let least = least.copied().unwrap_or(0.0);
        let all = 0..self.weights.len() as u32;
        all.filter(|i| self.weights[*i as usize] >= least).collect()
    }
}

struct Growing<'a> {
    of: &'a Boosting<'a>,
    features: &'a [usize],
    tree: Vec<Question>,
    values: Vec<f32>,
}

impl Growing<'_> {
    /// Adds a question that is fitted to the samples `chosen`, and further ones below it; `all`
    /// samples that reach a leaf get its value.
    fn node(&mut self, chosen: &[u32], all: &[u32], depth: usize) -> usize {
        let table = self.of.table;
        let (feature, level) = self.best(chosen);
        let at = self.tree.len();
        let below = table.threshold(feature, level);
        self.tree.push(Question { feature, below, next: [Next::Leaf(0.0); 2] });
        let row = table.row(feature);
        let [chosen, all] = [chosen, all].map(|of| -> [Vec<u32>; 2] {
            let (left, right) = of.iter().partition(|i| usize::from(row[**i as usize]) <= level);
            [left, right]
        });
        for side in 0..2 {
            let [weight, sum] = self.weight(&chosen[side]);
            // A pure leaf cannot be improved by a further question.
            let is_mixed = weight - sum.abs() > 1e-6;
            self.tree[at].next[side] = if depth > 1 && is_mixed {
                Next::Question(self.node(&chosen[side], &all[side], depth - 1))
            } else {
                let value = if weight > 0.0 { sum / weight } else { 0.0 };
                all[side].iter().for_each(|i| self.values[*i as usize] = value);
                Next::Leaf(value)
            };
        }
        at
    }

    fn weight(&self, of: &[u32]) -> [f32; 2] {
        of.iter().fold([0.0, 0.0], |[weight, sum], i| {
            let [w, y] = self.weighted(*i);
            [weight + w, sum + y]
        })
    }

    fn weighted(&self, i: u32) -> [f32; 2] {
        let weight = self.of.weights[i as usize];
        [weight, weight * self.of.truth[i as usize]]
    }

    /// Returns the feature and the level with the least squared error on both sides.
    fn best(&self, chosen: &[u32]) -> (usize, usize) {
        let weighted: Vec<(u32, [f32; 2])> =
            chosen.iter().map(|i| (*i, self.weighted(*i))).collect();
        let mut best = (f32::NEG_INFINITY, 0, 0);
        for &feature in self.features {
            let row = self.of.table.row(feature);
            // One pass over the samples makes every cut of a feature a sum of bins.
            let mut histogram = [[0.0_f32; 2]; LEVELS];
            for (i, [weight, sum]) in &weighted {
                let bin = &mut histogram[usize::from(row[*i as usize])];
                bin[0] += weight;
                bin[1] += sum;
            }
            let (gain, level) = cut(&histogram);
            if gain > best.0 {
                best = (gain, feature, level);
            }
        }
        (best.1, best.2)
    }
}

/// Returns the cut with the largest explained sum of squares, and that sum.
fn cut(histogram: &[[f32; 2]; LEVELS]) -> (f32, usize) {
    fn explained([weight, sum]: [f32; 2]) -> f32 {
        if weight > 1e-9 { sum * sum / weight } else { 0.0 }
    }

    let total = histogram.iter().fold([0.0, 0.0], |[w, s], bin| [w + bin[0], s + bin[1]]);
    let mut left = [0.0_f32; 2];
    let mut best = (f32::NEG_INFINITY, 0);
    // A cut above the last level would leave one side empty.
    for (level, bin) in histogram.iter().enumerate().take(LEVELS - 1) {
        left = [left[0] + bin[0], left[1] + bin[1]];
        let gain = explained(left) + explained([total[0] - left[0], total[1] - left[1]]);
        if gain > best.0 {
            best = (gain, level);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mix;

    fn value(tree: &[Question], numbers: &[f32]) -> f32 {
        let mut question = tree[0];
        loop {
            match question.next[usize::from(numbers[question.feature] >= question.below)] {
                Next::Leaf(value) => return value,
                Next::Question(to) => question = tree[to],
            }
        }
    }

    /// Generates points in a square; those of one class are in a disc in its middle.
    fn disc() -> (Vec<[f32; 2]>, Vec<bool>) {
        fn number(k: u64) -> f32 {
            (mix(k) >> 40) as f32 / (1_u64 << 24) as f32 - 0.5
        }

        let points: Vec<[f32; 2]> = (0..600).map(|k| [number(2 * k), number(2 * k + 1)]).collect();
        let truth = points.iter().map(|[x, y]| x * x + y * y < 0.1).collect();
        (points, truth)
    }

    #[test]
    fn trees_learn_what_no_single_tree_tells() {
        let (points, truth) = disc();
        let mut table = Levels::new(points.len());
        (0..2).for_each(|f| table.push(points.iter().map(|p| p[f])));
        let mut boosting = Boosting::new(&table, truth.iter().copied());
        let trees: Vec<_> = (0..40).map(|_| boosting.grow(&[0, 1], 2)).collect();
        let sums: Vec<f32> =
            points.iter().map(|p| trees.iter().map(|tree| value(tree, p)).sum()).collect();
        for (sum, known) in sums.iter().zip(boosting.sums()) {
            assert!((sum - known).abs() < 1e-4);
        }
        let right = sums.iter().zip(&truth).filter(|(sum, is)| (**sum > 0.0) == **is).count();
        assert!(right > 580, "{right}");
    }

    #[test]
    fn the_first_cut_is_the_one_with_the_least_squared_error() {
        let (points, truth) = disc();
        let numbers: Vec<f32> = points.iter().map(|p| (p[0] + 0.3 * p[1]) / 2.0).collect();
        let truth: Vec<bool> = truth.iter().zip(&points).map(|(is, p)| *is || p[0] > 0.2).collect();
        let mut table = Levels::new(numbers.len());
        table.push(numbers.iter().copied());
        let tree = Boosting::new(&table, truth.iter().copied()).grow(&[0], 1);
        let least = (1..256)
            .map(|level| squared_error(&numbers, &truth, table.threshold(0, level - 1)))
            .fold(f64::MAX, f64::min);
        let error = squared_error(&numbers, &truth, tree[0].below);
        // Samples with very little weight are ignored, so it is not exactly the least.
        assert!(error < least + 0.01, "{error} {least}");
    }

    /// Returns the weighted squared error of a cut with the mean of the classes on each side.
    fn squared_error(numbers: &[f32], truth: &[bool], below: f32) -> f64 {
        let classes = [false, true].map(|c| truth.iter().filter(|is| **is == c).count() as f64);
        let mut error = 0.0;
        for left in [true, false] {
            let side: Vec<(f64, f64)> = numbers
                .iter()
                .zip(truth)
                .filter(|(number, _)| (**number < below) == left)
                .map(|(_, is)| (0.5 / classes[usize::from(*is)], if *is { 1.0 } else { -1.0 }))
                .collect();
            let total: f64 = side.iter().map(|(weight, _)| weight).sum();
            let sum: f64 = side.iter().map(|(weight, sign)| weight * sign).sum();
            let mean = sum / total.max(1e-12);
            error += side.iter().map(|(weight, sign)| weight * (sign - mean).powi(2)).sum::<f64>();
        }
        error
    }
}
