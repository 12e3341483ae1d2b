use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

/// Normalisation of the grey values of a patch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// The mean is subtracted, then the vector is scaled to length 1: the squared distance of two
    /// patches is twice the difference of 1 and their correlation.
    #[default]
    Unit,
    /// Histograms of gradient directions replace the grey values (Dalal and Triggs, CVPR 2005): 5x5
    /// cells of 16 signed directions, each divided by the gradient strength around it; then the
    /// vector is scaled to length 1.
    Gradients,
    /// Grey values are divided by 255, so that they lie between 0 and 1. With a gamma of 8 nearly
    /// all patches are far from each other.
    Fraction,
    /// No normalisation; grey values lie between 0 and 255. With a gamma of 8 every patch is
    /// practically infinitely far from every other.
    Raw,
}

settings! {
    /// Settings of `svm-patch`.
    pub struct Config {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// Weight of this verifier's log-odds relative to the detector's score.
        pub weight: f64 = 1.0,
        /// Bound on the log-odds of one frame, in both directions: a single patch never decides
        /// alone.
        pub limit: f64 = 6.0,
        /// Settings of the fit; only `tagalong train` reads them.
        pub training: Training,
    }
}

settings! {
    /// Settings of the fit. Those needed at run time are stored in the model file.
    pub struct Training {
        /// Normalisation of the grey values: `unit`, `gradients`, `fraction` or `raw`.
        pub scaling: Scaling = Scaling::Gradients,
        /// Fraction of its side by which a candidate's square is enlarged.
        pub grow: f64 = 0.1,
        /// Widths of the kernel `exp(-gamma |a - b|^2)` to try.
        pub gammas: Vec<f64> = vec![0.5, 1.0, 2.0, 4.0, 8.0],
        /// Penalties of a training error to try; each class is weighted by the inverse of its
        /// share.
        pub penalties: Vec<f64> = vec![0.3, 1.0, 3.0, 10.0],
        /// Number of parts into which the groups are divided; each is held out once.
        pub folds: usize = 4,
        /// Largest number of examples in the cross-validation.
        pub max_tried: usize = 1000,
        /// Largest number of examples in the final fit; memory grows with its square.
        pub max_samples: usize = 4000,
        /// Largest number of support vectors in the model file; each takes half a kilobyte.
        pub max_vectors: usize = 1200,
        /// Largest number of examples of people, sampled at random; 0: all.
        pub people: usize = 0,
        /// Largest number of examples of other objects, sampled at random; 0: all.
        pub others: usize = 0,
    }
}
