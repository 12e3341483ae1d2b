//! Settings of each test of the funnel: data, not code.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

/// Text of the table.
pub const TABLE: &str = include_str!("remedies.toml");

/// Remedy for the candidates that a test drops.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Remedy {
    /// Name of the test; one that ends in `*` is a prefix.
    pub test: String,
    /// Plugin that has the settings, where others have some of that name.
    plugin: Option<String>,
    /// Keys of the settings.
    pub settings: Vec<String>,
    /// Advice on the test.
    pub look: String,
}

#[derive(Deserialize)]
struct File {
    drop: Vec<Remedy>,
}

/// Returns all remedies, in the order of the stages.
#[expect(clippy::expect_used, reason = "the table is part of the program, and a test reads it")]
pub fn all() -> Vec<Remedy> {
    toml::from_str::<File>(TABLE).expect("the built-in table is right").drop
}

/// Returns the table as Markdown.
pub fn markdown() -> String {
    let mut out = String::from("| test in the funnel | settings | look at |\n|---|---|---|\n");
    for remedy in all() {
        let settings: Vec<String> = remedy.settings.iter().map(|key| format!("`{key}`")).collect();
        let test = remedy.test.replace('*', "...");
        let of = remedy.plugin.map(|plugin| format!(" of `{plugin}`")).unwrap_or_default();
        out += &format!("| {test} | {}{of} | {} |\n", settings.join(", "), remedy.look);
    }
    out
}

/// Returns the remedy for a test, if the table has one.
pub fn of(test: &str) -> Option<Remedy> {
    all().into_iter().find(|remedy| remedy.is_for(test))
}

impl Remedy {
    fn is_for(&self, test: &str) -> bool {
        self.test
            .strip_suffix('*')
            .map_or(self.test == test, |beginning| test.starts_with(beginning))
    }

    /// Returns the settings with their sections in a resolved config, and their values.
    pub fn lines(&self, resolved: &Table) -> Vec<String> {
        let mut lines = Vec::new();
        for (section, value) in resolved {
            match value {
                Value::Array(items) => {
                    let tables = items.iter().filter_map(Value::as_table);
                    tables.for_each(|table| {
                        self.section(&format!("[[{section}]]"), table, &mut lines)
                    });
                }
                Value::Table(table) => self.section(&format!("[{section}]"), table, &mut lines),
                _ => {}
            }
        }
        lines
    }

    /// Adds the settings in one section: its own keys, or those of its plugin.
    fn section(&self, name: &str, table: &Table, lines: &mut Vec<String>) {
        let plugin = table.get("plugin").and_then(Value::as_str);
        if plugin.is_some() && self.plugin.is_some() && self.plugin.as_deref() != plugin {
            return;
        }
        let config = table.get("config").and_then(Value::as_table);
        for key in &self.settings {
            if let Some((plugin, value)) = plugin.zip(config.and_then(|config| config.get(key))) {
                lines.push(format!("{name} plugin = \"{plugin}\", config = {{ {key} = {value} }}"));
            } else if let (None, Some(value)) = (plugin, table.get(key)) {
                lines.push(format!("{name} {key} = {value}"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use tagalong_app::config_file::OuterSettings;
    use tagalong_config::commented_defaults;
    use tagalong_pipeline::PipelineSettings;

    use super::*;

    #[test]
    fn every_setting_of_the_table_exists() {
        let mut registry = tagalong_config::Registry::default();
        tagalong_catalog::register(&mut registry);
        let mut known: BTreeSet<String> = BTreeSet::new();
        let mut keys = |text: &str| {
            let bare =
                |line: &str| Some(line.trim_start_matches("# ").split_once(" =")?.0.to_owned());
            known.extend(text.lines().filter_map(bare));
        };
        registry.plugins().for_each(|plugin| keys(&plugin.defaults()));
        keys(&commented_defaults::<PipelineSettings>());
        keys(&commented_defaults::<OuterSettings>());
        for remedy in all() {
            for setting in &remedy.settings {
                assert!(known.contains(setting), "{}: there is no `{setting}`", remedy.test);
            }
            if let Some(plugin) = &remedy.plugin {
                assert!(registry.find(plugin).is_ok(), "{plugin}");
            }
        }
    }

    #[test]
    fn settings_are_shown_where_they_stand() {
        let resolved: Table = toml::from_str(
            "seed = 1\n[manager]\nplugin = 'm'\n[manager.config]\nstart_score = 0.5\n[[verifiers]]\nplugin = 'a'\n\
             [verifiers.config]\nweight = 2.0\n",
        )
        .unwrap();
        let lines = of("verifier").unwrap().lines(&resolved);
        assert_eq!(
            lines,
            [
                "[manager] plugin = \"m\", config = { start_score = 0.5 }",
                "[[verifiers]] plugin = \"a\", config = { weight = 2.0 }"
            ]
        );
        assert_eq!(of("stereo pixels: speckle").unwrap().test, "stereo pixels: *");
        assert!(of("something new").is_none());
    }
}
