//! Shared parts of the applications behind the `tagalong` command: failures with their exit codes,
//! output formats, config files and the choice among them, suggestions for mistyped paths, signals, progress and times.
//!
//! An application takes its arguments and returns an [`outcome::Outcome`]; the command line turns
//! that into an exit code and a message.

pub mod choice;
pub mod config_file;
pub mod format;
pub mod frame_notes;
pub mod input_args;
pub mod installed;
pub mod origin;
pub mod outcome;
pub mod progress;
pub mod remedies;
pub mod scoring;
pub mod serialize;
pub mod signals;
pub mod suggest;
pub mod threads;
pub mod timings;
pub mod unable;
