use std::path::PathBuf;

use tagalong_config::Registry;
use tagalong_pipeline::{Options, Pipeline};

use crate::TrialError;

/// Tables of a config that speak of logs and files; here are neither.
const FOREIGN: [&str; 3] = ["input", "limits", "output"];

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
        let foreign = FOREIGN.map(str::to_owned).to_vec();
        let options = Options { foreign, seed: Some(seed), threads: None };
        Pipeline::from_toml_with(&self.config, &self.folder, registry, &options)
            .map(|(pipeline, _)| pipeline)
            .map_err(|error| TrialError::Config(error.render(&self.name, &self.config)))
    }
}
