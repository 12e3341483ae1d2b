use crate::StageSettings;
use tagalong_core::settings;

settings! {
    /// Settings of the associator `associate-observation-centric`.
    pub struct Config {
        /// Smallest overlap (IoU) of a predicted box and a detection.
        #[schemars(range(min = 1e-6, max = 1.0))]
        pub min_overlap: f64 = 0.3,
        /// Weight of the direction of motion: a detection straight ahead adds half of it to the
        /// overlap, one straight behind subtracts half of it.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub direction_weight: f64 = 0.2,
        /// Age of the observation from which the direction is measured, frames.
        #[schemars(range(min = 1, max = 1000))]
        pub direction_frames: u32 = 3,
        /// Smallest overlap of the last observation and a detection, in the stage for the remaining
        /// tracks; above 1 there is no such stage.
        #[schemars(range(min = 1e-6, max = 2.0))]
        pub recovery_overlap: f64 = 0.3,
        /// Fraction of its length by which each side of a box is enlarged in the stage for the
        /// remaining tracks.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub recovery_buffer: f64 = 0.0,
        /// Smallest overlap of a predicted box and a weak detection; above 1 weak detections are
        /// not used.
        #[schemars(range(min = 1e-6, max = 2.0))]
        pub weak_overlap: f64 = 0.5,
        /// Order of detections and tracks, and the weight of the appearance.
        #[serde(flatten)]
        pub stages: StageSettings,
    }
}
