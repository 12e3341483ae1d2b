//! `onnx`: people by a neural network that the user brings as an ONNX file.
//!
//! The network runs through [`tagalong_network::PersonNetwork`], which knows the conventions of
//! eight families of detectors. Its boxes of whole people become upper-body squares with a place:
//! by depth where that shows the face, otherwise by the size of the box.

mod config;
mod detect;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use detect::Onnx;
use tagalong_config::Registry;

/// Name of this plugin in configs.
pub const NAME: &str = "onnx";

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.detector(NAME, "people by a neural network from an ONNX file", Onnx::new);
}
