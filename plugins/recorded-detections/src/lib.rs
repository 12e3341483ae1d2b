//! Gives back what another detector recorded: any detector there is can stand
//! in a pipeline, by running it elsewhere and recording what it found.
//!
//! Boxes come from a text file or from a topic of the log; positions come from
//! the depth image, from the recording, or from the size of the box with an
//! honestly large uncertainty. Nothing here looks at pixels of colour, so that
//! every tracker gets exactly the same detections, as tracking benchmarks with
//! given ("public") detections want it.

mod boxes;
mod config;
mod detect;
#[cfg(test)]
mod tests;

pub use config::{Body, Config, ScoreScale};
pub use detect::RecordedDetections;
use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "recorded-detections";

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.detector(
        NAME,
        "boxes that another detector recorded, in a file or in the log",
        RecordedDetections::new,
    );
}
