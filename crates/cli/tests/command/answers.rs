//! Subcommands that answer a question, and runs over real logs.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{Drawn, assert_same, code, config, own_plugin, tagalong, text};

fn answer(args: &[&str], folder: &Path) -> String {
    let output = own_plugin().args(args).current_dir(folder).output().unwrap();
    assert_eq!(code(&output), 0, "{args:?}: {}", text(&output.stderr));
    let told = text(&output.stdout);
    assert!(!told.contains('\u{1b}'), "no colour where there is no terminal: {told}");
    told
}

#[test]
fn the_list_names_every_plugin_with_its_kind() {
    let home = tempfile::tempdir().unwrap();
    let told = answer(&["list"], home.path());
    for (kind, name) in [("filter", "ekf"), ("detector", "nearest-thing")] {
        let line = told.lines().find(|line| line.contains(name)).unwrap();
        assert!(line.starts_with(kind), "{line}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&answer(&["list", "--format", "json"], home.path())).unwrap();
    let ekf = json.as_array().unwrap().iter().find(|plugin| plugin["name"] == "ekf").unwrap();
    assert!(ekf["schema"]["properties"].is_object(), "{ekf}");
}

#[test]
fn printed_defaults_are_accepted_as_they_are() {
    let home = tempfile::tempdir().unwrap();
    let around = answer(&["config", "pipeline"], home.path());
    let detector = answer(&["config", "nearest-thing"], home.path());
    assert!(around.contains("[merge]") && around.contains("# depth_topic ="), "{around}");
    let plugins = format!(
        "\n[[detectors]]\nplugin = \"nearest-thing\"\n[detectors.config]\n{detector}\n[filter]\n\
         plugin = \"ekf\"\n"
    );
    fs::write(home.path().join("all.toml"), around + &plugins).unwrap();
    let told = answer(&["check", "all.toml"], home.path());
    assert!(told.contains("valid; needs depth\n"), "{told}");
}

#[test]
fn a_check_with_a_log_tries_it() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(3).write(&home.path().join("walk.mcap"));
    config(home.path(), "");
    let told = answer(&["check", "nearest.toml", "walk.mcap"], home.path());
    assert!(told.contains("walk.mcap: fits"), "{told}");
    assert!(told.contains("\n  depth: /"), "the topic of the depth: {told}");
    assert!(told.contains("\n  no odometry: "), "{told}");
    assert!(!home.path().join("runs").exists(), "a check writes nothing");
}

#[test]
fn a_check_warns_of_a_camera_that_the_config_is_not_for() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(3).write(&home.path().join("walk.mcap"));
    let [low, high] = [0.6, 1.2].map(|height_m| {
        let camera =
            format!("extends = 'follow-depth.toml'\n[input.camera]\nheight_m = {height_m}\n");
        fs::write(home.path().join("mine.toml"), camera).unwrap();
        answer(&["check", "mine.toml"], home.path())
    });
    let warning = "the camera is 0.60 m high, but the config is for 0.9 to 2 m";
    assert!(low.contains(warning), "{low}");
    assert!(!high.contains("the camera is"), "{high}");
    config(home.path(), "[suits]\ncamera_height_m = [2.0, 3.0]\n");
    let told = answer(&["check", "nearest.toml", "walk.mcap"], home.path());
    assert!(told.contains("the camera is 1.20 m high"), "{told}");
}

#[test]
fn an_inspection_shows_topics_camera_and_use() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(11).write(&home.path().join("walk.mcap"));
    let told = answer(&["inspect", "walk.mcap"], home.path());
    for part in ["/camera/depth/image_raw", "16UC1", "10.00 Hz", "1.20 m above the floor"] {
        assert!(told.contains(part), "no `{part}` in {told}");
    }
    let json: serde_json::Value =
        serde_json::from_str(&answer(&["inspect", "walk.mcap", "--format", "json"], home.path()))
            .unwrap();
    assert_eq!(json["usable"], serde_json::json!(["colour", "depth"]));
}

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn run_real(log: &Path, out: &Path, threads: &str) {
    let output = tagalong()
        .arg("run")
        .arg(repository().join("configs/depth-ekf.toml"))
        .arg(log)
        .arg("-o")
        .arg(out)
        .args(["--threads", threads])
        .output()
        .unwrap();
    assert_eq!(code(&output), 0, "{}: {}", log.display(), text(&output.stderr));
}

#[test]
fn the_shipped_config_runs_on_every_real_log_with_depth_and_repeats_to_the_byte() {
    let Some(logs) = tagalong_conformance::testdata::find("logs") else { return };
    let home = tempfile::tempdir().unwrap();
    let names = [
        "um",
        "filinha",
        "lab2-camera1",
        "lab2-camera2",
        "pcl-single-frames",
        "uc3m-single-frames",
    ];
    for name in names {
        let log = logs.join(name).with_extension("mcap");
        let a = home.path().join(name);
        let b = home.path().join(format!("{name}-again"));
        run_real(&log, &a, "1");
        run_real(&log, &b, "3");
        for file in ["tracks.mcap", "tracks.csv", "tracks-metres.csv", "report.json"] {
            assert_same(&a.join(file), &b.join(file));
        }
    }
}
