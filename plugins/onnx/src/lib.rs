//! `onnx`: finds people with a neural network that the user provides as an ONNX file.
//!
//! The network runs through [`tagalong_network::PersonNetwork`], which knows the conventions of
//! nine families of detectors. Its boxes of whole people become upper-body squares with a position:
//! from depth if it shows the face, otherwise from the size of the box.
//!
//! ```
//! use tagalong_conformance::{context, patch};
//! use tagalong_core::{Detector, Funnel, Query};
//! use tagalong_onnx::{Config, Onnx};
//!
//! // The file of the network is `model`. Without one the detector finds no person, and says so.
//! let mut detector = Onnx::new(Config::default(), &context())?;
//! let mut funnel = Funnel::default();
//! let frame = patch::frame(patch::picture(true, 1));
//! let found = detector.detect(&frame, &Query::Discover { occupied: &[] }, &mut funnel)?;
//! assert!(found.is_empty());
//! assert_eq!(funnel.count("no model"), 1);
//! # Ok::<(), tagalong_core::Error>(())
//! ```

mod config;
mod detect;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use detect::Onnx;
use tagalong_config::{Registry, Remedy};

/// Name of this plugin in configs.
pub const NAME: &str = "onnx";

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[
    Remedy {
        test: "no model",
        settings: &["model"],
        look: "an ONNX file is needed; `tagalong model FILE.onnx` says whether it fits",
    },
    Remedy {
        test: "network: late",
        settings: &["deadline_s", "threads"],
        look: "the network takes longer than its deadline: a smaller one, or `every = 3` beside `plugin`",
    },
    Remedy {
        test: "network: score",
        settings: &["discover_score", "track_score"],
        look: "boxes that the network doubts; colours in the wrong order or scale lower all scores",
    },
];

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.network_of_a_file(NAME);
    registry.detector(NAME, "people by a neural network from an ONNX file", Onnx::new);
}
