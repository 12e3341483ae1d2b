//! Errors in a config are reported with the place, the cause and the remedy; the shipped configs
//! have none.

#![allow(clippy::unwrap_used, reason = "a broken test may stop loudly")]

use std::fs;
use std::path::{Path, PathBuf};

use tagalong_log::{InputSettings, Limits};
use tagalong_pipeline::{BuildError, ConfigSource, Pipeline};

const GOOD: &str = r#"seed = 3

[[detectors]]
plugin = "depth-template"
roles = ["track", "discover"]
every = 2
config = { max_depth_m = 5.0 }

[filter]
plugin = "ekf"

[associator.config]
cost = "mahalanobis"
gate_m = 1.0

[manager.config]
confirm_hits = 3
"#;

fn build(text: &str) -> Result<Pipeline, BuildError> {
    build_in(Path::new("."), text)
}

/// Builds a config that refers to files beside the configs of this folder.
fn build_in(folder: &Path, text: &str) -> Result<Pipeline, BuildError> {
    let registry = tagalong_catalog::registry();
    let source = ConfigSource::from_text(text, folder).with_name("my.toml");
    Pipeline::builder(&registry).build(&source)
}

/// Returns the message for `GOOD` with `from` replaced by `to`.
fn message(from: &str, to: &str) -> String {
    assert!(GOOD.contains(from), "`{from}` is not in the good config");
    let text = GOOD.replacen(from, to, 1);
    match build(&text) {
        Ok(_) => panic!("accepted: {from:?} -> {to:?}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn the_good_config_is_good() {
    build(GOOD).unwrap();
}

#[test]
fn mistakes_are_answered_with_place_cause_and_remedy() {
    let cases: &[(&str, &str, &[&str])] = &[
        ("\"ekf\"", "\"ekff\"", &["my.toml:10:10", "`ekff`", "did you mean `ekf`", "available"]),
        ("\"ekf\"", "\"zebra\"", &["my.toml:10:10", "`zebra`", "available", "ekf"]),
        ("\"ekf\"", "\"depth-template\"", &["my.toml:10:10", "is a detector", "filter", "ekf"]),
        (
            "\"depth-template\"",
            "\"depth-templat\"",
            &["my.toml:4:10", "did you mean `depth-template`"],
        ),
        ("max_depth_m = 5.0", "max_dept_m = 5.0", &["my.toml:7:", "`max_dept_m`", "`max_depth_m`"]),
        ("max_depth_m = 5.0", "max_depth_m = \"far\"", &["my.toml:7:", "far"]),
        ("[associator.config]", "[asociation]", &["my.toml:12:2", "did you mean `associator`"]),
        ("gate_m =", "gate_n =", &["my.toml:14:1", "`gate_n`", "`gate_m`"]),
        ("gate_m = 1.0", "gate_m = -1.0", &["my.toml:14:", "`gate_m` must be positive"]),
        ("gate_m = 1.0", "gate_m = nan", &["my.toml:14:", "`gate_m` must be positive"]),
        ("\"mahalanobis\"", "\"overlp\"", &["my.toml:13:8", "`overlp`", "`overlap`"]),
        ("\"track\", ", "\"trak\", ", &["my.toml:5:", "`trak`", "`track`"]),
        ("every = 2", "every = 0", &["my.toml:6:", "every"]),
        ("every = 2", "every = 2\noffset = 2", &["my.toml:7:", "offset"]),
        (
            "confirm_hits = 3",
            "confirm_hits = 0",
            &["my.toml:17:", "`confirm_hits` must lie between 1 and 32"],
        ),
        ("[filter]\nplugin = \"ekf\"\n", "", &["filter"]),
        ("plugin = \"ekf\"", "plugin = \"ekf\"\nconfig = { gain = 1 }", &["my.toml:11:", "`gain`"]),
        ("seed = 3", "seed = 3\nseed = 4", &["my.toml:2:", "duplicate key"]),
        ("seed = 3", "seed = ", &["my.toml:1:"]),
    ];
    let mut wrong = Vec::new();
    for (from, to, expected) in cases {
        let message = message(from, to);
        let missing: Vec<_> = expected.iter().filter(|part| !message.contains(**part)).collect();
        if !missing.is_empty() {
            wrong.push(format!("{to:?}: no {missing:?} in\n{message}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn a_method_that_was_removed_from_the_config_is_gone() {
    let removed = GOOD.replace("config = { max_depth_m = 5.0 }\n", "");
    let filterless = removed.replace("roles = [\"track\", \"discover\"]", "roles = [\"discover\"]");
    build(&filterless).unwrap();
    let message = build("[filter]\nplugin = \"ekf\"\n").err().map(|error| error.to_string());
    assert!(message.as_ref().is_some_and(|m| m.contains("detector")), "{message:?}");
}

fn shipped() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let folders = [folder.join("robots"), folder];
    let entries = folders.iter().flat_map(|folder| fs::read_dir(folder).unwrap());
    let files = entries.map(|entry| entry.unwrap().path());
    let mut configs: Vec<PathBuf> =
        files.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    configs.sort();
    configs
}

#[test]
fn every_shipped_config_builds() {
    // With a wrong folder the loop below would pass without a config.
    assert!(!shipped().is_empty());
    for path in shipped() {
        let text = fs::read_to_string(&path).unwrap();
        let tables = build_in(path.parent().unwrap(), &text).and_then(|pipeline| {
            pipeline.config().table::<InputSettings>("input")?;
            pipeline.config().table::<Limits>("limits")
        });
        if let Err(error) = tables {
            panic!("{}: {error}", path.display());
        }
    }
}
