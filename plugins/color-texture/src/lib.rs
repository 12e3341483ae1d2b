//! Verifies candidates by colour and texture, which P1 demands after its silhouettes, and by the
//! shape of their surface in depth.
//!
//! A candidate is reduced to numbers ([`Features`]): gradients, local binary patterns, colours of
//! head and torso, the depth outside of the silhouette that the detector has already matched (a
//! coat stand is thin below, a poster is flat, a plant is rough), and the gradients of the whole
//! candidate from the floor up. A sum of small decision trees ([`Model`]) turns them into log-odds.
//! Features that a frame lacks, such as colour in a grey log or depth in a photograph, have no
//! vote.
//!
//! With the feature `train` the plugin also offers a trainer (`train`).
//!
//! ```
//! use tagalong_conformance::{context, patch};
//! use tagalong_core::Verifier;
//! use tagalong_color_texture::{ColorTexture, Config};
//!
//! let mut verifier = ColorTexture::new(Config::default(), &context())?;
//! let frame = patch::frame(patch::picture(true, 1)); // a head above shoulders
//! let bars = patch::frame(patch::picture(false, 1));
//! let candidate = patch::candidate();
//! assert!(verifier.log_odds(&frame, &candidate)? > verifier.log_odds(&bars, &candidate)?);
//! # Ok::<(), tagalong_core::Error>(())
//! ```

mod config;
mod features;
mod model;
#[cfg(test)]
mod tests;
#[cfg(feature = "train")]
pub mod train;
mod verify;

pub use config::{Config, Training};
pub use features::{COUNT, Family, Features};
pub use model::{Model, Stump, Tree};
use tagalong_config::Registry;
pub use verify::ColorTexture;

/// The name of this plugin in configs.
pub const NAME: &str = "color-texture";

/// Registers the plugin, and its trainer if that is compiled in.
pub fn register(registry: &mut Registry) {
    registry.verifier(NAME, "colour, texture and surface of a candidate", ColorTexture::new);
    #[cfg(feature = "train")]
    registry.training(
        NAME,
        tagalong_config::TrainingOffer::new(
            tagalong_config::TrainingData::Candidates,
            "[training]\ntrees = [25, 50]",
        ),
    );
    #[cfg(feature = "train")]
    registry.trainer(NAME, |config: Config, context| {
        train::TreeTrainer::new(config.training, context.seed)
    });
}
