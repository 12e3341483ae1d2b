use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_core::settings;

settings! {
    /// Settings of `depth-net`.
    pub struct Config {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// Sensor whose readings fill the map.
        pub source: Source = Source::Depth,
        /// Log-odds from which a peak of the map is a person. The scores on the model's card are
        /// those of the default, on rooms that were left out.
        pub discover_score: f64 = 1.0,
        /// Log-odds from which a peak is a person near a confirmed track.
        pub track_score: f64 = -1.5,
        /// Largest distance of a peak from a track that it belongs to, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub track_radius_m: f64 = 0.6,
        /// Upper limit of the log-odds of a detection.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_score: f64 = 6.0,
        /// Least distance between two people, m.
        #[schemars(range(min = 0.0, max = 10.0))]
        pub separation_m: f64 = 0.4,
        /// Standard deviation of a head's position on the floor, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub sigma_m: f64 = 0.08,
        /// Standard deviation of a head's height as estimated by the network, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub sigma_height_m: f64 = 0.08,
        /// The same for a head outside of the image, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub sigma_unseen_height_m: f64 = 0.2,
        /// Measures a head on its surface, where the depth image shows it; otherwise the position
        /// and the height are those of the network.
        pub measure_heads: bool = true,
        /// Standard deviation of the height of a measured head, m.
        #[schemars(range(min = 1e-6, max = 10.0))]
        pub sigma_measured_height_m: f64 = 0.03,
        /// Settings of the fit; only `tagalong train` reads them.
        pub training: Training,
    }
}

/// Sensor whose readings fill the map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// A depth camera.
    Depth,
    /// A 3-D lidar: four maps, of the regions ahead, to the left, behind and to the right. Heads
    /// are not measured on their surface, and have no box in an image.
    Points,
}

settings! {
    /// Settings of the fit.
    pub struct Training {
        /// Number of steps on simulated rooms alone.
        #[schemars(range(min = 1, max = 1_000_000))]
        pub steps: usize = 800,
        /// Number of further steps on simulated and real rooms; they are repeated with each room
        /// left out.
        #[schemars(range(min = 1, max = 1_000_000))]
        pub real_steps: usize = 100,
        /// Frames per step.
        #[schemars(range(min = 1, max = 1024))]
        pub batch: usize = 12,
        /// Fraction of real frames in the further steps.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub real_share: f64 = 0.6,
        /// Peak learning rate (Adam).
        #[schemars(range(min = 1e-9, max = 1.0))]
        pub rate: f64 = 3e-3,
        /// Weight decay, as a fraction of the learning rate.
        #[schemars(range(min = 0.0, max = 1.0))]
        pub decay: f64 = 1e-4,
    }
}

settings! {
    /// Settings of `depth-net-verifier`.
    pub struct VerifierConfig {
        /// Model file, relative to the config; empty: the built-in model.
        pub model: String,
        /// Radius around the candidate within which the largest log-odds count, m.
        #[schemars(range(min = 0.1, max = 2.0))]
        pub radius_m: f64 = 0.25,
        /// Weight of these log-odds relative to the detector's score.
        pub weight: f64 = 1.0,
        /// Bound on the log-odds of one frame, in both directions.
        pub limit: f64 = 4.0,
        /// Log-odds added to those of each frame. Below zero the verifier is stricter.
        pub bias: f64 = 0.0,
    }
}
