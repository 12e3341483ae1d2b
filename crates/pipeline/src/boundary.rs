use std::panic::{AssertUnwindSafe, catch_unwind};

use tagalong_core::{Error, Frame};

/// Why a frame could not be processed. A pipeline that returned one is stopped.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum StepError {
    /// A plugin refused the frame, for example because the log lacks an image.
    #[error("frame {frame}: `{plugin}` {error}")]
    Plugin {
        /// The plugin.
        plugin: String,
        /// Index of the frame.
        frame: u64,
        /// What it said.
        error: Error,
    },
    /// A plugin panicked: a mistake in its code.
    #[error("frame {frame}: `{plugin}` panicked: {message}; please report this to its author")]
    Panic {
        /// The plugin.
        plugin: String,
        /// Index of the frame.
        frame: u64,
        /// The panic's message.
        message: String,
    },
    /// The pipeline failed on an earlier frame.
    #[error("the pipeline stopped at frame {frame}; build it anew to go on")]
    Stopped {
        /// The frame on which it failed.
        frame: u64,
    },
}

impl StepError {
    /// Tells an image that nothing declares from one that the log lacks; `frame` is the
    /// one that came, with the images that were held back.
    pub(crate) fn blame_declaration(self, frame: &Frame) -> Self {
        match self {
            Self::Plugin { plugin, frame: index, error: Error::MissingImage { input } }
                if frame.holds(input) =>
            {
                let error = Error::UndeclaredImage { input };
                Self::Plugin { plugin, frame: index, error }
            }
            other => other,
        }
    }

    /// The frame that failed.
    pub fn frame(&self) -> u64 {
        match self {
            Self::Plugin { frame, .. } | Self::Panic { frame, .. } | Self::Stopped { frame } => {
                *frame
            }
        }
    }
}

/// As [`guard`], for calls that return no errors of their own.
pub(crate) fn contain<T>(
    plugin: &str,
    frame: u64,
    call: impl FnOnce() -> T,
) -> Result<T, StepError> {
    guard(plugin, frame, || Ok(call()))
}

/// Calls into a plugin: errors get its name and the frame, panics become errors.
pub(crate) fn guard<T>(
    plugin: &str,
    frame: u64,
    call: impl FnOnce() -> tagalong_core::Result<T>,
) -> Result<T, StepError> {
    let plugin = || plugin.to_owned();
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(error)) => Err(StepError::Plugin { plugin: plugin(), frame, error }),
        Err(panic) => {
            let message = panic
                .downcast_ref::<&str>()
                .map(|text| (*text).to_owned())
                .or_else(|| panic.downcast_ref::<String>().cloned())
                .unwrap_or_else(|| "no message".to_owned());
            Err(StepError::Panic { plugin: plugin(), frame, message })
        }
    }
}
