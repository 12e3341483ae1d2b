//! A missing topic is reported before a run starts: the wanted topic, the existing ones, and the
//! nearest name (fault T6).

use std::path::Path;

use crate::common::{Drawn, code, config, messages_of, own_plugin, tagalong, text};

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
        assert_eq!(code, 2, "{key}: {told}");
        let line = format!("| {key} = \"{wrong}\"");
        assert!(told.contains("nearest.toml:") && told.contains(&line), "{key}: {told}");
        assert!(told.contains(&format!("no topic `{wrong}` fit for `{key}`")), "{key}: {told}");
        assert_eq!(told.contains(&format!("did you mean `{near}`?")), !near.is_empty(), "{told}");
        let (_, present) = told.split_once("present:").expect("what is there");
        assert!(present.contains(info) && present.contains("/tf_static"), "{key}: {told}");
        assert!(!home.path().join("runs").exists(), "a refused run leaves nothing behind");
    }
}

#[test]
fn a_topic_of_a_wrong_kind_is_told_with_its_line_its_kind_and_the_remedy() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(3).write(&home.path().join("good.mcap"));
    let colour = "/camera/color/image_raw";
    let depth = "/camera/depth/image_raw";
    for (key, wrong, kind, remedy) in [
        ("depth_topic", colour, "sensor_msgs/msg/Image, rgb8", depth),
        ("colour_topic", depth, "sensor_msgs/msg/Image, ", colour),
        ("colour_topic", "/tf_static", "tf2_msgs/msg/TFMessage", colour),
    ] {
        let input = format!("{key} = \"{wrong}\"");
        let (code, told) = run(home.path(), "good.mcap", &input);
        assert_eq!(code, 2, "{key}: {told}");
        assert!(told.contains("nearest.toml:") && told.contains(&format!("| {input}")), "{told}");
        assert!(told.contains(kind) && told.contains(remedy), "{key}: {told}");
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

#[test]
fn a_log_of_which_no_frame_can_be_made_is_no_success() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(3).write(&home.path().join("good.mcap"));
    config(home.path(), "[limits]\nimage_side_px = 8");
    let args = ["run", "nearest.toml", "good.mcap"];
    let told = messages_of(&own_plugin().args(args).current_dir(home.path()).output().unwrap(), 1);
    assert!(told.contains("no frame could be made from good.mcap: "), "{told}");
    assert!(told.contains("images too large 3"), "{told}");
    let doctor = "`tagalong doctor nearest.toml good.mcap` tells more";
    assert!(told.contains(doctor), "{told}");
    assert!(!home.path().join("runs/good-nearest").exists(), "an empty result looks like one");
}

/// The colour topic that the log has is not the right image of a pair.
#[test]
fn a_config_for_a_pair_on_another_log_leads_to_the_configs_that_fit() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(3).write(&home.path().join("rgbd.mcap"));
    let arguments = ["run", "stereo-verified", "rgbd.mcap"];
    let told =
        messages_of(&tagalong().args(arguments).current_dir(home.path()).output().unwrap(), 1);
    assert!(told.contains("no log of a stereo pair") && told.contains("tagalong doctor"), "{told}");
    assert!(!told.contains("as `right_topic`"), "{told}");
}
