//! Person detector for the panorama of a conical mirror (P5, section 4).
//!
//! Pixels that differ from the background are counted by column and by row. A run of columns is a
//! person: its mean gives the bearing, and a few features, mainly width, lower edge and area, give
//! the distance with a learned model ([`Model`]). The panorama wraps around, so columns are counted
//! modulo its width throughout: in runs, means and extents ([`circular`]).
//!
//! A shadow also differs from the background, and displaces the lower edge. It darkens all colours
//! alike, so pixels that are only darker are left out.
//!
//! While the robot moves, the background moves with it: the floor by the odometry, everything else
//! as if it were at one of a few fixed distances.
//!
//! With the feature `train` the crate also fits models (`train`).

mod background;
mod blob;
mod changes;
pub mod circular;
mod config;
mod detector;
mod expected;
mod eyes;
#[cfg(feature = "train")]
mod fit;
mod model;
mod network;
mod segment;
#[cfg(test)]
mod tests;
#[cfg(feature = "train")]
pub mod train;
mod warp;

pub use background::Background;
pub use blob::{Blob, FEATURES, Features};
pub use config::{AfterMeasuring, Config, Distance};
pub use detector::OmniAppearance;
pub use eyes::Eyes;
pub use model::{
    Geometry, Head, Line, Model, PanoramaGeometry, Person, Ridge, Signature, recognised,
};
pub use network::Network;
pub use segment::{Counts, Segmenter};
use tagalong_config::{Registry, Remedy};

/// Name of this plugin in configs.
pub const NAME: &str = "omni-appearance";

/// Name of the distance model in `tagalong train`.
pub const TRAINER: &str = "omni-distance";

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[
    Remedy {
        test: "background is being learned",
        settings: &["background_frames"],
        look: "the first frames of a panorama",
    },
    Remedy {
        test: "head height",
        settings: &["head_height_m"],
        look: "is the camera's height right?",
    },
];

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.detector(
        NAME,
        "people in the panorama of a conical mirror, distance by a small network",
        OmniAppearance::new,
    );
    #[cfg(feature = "train")]
    registry.training(
        TRAINER,
        tagalong_config::TrainingOffer::new(tagalong_config::TrainingData::Panoramas, ""),
    );
    #[cfg(feature = "train")]
    registry.trainer(TRAINER, |config: Config, context| {
        train::DistanceTrainer::new(config, context.seed)
    });
}
