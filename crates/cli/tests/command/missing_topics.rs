//! A missing topic is reported before a run starts: the wanted topic, the existing ones, and the
//! nearest name (fault T6).

use std::path::Path;

use crate::common::{Drawn, code, config, own_plugin, text};

/// Runs with these settings; returns the exit code and the message.
fn run(home: &Path, log: &str, input: &str) -> (i32, String) {
    config(home, &format!("[input]\n{input}"));
    let output =
        own_plugin().args(["run", "nearest.toml", log]).current_dir(home).output().unwrap();
    (code(&output), text(&output.stderr))
}

#[test]
fn t6_a_topic_that_is_not_there_is_told_with_those_that_are() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(3).write(&home.path().join("good.mcap"));
    let info = "/camera/color/camera_info";
    for (key, wrong, near) in [
        ("colour_topic", "/camera/colour/image_raw", "/camera/color/image_raw"),
        ("depth_topic", "/camera/depht/image_raw", "/camera/depth/image_raw"),
        ("colour_info_topic", "/camera/color/camera_inf", info),
        ("odometry_topic", "/odom", ""),
    ] {
        let (code, told) = run(home.path(), "good.mcap", &format!("{key} = \"{wrong}\""));
        assert_eq!(code, 1, "{key}: {told}");
        assert!(told.contains(&format!("no topic `{wrong}` fit for `{key}`")), "{key}: {told}");
        assert_eq!(told.contains(&format!("did you mean `{near}`?")), !near.is_empty(), "{told}");
        let (_, present) = told.split_once("present:").expect("what is there");
        assert!(present.contains(info) && present.contains("/tf_static"), "{key}: {told}");
        assert!(!home.path().join("runs").exists(), "a refused run leaves nothing behind");
    }
}

#[test]
fn t6_images_that_are_needed_and_found_nowhere_are_told() {
    let home = tempfile::tempdir().unwrap();
    Drawn { depth: false, ..Drawn::of(3) }.write(&home.path().join("no-depth.mcap"));
    let (code, told) = run(home.path(), "no-depth.mcap", "");
    assert_eq!(code, 1, "{told}");
    assert!(told.contains("has no depth images (sensor_msgs/Image with 16UC1 or 32FC1"), "{told}");
    assert!(told.contains("present:") && told.contains("/camera/color/image_raw"), "{told}");
}
