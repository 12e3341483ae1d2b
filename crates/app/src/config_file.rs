//! Config files, with the tables that are not the pipeline's.

use std::io::ErrorKind;
use std::ops::Range;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tagalong_config::{ConfigError, FileLimit, Registry, Settings, parse_settings, read_text};
use tagalong_log::write::OutputSettings;
use tagalong_log::{InputSettings, Limits, LogError, ObstacleKind, ObstacleTopic};
use tagalong_pipeline::{
    Document, Options, Pipeline, RunSettings, SourceKind, SourceSettings, check_tuning, flattened,
    flattened_with,
};

use crate::outcome::Failure;
use crate::serialize::to_toml;
use crate::suggest::config_hint;

/// Names and texts of configs.
macro_rules! configs {
    ($($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../../configs/", $name, ".toml")))),*]
    };
}

/// Configs that need no file: all of the folder but those with a model in a file of its own.
const BUILT_IN: &[(&str, &str)] = configs! {
    "depth-alone"
    "depth-color-ekf"
    "depth-ekf"
    "depth-ekf-follow"
    "depth-jpda"
    "depth-laser"
    "depth-net-ekf"
    "depth-sprt"
    "depth-svm-ekf"
    "depth-two-stage"
    "depth-verified"
    "follow-arc"
    "follow-depth"
    "follow-depth-near"
    "follow-low"
    "follow-sonar"
    "joint-particle"
    "joint-particle-all"
    "joint-particle-kde30"
    "joint-particle-kde50"
    "joint-particle-table"
    "laser-follow"
    "laser-legs"
    "mono"
    "naive"
    "omni-appearance"
    "omni-ekf"
    "omni-rich"
    "particle-verified"
    "recorded"
    "recorded-observation-centric"
    "rgbd-compressive"
    "rgbd-detector"
    "rgbd-ekf"
    "rgbd-faces"
    "rgbd-follow"
    "rgbd-kalman"
    "rgbd-upper-bodies"
    "stereo-ekf"
    "stereo-follow"
    "stereo-particle"
    "stereo-street"
    "stereo-svm-ekf"
    "stereo-verified"
};

/// Text of a config file, with its path.
pub struct ConfigFile {
    path: PathBuf,
    text: String,
}

fn built_in_text(name: &str) -> Option<&'static str> {
    BUILT_IN.iter().find(|(built_in, _)| *built_in == name).map(|(_, text)| *text)
}

/// Tables of a config that are not the pipeline's.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OuterSettings {
    /// `[input]`: topics and frames of the images.
    pub input: InputSettings,
    /// `[limits]`: largest sizes of a log's parts.
    pub limits: Limits,
    /// `[output]`: contents of the output files.
    pub output: OutputSettings,
}

impl ConfigFile {
    /// Reads a config: a file, or the name of a built-in one.
    ///
    /// # Errors
    /// A file that is missing, unreadable, too long or no text: exit code 2.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let shown = path.display();
        let error = match read_text(path, FileLimit::Config) {
            Ok(text) => return Ok(Self { path: path.to_owned(), text }),
            Err(error) => error,
        };
        Err(Failure::usage(match error.kind() {
            // A config in the directory is suggested: `x` stands for any name in it.
            ErrorKind::IsADirectory => {
                format!("{shown} is a directory, not a config") + &config_hint(&path.join("x"))
            }
            ErrorKind::InvalidData => format!("{shown} is not UTF-8 text, so no config"),
            ErrorKind::FileTooLarge => format!("{shown}: a config {error}"),
            ErrorKind::NotFound => {
                if let Some(built_in) = path.to_str().and_then(Self::named) {
                    return Ok(built_in);
                }
                format!("cannot read config {shown}: {error}") + &config_hint(path)
            }
            _ => format!("cannot read config {shown}: {error}"),
        }))
    }

    /// Returns the config of a text, whose relative paths are resolved against `folder`.
    pub fn of_text(text: String, folder: &Path) -> Self {
        Self { path: folder.join("config.toml"), text }
    }

    /// Returns the config that is used where neither a config nor a log is given.
    pub fn built_in() -> Self {
        Self::new("depth-ekf", include_str!("../../../configs/depth-ekf.toml"))
    }

    /// Returns the names of the built-in configs.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// Returns the built-in config of a name, or of the file that it is in a clone; `None` if there
    /// is none.
    pub fn named(name: &str) -> Option<Self> {
        let file = name.strip_prefix("configs/");
        let name = file.map_or(Some(name), |file| file.strip_suffix(".toml"))?;
        let text = built_in_text(name)?;
        // Those that it extends are built in, too.
        let read_base = |path: &Path| {
            let base = path.file_stem().and_then(|stem| built_in_text(&stem.to_string_lossy()));
            base.map(str::to_owned).ok_or(ErrorKind::NotFound.into())
        };
        let whole = flattened_with(text, Path::new("configs"), &read_base);
        Some(Self::new(name, whole.as_deref().unwrap_or(text)))
    }

    fn new(name: &str, text: &str) -> Self {
        Self { path: format!("configs/{name}.toml").into(), text: text.to_owned() }
    }

    /// Returns its name without folder and extension.
    pub fn stem(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns its name without folder.
    pub fn name(&self) -> String {
        self.path.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns the config with another text at the same path, so that it names the same files.
    pub fn with_text(&self, text: String) -> Self {
        Self { path: self.path.clone(), text }
    }

    /// Checks the values of `[tune]` by building the pipeline with each of them.
    ///
    /// # Errors
    /// A value that its setting does not allow, shown with its line: exit code 2.
    pub fn check_tuning(&self, registry: &Registry) -> Result<(), Failure> {
        let (pipeline, settings) = self.pipeline(registry, None)?;
        check_tuning(&settings.tune, &pipeline, self.folder(), registry, &options(None, None))
            .map_err(|error| self.mistake(&error))
    }

    /// Returns the folder against which relative paths are resolved.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// SHA-256 of its bytes, and of those of the configs that it extends.
    pub fn sha256(&self) -> String {
        let mut digest = Sha256::new_with_prefix(self.text.as_bytes());
        if let Ok(document) = self.document() {
            document.bases().for_each(|(_, text)| digest.update(text.as_bytes()));
        }
        digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Returns the files that its settings name, such as models, with the name used there.
    pub fn files(&self) -> Vec<(String, PathBuf)> {
        let Ok(table) = self.document().and_then(|document| document.table()) else {
            return Vec::new();
        };
        let folder = self.folder();
        let mut names = Vec::new();
        strings(&toml::Value::Table(table), &mut names);
        let named = names.into_iter().map(|name| (folder.join(&name), name));
        // Plugins alone know which texts are paths; a text that names a file counts as one.
        named.filter(|(path, _)| path.is_file()).map(|(path, name)| (name, path)).collect()
    }

    /// Builds the pipeline of other text at the same path, for example of the resolved config with
    /// another value.
    ///
    /// # Errors
    /// A mistake in the text.
    pub fn variant(&self, text: &str, registry: &Registry) -> Result<Pipeline, ConfigError> {
        let built = Pipeline::from_toml_with(text, self.folder(), registry, &options(None, None));
        built.map(|(pipeline, _)| pipeline)
    }

    /// Builds the pipeline.
    ///
    /// # Errors
    /// A mistake in the config, shown with its line: exit code 2.
    pub fn pipeline(
        &self,
        registry: &Registry,
        seed: Option<u64>,
    ) -> Result<(Pipeline, RunSettings), Failure> {
        self.pipeline_on(registry, seed, None)
    }

    /// Builds the pipeline as [`ConfigFile::pipeline`] does, for at most so many threads.
    ///
    /// # Errors
    /// As for [`ConfigFile::pipeline`].
    pub fn pipeline_on(
        &self,
        registry: &Registry,
        seed: Option<u64>,
        threads: Option<usize>,
    ) -> Result<(Pipeline, RunSettings), Failure> {
        Pipeline::from_toml_with(&self.text, self.folder(), registry, &options(seed, threads))
            .map_err(|error| self.mistake(&error))
    }

    /// Returns its text with those of the configs that it extends.
    pub fn whole_text(&self) -> String {
        // A mistake shows its line when the pipeline is built from the text as it is.
        flattened(&self.text, self.folder()).unwrap_or_else(|_| self.text.clone())
    }

    /// Returns the tables that are not the pipeline's.
    ///
    /// # Errors
    /// As for [`ConfigFile::pipeline`].
    pub fn outer(&self) -> Result<OuterSettings, Failure> {
        let read = || -> Result<OuterSettings, ConfigError> {
            Ok(OuterSettings {
                input: self.table("input")?,
                limits: self.table("limits")?,
                output: self.table("output")?,
            })
        };
        read().map_err(|error| self.mistake(&error))
    }

    /// Returns the tables that are not the pipeline's, with the sources of obstacles that its collision
    /// monitor asks for as part of the input.
    ///
    /// # Errors
    /// As for [`ConfigFile::pipeline`].
    pub fn outer_for(&self, pipeline: &Pipeline) -> Result<OuterSettings, Failure> {
        let mut outer = self.outer()?;
        outer.input.sources = pipeline.obstacle_sources().iter().map(obstacle_topic).collect();
        Ok(outer)
    }

    /// Reads one top-level table, with spans for its mistakes.
    fn table<T: Settings>(&self, name: &str) -> Result<T, ConfigError> {
        let document = self.document()?;
        let table = document.root()?.remove(name);
        parse_settings(table).map_err(|error| document.locate(error))
    }

    fn document(&self) -> Result<Document, ConfigError> {
        Document::read(&self.text, self.folder())
    }

    /// Returns the failure of a log that does not fit the config: a topic of a wrong kind is shown
    /// with the line that names it.
    pub fn refusal(&self, error: LogError) -> Failure {
        let LogError::WrongTopic { key, .. } = &error else { return error.into() };
        match self.place_of_input(key) {
            Some(place) => self.mistake(&place.into_error(error.to_string())),
            None => error.into(),
        }
    }

    /// Returns the place of a key under `[input]`.
    fn place_of_input(&self, key: &str) -> Option<Place> {
        let document = self.document().ok()?;
        let span = {
            let root = document.root().ok()?;
            let input = root.get("input")?;
            let keys = || key.split('.');
            let found = keys().try_fold(input, |at, part| at.get_ref().as_table()?.get(part));
            found?.span()
        };
        Some(Place { document, span })
    }

    fn mistake(&self, error: &ConfigError) -> Failure {
        Failure::usage(error.render(&self.path.display().to_string(), &self.text))
    }
}

/// Place in a config or in one that it extends.
struct Place {
    document: Document,
    span: Range<usize>,
}

impl Place {
    /// Returns the error at this place.
    fn into_error(self, message: String) -> ConfigError {
        self.document.locate(ConfigError { message, span: Some(self.span) })
    }
}

/// Returns the topic of a source of obstacles.
fn obstacle_topic(source: &SourceSettings) -> ObstacleTopic {
    ObstacleTopic {
        name: source.name.clone(),
        kind: match source.kind {
            SourceKind::Scan => ObstacleKind::Scan,
            SourceKind::Depth => ObstacleKind::Depth,
            SourceKind::Range => ObstacleKind::Range,
            SourceKind::Bumper => ObstacleKind::Bumper,
        },
        topic: source.topic.clone(),
        info_topic: Some(source.info_topic.clone()).filter(|topic| !topic.is_empty()),
        mount: source.mount,
    }
}

fn options(seed: Option<u64>, threads: Option<usize>) -> Options {
    Options { foreign: OuterSettings::TABLES.map(str::to_owned).to_vec(), seed, threads }
}

/// Collects all texts in a value.
fn strings(value: &toml::Value, out: &mut Vec<String>) {
    match value {
        toml::Value::String(text) if !text.is_empty() => out.push(text.clone()),
        toml::Value::Array(items) => items.iter().for_each(|item| strings(item, out)),
        toml::Value::Table(table) => table.values().for_each(|item| strings(item, out)),
        _ => {}
    }
}

impl OuterSettings {
    /// Names of the tables.
    const TABLES: [&str; 3] = ["input", "limits", "output"];

    /// Returns the tables as TOML, to be appended to the pipeline's resolved config.
    ///
    /// # Errors
    /// As for [`to_toml`].
    pub fn resolved(&self) -> Result<String, Failure> {
        to_toml("the tables [input], [limits] and [output]", self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_of_obstacles_reach_the_input() {
        let text = "extends = 'follow-depth.toml'\n[[collision_monitor.sources]]\nname = 'sonar'\n\
                    type = 'range'\ntopic = '/sonar'\nmount = [0.3, 0, 0.2, 0, 0, 90]\n\
                    [[collision_monitor.sources]]\nname = 'rear'\ntype = 'depth'\n\
                    topic = '/rear/depth'\ninfo_topic = '/rear/info'\n";
        let mut registry = Registry::default();
        tagalong_catalog::register(&mut registry);
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
        assert!(!outer.resolved().unwrap().contains("sonar"));
    }

    #[test]
    fn all_configs_of_the_folder_are_built_in_but_those_with_a_model_of_their_own() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
        let files = crate::suggest::toml_files(&folder);
        let stems = files.iter().map(|file| file.file_stem().unwrap().to_str().unwrap());
        let left_out: Vec<&str> = stems.filter(|stem| ConfigFile::named(stem).is_none()).collect();
        assert_eq!(left_out, ["onnx"]);
        for name in ConfigFile::built_in_names() {
            let built_in = ConfigFile::named(name).unwrap();
            let table: toml::Table = built_in.text.parse().unwrap();
            assert!(!table.contains_key("extends"), "{name}");
        }
    }
}
