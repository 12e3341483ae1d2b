//! Replays the detections of another detector: any detector can serve in a pipeline by running
//! elsewhere and recording its output.
//!
//! Boxes come from a text file or from a topic of the log; positions come from the depth image,
//! from the recording, or from the size of the box with a correspondingly large uncertainty. No
//! colour image is read, so that every tracker gets exactly the same detections, as tracking
//! benchmarks with given ("public") detections require.

mod boxes;
mod config;
mod detect;
#[cfg(test)]
mod tests;

pub use config::{Config, ScoreScale};
pub use detect::RecordedDetections;
use tagalong_config::{Registry, Remedy};

/// Name of this plugin in configs.
pub const NAME: &str = "recorded-detections";

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[
    Remedy {
        test: "nothing recorded",
        settings: &["path", "detections_topic"],
        look: "does the log, or the file, have detections of these frames?",
    },
    Remedy {
        test: "recorded score",
        settings: &["min_score", "discover_score"],
        look: "recorded detections that their detector doubts",
    },
];

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.detector(
        NAME,
        "boxes that another detector recorded, in a file or in the log",
        RecordedDetections::new,
    );
}
