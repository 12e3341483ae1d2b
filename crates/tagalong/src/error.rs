use std::fmt;

use tagalong_pipeline::{BuildError, EnrollmentError, MissingSource, StepError};

/// Failure of a pipeline, a log, or a frame. Its text names the object, the cause and the remedy; for
/// a config also the file and the line.
///
/// The `Debug` form is the same text, because `fn main() -> tagalong::Result<()>` prints that.
#[derive(thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A config from which no pipeline can be built.
    #[error(transparent)]
    Config(#[from] BuildError),
    /// A log that cannot be used at all.
    #[cfg(feature = "logs")]
    #[error(transparent)]
    Log(#[from] tagalong_log::LogError),
    /// A log that is partly lost; the frames before this error are intact.
    #[cfg(feature = "logs")]
    #[error(
        "`{}`: part of the log was lost: {notes}; record it again or look for a whole copy, or accept \
         the loss with `Frames::accept_loss`",
        log.display()
    )]
    Damaged {
        /// The log.
        log: std::path::PathBuf,
        /// The part of the log that is lost, and where it was.
        notes: String,
    },
    /// A controller lacks a source of data that it needs to drive.
    #[error(transparent)]
    Source(#[from] MissingSource),
    /// Images, a pose or a scan from which no frame can be made.
    #[error("the frame at {stamp} s: {why}")]
    Frame {
        /// Time of the frame, s.
        stamp: tagalong_core::Stamp,
        /// The cause and the remedy.
        why: String,
    },
    /// A plugin failed at a frame.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A plugin refuses its settings or an input.
    #[error(transparent)]
    Plugin(#[from] tagalong_core::Error),
    /// The chosen person cannot be followed.
    #[error(transparent)]
    Enrollment(#[from] EnrollmentError),
}

/// Result of a call of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_ends_with_an_error_prints_its_text() {
        let error = Error::from(MissingSource::Odometry);
        assert_eq!(format!("{error:?}"), MissingSource::Odometry.to_string());
    }
}
