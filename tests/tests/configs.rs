//! The shipped configs say when to take them, and state nothing that holds without it.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use std::fs;
use std::path::{Path, PathBuf};

use tagalong_config::Registry;
use tagalong_pipeline::Pipeline;
use toml::{Table, Value};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs")
}

/// Returns the name and the text of each shipped config.
fn configs() -> Vec<(String, String)> {
    fn name(path: &Path) -> String {
        path.file_name().unwrap().to_string_lossy().into_owned()
    }

    let paths = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path());
    let configs = paths.filter(|path| path.extension().is_some_and(|it| it == "toml"));
    configs.map(|path| (name(&path), fs::read_to_string(&path).unwrap())).collect()
}

fn resolved(registry: &Registry, text: &str) -> Option<String> {
    let built = Pipeline::builder(registry).folder(folder()).from_toml(text);
    built.ok().map(|pipeline| pipeline.config().to_toml().to_owned())
}

/// Adds the paths of all values that are no tables.
fn leaves(path: &[String], value: &Value, out: &mut Vec<Vec<String>>) {
    let below = |key: String| [path, &[key]].concat();
    match value {
        Value::Table(table) => {
            table.iter().for_each(|(key, value)| leaves(&below(key.clone()), value, out));
        }
        Value::Array(items) if items.iter().any(Value::is_table) => {
            let items = items.iter().enumerate();
            items.for_each(|(at, value)| leaves(&below(at.to_string()), value, out));
        }
        _ => out.push(path.to_vec()),
    }
}

fn without(table: &Table, path: &[String]) -> String {
    let mut root = Value::Table(table.clone());
    let (key, way) = path.split_last().unwrap();
    let parent = way.iter().fold(&mut root, |at, part| match at {
        Value::Array(items) => &mut items[part.parse::<usize>().unwrap()],
        at => &mut at[part.as_str()],
    });
    parent.as_table_mut().unwrap().remove(key);
    toml::to_string(&root).unwrap()
}

#[test]
fn a_config_begins_with_when_to_take_it() {
    let all = configs();
    assert!(all.len() > 30, "{}", all.len());
    for (name, text) in all {
        assert!(text.starts_with("# Take this "), "{name}: {:?}", text.lines().next());
    }
}

#[test]
fn a_config_states_only_what_is_special_about_it() {
    let registry = tagalong_catalog::registry();
    let mut needless = Vec::new();
    for (name, text) in configs() {
        let table: Table = text.parse().unwrap();
        let whole = resolved(&registry, &text).unwrap();
        let mut all = Vec::new();
        leaves(&[], &Value::Table(table.clone()), &mut all);
        // Values to try are stated whatever the config has.
        all.retain(|path| path[0] != "tune" && path[0] != "suits");
        let same = |path: &Vec<String>| {
            resolved(&registry, &without(&table, path)).is_some_and(|shorter| shorter == whole)
        };
        needless.extend(
            all.iter().filter(|path| same(path)).map(|p| format!("{name}: {}", p.join("."))),
        );
    }
    assert!(needless.is_empty(), "the same without:\n{}", needless.join("\n"));
}
