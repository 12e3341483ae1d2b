use std::path::{Path, PathBuf};

use clap::Args;
use tagalong_app::format::Format;

/// Arguments of `tagalong run`.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// The pipeline, a TOML file [default: depth-ekf, built in].
    pub config: Option<PathBuf>,
    /// The log, an MCAP file with ROS 2 messages [default: a short simulated one, written to
    /// runs/sample.mcap].
    pub log: Option<PathBuf>,
    /// Output folder [default: runs/<log>-<config>].
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Render a picture of every frame: boxes, ids, trails, and a view from above.
    #[arg(long)]
    pub overlay: bool,
    /// Replace the files of an earlier run in the same directory.
    #[arg(long)]
    pub overwrite: bool,
    /// Fail (exit code 1) if anything of the log was lost or damaged.
    #[arg(long)]
    pub strict: bool,
    /// Threads: 1 does everything in turn, 2 reads ahead, 3 also renders in parallel. The results
    /// are the same.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=64))]
    pub threads: Option<u8>,
    /// Use this seed instead of the config's.
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,
    /// Output format of the results.
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Suppresses all output; for commands that consist of runs.
    #[arg(skip)]
    pub quiet: bool,
}

impl RunArgs {
    /// Returns the path of the log.
    pub fn log(&self) -> &Path {
        self.log.as_deref().unwrap_or(Path::new(SAMPLE))
    }
}

/// Path of the simulated log that stands in for a real one.
const SAMPLE: &str = "runs/sample.mcap";
