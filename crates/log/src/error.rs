use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::camera_info::CalibrationError;

/// Error for a file that is not a container of messages, as a sentence without the name of the
/// file.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct NotMcap(pub String);

/// Reason why a log cannot be used at all. Damage inside a log is not an error: it is skipped and
/// counted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The file cannot be read.
    #[error("cannot open `{}`: {source}", path.display())]
    Open {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The path is a directory, a pipe or a device.
    #[error("`{}` is {kind}; name a regular .mcap file{remedy}", path.display())]
    NotAFile {
        /// The path.
        path: PathBuf,
        /// Kind of the path.
        kind: &'static str,
        /// Advice for the user.
        remedy: Cow<'static, str>,
    },
    /// The file is compressed and cannot be unpacked.
    #[error("`{}` is compressed: {why}", path.display())]
    Packed {
        /// Path of the file.
        path: PathBuf,
        /// Reason, with the remedy.
        why: String,
    },
    /// The file is not MCAP.
    #[error("`{}`: {source}", path.display())]
    NotMcap {
        /// Path of the file.
        path: PathBuf,
        /// Start of the file.
        source: NotMcap,
    },
    /// A topic or calibration that the pipeline requires is not in the log.
    #[error("`{}` has no {wanted}{hint}\npresent:\n{present}", path.display())]
    Missing {
        /// Path of the file.
        path: PathBuf,
        /// Missing topic or calibration.
        wanted: String,
        /// Most similar name or other advice; may be empty.
        hint: String,
        /// Topics of the log, one per line.
        present: String,
    },
    /// A topic that the settings name is not in the log.
    #[error("`{}` has no topic `{topic}` fit for `{key}` of [input]{hint}\npresent:\n{present}", path.display())]
    UnknownTopic {
        /// Path of the file.
        path: PathBuf,
        /// Key under `[input]`.
        key: String,
        /// The topic.
        topic: String,
        /// Most similar name; may be empty. It is boxed, because every result is as large as the
        /// largest variant.
        hint: Box<str>,
        /// Topics of the log, one per line.
        present: String,
    },
    /// A topic that the settings name has messages of another kind.
    #[error("`{}`: `{key}` under [input] names {topic}, which is {kind}; {remedy}", path.display())]
    WrongTopic {
        /// Path of the file.
        path: PathBuf,
        /// Key under `[input]`.
        key: String,
        /// Topic with that name.
        topic: String,
        /// Type and encoding of its messages.
        kind: String,
        /// Advice for the user.
        remedy: String,
    },
    /// The topic of an obstacle source has messages of another type.
    #[error("`{}`: source `{name}` of [[collision_monitor.sources]] names {why}", path.display())]
    Source {
        /// Path of the file.
        path: PathBuf,
        /// Name of the obstacle source.
        name: String,
        /// Topic and type of its messages, with the types that the source reads.
        why: String,
    },
    /// A calibration cannot be used.
    #[error("`{}`, topic {topic}: {source}", path.display())]
    Calibration {
        /// Path of the file.
        path: PathBuf,
        /// Topic of the `sensor_msgs/CameraInfo`.
        topic: String,
        /// Reason.
        source: CalibrationError,
    },
    /// A message of the truth channel cannot be read.
    #[error("`{}`, message {number} on {}: {why}", path.display(), crate::TRUTH_TOPIC)]
    Truth {
        /// Path of the file.
        path: PathBuf,
        /// Number of the message in the channel, from 1.
        number: usize,
        /// Reason.
        why: String,
    },
    /// A log of scans with annotated legs is not complete.
    #[error("`{}`: {why}", path.display())]
    LegScans {
        /// Path of the file.
        path: PathBuf,
        /// Reason.
        why: String,
    },
    /// The settings of `[input]` are invalid.
    #[error("[input] {0}")]
    Settings(String),
}

impl LogError {
    /// Returns a function that converts the cause to the error for a path that cannot be opened or
    /// read.
    pub(crate) fn opening(path: &Path) -> impl Fn(std::io::Error) -> Self {
        move |source| Self::Open { path: path.to_owned(), source }
    }
}
