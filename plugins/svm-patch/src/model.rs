use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde::{Deserialize, Serialize};
use tagalong_math::exp2_of_negative;

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
    /// Support vectors, one after the other, each a number of `steps` times these, and zeros.
    vectors: Vec<[i8; PADDED]>,
    steps: Vec<f32>,
    /// Squared lengths of the support vectors.
    squares: Vec<f64>,
    /// Weights of the support vectors; positive for people.
    weights: Vec<f32>,
}

/// Length of a stored vector: a number of whole registers of any processor.
const PADDED: usize = PIXELS.next_multiple_of(128);

/// A patch in 16 bits: its values are `step` times these.
struct QuantisedPatch {
    values: [i16; PADDED],
    step: f64,
    /// Squared length.
    square: f64,
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn quantised_patch(patch: &Patch) -> QuantisedPatch {
    // Adding this number leaves no digits behind the point, and the whole number in the low bits.
    const WHOLE: f32 = 12_582_912.0;
    let step = largest(patch) / f32::from(i16::MAX);
    let per_step = if step > 0.0 { 1.0 / step } else { 0.0 };
    let mut values = [0; PADDED];
    for (to, from) in values.iter_mut().zip(patch) {
        *to = (from * per_step + WHOLE).to_bits() as i16;
    }
    let square = values
        .iter()
        .fold(0u64, |sum, value| sum.wrapping_add(u64::from(value.unsigned_abs()).wrapping_pow(2)));
    QuantisedPatch { values, step: step.into(), square: f64::from(step).powi(2) * square as f64 }
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
            steps: Vec::new(),
            squares: Vec::new(),
            weights: Vec::new(),
        };
        for (vector, weight) in support {
            let step = step_of(vector);
            model.push(vector.iter().map(|v| quantised(*v, step) as i8), step, weight as f32);
        }
        model
    }

    fn push(&mut self, vector: impl Iterator<Item = i8>, step: f32, weight: f32) {
        let mut padded = [0; PADDED];
        padded.iter_mut().zip(vector).for_each(|(to, from)| *to = from);
        let square: i32 = padded.iter().map(|v| i32::from(*v).pow(2)).sum();
        self.vectors.push(padded);
        self.steps.push(step);
        self.squares.push(f64::from(step).powi(2) * f64::from(square));
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
        let patch = quantised_patch(patch);
        let per_square = f64::from(self.gamma) * std::f64::consts::LOG2_E;
        let each = self.vectors.iter().zip(&self.steps).zip(&self.squares);
        // |a - b|² from the stored squares costs one scalar product.
        let exponents = each.map(|((vector, step), square)| {
            let product = f64::from(dot(vector, &patch.values)) * f64::from(*step) * patch.step;
            per_square * (2.0 * product - square - patch.square)
        });
        let exponents: Vec<f64> = exponents.collect();
        weighted_powers(&exponents, &self.weights) + f64::from(self.bias)
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
            vectors: (0..self.len()).map(|k| self.entry(k)).collect(),
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
            model.push(bytes.iter().map(|b| *b as i8), entry.step, entry.weight);
        }
        if model.is_finite() { Ok(model) } else { Err("it has numbers that are not finite".into()) }
    }

    fn is_finite(&self) -> bool {
        let scalars = [self.sampler.grow, self.gamma.into(), self.bias.into(), self.slope];
        scalars.into_iter().chain([self.offset]).all(f64::is_finite)
            && self.gamma >= 0.0
            && self.steps.iter().chain(&self.weights).all(|v| v.is_finite())
    }

    fn entry(&self, k: usize) -> Entry {
        let bytes: Vec<u8> = self.vectors[k][..PIXELS].iter().map(|v| *v as u8).collect();
        Entry { weight: self.weights[k], step: self.steps[k], bytes: STANDARD.encode(bytes) }
    }
}

/// Returns the step of which the largest coordinate is 127.
fn step_of(vector: &Patch) -> f32 {
    largest(vector) / FULL
}

/// Returns the largest absolute value.
#[inline(always)]
fn largest(patch: &Patch) -> f32 {
    #[inline(always)]
    fn larger(a: f32, b: f32) -> f32 {
        if b > a { b } else { a }
    }

    let mut lanes = [0.0; 16];
    for values in patch.as_chunks::<16>().0 {
        for (lane, value) in lanes.iter_mut().zip(values) {
            *lane = larger(*lane, value.abs());
        }
    }
    lanes.into_iter().fold(0.0, larger)
}

/// Returns the whole number of steps that is nearest to a coordinate.
fn quantised(value: f32, step: f32) -> f32 {
    if step > 0.0 { (value / step).round() } else { 0.0 }
}

/// Returns a scalar product. Whole numbers add up to the same in any order, so that vector
/// instructions change nothing.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn dot(a: &[i8; PADDED], b: &[i16; PADDED]) -> i32 {
    // 400 products of 8 with 16 bits stay below 2^31, and checks would cost the vectors.
    a.iter()
        .zip(b)
        .fold(0, |sum: i32, (a, b)| sum.wrapping_add(i32::from(*a).wrapping_mul(i32::from(*b))))
}

/// Returns the sum of weights times 2 to the power of exponents, in the same order on any processor.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn weighted_powers(exponents: &[f64], weights: &[f32]) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    let (exponents, last) = exponents.as_chunks::<LANES>();
    let (weights, last_weights) = weights.as_chunks::<LANES>();
    for (exponents, weights) in exponents.iter().zip(weights) {
        for lane in 0..LANES {
            sums[lane] += f64::from(weights[lane]) * exp2_of_negative(exponents[lane]);
        }
    }
    let last = last.iter().zip(last_weights);
    let last: f64 =
        last.map(|(exponent, weight)| f64::from(*weight) * exp2_of_negative(*exponent)).sum();
    sums.iter().sum::<f64>() + last
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
        let mut sum = 0.0;
        for ((vector, step), weight) in model.vectors.iter().zip(&model.steps).zip(&model.weights) {
            let differences =
                vector.iter().zip(x).map(|(v, x)| f64::from(step * f32::from(*v)) - f64::from(*x));
            let distance: f64 = differences.map(|off| off.powi(2)).sum();
            sum += f64::from(*weight) * (-f64::from(model.gamma) * distance).exp();
        }
        sum + f64::from(model.bias)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn the_fast_sum_is_the_sum(seed: u64, vectors in 0u64..40, gamma in 0.1f64..16.0) {
            let model = model(seed, vectors, gamma);
            let x = patch(seed.rotate_left(7));
            prop_assert!((model.decision(&x) - slow(&model, &x)).abs() < 1e-4);
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

    /// The largest products that there are add up without an overflow.
    #[test]
    fn patches_of_one_value_are_compared() {
        for value in [1.0f32, -1.0] {
            let model = Model::new(SAMPLER, 0.01, 0.0, [(&[1.0; PIXELS], 1.0)]);
            let x = [value; PIXELS];
            assert!((model.decision(&x) - slow(&model, &x)).abs() < 1e-6);
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
