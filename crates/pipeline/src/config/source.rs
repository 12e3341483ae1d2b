use std::fmt::Write as _;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use tagalong_config::{ConfigError, FileLimit, Settings, nearest, parse_settings, read_text};
use tagalong_network::model_file;

use super::builtin::{builtin_names, builtin_text};
use super::document::{Document, flattened};

/// File name that a config without a file has in messages.
const NO_FILE: &str = "config.toml";

/// Config from which no pipeline can be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// No built-in config has the name.
    #[error("no built-in config is called `{name}`{hint}")]
    UnknownName {
        /// The name.
        name: String,
        /// The nearest name, or all names.
        hint: String,
    },
    /// The file cannot be read.
    #[error("{why}")]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Kind of the failure.
        kind: ErrorKind,
        /// The cause, with the path.
        why: String,
    },
    /// A mistake in the config.
    #[error("{shown}")]
    Mistake {
        /// File of the config, or the name that stands for it.
        file: PathBuf,
        /// Line of the mistake, from 1; `None` if it concerns the config as a whole.
        line: Option<usize>,
        /// The cause and the remedy, without the place.
        message: String,
        /// File, line, column, cause and remedy, and the line itself.
        shown: String,
    },
}

/// Text of a config, with the path that names it in messages and against which its relative paths are
/// resolved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigSource {
    path: PathBuf,
    text: String,
}

impl ConfigSource {
    /// Reads a config file.
    ///
    /// # Errors
    /// [`BuildError::Unreadable`]: a file that is missing, too long or no text.
    pub fn from_file(path: impl AsRef<Path>) -> Result<Self, BuildError> {
        let path = path.as_ref();
        let error = match read_text(path, FileLimit::Config) {
            Ok(text) => return Ok(Self { path: path.to_owned(), text }),
            Err(error) => error,
        };
        let shown = path.display();
        let kind = error.kind();
        let why = match kind {
            ErrorKind::IsADirectory => format!("{shown} is a directory, not a config"),
            ErrorKind::InvalidData => format!("{shown} is not UTF-8 text, so it is not a config"),
            ErrorKind::FileTooLarge => format!("{shown}: a config {error}"),
            _ => format!("cannot read config {shown}: {error}"),
        };
        Err(BuildError::Unreadable { path: path.to_owned(), kind, why })
    }

    /// Returns the built-in config of a name, or of the file that it is in a clone
    /// (`configs/depth-ekf.toml`).
    ///
    /// # Errors
    /// [`BuildError::UnknownName`], with the nearest name.
    pub fn builtin(name: &str) -> Result<Self, BuildError> {
        let file = name.strip_prefix("configs/");
        let stem = file.map_or(Some(name), |file| file.strip_suffix(".toml"));
        let Some((stem, text)) = stem.and_then(|stem| Some((stem, builtin_text(stem)?))) else {
            return Err(BuildError::UnknownName { name: name.to_owned(), hint: hint_for(name) });
        };
        Ok(Self { path: format!("configs/{stem}.toml").into(), text })
    }

    /// Reads a config file; a path at which there is none may be the name of a built-in config.
    ///
    /// # Errors
    /// As for [`ConfigSource::from_file`].
    pub fn open(path_or_name: impl AsRef<Path>) -> Result<Self, BuildError> {
        let path = path_or_name.as_ref();
        Self::from_file(path).or_else(|error| {
            let is_missing =
                matches!(error, BuildError::Unreadable { kind: ErrorKind::NotFound, .. });
            let name = path.to_str().filter(|_| is_missing);
            name.and_then(|name| Self::builtin(name).ok()).ok_or(error)
        })
    }

    /// Returns the config of a text, whose relative paths are resolved against `folder`.
    pub fn from_text(text: impl Into<String>, folder: impl AsRef<Path>) -> Self {
        Self { path: folder.as_ref().join(NO_FILE), text: text.into() }
    }

    /// Returns the names of the built-in configs: all that need no file beside them.
    pub fn builtin_names() -> impl Iterator<Item = &'static str> {
        builtin_names()
    }

    /// Returns the config under another name in its folder, for messages.
    pub fn with_name(self, name: &str) -> Self {
        Self { path: self.folder().join(name), ..self }
    }

    /// Returns the config with another text at the same path, so that it names the same files.
    pub fn with_text(&self, text: impl Into<String>) -> Self {
        Self { path: self.path.clone(), text: text.into() }
    }

    /// Returns the path that names the config in messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the folder against which relative paths are resolved.
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Returns its name without folder and extension.
    pub fn stem(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Returns the text as it stands in the file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the text with those of the configs that it extends.
    pub fn whole_text(&self) -> String {
        // A mistake shows its line when the pipeline is built from the text as it is.
        flattened(&self.text, self.folder()).unwrap_or_else(|_| self.text.clone())
    }

    /// Returns the config with those that it extends.
    ///
    /// # Errors
    /// As for [`Document::read`].
    pub fn document(&self) -> Result<Document, ConfigError> {
        Document::read(&self.text, self.folder())
    }

    /// Returns a top-level table that belongs to another program than the pipeline; the defaults where
    /// the config does not have it.
    ///
    /// # Errors
    /// Unknown keys and wrong types, with their place in the config.
    pub fn table<T: Settings>(&self, name: &str) -> Result<T, BuildError> {
        let document = self.document().map_err(|error| self.mistake(&error))?;
        self.table_of(&document, name)
    }

    /// Returns a top-level table of this config, whose document was read before.
    pub(super) fn table_of<T: Settings>(
        &self,
        document: &Document,
        name: &str,
    ) -> Result<T, BuildError> {
        let settings = document.root().and_then(|mut root| parse_settings(root.remove(name)));
        settings.map_err(|error| self.mistake(&document.locate(error)))
    }

    /// Returns the files that the settings name, such as models, with the name used there.
    pub fn files(&self) -> Vec<(String, PathBuf)> {
        let Ok(table) = self.document().and_then(|document| document.table()) else {
            return Vec::new();
        };
        let mut names = Vec::new();
        collect_strings(&toml::Value::Table(table), &mut names);
        let named = names.into_iter().map(|name| (name.clone(), model_file(self.folder(), &name)));
        // Plugins alone know which texts are paths; a text that names a file counts as one.
        named.filter(|(_, path)| path.is_file()).collect()
    }

    /// Returns a mistake in this config with its file and line.
    pub fn mistake(&self, error: &ConfigError) -> BuildError {
        BuildError::Mistake {
            file: self.path.clone(),
            line: error.line(&self.text),
            message: error.message.clone(),
            shown: error.render(&self.path.display().to_string(), &self.text),
        }
    }
}

/// Returns the built-in name that was meant, or all of them.
fn hint_for(name: &str) -> String {
    if let Some(best) = nearest(name, builtin_names()) {
        return format!("; did you mean `{best}`?");
    }
    let mut hint = "; there are:".to_owned();
    for (place, known) in builtin_names().enumerate() {
        let comma = if place == 0 { "" } else { "," };
        // Writing to a text cannot fail.
        let _ = write!(hint, "{comma} {known}");
    }
    hint
}

/// Collects all texts in a value.
fn collect_strings(value: &toml::Value, out: &mut Vec<String>) {
    match value {
        toml::Value::String(text) if !text.is_empty() => out.push(text.clone()),
        toml::Value::Array(items) => items.iter().for_each(|item| collect_strings(item, out)),
        toml::Value::Table(table) => table.values().for_each(|item| collect_strings(item, out)),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn names_paths_and_files_open_a_config() {
        for name in ["depth-ekf", "configs/depth-ekf.toml"] {
            let source = ConfigSource::open(name).unwrap();
            assert_eq!(source.stem(), "depth-ekf");
            assert_eq!(source.path(), Path::new("configs/depth-ekf.toml"));
        }
        let robot = ConfigSource::builtin("configs/robots/turtlebot4.toml").unwrap();
        assert_eq!(robot.path(), Path::new("configs/robots/turtlebot4.toml"));
        assert_eq!(robot.text(), ConfigSource::builtin("turtlebot4").unwrap().text());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("own.toml");
        fs::write(&path, "seed = 3\n").unwrap();
        let own = ConfigSource::open(&path).unwrap();
        assert_eq!((own.text(), own.folder()), ("seed = 3\n", folder.path()));
    }

    #[test]
    fn what_cannot_be_read_names_the_path_and_the_cause() {
        fn shown(path: &Path) -> String {
            ConfigSource::open(path).unwrap_err().to_string()
        }

        let folder = tempfile::tempdir().unwrap();
        assert!(shown(folder.path()).ends_with("is a directory, not a config"));
        assert!(shown(&folder.path().join("none.toml")).starts_with("cannot read config "));
        let odd = folder.path().join("odd.toml");
        fs::write(&odd, [0xff, 0xfe]).unwrap();
        assert!(shown(&odd).ends_with("odd.toml is not UTF-8 text, so it is not a config"));
    }

    #[test]
    fn an_unknown_name_gets_the_nearest_one() {
        fn shown(name: &str) -> String {
            ConfigSource::builtin(name).unwrap_err().to_string()
        }

        assert!(shown("depth-verifed").ends_with("; did you mean `depth-verified`?"));
        assert!(shown("?").contains("; there are: depth-alone, "), "{}", shown("?"));
    }

    #[test]
    fn built_in_configs_extend_no_file() {
        for name in ConfigSource::builtin_names() {
            let table: toml::Table = ConfigSource::builtin(name).unwrap().text().parse().unwrap();
            assert!(!table.contains_key("extends"), "{name}");
        }
    }
}
