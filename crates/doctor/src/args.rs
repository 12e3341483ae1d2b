use std::path::PathBuf;

use clap::{Args, ValueEnum};
use tagalong_app::format::Format;
use tagalong_app::input_args::InputArgs;

/// Arguments of `tagalong doctor`.
#[derive(Args, Debug)]
#[command(allow_missing_positional = true)]
pub struct DoctorArgs {
    /// The pipeline, a TOML file or the name of a built-in one [default: each recommended one that
    /// fits the log].
    pub config: Option<PathBuf>,
    /// The log: MCAP, `.db3`, `.bag`, or the folder of a bag.
    #[arg(required = true)]
    pub log: PathBuf,
    /// Write pictures into this folder: frames with their tracks, and candidates that each test
    /// dropped.
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Replace the pictures of an earlier visit in the same folder.
    #[arg(long)]
    pub overwrite: bool,
    /// Number of frames to examine, from the first one on.
    #[arg(long, value_name = "N", default_value_t = 300, value_parser = clap::value_parser!(u64).range(1..))]
    pub frames: u64,
    /// Try other settings on this log, and print the changes with each.
    #[arg(long, value_enum, default_value_t)]
    pub settings: Trying,
    /// Output format.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Options for reading the log.
    #[command(flatten)]
    pub input: InputArgs,
}

/// Condition for trying other settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Trying {
    /// If the tracks disagree with the shapes that come and go.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never: the log is read once.
    Never,
}
