use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::Result;
use tagalong_vision::BoxSettings;

/// Meaning of the recorded score.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ScoreScale {
    /// A probability, 0 to 1.
    Probability,
    /// Log-odds, or a margin like that of an SVM: 0 is undecided.
    LogOdds,
}

/// Settings of `recorded-detections`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// A `det.txt` of the MOTChallenge (frame, -1, x, y, width, height, score; frames from 1,
    /// pixels), relative to the config. Empty: the log topic that `[input] detections_topic` names.
    pub path: String,
    /// Boxes with a lower score, on the recorded scale, are dropped.
    pub min_score: f64,
    /// Meaning of the score.
    pub score: ScoreScale,
    /// Boxes to detections with a position.
    #[serde(flatten)]
    pub boxes: BoxSettings,
    /// Standard deviation of a recorded position in space, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_position_m: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            path: String::new(),
            min_score: 0.3,
            score: ScoreScale::Probability,
            boxes: BoxSettings::default(),
            sigma_position_m: 0.15,
        }
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)
    }
}
