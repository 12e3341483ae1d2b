//! `associate-two-stage`: strong detections are assigned first, and weak ones to the remaining
//! tracks (ByteTrack: Zhang et al., *Multi-Object Tracking by Associating Every Detection Box*,
//! ECCV 2022, Algorithm 1).
//!
//! A weak detection is often a half-hidden person. It continues a track that no strong detection
//! explains, and starts none.

mod associate;
mod config;

pub use associate::TwoStage;
pub use config::Config;
use tagalong_config::{Registry, Remedy};

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[Remedy {
    test: "associator",
    settings: &["strong_log_odds"],
    look: "weak detections that continue no track",
}];

/// Registers the associator `associate-two-stage`.
pub fn register(registry: &mut Registry) {
    registry.remedies("associate-two-stage", REMEDIES);
    registry.associator(
        "associate-two-stage",
        "strong detections first, weak ones for the tracks that are left (ByteTrack)",
        |config: Config, _| TwoStage::new(config),
    );
}
