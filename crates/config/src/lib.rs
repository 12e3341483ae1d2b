//! Settings and their ranges, and the registry of plugins that a config names.
//!
//! * [`Settings`]: a struct with documented fields, defaults and ranges. [`parse_settings`] reads
//!   it from TOML and refuses unknown keys and numbers out of range, with their place in the text.
//! * [`Registry`]: the plugins of a program. A plugin crate has a `register` function, which the
//!   program calls.
//! * [`read_text`], [`read_bytes`]: files that a user names, within a limit.
//! * [`check_xml`]: refuses XML files that would keep a parser busy.
//! * [`path_text`]: paths in JSON, whatever their bytes.
//! * [`OrAuto`]: a setting that is one of several words, or `auto`.
//! * [`ConfigError`]: an error with its place in the text.
//!
//! # External crates in public signatures
//!
//! Settings implement traits of `serde` and `schemars`, and values of a config are those of `toml`.
//! The versions that Tagalong uses are re-exported as [`serde`], [`schemars`] and [`toml`]; another
//! major version of one of them is a breaking change of this crate. A plugin that uses these
//! re-exports needs no dependencies of its own, and its versions always match:
//!
//! ```
//! use tagalong_config::schemars::JsonSchema;
//! use tagalong_config::serde::{Deserialize, Serialize};
//! use tagalong_config::{check_settings, toml};
//!
//! /// Settings of a plugin.
//! #[derive(Default, Serialize, Deserialize, JsonSchema)]
//! #[serde(crate = "tagalong_config::serde", default, deny_unknown_fields)]
//! #[schemars(crate = "tagalong_config::schemars")]
//! struct Config {
//!     /// Distance from which people are found, m.
//!     #[schemars(range(min = 0.5))]
//!     near_m: f64,
//! }
//!
//! let config: Config = toml::from_str("near_m = 0.2")?;
//! let refused = check_settings(&config).unwrap_err().to_string();
//! assert!(refused.contains("near_m"), "{refused}");
//! # Ok::<(), toml::de::Error>(())
//! ```

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

pub use {schemars, serde, toml};

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
