//! Replays the detections of another detector: any detector can be used in a pipeline if it runs
//! elsewhere and its output is recorded.
//!
//! Boxes come from a text file or from a topic of the log; positions come from the depth image,
//! from the recording, or from the size of the box with a correspondingly large uncertainty. No
//! colour image is read, so every tracker gets exactly the same detections, as tracking benchmarks
//! with given ("public") detections require.
//!
//! ```
//! use tagalong_conformance::{context, patch};
//! use tagalong_core::{Detector, ExternalDetection, Funnel, Query};
//! use tagalong_geometry::Rect;
//! use tagalong_recorded_detections::{Config, RecordedDetections};
//!
//! let mut detector = RecordedDetections::new(Config::default(), &context())?;
//! let region = Rect::new(8.0, 8.0, 48.0, 48.0);
//! let recorded = vec![ExternalDetection::in_image(region, 0.9)];
//! let frame = patch::frame(patch::picture(true, 1)).with_recorded(Some(recorded));
//! let all = Query::Discover { occupied: &[] };
//! let found = detector.detect(&frame, &all, &mut Funnel::default())?;
//! assert!(found.len() == 1 && found[0].score > 2.0, "the log-odds of 0.9");
//! # Ok::<(), tagalong_core::Error>(())
//! ```

mod boxes;
mod config;
mod detect;
#[cfg(test)]
mod tests;

pub use config::{Config, ScoreScale};
pub use detect::RecordedDetections;
use tagalong_config::{RecordedOffer, Registry, Remedy};

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

/// Settings for the detections that come with the frames.
const OFFER: RecordedOffer = RecordedOffer {
    whole_people: "path = ''\nbody = 'full-box'",
    known_positions: "score = 'log-odds'\nmin_score = 0.0\nsigma_position_m = 0.05\noutside_image = true",
};

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.recorded(NAME, OFFER);
    registry.detector(
        NAME,
        "boxes that another detector recorded, in a file or in the log",
        RecordedDetections::new,
    );
}
