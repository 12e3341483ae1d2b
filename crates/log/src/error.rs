use std::path::PathBuf;

use crate::camera_info::CalibrationError;
use crate::mcap_walk::NotMcap;

/// Why a log cannot be used at all. Damage inside a log is no error: it is
/// skipped and counted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The file cannot be read.
    #[error("cannot open `{}`: {source}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// It is a directory, a pipe or a device.
    #[error("`{}` is {kind}; name a regular .mcap file{remedy}", path.display())]
    NotAFile {
        /// The path.
        path: PathBuf,
        /// What it is.
        kind: &'static str,
        /// What to do about it.
        remedy: &'static str,
    },
    /// It is not MCAP.
    #[error("`{}`: {source}", path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: NotMcap,
    },
    /// Something that the pipeline cannot do without is not in the log.
    #[error("`{}` has no {wanted}{hint}\npresent:\n{present}", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// What was looked for.
        wanted: String,
        /// The nearest name or another way out, or empty.
        hint: String,
        /// The topics of the log, one a line.
        present: String,
    },
    /// A calibration cannot be used.
    #[error("`{}`, topic {topic}: {source}", path.display())]
    Calibration {
        /// The file.
        path: PathBuf,
        /// The topic of the `sensor_msgs/CameraInfo`.
        topic: String,
        /// What is wrong with it.
        source: CalibrationError,
    },
    /// A message of the truth channel cannot be read.
    #[error("`{}`, message {number} on {}: {why}", path.display(), crate::TRUTH_TOPIC)]
    Truth {
        /// The file.
        path: PathBuf,
        /// Which message of the channel, from 1.
        number: usize,
        /// What is wrong with it.
        why: String,
    },
    /// Settings of `[input]` that cannot work.
    #[error("[input] {0}")]
    Settings(String),
}
