use crate::survey::Survey;
use crate::{Limits, Port, Tensor};

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
/// Bytes that the survey refuses, operators that the runtime does not know, weights in another file,
/// and tensors that are too large; any file in a build without the feature `rten`. The message is a
/// sentence.
pub fn rten(bytes: Vec<u8>, limits: &Limits) -> Result<Box<dyn Network>, String> {
    built_in(bytes, limits)
}

#[cfg(feature = "rten")]
fn built_in(bytes: Vec<u8>, limits: &Limits) -> Result<Box<dyn Network>, String> {
    Ok(Box::new(crate::RtenNetwork::from_onnx(bytes, limits)?))
}

/// Refuses every file, after the survey: a mistake in it comes before one in the choice of the build.
#[cfg(not(feature = "rten"))]
fn built_in(bytes: Vec<u8>, limits: &Limits) -> Result<Box<dyn Network>, String> {
    check_file(&bytes, limits)?;
    Err("needs the runtime of networks, which this build leaves out: build it with the feature \
         `networks` of the crate `tagalong` (`rten` of `tagalong-network`)"
        .into())
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
