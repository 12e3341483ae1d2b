use crate::survey::Survey;
use crate::{Limits, Port, Tensor};

/// Neural network with named tensors as inputs and outputs.
///
/// The runtime implements this trait, so that it can be replaced by another implementation.
pub trait Network: Send {
    /// Returns the inputs in the order of [`Self::run`].
    fn inputs(&self) -> &[Port];

    /// Returns the outputs in the order of [`Self::run`].
    fn outputs(&self) -> &[Port];

    /// Computes the outputs.
    ///
    /// # Errors
    /// Inputs that do not fit, and operators that fail; the message is a sentence.
    fn run(&mut self, inputs: &[Tensor]) -> Result<Vec<Tensor>, String>;
}

/// Function that creates a network from the bytes of an ONNX file.
///
/// # Errors
/// A file that the runtime cannot execute, in a sentence about the file.
pub type Runtime = fn(Vec<u8>, &Limits) -> Result<Box<dyn Network>, String>;

/// Creates a network that runs on `rten`, the default [`Runtime`].
///
/// # Errors
/// Bytes that fail the check, operators that the runtime does not know, weights in another file,
/// and tensors that are too large; any file in a build without the feature `rten`. The message is a
/// sentence.
pub fn rten(bytes: Vec<u8>, limits: &Limits) -> Result<Box<dyn Network>, String> {
    built_in(bytes, limits)
}

#[cfg(feature = "rten")]
fn built_in(bytes: Vec<u8>, limits: &Limits) -> Result<Box<dyn Network>, String> {
    Ok(Box::new(crate::RtenNetwork::from_onnx(bytes, limits)?))
}

/// Rejects every file, but checks it first: an error in the file is reported rather than the
/// missing feature.
#[cfg(not(feature = "rten"))]
fn built_in(bytes: Vec<u8>, limits: &Limits) -> Result<Box<dyn Network>, String> {
    check_file(&bytes, limits)?;
    Err("needs the runtime of networks, which this build leaves out: build it with the feature \
         `networks` of the crate `tagalong` (`rten` of `tagalong-network`)"
        .into())
}

/// Rejects the bytes of an ONNX file that are damaged or beyond the limits, before a [`Runtime`]
/// reads them.
///
/// # Errors
/// The reason, in a sentence with the remedy.
pub fn check_file(bytes: &[u8], limits: &Limits) -> Result<(), String> {
    Survey::of(bytes, limits).map(drop)
}

impl Network for Box<dyn Network> {
    fn inputs(&self) -> &[Port] {
        (**self).inputs()
    }

    fn outputs(&self) -> &[Port] {
        (**self).outputs()
    }

    fn run(&mut self, inputs: &[Tensor]) -> Result<Vec<Tensor>, String> {
        (**self).run(inputs)
    }
}
