use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Error of writing results.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The output directory is not empty.
    #[error("{} exists and is not empty; give another directory or --overwrite", path.display())]
    Exists {
        /// Output directory.
        path: PathBuf,
    },
    /// The output path exists and is not a directory.
    #[error("{} is not a directory; results need one of their own", path.display())]
    NotADirectory {
        /// The path.
        path: PathBuf,
    },
    /// The log that is read lies in the output directory.
    #[error(
        "the log {} lies in the output directory {}; give another directory, so that the log \
         cannot be overwritten",
        input.display(),
        output.display()
    )]
    InputInside {
        /// Path of the log.
        input: PathBuf,
        /// Output directory.
        output: PathBuf,
    },
    /// A file could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// The MCAP writer failed.
    #[error("cannot write {}: {source}", path.display())]
    Mcap {
        /// Path of the file.
        path: PathBuf,
        /// Cause.
        source: Box<mcap::McapError>,
    },
}

impl WriteError {
    /// Returns true if the request is not allowed, as opposed to a disk that failed.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Exists { .. } | Self::NotADirectory { .. } | Self::InputInside { .. })
    }

    /// Returns true if the disk has no room.
    pub fn is_disk_full(&self) -> bool {
        let cause = match self {
            Self::Io { source, .. } => source,
            Self::Mcap { source, .. } => match &**source {
                mcap::McapError::Io(source) => source,
                _ => return false,
            },
            _ => return false,
        };
        matches!(cause.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
    }

    pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    pub(super) fn mcap(path: &Path) -> impl FnOnce(mcap::McapError) -> Self + '_ {
        move |source| Self::Mcap { path: path.to_owned(), source: Box::new(source) }
    }
}
