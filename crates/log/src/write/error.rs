use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use mcap::McapError;

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
    /// The log that is read is in the output directory.
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
    /// Another run, or another process of this program, is writing there.
    #[error("another run is writing {}; wait until it ends, or give another name", path.display())]
    Busy {
        /// Output directory, or file.
        path: PathBuf,
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
        source: Box<McapError>,
    },
}

impl WriteError {
    /// Returns true if the request is not allowed, as opposed to a failure of the disk.
    pub fn is_refusal(&self) -> bool {
        matches!(
            self,
            Self::Exists { .. }
                | Self::NotADirectory { .. }
                | Self::InputInside { .. }
                | Self::Busy { .. }
        )
    }

    /// Returns true if the disk is full.
    pub fn is_disk_full(&self) -> bool {
        let Self::Io { source, .. } = self else { return false };
        matches!(source.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
    }

    pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    pub(super) fn mcap(path: &Path) -> impl FnOnce(McapError) -> Self + '_ {
        move |source| match source {
            // The header of a record is written by `binrw`, whose errors have the name of parse
            // errors.
            McapError::Io(source) | McapError::Parse(binrw::Error::Io(source)) => {
                Self::io(path)(source)
            }
            other => Self::Mcap { path: path.to_owned(), source: Box::new(other) },
        }
    }
}
