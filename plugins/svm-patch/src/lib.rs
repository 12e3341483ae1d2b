//! Verifies candidates by their intensity patch, with a support vector machine (P4, section II-C).
//!
//! Silhouettes in depth cannot tell a person from a coat on a stand; the grey values inside often
//! can. A candidate's square is reduced to 20x20 grey values ([`Sampler`]), which are normalised
//! for brightness and contrast or replaced by gradient directions, and compared with the support
//! vectors of a [`Model`] by a radial basis function. The decision value becomes log-odds by a
//! calibration on held-out groups.
//!
//! The log-odds assume even priors: the prior, one person in many candidates, belongs to the score
//! of the detector, which the pipeline adds.
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
