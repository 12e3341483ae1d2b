//! Neural networks from ONNX files.
//!
//! [`PersonNetwork`] reads a detector of one of the [families](Family), recognises the family from
//! the outputs, prepares images by its convention and decodes the outputs into boxes of people.
//! [`EmbeddingNetwork`] turns the image of a person into an embedding by which people are
//! recognised. [`Network`] is the interface to the runtime, which is `RtenNetwork` unless a
//! [`Runtime`] is given. A build without the feature `rten` has none, and reports this when a
//! network is loaded.
//!
//! A file is not trusted: its bytes are checked before the runtime reads them, [`Limits`] bound its
//! size, its operators and its tensors, and each call runs in a thread and is abandoned at a
//! deadline. An abandoned call keeps its thread until it ends; a network has only one thread, so
//! every call until then is late as well. This is not a sandbox: a malicious file may still use up
//! the memory, so trust the source of a network as you would that of a program.
//!
//! ```
//! use tagalong_core::RgbImage;
//! use tagalong_network::{Choices, Limits, PersonNetwork};
//!
//! # let models = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models");
//! let mut network =
//!     PersonNetwork::load(&models.join("yolox.onnx"), &Choices::default(), &Limits::default())?;
//! let preparation = network.family().preparation();
//! // A bright person in front of a dark wall, as this test network knows them.
//! let image = RgbImage::from_fn(64, 64, |x, y| {
//!     let is_person = (32..48).contains(&x) && (16..48).contains(&y);
//!     let wall = |channel: usize| (x + 2 * y + 7 * channel) % 40;
//!     [0, 1, 2].map(|channel| if is_person { 230 + 10 * channel } else { wall(channel) } as u8)
//! });
//! let found = network.find(&image, &preparation, 0.5, 0.5)?.expect("within the deadline");
//! assert_eq!(found.len(), 1);
//! # Ok::<(), String>(())
//! ```

mod decode;
mod detector;
mod embedding;
mod family;
mod grey;
mod installed;
mod limits;
mod names;
mod network;
mod order;
mod preparation;
#[cfg(feature = "rten")]
mod runtime;
mod survey;
mod tensor;
mod values;
mod worker;

pub use decode::ScoredBox;
pub use detector::{About, Choices, PersonNetwork, inspect};
pub use embedding::{Convention, EmbeddingNetwork};
pub use family::{Family, IMAGENET, OutputShape};
pub use grey::with_colours;
pub use installed::{DATA_FOLDER, Variables, model_file, networks_folder, networks_folder_of};
pub use limits::{LimitSettings, Limits};
pub use names::ClassNames;
pub use network::{Network, Runtime, check_file, rten};
pub use preparation::{Colours, Fit, InputSize, Placement, Preparation};
#[cfg(feature = "rten")]
pub use runtime::RtenNetwork;
pub use tensor::{Element, Port, Tensor};
pub use values::{BoxOrder, BoxUnit};
