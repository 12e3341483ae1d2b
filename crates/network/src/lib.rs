//! Neural networks from ONNX files.
//!
//! [`PersonNetwork`] reads a detector of one of the [families](Family), recognises it by its
//! outputs, prepares images by its convention and decodes the outputs to boxes of people.
//! [`Network`] is the border to the runtime, which is [`RtenNetwork`].
//!
//! A file is not trusted: its bytes are surveyed before the runtime reads them, [`Limits`] bound
//! its size, its operators and its tensors, and each call runs in a thread that is given up at a
//! deadline. That is no sandbox: a file made to do harm may still use up the memory, so take
//! networks from where you would take a program.

mod decode;
mod detector;
mod family;
mod limits;
mod network;
mod preparation;
mod runtime;
mod survey;
mod tensor;
mod worker;

pub use decode::ScoredBox;
pub use detector::{About, Choices, PersonNetwork, inspect};
pub use family::{Family, IMAGENET, OutputShape, recognise};
pub use limits::Limits;
pub use network::Network;
pub use preparation::{Colours, Fit, InputSize, Placement, Preparation};
pub use runtime::RtenNetwork;
pub use tensor::{Element, Port, Tensor};
