use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What is done to the grey values of a patch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// The mean is subtracted, then the length of the vector becomes 1: two
    /// patches are apart by twice one minus their correlation.
    #[default]
    Unit,
    /// Histograms of the directions of gradients in their place (Dalal and
    /// Triggs, CVPR 2005): 5x5 cells of 16 directions with sign, each divided
    /// by the strength around it; then the length becomes 1.
    Gradients,
    /// Grey values are divided by their largest, so that they are 0 to 1. With the
    /// paper's gamma nearly all patches are far from each other.
    Fraction,
    /// Nothing; grey values are 0 to 255. This is what the paper prints, and
    /// with its gamma every patch is infinitely far from every other.
    Raw,
}

/// Settings of `svm-patch`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Model file, relative to the config; empty: the model that is built in.
    pub model: String,
    /// Weight of this verifier's log-odds beside the detector's score.
    pub weight: f64,
    /// Log-odds of one frame are limited to plus and minus this: one patch is
    /// never beyond doubt.
    pub limit: f64,
    /// How a model is fitted; only `tagalong train` reads it.
    pub training: Training,
}

impl Default for Config {
    fn default() -> Self {
        Self { model: String::new(), weight: 1.0, limit: 6.0, training: Training::default() }
    }
}

/// How a model is fitted. What matters at run time is kept in the model file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Training {
    /// What is done to the grey values: `unit`, `gradients`, `fraction` or `raw`.
    pub scaling: Scaling,
    /// The square of a candidate is enlarged by this fraction of its side.
    pub grow: f64,
    /// Widths of the kernel `exp(-gamma |a - b|^2)` that are tried (P4: 8).
    pub gammas: Vec<f64>,
    /// Penalties of a training error that are tried; each class is weighted by
    /// the inverse of its share.
    pub penalties: Vec<f64>,
    /// Parts into which the groups are divided, each held out once.
    pub folds: usize,
    /// Examples in the cross-validation at most.
    pub max_tried: usize,
    /// Examples in the final fit at most; memory grows with the square.
    pub max_samples: usize,
    /// Support vectors in the model file at most; each takes half a kilobyte.
    pub max_vectors: usize,
    /// Examples of people that are used at most, by chance (P4: 438); 0: all.
    pub people: usize,
    /// Examples of others that are used at most, by chance (P4: 146); 0: all.
    pub others: usize,
}

impl Default for Training {
    fn default() -> Self {
        Self {
            scaling: Scaling::Gradients,
            grow: 0.1,
            gammas: vec![0.5, 1.0, 2.0, 4.0, 8.0],
            penalties: vec![0.3, 1.0, 3.0, 10.0],
            folds: 4,
            max_tried: 1000,
            max_samples: 4000,
            max_vectors: 1200,
            people: 0,
            others: 0,
        }
    }
}
