use crate::survey::Survey;
use crate::{Limits, Port, RtenNetwork, Tensor};

/// Neural network: named tensors in, named tensors out.
///
/// The runtime stands behind this trait, so that another one is one more implementation.
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

/// Function that makes a network of the bytes of an ONNX file.
///
/// # Errors
/// A file that it cannot run, in a sentence about the file.
pub type Runtime = fn(Vec<u8>, &Limits) -> Result<Box<dyn Network>, String>;

/// Makes a network that `rten` runs: the [`Runtime`] where no other one is named.
///
/// # Errors
/// As [`RtenNetwork::from_onnx`].
pub fn rten(bytes: Vec<u8>, limits: &Limits) -> Result<Box<dyn Network>, String> {
    Ok(Box::new(RtenNetwork::from_onnx(bytes, limits)?))
}

/// Refuses the bytes of an ONNX file that are damaged or beyond the limits, before a [`Runtime`]
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
