//! Settings and their ranges, and the registry of plugins that a config names.
//!
//! * [`Settings`]: a struct with documented fields, defaults and ranges. [`parse_settings`]
//!   reads it from TOML and refuses unknown keys and numbers out of range, with their place.
//! * [`Registry`]: the plugins of a program. A plugin crate has a `register` function that the
//!   program calls.
//! * [`read_text`], [`read_bytes`]: files that a user names, within a limit.
//! * [`check_xml`]: XML files that keep a parser busy are refused.
//! * [`path_text`]: paths in JSON, of any bytes.
//! * [`OrAuto`]: a setting that is one of several words, or `auto`.
//! * [`ConfigError`]: a mistake with its place in the text.

mod bounded;
mod exported;
mod names;
mod offers;
mod or_auto;
pub mod path_text;
mod registry;
mod settings;
mod trainer;
mod xml;

pub use bounded::{FileLimit, read_bytes, read_text};
pub use exported::{ExportedNetwork, NamedTensor};
pub use names::{model_hint, nearest};
pub use offers::{RecordedOffer, Remedy, TrainingData, TrainingOffer, TrialValues};
pub use or_auto::OrAuto;
pub use path_text::PathText;
pub use registry::{Context, Kind, PluginInfo, Registry};
pub use settings::{
    ConfigError, NoSettings, Settings, Value, check_settings, commented_defaults, parse_settings,
};
pub use trainer::{AnnotatedPerson, Example, Fitted, Trainer};
pub use xml::check_xml;
