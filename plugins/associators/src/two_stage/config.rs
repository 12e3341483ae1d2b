use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::hungarian;

/// Settings of the associator `associate-two-stage`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
// Unknown keys are refused by the flattened struct: of its keys it leaves those in place that it
// flattens itself, and serde would refuse them here.
#[serde(default)]
pub struct Config {
    /// The settings of `associate-hungarian`.
    #[serde(flatten)]
    pub pairs: hungarian::Config,
    /// Log-odds from which a detection is strong.
    pub strong_log_odds: f64,
    /// Fraction of the gate within which a weak detection continues a track, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub weak_gate: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self { pairs: hungarian::Config::default(), strong_log_odds: 0.5, weak_gate: 0.5 }
    }
}
