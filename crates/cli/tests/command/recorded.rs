//! The shipped `configs/recorded.toml` on a log in which another program has recorded its boxes.

use std::fs;
use std::path::Path;

use serde_json::Value;

use crate::common::{Drawn, code, messages_of, tagalong, text};

fn shipped() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/recorded.toml")
}

/// Runs over a log and scores the tracks.
fn scores(log: &Drawn, similarity: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    log.write(&folder.path().join("walk.mcap"));
    fs::write(folder.path().join("walk.people.csv"), crate::common::people(20)).unwrap();
    let mut run = tagalong();
    run.current_dir(folder.path()).arg("run").arg(shipped()).args(["walk.mcap", "-o", "out"]);
    let output = run.output().unwrap();
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let mut eval = tagalong();
    eval.current_dir(folder.path()).args(["eval", "--truth", "walk.people.csv"]);
    eval.args(["--tracks", "out", "--format", "json", "--similarity", similarity]);
    serde_json::from_slice(&eval.output().unwrap().stdout).unwrap()
}

#[test]
fn boxes_of_the_log_are_tracked() {
    let log = Drawn { boxes: true, ..Drawn::of(20) };
    let image = scores(&log, "iou");
    assert!(image["MOTA"].as_f64().unwrap() > 0.7, "{image}");
    assert_eq!(image["track_ids"].as_u64(), Some(1), "{image}");
    let floor = scores(&log, "metres");
    assert!(floor["position_error_mean_m"].as_f64().unwrap() < 0.15, "{floor}");
}

#[test]
fn without_depth_the_size_of_the_box_tells_the_distance() {
    let floor = scores(&Drawn { boxes: true, depth: false, ..Drawn::of(20) }, "metres");
    assert!(floor["position_error_mean_m"].as_f64().unwrap() < 0.5, "{floor}");
}

#[test]
fn detections_in_space_are_brought_into_the_robot_frame() {
    let log = Drawn { in_space: true, depth: false, ..Drawn::of(20) };
    let floor = scores(&log, "metres");
    assert!(floor["position_error_mean_m"].as_f64().unwrap() < 0.1, "{floor}");
    let image = scores(&log, "iou");
    assert!(image["MOTP"].as_f64().unwrap() > 0.8, "{image}");
}

#[test]
fn a_log_without_boxes_is_refused_with_the_name_of_the_topic() {
    let folder = tempfile::tempdir().unwrap();
    Drawn::of(3).write(&folder.path().join("walk.mcap"));
    let mut run = tagalong();
    let output = run.current_dir(folder.path()).arg("run").arg(shipped()).arg("walk.mcap");
    let told = messages_of(&output.output().unwrap(), 2);
    assert!(told.contains("/detections") && told.contains("detections_topic"), "{told}");
}
