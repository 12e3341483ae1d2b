//! Public logs with real people, with the default settings.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

use std::path::{Path, PathBuf};

use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits, inspect};

struct Expected {
    name: &'static str,
    frames: u64,
    depth: bool,
    /// Height in m, pitch and roll in degrees at the first frame.
    pose: Option<(f64, f64, f64)>,
}

const fn log(
    name: &'static str,
    frames: u64,
    depth: bool,
    pose: Option<(f64, f64, f64)>,
) -> Expected {
    Expected { name, frames, depth, pose }
}

const LOGS: [Expected; 8] = [
    log("um", 38, true, Some((2.37, 27.7, 11.0))),
    log("filinha", 108, true, Some((2.36, 27.7, 11.8))),
    log("lab2-camera1", 39, true, Some((1.09, 2.1, -0.6))),
    log("lab2-camera2", 39, true, Some((1.17, 1.2, 0.2))),
    log("TUD-Stadtmitte", 179, false, None),
    log("pcl-single-frames", 2, true, Some((1.28, 4.7, 0.4))),
    log("kitti-stereo", 4, false, Some((1.67, -1.4, -0.3))),
    log("uc3m-single-frames", 12, true, Some((1.03, 1.4, -0.5))),
];

fn logs() -> Option<PathBuf> {
    tagalong_conformance::testdata::find("logs")
}

fn open(folder: &Path, name: &str, input: &InputSettings, inputs: Inputs) -> FrameSource {
    let path = folder.join(name).with_extension("mcap");
    FrameSource::open(&path, input, &Limits::default(), inputs).unwrap()
}

fn inputs(expected: &Expected) -> Inputs {
    let inputs = Inputs::ANY.require(Input::Colour);
    let inputs = if expected.depth { inputs.require(Input::Depth) } else { inputs };
    if expected.name == "kitti-stereo" { inputs.require(Input::Right) } else { inputs }
}

#[test]
fn every_log_opens_and_yields_its_frames() {
    let Some(folder) = logs() else { return };
    for expected in &LOGS {
        let mut source = open(&folder, expected.name, &InputSettings::default(), inputs(expected));
        let mut count = 0;
        let mut last = None;
        while let Some(found) = source.next_frame() {
            count += 1;
            let frame = &found.frame;
            assert_eq!(frame.index, count, "{}", expected.name);
            assert!(frame.colour().is_ok() && frame.depth().is_ok() == expected.depth);
            assert!(last.is_none_or(|last| last < frame.stamp));
            assert!(!found.odom_stale);
            last = Some(frame.stamp);
        }
        assert_eq!(count, expected.frames, "{}: {:?}", expected.name, source.counters());
        assert!(!source.data_lost(), "{}: {:?}", expected.name, source.notes());
        assert_eq!(source.progress(), 1.0);
        if let Some((height, pitch, roll)) = expected.pose {
            let facts = source.facts();
            assert!((facts.camera_height_m - height).abs() < 0.01, "{facts:?}");
            assert!((facts.camera_pitch_down_deg - pitch).abs() < 0.1, "{facts:?}");
            assert!((facts.camera_roll_deg - roll).abs() < 0.1, "{facts:?}");
            assert!(facts.camera_source.starts_with("tf"), "{facts:?}");
        }
    }
}

#[test]
fn a_camera_that_moves_between_frames_is_followed() {
    let Some(folder) = logs() else { return };
    let input = InputSettings::default();
    let mut source = open(&folder, "pcl-single-frames", &input, Inputs::ANY);
    let heights: Vec<f64> = std::iter::from_fn(|| source.next_frame())
        .map(|found| found.frame.camera.height_m())
        .collect();
    assert!((heights[0] - 1.28).abs() < 0.01 && (heights[1] - 1.46).abs() < 0.01, "{heights:?}");
    assert!(!source.counters().contains_key("frames_without_camera_pose"));
}

#[test]
fn the_baseline_of_a_stereo_pair_is_known() {
    let Some(folder) = logs() else { return };
    let inputs = Inputs::ANY.require(Input::Right);
    let mut source = open(&folder, "kitti-stereo", &InputSettings::default(), inputs);
    assert!((source.facts().baseline_m.unwrap() - 0.5327).abs() < 1e-3);
    let frame = source.next_frame().unwrap().frame;
    assert_eq!(frame.right().unwrap().image.width(), frame.colour().unwrap().width());
}

/// The floor that is fitted without tf agrees with the tf, which was measured by other means.
#[test]
fn the_floor_gives_the_pose_of_the_camera() {
    let Some(folder) = logs() else { return };
    let input = InputSettings { base_frame: "no_such_frame".into(), ..InputSettings::default() };
    for expected in LOGS.iter().filter(|log| log.depth && !log.name.contains("single")) {
        let source = open(&folder, expected.name, &input, inputs(expected));
        let facts = source.facts();
        eprintln!(
            "{}: {:.3} {:.2} {:.2} from {}; expected {:?}",
            expected.name,
            facts.camera_height_m,
            facts.camera_pitch_down_deg,
            facts.camera_roll_deg,
            facts.camera_source,
            expected.pose
        );
        assert!(facts.camera_source.contains("floor"));
        let (height, pitch, roll) = expected.pose.unwrap();
        // The floor of these cameras is shaped like a bowl (see the README of the logs).
        let metres = 0.08;
        let degrees = 2.0;
        assert!((facts.camera_height_m - height).abs() < metres, "{facts:?}");
        assert!((facts.camera_pitch_down_deg - pitch).abs() < degrees, "{facts:?}");
        assert!((facts.camera_roll_deg - roll).abs() < degrees, "{facts:?}");
    }
}

#[test]
fn missing_depth_is_told_before_the_first_frame() {
    let Some(folder) = logs() else { return };
    let inputs = Inputs::ANY.require(Input::Depth);
    let path = folder.join("TUD-Stadtmitte.mcap");
    let error = FrameSource::open(&path, &InputSettings::default(), &Limits::default(), inputs)
        .err()
        .unwrap()
        .to_string();
    assert!(error.contains("no depth images"), "{error}");
    assert!(error.contains("/camera/color/image_raw/compressed"), "{error}");
}

#[test]
fn a_mistyped_topic_answers_with_the_right_one() {
    let Some(folder) = logs() else { return };
    let input = InputSettings {
        colour_topic: Some("/camera/colour/image_raw/compressed".into()),
        ..InputSettings::default()
    };
    let path = folder.join("um.mcap");
    let error = FrameSource::open(&path, &input, &Limits::default(), Inputs::ANY).err().unwrap();
    assert!(error.to_string().contains("did you mean `/camera/color/image_raw/compressed`?"));
}

#[test]
fn inspection_tells_skew_rates_and_poses() {
    let Some(folder) = logs() else { return };
    let found =
        inspect(&folder.join("um.mcap"), &InputSettings::default(), &Limits::default()).unwrap();
    assert!((found.skew.unwrap().median_s - 0.008).abs() < 1e-6);
    assert_eq!(found.usable, ["colour", "depth"]);
    let colour = found.topics.iter().find(|t| t.topic.ends_with("color/image_raw/compressed"));
    assert!((colour.unwrap().rate_hz.unwrap() - 4.0).abs() < 0.01);
    let text = found.to_string();
    assert!(text.contains("2.37 m above the floor, 27.7 deg down"), "{text}");
    assert!(serde_json::to_string(&found).unwrap().contains("\"usable\":[\"colour\",\"depth\"]"));
}
