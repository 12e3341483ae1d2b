use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_config::check_settings;
use tagalong_core::Result;

/// Part of the body that a recorded box encloses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Body {
    /// The whole person, from head to feet; its upper-body square is tracked.
    Full,
    /// The whole person, and the box is tracked as it is. Its position is computed as for `full`.
    /// For data sets with whole bodies in their ground truth, too.
    FullBox,
    /// Head and shoulders, as a square.
    Upper,
}

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
    /// Part of the body that a box encloses.
    pub body: Body,
    /// Assumed height of a person, m, if a box encloses the whole body.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub height_m: f64,
    /// Standard deviation of the position of a box, pixels.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_px: f64,
    /// Standard deviation of the depth of a face read from the depth image, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_depth_m: f64,
    /// Standard deviation of a distance that is computed from the size of the box alone, as a
    /// fraction of the distance.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_distance: f64,
    /// Standard deviation of a recorded position in space, m.
    #[schemars(range(min = 1e-6, max = 1e6))]
    pub sigma_position_m: f64,
    /// A search near a track accepts boxes of uncertain distance that overlap the expected box by
    /// this much (IoU), and ...
    pub near_overlap: f64,
    /// ... positions within this distance on the floor, m.
    pub near_m: f64,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            path: String::new(),
            min_score: 0.3,
            score: ScoreScale::Probability,
            body: Body::Full,
            height_m: 1.7,
            sigma_px: 4.0,
            sigma_depth_m: 0.1,
            sigma_distance: 0.2,
            sigma_position_m: 0.15,
            near_overlap: 0.3,
            near_m: 0.8,
        }
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)
    }
}
