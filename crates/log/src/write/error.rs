use std::path::{Path, PathBuf};

/// What can go wrong while results are written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The output directory holds something already.
    #[error("{} exists and is not empty; give another directory or --overwrite", path.display())]
    Exists {
        /// The output directory.
        path: PathBuf,
    },
    /// The output path is taken by something that is no directory.
    #[error("{} is not a directory; results need one of their own", path.display())]
    NotADirectory {
        /// The path.
        path: PathBuf,
    },
    /// Writing would endanger the log that is read.
    #[error(
        "the log {} lies in the output directory {}; give another directory, so that the log \
         cannot be overwritten",
        input.display(),
        output.display()
    )]
    InputInside {
        /// The log.
        input: PathBuf,
        /// The output directory.
        output: PathBuf,
    },
    /// A file could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The MCAP writer failed.
    #[error("cannot write {}: {source}", path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// Why.
        source: Box<mcap::McapError>,
    },
}

impl WriteError {
    /// True if the caller asked for something that is not allowed, as opposed
    /// to a disk that failed.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Exists { .. } | Self::NotADirectory { .. } | Self::InputInside { .. })
    }

    pub(super) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| Self::Io { path: path.to_owned(), source }
    }

    pub(super) fn mcap(path: &Path) -> impl FnOnce(mcap::McapError) -> Self + '_ {
        move |source| Self::Mcap { path: path.to_owned(), source: Box::new(source) }
    }
}
