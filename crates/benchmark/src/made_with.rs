//! Recordings that were used to make the shipped models and settings of a pipeline.

use std::collections::{BTreeMap, BTreeSet};

use serde::Deserialize;
use tagalong_app::config_file::ConfigFile;
use tagalong_app::outcome::Failure;
use toml::{Table, Value};

use super::plan::Task;

/// The table, which is compiled into the program.
const TABLE: &str = include_str!("../configs/models/made-with.toml");

/// Recordings by models, plugins and configs.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MadeWith {
    /// SHA-256 by name.
    recordings: BTreeMap<String, String>,
    models: Vec<Model>,
    plugins: BTreeMap<String, Vec<String>>,
    configs: BTreeMap<String, Vec<String>>,
}

/// Built-in model of a plugin, or settings of a plugin that were chosen with recordings.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Model {
    /// Name of the model card; `None` for settings.
    card: Option<String>,
    plugin: String,
    /// Settings that select the model among several.
    #[serde(default)]
    with: Table,
    recordings: Vec<String>,
}

impl Model {
    /// Returns true for a plugin that has these settings and, for a model, does not name another
    /// one.
    fn is_of(&self, plugin: &str, config: &Table) -> bool {
        let own = config.get("model").and_then(Value::as_str).unwrap_or_default();
        let is_chosen = self.with.iter().all(|(key, value)| config.get(key) == Some(value));
        self.plugin == plugin && is_chosen && (own.is_empty() || self.card.is_none())
    }
}

/// Returns the hashes of the recordings with which the shipped models and settings of a config were
/// made. `resolved` has every setting of the config.
///
/// # Errors
/// None in an intact program, because the table is part of it.
pub fn recordings_of(file: &ConfigFile, resolved: &Table) -> Result<BTreeSet<String>, Failure> {
    let table: MadeWith = toml::from_str(TABLE).map_err(Failure::failed)?;
    let mut names = BTreeSet::new();
    for (name, recordings) in &table.configs {
        if file.is_or_extends(name) {
            names.extend(recordings);
        }
    }
    for value in resolved.values() {
        table.add_plugins(value, &mut names);
    }
    Ok(names.into_iter().filter_map(|name| table.recordings.get(name).cloned()).collect())
}

impl MadeWith {
    /// Adds the recordings of all plugins in a part of a config.
    fn add_plugins<'a>(&'a self, value: &Value, names: &mut BTreeSet<&'a String>) {
        if let Value::Array(parts) = value {
            parts.iter().for_each(|part| self.add_plugins(part, names));
        }
        let Value::Table(part) = value else { return };
        let Some(plugin) = part.get("plugin").and_then(Value::as_str) else { return };
        let nothing = Table::new();
        let config = part.get("config").and_then(Value::as_table).unwrap_or(&nothing);
        names.extend(self.plugins.get(plugin).into_iter().flatten());
        for model in self.models.iter().filter(|model| model.is_of(plugin, config)) {
            names.extend(&model.recordings);
        }
    }
}

/// Returns a note for each set of logs with which pipelines were made, with the names of these
/// pipelines.
pub fn notes<'a>(done: impl Iterator<Item = &'a Task>) -> Vec<String> {
    let mut logs_of: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for task in done.filter(|task| task.made_with_log) {
        logs_of.entry(&task.pipeline).or_default().insert(&task.log_name);
    }
    let mut pipelines_of: BTreeMap<BTreeSet<&str>, Vec<&str>> = BTreeMap::new();
    for (pipeline, logs) in logs_of {
        pipelines_of.entry(logs).or_default().push(pipeline);
    }
    pipelines_of.iter().map(|(logs, pipelines)| note(logs, pipelines)).collect()
}

fn note(logs: &BTreeSet<&str>, pipelines: &[&str]) -> String {
    let logs: Vec<&str> = logs.iter().copied().collect();
    format!(
        "models or settings of {} were fitted to {}: figures there say little about other rooms; \
         docs/benchmarks.md has those of rooms left out",
        pipelines.join(", "),
        logs.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::plan::{planned_for_tests, sha256_of_file};
    use super::*;

    fn table() -> MadeWith {
        toml::from_str(TABLE).expect("the table")
    }

    /// Returns the names of the recordings of a config with this text.
    fn names_of(text: &str) -> Vec<String> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs");
        names_of_file(&ConfigFile::of_text(text.to_owned(), &folder))
    }

    fn names_of_file(file: &ConfigFile) -> Vec<String> {
        let registry = tagalong_catalog::registry();
        let (_, resolved) = file.pipeline(&registry, None).expect("a config");
        let hashes = recordings_of(file, resolved.values()).expect("the table");
        let recordings = table().recordings.into_iter();
        recordings.filter(|(_, sha256)| hashes.contains(sha256)).map(|(name, _)| name).collect()
    }

    /// Settings of silhouettes were chosen on three rooms, the network was trained on a fourth, and the
    /// settings of a scanner on a log of it.
    #[test]
    fn recordings_are_those_of_the_plugins_and_of_the_config_that_is_extended() {
        let rooms = ["corredor1-camera1", "filinha", "lab2-camera1", "lab2-camera2", "um"];
        assert_eq!(names_of("extends = 'depth-ekf.toml'"), rooms);
        let verified = names_of("extends = 'depth-verified.toml'\nmerge.duplicate_m = 0.1");
        assert_eq!(verified[4], "uc3m-single-frames", "{verified:?}");
        let robot = ConfigFile::named("turtlebot3").expect("a built-in config");
        let by_name = names_of_file(&robot);
        let by_file = names_of("extends = 'robots/turtlebot3.toml'");
        assert_eq!(by_name, by_file);
        let walking = names_of("extends = 'laser-legs.toml'");
        for (names, log, other) in [
            (&by_name, "laser-following", "laser-moving"),
            (&walking, "laser-moving", "laser-following"),
        ] {
            assert!(names.iter().any(|name| name == log), "{names:?}");
            assert!(names.iter().all(|name| name != other), "{names:?}");
        }
        // Trained on photographs, unlike the trees, and on simulated rooms alone.
        let filter = "filter.plugin = 'image-kalman'\n[[detectors]]\nplugin = 'hog-upper-body'\n";
        assert_eq!(names_of(filter).len(), 6);
        assert_eq!(names_of(&format!("{filter}config.machine = 'linear'")).len(), 0);
        assert_eq!(names_of("extends = 'omni-appearance.toml'").len(), 0);
    }

    #[test]
    fn a_model_of_ones_own_was_made_with_nothing_that_is_known() {
        let mut resolved = Table::new();
        let mut config = Table::from_iter([("model".to_owned(), "own.toml".into())]);
        let model = &table().models[0];
        assert!(!model.is_of(&model.plugin, &config));
        config.insert("model".into(), "".into());
        assert!(model.is_of(&model.plugin, &config));
        resolved.insert("plugin".into(), "depth-net".into());
        let mut names = BTreeSet::new();
        let table = table();
        table.add_plugins(&Value::Array(vec![Value::Table(resolved)]), &mut names);
        assert_eq!(names.len(), 6);
    }

    /// The network is of others, and its place by the floor was chosen with six logs.
    #[test]
    fn settings_for_a_network_in_colour_are_those_of_the_logs_whatever_the_network() {
        let table = table();
        for (floor, sigma_distance, count) in [(true, 0.3, 6), (true, 0.2, 0), (false, 0.3, 0)] {
            let mut config = Table::from_iter([("model".to_owned(), "own.onnx".into())]);
            config.insert("floor".into(), floor.into());
            config.insert("sigma_distance".into(), sigma_distance.into());
            let mut part = Table::from_iter([("plugin".to_owned(), "onnx".into())]);
            part.insert("config".into(), config.into());
            let mut names = BTreeSet::new();
            table.add_plugins(&Value::Table(part), &mut names);
            assert_eq!(names.len(), count, "{floor} {sigma_distance}");
            assert!(count == 0 || names.contains(&"TUD-Stadtmitte".to_owned()), "{names:?}");
        }
    }

    #[test]
    fn models_have_the_recordings_of_their_cards() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/models");
        let table = table();
        let mut with_recordings = 0;
        for entry in std::fs::read_dir(folder).expect("models") {
            let path = entry.expect("a file").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let Some(name) = name.strip_suffix(".card.toml").map(ToOwned::to_owned) else {
                continue;
            };
            let card: Table =
                toml::from_str(&std::fs::read_to_string(&path).expect("a card")).expect("a card");
            let sources = card.get("trained_on").and_then(Value::as_array);
            let mut logs: Vec<&str> = sources.into_iter().flatten().filter_map(log_of).collect();
            logs.sort_unstable();
            with_recordings += usize::from(!logs.is_empty());
            let rows = table.models.iter().filter(|model| model.card.as_ref() == Some(&name));
            assert_eq!(rows.clone().count() == 0, logs.is_empty(), "{name}");
            for row in rows {
                let mut recordings = row.recordings.clone();
                recordings.sort_unstable();
                assert_eq!(recordings, logs, "{name}");
            }
        }
        assert_eq!(with_recordings, 6);
    }

    /// Returns the name of a log among the sources of a card.
    fn log_of(source: &Value) -> Option<&str> {
        source.as_str()?.strip_prefix("logs/")?.strip_suffix(".mcap")
    }

    #[test]
    fn recordings_have_the_hashes_of_their_files() {
        for (name, sha256) in table().recordings {
            let folder = if name.starts_with("laser-") { "laser" } else { "logs" };
            let file = format!("{folder}/{name}.mcap");
            let Some(log) = tagalong_conformance::testdata::find(&file) else { return };
            assert_eq!(
                sha256_of_file(&log).map_err(|failure| failure.message),
                Ok(sha256),
                "{name}"
            );
        }
    }

    #[test]
    fn pipelines_with_the_same_logs_share_a_note() {
        let mut tasks = Vec::new();
        for (pipeline, log, made_with_log) in [
            ("a", "um", true),
            ("b", "um", true),
            ("c", "um", true),
            ("a", "hall", false),
            ("c", "lab", true),
            ("d", "hall", false),
        ] {
            let task = planned_for_tests(pipeline);
            tasks.push(Task { log_name: log.into(), made_with_log, ..task });
        }
        let notes = notes(tasks.iter());
        let starts = [
            "models or settings of c were fitted to lab, um:",
            "models or settings of a, b were fitted to um:",
        ];
        assert_eq!(notes.len(), 2, "{notes:?}");
        for (note, start) in notes.iter().zip(starts) {
            assert!(note.starts_with(start), "{note}");
        }
    }
}
