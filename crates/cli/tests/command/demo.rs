//! `tagalong demo` and `tagalong trials`: their refusals, and their output.

use std::collections::BTreeSet;
use std::fs;

use crate::common::{code, messages_of, tagalong, text};

#[test]
fn a_folder_with_other_files_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("tagalong-demo")).unwrap();
    fs::write(folder.path().join("tagalong-demo/mine.txt"), "mine").unwrap();
    let said = messages_of(&tagalong().current_dir(folder.path()).arg("demo").output().unwrap(), 2);
    assert!(said.contains("--overwrite"), "{said}");
    assert_eq!(fs::read_dir(folder.path().join("tagalong-demo")).unwrap().count(), 1);
}

const SCENE: &str = "duration_s = 1.5\n[camera]\nwidth = 160\nheight = 120\n[[people]]\n\
    path = [[4.0, 2.5], [4.0, 4.0]]\nspeed_mps = 0.5\n";

#[test]
fn trials_print_the_same_table_on_any_number_of_jobs() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), SCENE).unwrap();
    let config = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/naive.toml");
    let [table, other] = ["1", "3"].map(|jobs| {
        let mut command = tagalong();
        command.current_dir(folder.path()).args(["trials", "s.toml", "--seeds", "3"]);
        command.args(["--format", "json", "--jobs", jobs, "--configs", config, config]);
        let output = command.output().unwrap();
        assert_eq!(code(&output), 0, "{}", text(&output.stderr));
        text(&output.stdout)
    });
    assert_eq!(table, other);
    let table: serde_json::Value = serde_json::from_str(&table).unwrap();
    assert_eq!(
        (table["rows"].as_array().unwrap().len(), &table["rows"][0]["draws"]),
        (2, &3.into())
    );
    assert_eq!(table["gains"][0]["idf1"]["difference"]["estimate"], 0.0);
}

/// Adds all topics that a Foxglove layout names: keys and values that begin with a slash.
fn add_topics(value: &serde_json::Value, topics: &mut BTreeSet<String>) {
    match value {
        serde_json::Value::Object(fields) => {
            topics.extend(fields.keys().filter(|key| key.starts_with('/')).cloned());
            fields.values().for_each(|field| add_topics(field, topics));
        }
        serde_json::Value::Array(items) => items.iter().for_each(|item| add_topics(item, topics)),
        serde_json::Value::String(text) if text.starts_with('/') => {
            topics.insert(text.clone());
        }
        _ => {}
    }
}

#[test]
fn the_topics_of_the_foxglove_layout_are_in_the_file_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.toml"), SCENE).unwrap();
    let config = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/depth-ekf.toml");
    let mut simulate = tagalong();
    simulate.current_dir(folder.path()).args(["simulate", "s.toml", "-o", "s.mcap"]);
    assert_eq!(code(&simulate.output().unwrap()), 0);
    let mut run = tagalong();
    run.current_dir(folder.path()).args(["run", config, "s.mcap", "-o", "run"]);
    let output = run.arg("--with-images").output().unwrap();
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let bytes = fs::read(folder.path().join("run/tracks.mcap")).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let written: BTreeSet<String> =
        summary.channels.values().map(|channel| channel.topic.clone()).collect();
    let layout = concat!(env!("CARGO_MANIFEST_DIR"), "/../../bridges/ros2/foxglove/tagalong.json");
    let layout = serde_json::from_str(&fs::read_to_string(layout).unwrap()).unwrap();
    let mut shown = BTreeSet::new();
    add_topics(&layout, &mut shown);
    assert!(shown.len() >= 6, "{shown:?}");
    let missing: Vec<_> = shown.difference(&written).collect();
    assert!(missing.is_empty(), "{missing:?} of the layout are not in {written:?}");
}
