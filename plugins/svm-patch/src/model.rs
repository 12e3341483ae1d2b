use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};

use crate::patch::{PIXELS, Patch};
use crate::{Sampler, Scaling};

/// Largest absolute value of a quantised coordinate.
const FULL: f32 = 127.0;

/// Most support vectors in a model file.
const MOST_VECTORS: usize = 10_000;

/// A fitted machine: `f(x) = sum_i weight_i exp(-gamma |v_i - x|^2) + bias`, and the straight line
/// that maps `f` to log-odds.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Sampling of patches from the image.
    pub sampler: Sampler,
    /// Width of the kernel.
    pub gamma: f32,
    /// Constant term of `f`.
    pub bias: f32,
    /// Log-odds per unit of `f` ...
    pub slope: f64,
    /// ... and the log-odds at `f` = 0.
    pub offset: f64,
    /// Support vectors, one after the other.
    vectors: Vec<f32>,
    /// Squared lengths of the support vectors.
    squares: Vec<f32>,
    /// Weights of the support vectors; positive for people.
    weights: Vec<f32>,
}

/// A model as TOML. Vectors are stored with 8 bits per coordinate.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    scaling: Scaling,
    grow: f64,
    gamma: f32,
    bias: f32,
    slope: f64,
    offset: f64,
    vectors: Vec<Entry>,
}

/// One support vector: coordinates are `step` times signed bytes.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    weight: f32,
    step: f32,
    bytes: String,
}

const FORMAT: &str = "svm-patch 1";

impl Model {
    /// Builds a model from support vectors and their weights, quantised as in its file. The
    /// calibration is the identity.
    pub fn new<'a>(
        sampler: Sampler,
        gamma: f64,
        bias: f64,
        support: impl IntoIterator<Item = (&'a Patch, f64)>,
    ) -> Self {
        let mut model = Self {
            sampler,
            gamma: gamma as f32,
            bias: bias as f32,
            slope: 1.0,
            offset: 0.0,
            vectors: Vec::new(),
            squares: Vec::new(),
            weights: Vec::new(),
        };
        for (vector, weight) in support {
            // Quantising here gives the fitted model the same answers as the one read back from
            // its file.
            let step = step_of(vector);
            model.push(vector.iter().map(|v| step * quantised(*v, step)), weight as f32);
        }
        model
    }

    fn push(&mut self, vector: impl Iterator<Item = f32>, weight: f32) {
        let start = self.vectors.len();
        self.vectors.extend(vector);
        self.squares.push(self.vectors[start..].iter().map(|v| v * v).sum());
        self.weights.push(weight);
    }

    /// Returns the number of support vectors.
    pub fn len(&self) -> usize {
        self.weights.len()
    }

    /// Returns true for a model without support vectors.
    pub fn is_empty(&self) -> bool {
        self.weights.is_empty()
    }

    /// Returns the decision value; positive for people.
    pub fn decision(&self, patch: &Patch) -> f64 {
        let vectors = self.vectors.chunks_exact(PIXELS);
        self.weighted_sum(patch, vectors.map(|vector| dot(vector, patch)))
    }

    /// Returns the decision values of many patches: those of [`Self::decision`], but for rounding.
    #[cfg(feature = "train")]
    pub(crate) fn decisions(&self, patches: &[&Patch]) -> Vec<f64> {
        let values: Vec<f32> = patches.iter().flat_map(|patch| patch.iter().copied()).collect();
        let products = tagalong_learn::dense::scalar_products(&values, &self.vectors, PIXELS);
        let row = |k: usize| products[k * self.len()..][..self.len()].iter().copied();
        let each = patches.iter().enumerate();
        each.map(|(k, patch)| self.weighted_sum(patch, row(k))).collect()
    }

    /// Adds up the kernels of a patch, from its scalar products with the support vectors.
    fn weighted_sum(&self, patch: &Patch, products: impl Iterator<Item = f32>) -> f64 {
        let square: f32 = patch.iter().map(|v| v * v).sum();
        let each = products.zip(&self.squares).zip(&self.weights);
        let sum: f64 = each
            .map(|((product, own), weight)| {
                // |a - b|² from the stored squares costs one scalar product; rounding may bring
                // it below 0.
                let distance = (square + own - 2.0 * product).max(0.0);
                f64::from(weight * (-self.gamma * distance).exp())
            })
            .sum();
        sum + f64::from(self.bias)
    }

    /// Returns the log-odds that the patch shows a person, with even priors.
    pub fn log_odds(&self, patch: &Patch) -> f64 {
        self.slope * self.decision(patch) + self.offset
    }

    /// Formats the model file.
    ///
    /// # Errors
    /// Numbers that TOML cannot express.
    pub fn to_text(&self) -> Result<String, String> {
        let file = File {
            format: FORMAT.into(),
            scaling: self.sampler.scaling,
            grow: self.sampler.grow,
            gamma: self.gamma,
            bias: self.bias,
            slope: self.slope,
            offset: self.offset,
            vectors: self.vectors.chunks_exact(PIXELS).zip(&self.weights).map(entry).collect(),
        };
        toml::to_string(&file).map_err(|why| format!("the model is no TOML: {why}"))
    }

    /// Parses a model file.
    ///
    /// # Errors
    /// Text that is not a model; the message is one sentence.
    pub fn from_text(text: &str) -> Result<Self, String> {
        let file: File = toml::from_str(text).map_err(|e| e.message().trim_end().to_owned())?;
        if file.format != FORMAT {
            return Err(format!("the format is `{}`, not `{FORMAT}`", file.format));
        }
        if file.vectors.len() > MOST_VECTORS {
            return Err(format!("more than {MOST_VECTORS} support vectors"));
        }
        let sampler = Sampler { grow: file.grow, scaling: file.scaling };
        let mut model = Self::new(sampler, file.gamma.into(), file.bias.into(), []);
        (model.slope, model.offset) = (file.slope, file.offset);
        for (number, entry) in file.vectors.iter().enumerate() {
            // Invalid base64 becomes a vector of the wrong length, which the next check reports.
            let bytes = STANDARD.decode(&entry.bytes).unwrap_or_default();
            if bytes.len() != PIXELS {
                return Err(format!("vector {number} does not have {PIXELS} bytes"));
            }
            model.push(bytes.iter().map(|b| entry.step * f32::from(*b as i8)), entry.weight);
        }
        if model.is_finite() { Ok(model) } else { Err("it has numbers that are not finite".into()) }
    }

    fn is_finite(&self) -> bool {
        let scalars = [self.sampler.grow, self.gamma.into(), self.bias.into(), self.slope];
        scalars.into_iter().chain([self.offset]).all(f64::is_finite)
            && self.gamma >= 0.0
            && self.squares.iter().chain(&self.weights).all(|v| v.is_finite())
    }
}

fn entry((vector, weight): (&[f32], &f32)) -> Entry {
    let step = step_of(vector);
    let bytes: Vec<u8> = vector.iter().map(|v| quantised(*v, step) as i8 as u8).collect();
    Entry { weight: *weight, step, bytes: STANDARD.encode(bytes) }
}

/// Returns the step of which the largest coordinate is 127.
fn step_of(vector: &[f32]) -> f32 {
    vector.iter().fold(0.0f32, |most, v| most.max(v.abs())) / FULL
}

fn quantised(value: f32, step: f32) -> f32 {
    if step > 0.0 { (value / step).round().clamp(-FULL, FULL) } else { 0.0 }
}

/// Returns the scalar product.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    // Independent sums let the compiler use vector instructions.
    const LANES: usize = 16;
    let mut lanes = [0.0f32; LANES];
    for (a, b) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for (lane, (a, b)) in lanes.iter_mut().zip(a.iter().zip(b)) {
            *lane += a * b;
        }
    }
    lanes.iter().sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SAMPLER: Sampler = Sampler { grow: 0.1, scaling: Scaling::Unit };

    fn patch(seed: u64) -> Patch {
        let mut state = seed;
        let mut patch: Patch = std::array::from_fn(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_041);
            (state >> 40) as f32 / (1u64 << 24) as f32 - 0.5
        });
        let length = patch.iter().map(|v| v * v).sum::<f32>().sqrt();
        patch.iter_mut().for_each(|v| *v /= length);
        patch
    }

    fn model(seed: u64, vectors: u64, gamma: f64) -> Model {
        let patches: Vec<Patch> = (0..vectors).map(|k| patch(seed ^ (k << 32))).collect();
        let weights = (0..vectors).map(|k| if k % 2 == 0 { 1.5 } else { -0.7 });
        Model::new(SAMPLER, gamma, 0.25, patches.iter().zip(weights))
    }

    /// The sum by its definition, in double precision.
    fn slow(model: &Model, x: &Patch) -> f64 {
        let kernel = |v: &[f32]| {
            let distance: f64 =
                v.iter().zip(x).map(|(v, x)| (f64::from(*v) - f64::from(*x)).powi(2)).sum();
            (-f64::from(model.gamma) * distance).exp()
        };
        let each = model.vectors.chunks_exact(PIXELS).zip(&model.weights);
        each.map(|(v, w)| f64::from(*w) * kernel(v)).sum::<f64>() + f64::from(model.bias)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn the_fast_sum_is_the_sum(seed: u64, vectors in 0u64..40, gamma in 0.1f64..16.0) {
            let model = model(seed, vectors, gamma);
            let x = patch(seed.rotate_left(7));
            prop_assert!((model.decision(&x) - slow(&model, &x)).abs() < 1e-4);
        }

        #[cfg(feature = "train")]
        #[test]
        fn the_sums_of_many_patches_are_those_of_each(seed: u64, vectors in 0u64..40) {
            let model = model(seed, vectors, 2.0);
            let patches = [patch(seed ^ 1), patch(seed ^ 2), patch(seed ^ 3)];
            let fast = model.decisions(&patches.each_ref());
            prop_assert_eq!(fast.len(), 3);
            for (value, x) in fast.iter().zip(&patches) {
                prop_assert!((value - slow(&model, x)).abs() < 1e-4);
            }
        }

        #[test]
        fn a_model_survives_its_file(seed: u64, vectors in 0u64..8) {
            let model = Model { slope: 1.75, offset: -0.5, ..model(seed, vectors, 2.0) };
            let read = Model::from_text(&model.to_text().unwrap()).unwrap();
            let x = patch(seed ^ 5);
            prop_assert!((model.log_odds(&x) - read.log_odds(&x)).abs() < 1e-4);
            prop_assert_eq!(read.to_text(), model.to_text());
        }
    }

    #[test]
    fn eight_bits_are_enough() {
        let exact = patch(3);
        let model = Model::new(SAMPLER, 8.0, 0.0, [(&exact, 1.0)]);
        assert!((model.decision(&exact) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn broken_files_are_refused_in_a_sentence() {
        let good = model(1, 2, 1.0).to_text().unwrap();
        let format = good.replace("svm-patch 1", "svm-patch 9");
        assert!(Model::from_text(&format).unwrap_err().contains("svm-patch 9"));
        let bytes = good.replacen("bytes = \"", "bytes = \"AAAA", 1);
        assert!(Model::from_text(&bytes).unwrap_err().contains("vector 0"));
        let infinite = good.replace("slope = 1.0", "slope = inf");
        assert!(Model::from_text(&infinite).unwrap_err().contains("not finite"));
        assert!(Model::from_text("nonsense").is_err());
    }

    #[test]
    fn a_model_knows_its_number_of_vectors() {
        assert!(model(1, 0, 1.0).is_empty() && !model(1, 2, 1.0).is_empty());
        assert_eq!(model(1, 2, 1.0).len(), 2);
    }
}
