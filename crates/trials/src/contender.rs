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
    /// Where the config's relative paths start.
    pub folder: PathBuf,
}

impl Contender {
    /// A contender whose config names no files.
    pub fn new(name: impl Into<String>, config: impl Into<String>) -> Self {
        Self { name: name.into(), config: config.into(), folder: PathBuf::new() }
    }

    /// Builds the pipeline anew, with nothing left over from earlier trials.
    ///
    /// # Errors
    /// [`TrialError::Config`] with the place of the mistake.
    pub fn pipeline(&self, registry: &Registry, seed: u64) -> Result<Pipeline, TrialError> {
        // The seed of the scene: each draw gives the plugins other random numbers, too.
        let source = ConfigSource::from_text(&*self.config, &self.folder).with_name(&self.name);
        let built = Pipeline::builder(registry).seed(seed).build(&source);
        built.map_err(|error| TrialError::Config(error.to_string()))
    }
}
