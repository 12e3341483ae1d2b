use serde::Serialize;
use tagalong_config::{ConfigError, Settings};
use tagalong_following::RobotSettings;

use super::document::Document;
use super::source::{BuildError, ConfigSource};
use super::suits::Suits;
use super::tune::{Tunable, values_replaced};

/// Config of a pipeline with every default filled in, and the text from which it was read.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ResolvedConfig {
    /// Seed of the run.
    pub seed: u64,
    /// The robot.
    pub robot: RobotSettings,
    /// `[tune]`: the settings that may be fitted. A run ignores them.
    pub tune: Vec<Tunable>,
    /// `[suits]`: the cameras that the config is for. A run ignores it.
    pub suits: Suits,
    pub(super) source: ConfigSource,
    pub(super) document: Document,
    pub(super) values: toml::Table,
    pub(super) text: String,
    /// Top-level tables that belong to other programs.
    pub(super) foreign: Vec<String>,
}

impl ResolvedConfig {
    /// Returns the values, with every default filled in. Tables that belong to other programs are as
    /// the config has them, or as [`ResolvedConfig::with_tables`] has set them.
    pub fn values(&self) -> &toml::Table {
        &self.values
    }

    /// Returns the values as TOML.
    pub fn to_toml(&self) -> &str {
        &self.text
    }

    /// Returns the text from which the config was read.
    pub fn source(&self) -> &ConfigSource {
        &self.source
    }

    /// Returns a top-level table that belongs to another program, such as `[input]` of the log reader;
    /// the defaults where the config does not have it.
    ///
    /// # Errors
    /// Unknown keys and wrong types, with their place in the config.
    pub fn table<T: Settings>(&self, name: &str) -> Result<T, BuildError> {
        self.source.table_of(&self.document, name)
    }

    /// Returns the config with the tables of another program, which `tables` has as its fields, in
    /// place of those that the config has: their defaults are filled in, too.
    ///
    /// # Errors
    /// Tables that TOML cannot express.
    pub fn with_tables<T: Serialize>(&self, tables: &T) -> Result<Self, ConfigError> {
        let tables = toml::Table::try_from(tables).map_err(not_toml)?;
        let mut values = self.values.clone();
        for name in tables.keys() {
            values.remove(name);
        }
        let own = to_text(&values)?;
        let theirs = to_text(&tables)?;
        values.extend(tables);
        Ok(Self { values, text: format!("{own}\n{theirs}"), ..self.clone() })
    }

    /// Leaves a section of the values out.
    pub(crate) fn remove(&mut self, section: &str) -> Result<(), ConfigError> {
        self.values.remove(section);
        self.text = to_text(&self.values)?;
        Ok(())
    }

    /// Returns the text of the config with other values for some settings, by their dotted keys.
    ///
    /// # Errors
    /// A setting that the config does not have.
    pub fn with_values(&self, values: &[(&str, &toml::Value)]) -> Result<String, ConfigError> {
        values_replaced(self.values.clone(), values)
    }

    /// Returns a mistake at a dotted key of the config, with its file and line; `None` where the config
    /// does not have the key.
    pub fn mistake_at(&self, key: &str, message: &str) -> Option<BuildError> {
        let span = {
            let root = self.document.root().ok()?;
            let mut parts = key.split('.');
            let first = root.get(parts.next()?)?;
            parts.try_fold(first, |value, part| value.get_ref().as_table()?.get(part))?.span()
        };
        let error = ConfigError::new(message.to_owned()).or_at(Some(span));
        Some(self.source.mistake(&self.document.locate(error)))
    }
}

/// Returns a table as TOML.
pub(super) fn to_text(values: &toml::Table) -> Result<String, ConfigError> {
    toml::to_string(values).map_err(not_toml)
}

fn not_toml(error: toml::ser::Error) -> ConfigError {
    ConfigError::new(format!("the settings cannot be written as TOML: {error}"))
}

#[cfg(test)]
mod tests {
    use schemars::JsonSchema;
    use serde::Deserialize;

    use crate::tests::doubles::{PLAIN, World};

    #[derive(Debug, Default, PartialEq, serde::Serialize, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    struct Input {
        topic: String,
        late_frames: u32,
    }

    #[derive(serde::Serialize)]
    struct Tables {
        input: Input,
    }

    fn text(input: &str) -> String {
        format!("{PLAIN}[input]\n{input}\n")
    }

    #[test]
    fn tables_of_other_programs_appear_once_with_their_defaults() {
        let pipeline = World::default().pipeline(&text("topic = '/image'"));
        let config = pipeline.config();
        let input: Input = config.table("input").unwrap();
        assert_eq!(input, Input { topic: "/image".into(), late_frames: 0 });
        let whole = config.with_tables(&Tables { input }).unwrap();
        let read: toml::Table = whole.to_toml().parse().unwrap();
        assert_eq!(&read, whole.values());
        assert_eq!(read["input"]["late_frames"].as_integer(), Some(0));
        assert_eq!(read["filter"], config.values()["filter"]);
    }

    #[test]
    fn mistakes_in_tables_of_other_programs_are_shown_with_their_line() {
        let pipeline = World::default().pipeline(&text("topik = '/image'"));
        let shown = pipeline.config().table::<Input>("input").unwrap_err().to_string();
        assert!(
            shown.contains("config.toml:7:1: ") && shown.contains("did you mean `topic`"),
            "{shown}"
        );
        let at = pipeline.config().mistake_at("input.topik", "is of another kind").unwrap();
        assert!(at.to_string().contains("config.toml:7:9: is of another kind"), "{at}");
        assert!(pipeline.config().mistake_at("input.none", "").is_none());
    }
}
