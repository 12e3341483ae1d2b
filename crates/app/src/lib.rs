//! Shared parts of the applications behind the `tagalong` command: failures with their exit codes,
//! output formats, config files and the choice among them, suggestions for mistyped paths, signals, progress and times.
//!
//! An application receives its arguments and returns an [`outcome::Outcome`]; the command line
//! converts that to an exit code and a message.
//!
//! ```
//! use tagalong_app::config_file::ConfigFile;
//! use tagalong_app::outcome::{Ended, Failure, Outcome};
//!
//! /// An application: it finds the config of a name.
//! fn known(name: &str) -> Outcome {
//!     ConfigFile::named(name).ok_or_else(|| Failure::usage(format!("no config `{name}`")))?;
//!     Ok(Ended::Well)
//! }
//!
//! assert_eq!(known("depth-ekf").map(Ended::code), Ok(0));
//! assert_eq!(known("depth-efk").map_err(|failure| failure.code), Err(2));
//! ```

pub mod choice;
pub mod config_file;
pub mod format;
pub mod frame_notes;
pub mod input_args;
pub mod installed;
pub mod lacking;
pub mod misfit;
pub mod missed;
pub mod origin;
pub mod outcome;
pub mod progress;
pub mod recorded_boxes;
pub mod remedies;
pub mod scoring;
pub mod serialize;
pub mod signals;
pub mod suggest;
pub mod threads;
pub mod timings;
pub mod unable;
