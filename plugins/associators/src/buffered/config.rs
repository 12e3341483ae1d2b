use crate::StageSettings;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

/// Source of the box at which a track is expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Motion {
    /// The last observation, moved by the mean velocity of the most recent ones.
    #[default]
    Observed,
    /// The filter's prediction.
    Predicted,
}

settings! {
    /// Settings of the associator `associate-buffered`.
    pub struct Config {
        /// Fraction of its length by which each side of a box is enlarged in the first stage.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub buffer: f64 = 0.3,
        /// Smallest overlap (IoU) of the enlarged boxes in the first stage.
        #[schemars(range(min = 1e-6, max = 1.0))]
        pub min_overlap: f64 = 0.3,
        /// The same fraction in the second stage, for the remaining tracks and detections.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub second_buffer: f64 = 0.4,
        /// Smallest overlap in the second stage; above 1 there is no such stage.
        #[schemars(range(min = 1e-6, max = 2.0))]
        pub second_overlap: f64 = 0.3,
        /// Source of the box at which a track is expected.
        pub motion: Motion = Motion::Observed,
        /// Age of the oldest observation in the mean velocity, frames.
        #[schemars(range(min = 1, max = 1000))]
        pub motion_frames: u32 = 5,
        /// Smallest overlap of a weak detection and a remaining track, with the second buffer;
        /// above 1 weak detections are not used.
        #[schemars(range(min = 1e-6, max = 2.0))]
        pub weak_overlap: f64 = 0.5,
        /// Order of detections and tracks, and the weight of the appearance.
        #[serde(flatten)]
        pub stages: StageSettings,
    }
}
