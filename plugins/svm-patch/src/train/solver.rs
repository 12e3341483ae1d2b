use linfa::Dataset;
use linfa::traits::Fit;
use linfa_svm::Svm;
use ndarray::{Array1, Array2};
use tagalong_core::{Error, Result};

use super::Sample;
use crate::{Model, PIXELS, Sampler};

/// Change of the objective at which the solver stops (that of libsvm).
const TOLERANCE: f64 = 1e-3;

/// Least absolute weight of a support vector; smaller ones are zero.
const LEAST_WEIGHT: f64 = 1e-9;

/// Fits a machine with the kernel `exp(-gamma |a - b|^2)`. Both classes have the same total weight.
///
/// # Errors
/// Samples that are not finite (the solver would return nonsense), or samples of one class only.
pub fn fit(samples: &[&Sample], sampler: Sampler, gamma: f64, penalty: f64) -> Result<Model> {
    let (for_people, for_others) = penalties(samples, penalty)?;
    if !samples.iter().all(|s| s.patch.iter().all(|v| v.is_finite())) {
        return Err(Error::Other("a training patch is not finite".into()));
    }
    let rows = Array2::from_shape_fn((samples.len(), PIXELS), |(row, column)| {
        f64::from(samples[row].patch[column])
    });
    let targets: Array1<bool> = samples.iter().map(|s| s.example.is_person).collect();
    // The Gram matrix is computed by this library, pair by pair, and not by `faer`: in 0.8 its `Fit`
    // takes rows only, and `fit_c`, which takes a finished kernel, is private, as is the trait of
    // the solver's kernels. Rows of a factor of the Gram matrix with the linear kernel would cost
    // more: that matrix has nearly full rank, so they have as many values as there are samples.
    // The kernel divides by its parameter. Shrinking stays off, the default: with
    // it, weights are returned for the wrong samples.
    let fitted = Svm::<f64, bool>::params()
        .pos_neg_weights(for_people, for_others)
        .gaussian_kernel(1.0 / gamma)
        .eps(TOLERANCE)
        .fit(&Dataset::new(rows, targets))
        .map_err(|error| Error::Other(format!("the solver failed: {error}")))?;
    let weights = samples.iter().zip(&fitted.alpha);
    let support = weights
        .filter(|(_, alpha)| alpha.abs() > LEAST_WEIGHT)
        .map(|(sample, alpha)| (&*sample.patch, *alpha));
    Ok(Model::new(sampler, gamma, -fitted.rho, support))
}

/// Returns the penalty of an error in each class, inverse to its share.
fn penalties(samples: &[&Sample], penalty: f64) -> Result<(f64, f64)> {
    let people = samples.iter().filter(|s| s.example.is_person).count();
    let others = samples.len() - people;
    if people == 0 || others == 0 {
        let message = format!("{people} people and {others} others: both are needed");
        return Err(Error::Other(message));
    }
    let half = 0.5 * samples.len() as f64;
    Ok((penalty * half / people as f64, penalty * half / others as f64))
}

#[cfg(test)]
mod tests {
    use tagalong_config::Example;

    use super::*;

    #[test]
    fn a_class_weighs_as_much_as_the_other_one_whatever_its_share() {
        fn sample(is_person: bool) -> Sample {
            Sample { patch: Box::new([0.0; PIXELS]), example: Example { is_person, group: 1 } }
        }

        let all: Vec<Sample> = (0..40).map(|k| sample(k < 10)).collect();
        let all: Vec<&Sample> = all.iter().collect();
        let (for_people, for_others) = penalties(&all, 3.0).unwrap();
        assert!((for_people - 6.0).abs() < 1e-12 && (for_others - 2.0).abs() < 1e-12);
        assert!((10.0 * for_people - 30.0 * for_others).abs() < 1e-9);
        assert!(penalties(&all[..10], 1.0).unwrap_err().to_string().starts_with("10 people and 0"));
    }

    /// With a large penalty all samples lie at the margin or beyond it, by the kernel of the model:
    /// the solver's own has another parameter.
    #[test]
    fn the_model_separates_what_it_was_fitted_to() {
        fn example(k: usize) -> Example {
            Example { is_person: k.is_multiple_of(3), group: k as u64 }
        }

        fn patch(k: usize) -> Box<[f32; PIXELS]> {
            let mut patch = Box::new([0.0; PIXELS]);
            patch[k] = 1.0;
            patch[(7 * k + 3) % PIXELS] += 0.5;
            patch
        }
        let samples: Vec<Sample> =
            (0..24).map(|k| Sample { patch: patch(k), example: example(k) }).collect();
        let of: Vec<&Sample> = samples.iter().collect();
        let sampler = Sampler { grow: 0.0, scaling: crate::Scaling::Unit };
        let model = fit(&of, sampler, 2.0, 1e3).unwrap();
        for sample in &samples {
            let decision = model.decision(&sample.patch);
            let margin = if sample.example.is_person { decision } else { -decision };
            assert!((margin - 1.0).abs() < 0.01, "all are support vectors: {margin}");
        }
    }
}
