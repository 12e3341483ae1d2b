use crate::Input;

/// Failure of a plugin at a frame or at its settings.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The frame lacks an image that the plugin requires.
    #[error("needs {input}, which this frame does not have")]
    MissingImage {
        /// The kind of image.
        input: Input,
    },
    /// A plugin requested an image that the log carries, but no plugin of the pipeline declares
    /// (see [`crate::Inputs`]).
    #[error(
        "uses {input} without declaring them: add `Input::{input:?}` to the inputs that the plugin \
         returns"
    )]
    UndeclaredImage {
        /// The kind of image.
        input: Input,
    },
    /// A model file could not be used.
    #[error("model file `{path}`: {why}")]
    Model {
        /// The file, as it was looked for.
        path: String,
        /// The cause.
        why: String,
    },
    /// A setting that parses but cannot work.
    #[error("`{key}` {why}")]
    Settings {
        /// The key, dotted where it stands in a table.
        key: String,
        /// Condition on it, and its value.
        why: String,
    },
    /// Any other failure, as a sentence.
    #[error("{0}")]
    Other(String),
}

/// Result of a call to a plugin.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Creates the error of a setting that cannot work: "`key` must be ...".
    pub fn setting(key: impl Into<String>, why: impl Into<String>) -> Self {
        Self::Settings { key: key.into(), why: why.into() }
    }
}
