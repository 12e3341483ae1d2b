use std::path::{Path, PathBuf};

use clap::Args;
use tagalong_app::format::Format;

/// Arguments of `tagalong run`.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// The pipeline, a TOML file or the name of a built-in one: depth-verified, depth-ekf,
    /// depth-net-ekf, stereo-verified, stereo-street, omni-rich, mono, laser-legs,
    /// laser-follow [default: the one for what the log has].
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
    /// Returns the path of the log: a single path is that of the log if it looks like one.
    pub fn log(&self) -> &Path {
        let single = self.config.as_deref().filter(|path| is_log(path));
        self.log.as_deref().or(single).unwrap_or(Path::new(SAMPLE))
    }

    /// Returns true if a log is given.
    pub fn has_log(&self) -> bool {
        self.log.is_some() || self.config.as_deref().is_some_and(is_log)
    }

    /// Returns the config, if one is given.
    pub fn config(&self) -> Option<&Path> {
        self.config.as_deref().filter(|path| self.log.is_some() || !is_log(path))
    }
}

/// Returns true for the path of a log, as opposed to that of a config: an MCAP file, or a folder
/// with one.
fn is_log(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "mcap") || path.is_dir()
}

/// Path of the simulated log that stands in for a real one.
const SAMPLE: &str = "runs/sample.mcap";
