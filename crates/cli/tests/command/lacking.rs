//! Frames that lack an input which a plugin requires: scans of a scanner that is silent for a time.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::broken::{self, Changes};
use crate::common::{messages_of, tagalong};

/// A depth camera and a scanner of ten images and scans a second.
const SCENE: &str = "
seed = 5
duration_s = 3.0
[room]
size_m = [9.0, 6.0]
[camera]
width = 160
height = 120
[robot]
start = [0.8, 3.0]
[laser]
[[people]]
path = [[4.0, 4.4], [4.0, 1.5]]
speed_mps = 0.6
";

const CONFIG: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/depth-laser.toml");

/// Returns a log with every tenth scan.
fn thinned(folder: &Path) -> PathBuf {
    let changes = Changes { thinned: Some(("scan", 10)), ..Changes::default() };
    broken::simulated(folder, SCENE, &changes)
}

#[test]
fn doctor_and_check_go_on_after_a_frame_without_a_required_input() {
    let folder = tempfile::tempdir().unwrap();
    let log = thinned(folder.path());
    for command in ["doctor", "check"] {
        let mut run = tagalong();
        let output = run.current_dir(folder.path()).arg(command).arg(CONFIG).arg(&log).output();
        let told = output.unwrap().stdout;
        let told = String::from_utf8_lossy(&told).split_whitespace().collect::<Vec<_>>().join(" ");
        let warning = "left out, the first is frame ";
        assert!(
            told.contains(warning) && told.contains("they lack laser scans"),
            "{command}: {told}"
        );
        assert!(!told.contains("the pipeline failed"), "{command}: {told}");
    }
}

#[test]
fn frames_without_a_required_input_are_left_out_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let log = thinned(folder.path());
    let config = Path::new(CONFIG);
    let mut run = tagalong();
    run.current_dir(folder.path()).arg("run").arg(config).arg(log).args(["-o", "out"]);
    let told = messages_of(&run.output().unwrap(), 0);
    let report = fs::read(folder.path().join("out/report.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    let frames = &report["frames"];
    let [read, processed, lacking] =
        ["read", "processed", "lacking"].map(|name| frames[name].as_u64().unwrap());
    assert!(lacking > 0 && processed > 0, "{frames}");
    assert_eq!(processed + lacking, read, "{frames}");
    assert_eq!(report["lacking"][0]["plugin"], "laser-legs");
    assert_eq!(report["lacking"][0]["frames"], lacking);
    assert_eq!(report["ended"], "complete");
    let warning = format!("warning: {lacking} of {read} frames left out, the first is frame ");
    assert!(told.contains(&warning) && told.contains("they lack laser scans"), "{told}");
    assert_eq!(told.matches("frames left out").count(), 1, "once: {told}");
}
