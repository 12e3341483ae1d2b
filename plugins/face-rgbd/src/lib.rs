//! `face-rgbd`: finds faces with a cascade of Haar-like features, where depth and geometry allow
//! them (P2, section III-A; P. Viola and M. Jones, *Rapid object detection using a boosted cascade
//! of simple features*, CVPR 2001).
//!
//! The depth image is sampled on a grid of points. Points at heights and distances that faces have
//! are connected to regions, which are ranked by their share of skin colour. The windows of a
//! [`Cascade`] are scanned only there, and only at the sizes that the distance allows. Without
//! depth the whole image is scanned, at all sizes.
//!
//! A detection is the upper-body square below the face.
//!
//! Cascades are XML files in OpenCV's format; with the feature `train` the plugin offers a trainer
//! for them (`train`).

mod cascade;
mod compiled;
mod config;
mod detect;
mod group;
mod level;
mod propose;
mod scan;
#[cfg(test)]
mod tests;
#[cfg(feature = "train")]
pub mod train;
mod xml;

pub use cascade::{Cascade, Feature, Next, Node, Part, Split, Stage, Tree};
pub use config::{Config, Training};
pub use detect::FaceRgbd;
pub use group::{Group, Grouping, Hit, grouped};
pub use level::Level;
pub use propose::Proposals;
pub use scan::{PassedWindow, Scanner, scales, whole};
use tagalong_config::{Registry, Remedy};

/// Name of this plugin in configs.
pub const NAME: &str = "face-rgbd";

/// Name of its trainer, which makes cascades.
#[cfg(feature = "train")]
pub const TRAINER: &str = "cascade";

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[
    Remedy {
        test: "window: no face",
        settings: &["min_side_px"],
        look: "nearly all windows of any image; faces smaller than this are not looked for",
    },
    Remedy {
        test: "face: log-odds",
        settings: &["min_score"],
        look: "faces in profile, in the dark, or blurred",
    },
    Remedy {
        test: "point: *",
        settings: &["max_points"],
        look: "places where depth and height allow no face, or that are less like skin than others",
    },
];

/// Registers the plugin, and its trainer if that is compiled in.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.detector(NAME, "faces by a cascade, where depth allows them", FaceRgbd::new);
    #[cfg(feature = "train")]
    registry.training(
        TRAINER,
        tagalong_config::TrainingOffer::new(
            tagalong_config::TrainingData::Faces,
            "[training]\nstages = 4\nfeatures = 200",
        ),
    );
    #[cfg(feature = "train")]
    registry.trainer(TRAINER, |config: Config, context| {
        let begun = (!config.model.is_empty())
            .then(|| context.model(&config.model, "", Cascade::from_xml))
            .transpose()?;
        train::CascadeTrainer::new(config, begun, context.seed)
    });
}
