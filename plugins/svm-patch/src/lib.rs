//! Verifies candidates by their grey values, with a support vector machine (P4, section II-C).
//!
//! A silhouette in depth cannot distinguish a person from a coat on a stand; the grey values inside
//! it often can. A candidate's square is reduced to 20x20 grey values ([`Sampler`]), which are
//! normalised for brightness and contrast or replaced by gradient directions, and compared with the
//! support vectors of a [`Model`] by a radial basis function. A calibration on held-out groups
//! turns the decision value into log-odds.
//!
//! The log-odds assume an even prior: the actual prior, one person in many candidates, is part of
//! the detector's score, which the pipeline adds.
//!
//! With the feature `train` the plugin also offers a trainer (`train`). Without it no solver is
//! compiled in.
//!
//! ```
//! use tagalong_conformance::{context, patch};
//! use tagalong_core::Verifier;
//! use tagalong_svm_patch::{SvmPatch, Config};
//!
//! let mut verifier = SvmPatch::new(Config::default(), &context())?;
//! let frame = patch::frame(patch::picture(true, 1)); // a head above shoulders
//! let bars = patch::frame(patch::picture(false, 1));
//! let candidate = patch::candidate();
//! assert!(verifier.log_odds(&frame, &candidate)? > verifier.log_odds(&bars, &candidate)?);
//! # Ok::<(), tagalong_core::Error>(())
//! ```

mod config;
mod gradients;
mod model;
mod patch;
#[cfg(test)]
mod tests;
#[cfg(feature = "train")]
pub mod train;
mod verify;

pub use config::{Config, Scaling, Training};
pub use model::Model;
pub use patch::{PIXELS, Patch, SIDE, Sampler};
use tagalong_config::Registry;
pub use verify::SvmPatch;

/// Name of this plugin in configs.
pub const NAME: &str = "svm-patch";

/// Registers the plugin, and its trainer if that is compiled in.
pub fn register(registry: &mut Registry) {
    registry.verifier(NAME, "a support vector machine on 20x20 grey patches", SvmPatch::new);
    #[cfg(feature = "train")]
    registry.training(
        NAME,
        tagalong_config::TrainingOffer::new(
            tagalong_config::TrainingData::Candidates,
            "[training]\ngammas = [2.0, 8.0]\npenalties = [1.0, 10.0]\nmax_tried = 300",
        ),
    );
    #[cfg(feature = "train")]
    registry.trainer(NAME, |config: Config, context| {
        train::PatchTrainer::new(config.training, context.seed)
    });
}
