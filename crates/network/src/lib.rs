//! Neural networks from ONNX files.
//!
//! [`PersonNetwork`] reads a detector of one of the [families](Family), recognises it by its
//! outputs, prepares images by its convention and decodes the outputs to boxes of people.
//! [`EmbeddingNetwork`] turns the image of a person into a vector by which people are recognised.
//! [`Network`] is the border to the runtime, which is [`RtenNetwork`] unless a [`Runtime`] is given.
//!
//! A file is not trusted: its bytes are surveyed before the runtime reads them, [`Limits`] bound
//! its size, its operators and its tensors, and each call runs in a thread that is given up at a
//! deadline. A call that is given up keeps its thread until it ends; a network has one thread, and
//! every call until then is late as well. That is no sandbox: a file made to do harm may still use up the memory, so take
//! networks from where you would take a program.

mod decode;
mod detector;
mod embedding;
mod family;
mod grey;
mod limits;
mod network;
mod preparation;
mod runtime;
mod survey;
mod tensor;
mod worker;

pub use decode::ScoredBox;
pub use detector::{About, Choices, PersonNetwork, inspect};
pub use embedding::{Convention, EmbeddingNetwork};
pub use family::{Family, IMAGENET, OutputShape, recognise};
pub use grey::with_colours;
pub use limits::{LimitSettings, Limits};
pub use network::{Network, Runtime, check_file, rten};
pub use preparation::{Colours, Fit, InputSize, Placement, Preparation};
pub use runtime::RtenNetwork;
pub use tensor::{Element, Port, Tensor};
