use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

settings! {
    /// Settings of `depth-net`.
    pub struct Config {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// Sensor whose readings make the map.
        pub source: Source = Source::Depth,
        /// Log-odds from which a peak of the map is a person. At the default the scores on rooms
        /// left out are those of the model's card.
        pub discover_score: f64 = 1.0,
        /// Log-odds from which a peak is a person near a confirmed track.
        pub track_score: f64 = -1.5,
        /// A peak belongs to a track if it is nearer than this, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub track_radius_m: f64 = 0.6,
        /// Upper limit of the log-odds of a detection.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_score: f64 = 6.0,
        /// Two people are at least this far apart, m.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub separation_m: f64 = 0.4,
        /// Standard deviation of a head's place on the floor, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub sigma_m: f64 = 0.08,
        /// Standard deviation of a head's height as the network tells it, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub sigma_height_m: f64 = 0.08,
        /// The same of a head outside of the image, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub sigma_unseen_height_m: f64 = 0.2,
        /// Measures a head on the surface that the depth image shows of it, where it does;
        /// otherwise the place and the height are those of the network.
        pub measure_heads: bool = true,
        /// Standard deviation of the height of a head that was measured, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub sigma_measured_height_m: f64 = 0.03,
        /// Settings of the fit; only `tagalong train` reads them.
        pub training: Training,
    }
}

/// Sensor whose readings make the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// A depth camera.
    Depth,
    /// A 3-D lidar: four maps, of what is ahead, at the left, behind and at the right. Heads are not
    /// measured on their surface, and have no box in an image.
    Points,
}

settings! {
    /// Settings of the fit.
    pub struct Training {
        /// Steps on simulated rooms alone.
        #[schemars(range(min = 1, max = 1_000_000))]
        pub steps: usize = 800,
        /// Further steps on simulated and real rooms, which are repeated with each room left out.
        #[schemars(range(min = 1, max = 1_000_000))]
        pub real_steps: usize = 100,
        /// Frames per step.
        #[schemars(range(min = 1, max = 1024))]
        pub batch: usize = 12,
        /// Fraction of real frames in the further steps.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub real_share: f64 = 0.6,
        /// Largest step of a weight.
        #[schemars(range(min = 1e-9, max = 1.0))]
        pub rate: f64 = 3e-3,
        /// Weights shrink by this fraction of a step.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub decay: f64 = 1e-4,
    }
}

settings! {
    /// Settings of `depth-net-verifier`.
    pub struct VerifierConfig {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// The largest log-odds nearer to the candidate than this count, m.
        #[schemars(range(min = 0.1, max = 2.0))]
        pub radius_m: f64 = 0.25,
        /// Weight of these log-odds beside the score of the detector.
        pub weight: f64 = 1.0,
        /// Log-odds of one frame are limited to plus and minus this.
        pub limit: f64 = 4.0,
        /// Added to the log-odds of each frame; below zero the verifier is stricter.
        pub bias: f64 = 0.0,
    }
}
