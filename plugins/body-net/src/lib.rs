//! Verifies candidates with a small convolutional network on their whole bodies.
//!
//! A vertical plane through the candidate, from the floor to 2 m, is sampled in intensity and depth
//! ([`NetworkInput`]), always at one scale. A network of four layers ([`Net`]) turns the samples
//! into log-odds ([`Model`]). Without depth it gives no evidence, unless it is configured and
//! trained to work without.
//!
//! With the feature `train` the plugin also offers a trainer (`train`).
//!
//! ```
//! use tagalong_conformance::{context, patch};
//! use tagalong_core::Verifier;
//! use tagalong_body_net::{BodyNet, Config};
//!
//! let mut verifier = BodyNet::new(Config::default(), &context())?;
//! let frame = patch::frame(patch::picture(true, 1)); // a head above shoulders
//! // There is no depth image, and so no evidence.
//! assert_eq!(verifier.log_odds(&frame, &patch::candidate())?, 0.0);
//! # Ok::<(), tagalong_core::Error>(())
//! ```

mod config;
mod model;
mod net;
#[cfg(test)]
mod tests;
#[cfg(feature = "train")]
pub mod train;
mod verify;
mod view;

pub use config::{Config, Training};
pub use model::Model;
pub use net::{Net, Pass};
use tagalong_config::Registry;
pub use verify::BodyNet;
pub use view::NetworkInput;

/// The name of this plugin in configs.
pub const NAME: &str = "body-net";

/// Registers the plugin, and its trainer if that is compiled in.
pub fn register(registry: &mut Registry) {
    registry.verifier(NAME, "a small network looks at all of a candidate", BodyNet::new);
    #[cfg(feature = "train")]
    registry.training(
        NAME,
        tagalong_config::TrainingOffer::new(
            tagalong_config::TrainingData::Candidates,
            "[training]\nepochs = 2",
        ),
    );
    #[cfg(feature = "train")]
    registry.trainer(NAME, |config: Config, context| train::NetTrainer::new(config, context.seed));
}
