/// What can go wrong while a plugin works on a frame.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The frame lacks an image that the plugin cannot do without.
    #[error("needs a {what} image, which this log does not carry")]
    MissingImage {
        /// The kind of image, for example "depth".
        what: &'static str,
    },
    /// A model file could not be used.
    #[error("model file `{path}`: {why}")]
    Model {
        /// The file as named in the config.
        path: String,
        /// What is wrong with it.
        why: String,
    },
    /// Settings that parse but cannot work.
    #[error("{0}")]
    Settings(String),
    /// Anything else, in a sentence.
    #[error("{0}")]
    Other(String),
}

/// The result of a plugin's work.
pub type Result<T> = std::result::Result<T, Error>;
