use crate::{Port, Tensor};

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
