use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of `body-net`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Model file, relative to the config; empty: the model that is built in.
    pub model: String,
    /// Weight of this verifier's log-odds beside the detector's score.
    pub weight: f64,
    /// Log-odds of one frame are limited to plus and minus this: one look is
    /// never beyond doubt.
    pub limit: f64,
    /// Added to the evidence of each frame, log-odds. Below zero the verifier is stricter.
    pub bias: f64,
    /// True to look at depth and say nothing without it; false for cameras that have none, with a
    /// model that was trained so.
    pub depth: bool,
    /// Fit of a model; only `tagalong train` reads it.
    pub training: Training,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            model: String::new(),
            weight: 1.0,
            limit: 6.0,
            bias: 0.0,
            depth: true,
            training: Training::default(),
        }
    }
}

/// Fit of a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Training {
    /// Number of passes over the candidates, each time a little changed.
    pub epochs: u32,
    /// Largest step of a weight.
    pub rate: f64,
    /// Weights shrink by this part of a step.
    pub decay: f64,
    /// Candidates a step.
    pub batch: usize,
    /// Parts into which the groups are divided, each held out once.
    pub folds: usize,
}

impl Default for Training {
    fn default() -> Self {
        Self { epochs: 24, rate: 0.002, decay: 0.01, batch: 64, folds: 2 }
    }
}
