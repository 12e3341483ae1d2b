use std::path::PathBuf;

use tagalong_config::Registry;
use tagalong_pipeline::{ConfigSource, Pipeline};

use crate::TrialError;

/// A pipeline that takes part in trials.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contender {
    /// Name in tables.
    pub name: String,
    /// Its config, TOML.
    pub config: String,
    /// Base folder of the config's relative paths.
    pub folder: PathBuf,
}

impl Contender {
    /// Creates a contender whose config names no files.
    pub fn new(name: impl Into<String>, config: impl Into<String>) -> Self {
        Self { name: name.into(), config: config.into(), folder: PathBuf::new() }
    }

    /// Builds a new pipeline, without any state from earlier trials.
    ///
    /// # Errors
    /// [`TrialError::Config`] with the position of the mistake.
    pub fn pipeline(&self, registry: &Registry, seed: u64) -> Result<Pipeline, TrialError> {
        // The seed is that of the scene, so that each draw also gives the plugins other random
        // numbers.
        let source = ConfigSource::from_text(&*self.config, &self.folder).with_name(&self.name);
        let built = Pipeline::builder(registry).seed(seed).build(&source);
        built.map_err(|error| TrialError::Config(error.to_string()))
    }
}
