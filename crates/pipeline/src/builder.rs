use std::path::{Path, PathBuf};

use tagalong_config::Registry;

use crate::config::Options;
use crate::{BuildError, ConfigSource, Pipeline};

/// Builder of pipelines from the plugins of a registry.
#[derive(Clone)]
#[must_use = "it builds nothing until it gets a config"]
pub struct PipelineBuilder<'r> {
    registry: &'r Registry,
    options: Options,
    folder: PathBuf,
}

impl Pipeline {
    /// Returns a builder of pipelines from the plugins of a registry.
    pub fn builder(registry: &Registry) -> PipelineBuilder<'_> {
        PipelineBuilder { registry, options: Options::default(), folder: PathBuf::new() }
    }

    /// Builds a pipeline from one of the built-in configs; [`ConfigSource::builtin_names`] has their
    /// names.
    ///
    /// # Errors
    /// [`BuildError::UnknownName`], with the nearest name.
    #[cfg(feature = "plugins")]
    pub fn builtin(name: &str) -> Result<Self, BuildError> {
        Self::builder(&builtin_registry()).builtin(name)
    }

    /// Builds a pipeline from a config file. Paths in it are relative to the folder of the file.
    ///
    /// # Errors
    /// A file that cannot be read, and a mistake in it, with the line and the remedy.
    #[cfg(feature = "plugins")]
    pub fn from_toml_file(path: impl AsRef<Path>) -> Result<Self, BuildError> {
        Self::builder(&builtin_registry()).from_toml_file(path)
    }

    /// Builds a pipeline from the text of a config. Paths in it are relative to the current folder.
    ///
    /// # Errors
    /// A mistake in the text, with the line and the remedy.
    #[cfg(feature = "plugins")]
    pub fn from_toml(text: &str) -> Result<Self, BuildError> {
        Self::builder(&builtin_registry()).from_toml(text)
    }
}

/// Returns a registry with every plugin of Tagalong, to which a program may add its own.
#[cfg(feature = "plugins")]
pub fn builtin_registry() -> Registry {
    let mut registry = Registry::default();
    register_plugins(&mut registry);
    registry
}

/// Registers every plugin of Tagalong.
#[cfg(feature = "plugins")]
pub fn register_plugins(registry: &mut Registry) {
    tagalong_catalog::register(registry);
}

impl PipelineBuilder<'_> {
    /// Sets the seed, instead of that of the config.
    pub fn seed(mut self, seed: u64) -> Self {
        self.options.seed = Some(seed);
        self
    }

    /// Sets the greatest number of threads of stereo matching; the results do not depend on it.
    pub fn threads(mut self, most: usize) -> Self {
        self.options.threads = Some(most);
        self
    }

    /// Sets the folder to which paths in the text of [`PipelineBuilder::from_toml`] are relative.
    pub fn folder(mut self, folder: impl AsRef<Path>) -> Self {
        self.folder = folder.as_ref().to_owned();
        self
    }

    /// Lets configs have a top-level table that belongs to the caller, beside `[input]`, `[limits]` and
    /// `[output]`; [`crate::ResolvedConfig::table`] reads it.
    pub fn foreign_table(mut self, name: &str) -> Self {
        self.options.foreign.push(name.to_owned());
        self
    }

    /// Builds a pipeline from one of the built-in configs.
    ///
    /// # Errors
    /// [`BuildError::UnknownName`], and [`BuildError::Mistake`] where the registry lacks one of its
    /// plugins.
    pub fn builtin(&self, name: &str) -> Result<Pipeline, BuildError> {
        self.build(&ConfigSource::builtin(name)?)
    }

    /// Builds a pipeline from a config file. Paths in it are relative to the folder of the file.
    ///
    /// # Errors
    /// A file that cannot be read, and a mistake in it, with the line and the remedy.
    pub fn from_toml_file(&self, path: impl AsRef<Path>) -> Result<Pipeline, BuildError> {
        self.build(&ConfigSource::from_file(path)?)
    }

    /// Builds a pipeline from the text of a config.
    ///
    /// # Errors
    /// A mistake in the text, with the line and the remedy.
    pub fn from_toml(&self, text: &str) -> Result<Pipeline, BuildError> {
        self.build(&ConfigSource::from_text(text, &self.folder))
    }

    /// Builds a pipeline from a config that was read before.
    ///
    /// # Errors
    /// A mistake in the config, with the line and the remedy.
    pub fn build(&self, source: &ConfigSource) -> Result<Pipeline, BuildError> {
        Pipeline::from_source(source, self.registry, &self.options)
            .map_err(|error| source.mistake(&error))
    }
}
