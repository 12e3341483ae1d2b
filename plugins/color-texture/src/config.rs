use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of `color-texture`.
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
    /// Prior evidence, added to the evidence of each frame, log-odds. Below zero the verifier is
    /// stricter.
    pub bias: f64,
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
            training: Training::default(),
        }
    }
}

/// Fit of a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Training {
    /// Numbers of trees that are tried; each is one row of the card.
    pub trees: Vec<usize>,
    /// Each tree goes this part of its way.
    pub rate: f64,
    /// Part of the features among which each tree chooses, at random.
    pub features: f64,
    /// Where a tree has few examples its values shrink: as if it had so many
    /// more, undecided.
    pub caution: f64,
    /// Share of the weight of candidates without depth, photographs.
    pub without_depth: f64,
    /// Parts into which the groups are divided, each held out once.
    pub folds: usize,
}

impl Default for Training {
    fn default() -> Self {
        Self {
            trees: vec![100, 200, 400, 800],
            rate: 0.1,
            features: 0.25,
            caution: 5.0,
            without_depth: 0.1,
            folds: 4,
        }
    }
}
