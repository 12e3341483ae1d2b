//! Config files, with the tables outside of the pipeline.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tagalong::logs::{LogSettings, refusal};
use tagalong_config::{Registry, Settings};
use tagalong_log::write::OutputSettings;
use tagalong_log::{InputSettings, Limits, LogError};
use tagalong_pipeline::{BuildError, ConfigSource, Pipeline, ResolvedConfig};

use crate::installed;
use crate::outcome::Failure;
use crate::recorded_boxes::RecordedBoxes;
use crate::suggest::{config_hint, not_a_config};

/// Config that is used if neither a config nor a log is given.
const DEFAULT: &str = "depth-ekf";

/// Text of a config file, with its path.
#[derive(Clone)]
pub struct ConfigFile {
    source: ConfigSource,
}

/// Tables of a config outside of the pipeline.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OuterSettings {
    /// `[input]`: topics and frames of the images.
    pub input: InputSettings,
    /// `[limits]`: maximum sizes of the parts of a log.
    pub limits: Limits,
    /// `[output]`: contents of the output files.
    pub output: OutputSettings,
}

/// Placeholder for the name of the log in the text of a config.
const LOG_PLACE: &str = "{log}";

impl ConfigFile {
    /// Reads a config: a file, the name of a built-in one, or that of an installed network.
    ///
    /// # Errors
    /// A file that is missing, unreadable, too long or not text: exit code 2.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        match ConfigSource::open(path) {
            Ok(source) => Ok(Self { source }),
            Err(error) => {
                let installed = path.to_str().and_then(installed::config_file);
                let source = installed.map(ConfigSource::from_file).unwrap_or(Err(error));
                Ok(Self { source: source? })
            }
        }
    }

    /// Returns the config with this text; its relative paths are resolved against `folder`.
    pub fn of_text(text: String, folder: &Path) -> Self {
        Self { source: ConfigSource::from_text(text, folder) }
    }

    /// Returns the config that is used if neither a config nor a log is given.
    ///
    /// # Errors
    /// None in an intact program, because the config is part of it.
    pub fn built_in() -> Result<Self, Failure> {
        Ok(Self { source: ConfigSource::builtin(DEFAULT)? })
    }

    /// Returns the names of the built-in configs.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        ConfigSource::builtin_names()
    }

    /// Returns the built-in config with this name, or the one that has this path in a clone, or the
    /// config of an installed network; `None` if there is none.
    pub fn named(name: &str) -> Option<Self> {
        let source = ConfigSource::builtin(name).ok();
        let source = source.or_else(|| ConfigSource::from_file(installed::config_file(name)?).ok());
        Some(Self { source: source? })
    }

    /// Returns the name of the file without folder and extension.
    pub fn stem(&self) -> String {
        self.source.stem()
    }

    /// Returns the name of the file without folder.
    pub fn name(&self) -> String {
        self.source.path().file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns the config with another text at the same path, so that it refers to the same files.
    pub fn with_text(&self, text: String) -> Self {
        Self { source: self.source.with_text(text) }
    }

    /// Returns true if the text contains the placeholder for the name of a log.
    pub fn differs_by_log(&self) -> bool {
        self.source.text().contains(LOG_PLACE)
    }

    /// Returns the config for a log: `{log}` in its text is replaced by the name of the log without
    /// extension.
    #[must_use]
    pub fn on_log(&self, log: &Path) -> Self {
        let name = log.file_stem().unwrap_or_default().to_string_lossy();
        self.with_text(self.source.text().replace(LOG_PLACE, &name))
    }

    /// Checks the values of `[tune]` by building the pipeline with each of them.
    ///
    /// # Errors
    /// A value that its setting does not allow, shown with its line: exit code 2.
    pub fn check_tuning(&self, registry: &Registry) -> Result<(), Failure> {
        let (pipeline, _) = self.pipeline(registry, None)?;
        Ok(pipeline.check_tuning(registry)?)
    }

    /// Returns the folder against which relative paths are resolved.
    pub fn folder(&self) -> &Path {
        self.source.folder()
    }

    /// Returns the SHA-256 of the bytes of this config and of those that it extends.
    pub fn sha256(&self) -> String {
        let mut digest = Sha256::new_with_prefix(self.source.text().as_bytes());
        if let Ok(document) = self.source.document() {
            document.bases().for_each(|(_, text)| digest.update(text.as_bytes()));
        }
        digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Returns true for the built-in config with this name, whatever the file is called, and for
    /// one that extends it.
    pub fn is_or_extends(&self, builtin: &str) -> bool {
        let Ok(shipped) = ConfigSource::builtin(builtin) else { return false };
        if self.source.text() == shipped.text() {
            return true;
        }
        let Ok(document) = self.source.document() else { return false };
        document.bases().any(|(_, text)| text == shipped.text())
    }

    /// Returns the files to which its settings refer, such as models, with the names used there.
    pub fn files(&self) -> Vec<(String, PathBuf)> {
        self.source.files()
    }

    /// Builds the pipeline.
    ///
    /// # Errors
    /// A mistake in the config, shown with its line: exit code 2.
    pub fn pipeline(
        &self,
        registry: &Registry,
        seed: Option<u64>,
    ) -> Result<(Pipeline, ResolvedConfig), Failure> {
        self.pipeline_on(registry, seed, None)
    }

    /// Builds the pipeline as [`ConfigFile::pipeline`] does, for at most this number of threads.
    pub fn pipeline_on(
        &self,
        registry: &Registry,
        seed: Option<u64>,
        threads: Option<usize>,
    ) -> Result<(Pipeline, ResolvedConfig), Failure> {
        let mut builder = Pipeline::builder(registry);
        if let Some(seed) = seed {
            builder = builder.seed(seed);
        }
        if let Some(most) = threads {
            builder = builder.threads(most);
        }
        let pipeline = builder.build(&self.source).map_err(|error| self.explained(error))?;
        let config = pipeline.config().clone();
        Ok((pipeline, config))
    }

    /// Returns the failure for a config that cannot be built; if it names a known network that is
    /// not installed, with the command that installs it.
    fn explained(&self, error: BuildError) -> Failure {
        let settings = self.source.document().and_then(|document| document.table());
        let remedy = settings.ok().as_ref().and_then(installed::missing_model);
        let failure = Failure::from(error);
        match remedy {
            Some(remedy) => {
                Failure { message: format!("{}\n{remedy}", failure.message), ..failure }
            }
            None => failure,
        }
    }

    /// Returns the text of the config together with those that it extends.
    pub fn whole_text(&self) -> String {
        self.source.whole_text()
    }

    /// Returns the tables outside of the pipeline.
    pub fn outer(&self) -> Result<OuterSettings, Failure> {
        Ok(OuterSettings {
            input: self.table("input")?,
            limits: self.table("limits")?,
            output: self.table("output")?,
        })
    }

    /// Returns the tables outside of the pipeline, with the obstacle sources of its collision
    /// monitor as part of the input.
    pub fn outer_for(&self, pipeline: &Pipeline) -> Result<OuterSettings, Failure> {
        let LogSettings { input, limits, .. } = LogSettings::of(pipeline)?;
        Ok(OuterSettings { input, limits, output: pipeline.config().table("output")? })
    }

    /// Returns a note for each list that replaces an inherited one as a whole, because changing one
    /// setting this way loses all others; and on recorded boxes whose IDs are ignored. The config
    /// that is written for an installed network replaces its lists on purpose.
    pub fn notes(&self) -> Result<Vec<String>, Failure> {
        let installed = installed::config_file(&self.stem());
        if installed.is_some_and(|path| path == self.source.path()) {
            return Ok(Vec::new());
        }
        let replaced = self.source.document().and_then(|document| document.replaced_lists());
        let mut notes = Vec::new();
        for (list, own, inherited) in replaced.map_err(|error| self.source.mistake(&error))? {
            let name = self.name();
            let own = if own == 1 {
                format!("the [[{list}]] of {name} replaces")
            } else {
                format!("the {own} [[{list}]] of {name} replace")
            };
            notes.push(format!(
                "{own} all {inherited} of the config that it extends; to change one setting, write \
                 `{list}.0.config.KEY = VALUE`, counted from 0"
            ));
        }
        notes.extend(RecordedBoxes::of(self).iter().filter_map(RecordedBoxes::note));
        Ok(notes)
    }

    /// Reads one top-level table, with positions for its errors.
    fn table<T: Settings>(&self, name: &str) -> Result<T, BuildError> {
        self.source.table(name)
    }
}

impl From<BuildError> for Failure {
    /// Converts the error of a config: exit code 2. For a config that does not exist it adds a
    /// suggestion.
    fn from(error: BuildError) -> Self {
        if let BuildError::Unreadable { path, kind: ErrorKind::NotFound, .. } = &error
            && let Some(remedy) = path.to_str().and_then(installed::missing_network)
        {
            return Self::usage(remedy);
        }
        if let BuildError::Unreadable { path, .. } = &error
            && let Some(why) = not_a_config(path)
        {
            return Self::usage(why);
        }
        let hint = match &error {
            // A config in the directory is suggested: `x` stands for any name in it.
            BuildError::Unreadable { path, kind: ErrorKind::IsADirectory, .. } => {
                config_hint(&path.join("x"))
            }
            BuildError::Unreadable { path, kind: ErrorKind::NotFound, .. } => config_hint(path),
            _ => String::new(),
        };
        Self::usage(error.to_string() + &hint)
    }
}

impl From<tagalong::Error> for Failure {
    fn from(error: tagalong::Error) -> Self {
        match error {
            tagalong::Error::Config(error) => error.into(),
            tagalong::Error::Log(error) => error.into(),
            other => Self::failed(other),
        }
    }
}

/// Returns the failure for a log that does not fit a config. For a topic of the wrong kind it shows
/// the line of the config that names it.
pub fn refused_log(error: LogError, config: &ResolvedConfig) -> Failure {
    refusal(error, config).into()
}

impl OuterSettings {
    /// Returns the config of a pipeline with these tables in place of its own.
    ///
    /// # Errors
    /// Settings that cannot be written as TOML: exit code 1.
    pub fn resolved_with(&self, config: &ResolvedConfig) -> Result<ResolvedConfig, Failure> {
        config.with_tables(self).map_err(Failure::failed)
    }
}

#[cfg(test)]
mod tests {
    use tagalong_log::{ObstacleKind, ObstacleTopic};

    use super::*;

    #[test]
    fn a_known_network_that_is_not_installed_is_answered_with_its_command() {
        let why = refusal_of("movenet-multipose");
        assert!(why.contains("`tagalong model --install movenet-multipose.onnx`"), "{why}");
        let why = refusal_of("own");
        assert!(!why.contains("--install"), "{why}");
    }

    /// The message of a config that names this network, which no file holds.
    fn refusal_of(model: &str) -> String {
        let registry = tagalong_catalog::registry();
        let folder = tempfile::tempdir().expect("a folder");
        let text = format!(
            "[[detectors]]\nplugin = 'onnx'\nconfig = {{ model = '{model}' }}\n\
             [filter]\nplugin = 'image-kalman'\n"
        );
        let config = ConfigFile::of_text(text, folder.path());
        config.pipeline(&registry, None).err().expect("a refusal").message
    }

    #[test]
    fn sources_of_obstacles_reach_the_input() {
        let text = "extends = 'follow-depth.toml'\n[[collision_monitor.sources]]\nname = 'sonar'\n\
                    type = 'range'\ntopic = '/sonar'\nmount = [0.3, 0, 0.2, 0, 0, 90]\n\
                    [[collision_monitor.sources]]\nname = 'rear'\ntype = 'depth'\n\
                    topic = '/rear/depth'\ninfo_topic = '/rear/info'\n";
        let registry = tagalong_catalog::registry();
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
        let config = ConfigFile::of_text(text.to_owned(), &folder);
        let (pipeline, _) = config.pipeline(&registry, None).unwrap();
        assert!(config.outer().unwrap().input.sources.is_empty());
        let outer = config.outer_for(&pipeline).unwrap();
        let mount = Some([0.3, 0.0, 0.2, 0.0, 0.0, 90.0]);
        let sonar = ObstacleTopic::new("sonar", ObstacleKind::Range, "/sonar");
        let rear = ObstacleTopic::new("rear", ObstacleKind::Depth, "/rear/depth");
        let expected = [
            ObstacleTopic { mount, ..sonar },
            ObstacleTopic { info_topic: Some("/rear/info".to_owned()), ..rear },
        ];
        assert_eq!(outer.input.sources, expected);
        // They are keys of the collision monitor, and none of the input.
        let resolved = outer.resolved_with(pipeline.config()).unwrap();
        let input = resolved.values()["input"].to_string();
        assert!(!input.contains("sonar"), "{input}");
    }
}
