//! `face-rgbd`: faces by a cascade of Haar-like features, where depth and
//! geometry allow them (P2, section III-A; P. Viola and M. Jones, *Rapid object
//! detection using a boosted cascade of simple features*, CVPR 2001).
//!
//! Points all over the depth image are sampled. Those at heights and distances
//! where faces can be are connected to regions, which are ranked by how much of
//! them has the colour of skin. Only there, and only in the sizes that the
//! distance allows, the windows of a [`Cascade`] are looked at. Without depth it
//! looks everywhere, in all sizes.
//!
//! What is found is no face but a person: the detection is the upper-body square
//! of whoever has this face.
//!
//! Cascades are XML files as OpenCV has them; with the feature `train` the plugin
//! offers a trainer that makes them (`train`).

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
pub use scan::{Scanner, Seen, scales, whole};
use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "face-rgbd";

/// The name of its trainer: what it makes is a cascade.
#[cfg(feature = "train")]
pub const TRAINER: &str = "cascade";

/// Registers the plugin, and its trainer if that is compiled in.
pub fn register(registry: &mut Registry) {
    registry.detector(NAME, "faces by a cascade, where depth allows them (P2)", FaceRgbd::new);
    #[cfg(feature = "train")]
    registry.trainer(TRAINER, |config: Config, context| {
        let begun = (!config.model.is_empty())
            .then(|| context.model(&config.model, "", Cascade::from_xml))
            .transpose()?;
        train::CascadeTrainer::new(config, begun, context.seed)
    });
}
