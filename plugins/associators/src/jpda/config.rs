use crate::GateSettings;
use tagalong_core::settings;

settings! {
    /// Settings of the associator `associate-jpda`.
    pub struct Config {
        /// Probability that a visible person is detected in a frame.
        #[schemars(range(min = 0.01, max = 0.999))]
        pub detection_probability: f64 = 0.9,
        /// Density of false detections, per cubic metre and frame.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub clutter_per_m3: f64 = 0.05,
        /// Least probability of a pair; less probable pairs are left out.
        #[schemars(range(min = 1e-6, max = 0.5))]
        pub min_weight: f64 = 0.05,
        /// Largest number of detections in a cluster of tracks, 1 to 16. Each one more doubles the
        /// work.
        #[schemars(range(min = 1, max = 16))]
        pub max_detections: u32 = 12,
        /// Gate in metres, and the weight of the appearance.
        #[serde(flatten)]
        pub gating: GateSettings,
    }
}
