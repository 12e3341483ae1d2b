use crate::StageSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the associator `associate-observation-centric`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Smallest overlap (IoU) of a predicted box and a detection.
    #[schemars(range(min = 1e-6, max = 1.0))]
    pub min_overlap: f64,
    /// Weight of the direction: a detection straight ahead adds half of it to the overlap, one
    /// straight behind takes half of it away.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub direction_weight: f64,
    /// Age of the observation from which the direction is taken, frames.
    #[schemars(range(min = 1, max = 1000))]
    pub direction_frames: u32,
    /// Smallest overlap of the last observation and a detection, in the stage for tracks that are
    /// left; above 1 there is no such stage.
    #[schemars(range(min = 1e-6, max = 2.0))]
    pub recovery_overlap: f64,
    /// Each side of a box is enlarged by this fraction of it in the stage for tracks that are left.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub recovery_buffer: f64,
    /// Smallest overlap of a predicted box and a weak detection; above 1 weak detections are not
    /// used.
    #[schemars(range(min = 1e-6, max = 2.0))]
    pub weak_overlap: f64,
    /// Order of detections and tracks, and the part of the appearance.
    #[serde(flatten)]
    pub stages: StageSettings,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            min_overlap: 0.3,
            direction_weight: 0.2,
            direction_frames: 3,
            recovery_overlap: 0.3,
            recovery_buffer: 0.0,
            weak_overlap: 0.5,
            stages: StageSettings::default(),
        }
    }
}
