//! Logs that show what users of other tools met, each with its right answer. They are not part of
//! the repository; the relatives of each kind are made by the tests of `crates/log`.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{code, tagalong, text};

/// Result of a command on a log.
struct Ran {
    code: i32,
    said: String,
    folder: tempfile::TempDir,
}

impl Ran {
    fn report(&self) -> Value {
        let report = fs::read_to_string(self.folder.path().join("out/report.json")).unwrap();
        serde_json::from_str(&report).unwrap()
    }

    fn persons(&self) -> usize {
        self.report()["persons"].as_object().unwrap().len()
    }

    fn frames(&self) -> u64 {
        self.report()["frames"]["processed"].as_u64().unwrap()
    }

    /// Returns the rows of a table of tracks: the numbers of a line each, by their columns.
    fn rows(&self, table: &str) -> Vec<Vec<f64>> {
        let text = fs::read_to_string(self.folder.path().join("out").join(table)).unwrap();
        let mut rows = Vec::new();
        for line in text.lines() {
            let numbers: Vec<f64> = line.split(',').flat_map(str::parse).collect();
            if numbers.len() == line.split(',').count() {
                rows.push(numbers);
            }
        }
        rows
    }

    /// Checks that all these words are said.
    fn says(&self, words: &[&str]) {
        for word in words {
            assert!(self.said.contains(word), "`{word}` is not in:\n{}", self.said);
        }
    }

    /// Returns the topic that is used as an input.
    fn used(&self, input: &str) -> String {
        let report = self.report();
        let topics = report["inputs"].as_array().unwrap();
        let found = topics.iter().find(|topic| topic["used_as"] == input);
        found.map_or(String::new(), |topic| topic["topic"].as_str().unwrap().to_owned())
    }
}

/// Columns of places in the robot's frame, and of whether the person is seen.
const X: usize = 3;
const Y: usize = 4;
const SEEN: usize = 17;

fn field(name: &str) -> Option<PathBuf> {
    tagalong_conformance::testdata::find(&format!("field/{name}"))
}

/// Runs a command on a log, with the config of a text if it is not empty.
fn ran(command: &str, config: &str, log: &PathBuf, more: &[&str]) -> Ran {
    let folder = tempfile::tempdir().unwrap();
    let mut program = tagalong();
    program.current_dir(folder.path()).arg(command);
    if !config.is_empty() {
        fs::write(folder.path().join("config.toml"), config).unwrap();
        program.arg("config.toml");
    }
    program.arg(log).args(more);
    if command == "run" {
        program.args(["-o", "out"]);
    }
    let output = program.output().unwrap();
    let said = text(&output.stdout) + &text(&output.stderr);
    Ran { code: code(&output), said, folder }
}

fn run(config: &str, log: &PathBuf, more: &[&str]) -> Ran {
    ran("run", config, log, more)
}

/// Checks that `inspect` and `doctor` print the account of the topic that `run` prints.
fn all_say(log: &PathBuf, words: &[&str]) {
    for command in ["run", "inspect", "doctor"] {
        ran(command, "", log, &[]).says(words);
    }
}

fn recorded(more: &str) -> String {
    format!("extends = \"recorded.toml\"\n{more}")
}

#[test]
fn depth_as_mono16_is_taken() {
    let Some(log) = field("fallback-reason-false/depth-mono16.mcap") else { return };
    let ran = run("", &log, &[]);
    assert_eq!((ran.code, ran.persons()), (0, 2), "{}", ran.said);
    ran.says(&["the log has colour and depth", "is taken for depth"]);
    assert!(!ran.said.contains("alone"), "{}", ran.said);
}

#[test]
fn all_images_are_of_one_camera() {
    let Some(log) = field("cameras-mixed/front-back.mcap") else { return };
    let ran = run("", &log, &[]);
    assert_eq!((ran.code, ran.persons()), (0, 2), "{}", ran.said);
    assert!(ran.used("colour").starts_with("/front_camera/"), "{}", ran.said);
    assert!(ran.used("depth").starts_with("/front_camera/"), "{}", ran.said);
    all_say(&log, &["it is of another camera; `camera = \"/back_camera\"` under [input]"]);
    let other = run("", &log, &["--camera", "/back_camera"]);
    assert!(other.used("depth").starts_with("/back_camera/"), "{}", other.said);
    let both = run("", &log, &["--each-camera"]);
    for camera in ["front_camera", "back_camera"] {
        let report = both.folder.path().join("out").join(camera).join("report.json");
        let report: Value = serde_json::from_slice(&fs::read(report).unwrap()).unwrap();
        assert!(report["inputs"].to_string().contains(&format!("/{camera}/")), "{}", both.said);
    }
}

#[test]
fn a_recording_of_a_viewer_has_calibration_unit_and_depth() {
    let Some(log) = field("calibration-elsewhere/viewer-recording.bag") else { return };
    let ran = run("", &log, &[]);
    assert_eq!(ran.code, 0, "{}", ran.said);
    assert_eq!((ran.persons(), ran.frames()), (1, 8), "{}", ran.said);
    assert!(!ran.said.contains("53 degrees"), "{}", ran.said);
    // The person walks from here; with another unit or lens the place is another one.
    let places = ran.rows("tracks-metres.csv");
    assert_eq!(places.len(), 8, "{places:?}");
    for place in places {
        let off_m = (place[X] - 3.0).hypot(place[Y] - 1.75);
        assert!(off_m < 0.3, "{off_m} m: {place:?}");
    }
    ran.says(&["Depth_0/info/camera_info", "0.001 m by /device_0/sensor_0/option/Depth_Units"]);
    assert!(ran.used("depth").contains("Depth_0"), "{}", ran.said);
}

#[test]
fn chairs_are_no_people_unless_the_settings_say_so() {
    let Some(log) = field("detections-any-class/person-and-chair.mcap") else { return };
    let ran = run(&recorded(""), &log, &[]);
    assert_eq!(ran.code, 0, "{}", ran.said);
    ran.says(&["detections of the class `chair` are left out", "detection_classes"]);
    assert_eq!(ran.persons(), 1, "{}", ran.said);
    let both = "[input]\ndetection_classes = [\"person\", \"chair\"]\n";
    assert_eq!(run(&recorded(both), &log, &[]).persons(), 2);
}

#[test]
fn detections_that_are_slower_than_the_images_are_tracked() {
    let Some(log) = field("detections-slower-than-images/every-third.mcap") else { return };
    let ran = run(&recorded(""), &log, &[]);
    assert_eq!((ran.code, ran.persons(), ran.frames()), (0, 1, 20), "{}", ran.said);
    ran.says(&["note: /detections has messages for 6 of 20 images: tracks are predicted"]);
    // A message comes with every third image, and between two of them the person is predicted.
    let places = ran.rows("tracks-metres.csv");
    let seen: Vec<f64> = places.iter().filter(|row| row[SEEN] > 0.0).map(|row| row[1]).collect();
    let expected: Vec<f64> = (0..seen.len()).map(|step| 6.0 + 3.0 * step as f64).collect();
    assert!(seen.len() >= 5 && seen == expected, "{seen:?}");
    let numbers: Vec<f64> = places.iter().map(|row| row[1]).collect();
    let without_gap: Vec<f64> = (0..places.len()).map(|step| 6.0 + step as f64).collect();
    assert_eq!(numbers, without_gap, "a frame without a place");
    for pair in places.windows(2) {
        let step_m = (pair[1][X] - pair[0][X]).hypot(pair[1][Y] - pair[0][Y]);
        assert!((0.01..0.1).contains(&step_m), "{step_m} m: {pair:?}");
    }
    let doctor = self::ran("doctor", &recorded(""), &log, &[]);
    assert_eq!(doctor.code, 0, "{}", doctor.said);
    doctor
        .says(&["the config needs detections; the log has colour, detections", "1 track, seen in"]);
    assert!(!doctor.said.contains("BAD"), "{}", doctor.said);
}

#[test]
fn depth_as_jpeg_is_told_with_what_to_record() {
    let Some(log) = field("depth-as-jpeg/16uc1.mcap") else { return };
    let topic = "/camera/depth/image_raw/compressed";
    all_say(&log, &[topic, "JPEG keeps 8 of the 16 bits of depth", "compressedDepth"]);
    let ran = run("", &log, &[]);
    ran.says(&["depth-verified would do better and needs depth"]);
    let named = format!("extends = \"depth-verified.toml\"\n[input]\ndepth_topic = \"{topic}\"\n");
    let refused = run(&named, &log, &[]);
    assert_eq!(refused.code, 2, "{}", refused.said);
    refused.says(&["JPEG keeps"]);
}

#[test]
fn stamps_that_are_not_set_are_replaced() {
    let Some(log) = field("stamps-all-equal/stamps-zero.mcap") else { return };
    let ran = run("", &log, &["--strict"]);
    assert_eq!((ran.code, ran.frames(), ran.persons()), (0, 20, 2), "{}", ran.said);
    ran.says(&["are not set: all are 0.0", "times of recording"]);
    let insisting = run("", &log, &["--stamps", "header"]);
    assert_eq!(insisting.code, 3, "{}", insisting.said);
    insisting.says(&["different images have the same stamp"]);
}

#[test]
fn odometry_of_another_clock_gives_no_places() {
    let Some(log) = field("odometry-other-clock/images-sim-time.mcap") else { return };
    all_say(&log, &["/odom", "it begins 1699999990.0 s later, by another clock"]);
    let ran = run("", &log, &[]);
    assert!(!ran.said.contains("silent"), "{}", ran.said);
    let tracks = fs::read_to_string(ran.folder.path().join("out/tracks-metres.csv")).unwrap();
    assert!(tracks.lines().skip(1).all(|line| line.contains(",NaN,NaN,NaN,")), "{tracks}");
    let by_recording = run("", &log, &["--stamps", "recording"]);
    let way = by_recording.used("odometry");
    assert_eq!((by_recording.code, &*way), (0, "/odom"), "{}", by_recording.said);
}

#[test]
fn a_png_of_16_bits_is_depth_by_content() {
    let Some(log) = field("depth-png-by-format/format-png.mcap") else { return };
    let named = "extends = \"depth-verified.toml\"\n[input]\n\
                 depth_topic = \"/camera/depth/image/compressed\"\ndepth_unit_m = 0.001\n";
    let ran = run(named, &log, &[]);
    assert_eq!((ran.code, ran.persons()), (0, 2), "{}", ran.said);
    let unnamed = run("", &log, &[]);
    assert_eq!(unnamed.persons(), 2, "{}", unnamed.said);
    unnamed.says(&["is taken for depth"]);
}

#[test]
fn both_scanners_are_seen() {
    let Some(log) = field("second-sensor-unused/two-scanners.mcap") else { return };
    let ran = run("", &log, &[]);
    assert_eq!(ran.code, 0, "{}", ran.said);
    all_say(&log, &["laser: /scan_front", "laser: /scan_rear"]);
    assert_eq!((ran.persons(), ran.frames()), (1, 40), "{}", ran.said);
    let places = ran.rows("tracks-metres.csv");
    assert!(places.len() >= 38, "{} places", places.len());
    // The scanner at the rear alone sees the person.
    assert!(places.iter().all(|row| row[X] < -1.0), "{places:?}");
}

#[test]
fn detections_of_foxy_are_read() {
    let Some(log) = field("detections-older-layout/foxy.mcap") else { return };
    let ran = run(&recorded(""), &log, &[]);
    assert_eq!((ran.code, ran.persons()), (0, 1), "{}", ran.said);
}

#[test]
fn the_unit_of_depth_is_measured() {
    let Some(log) = field("depth-unit-advice/unit-quarter-mm.mcap") else { return };
    ran("doctor", "", &log, &[]).says(&["[input] depth_unit_m = 0.00025"]);
    run("", &log, &[]).says(&["its unit is 0.00025 m: set `depth_unit_m = 0.00025`"]);
    let set = "extends = \"depth-verified.toml\"\n[input]\ndepth_unit_m = 0.00025\n";
    let cured = run(set, &log, &[]);
    assert_eq!(cured.persons(), 2, "{}", cured.said);
}

/// Checks that one person is in all frames from the third on, where the network says that it is: at 213, 92
/// with 86 pixels in an image of 512 x 384, of which this one has a quarter.
fn has_the_box(ran: &Ran) {
    assert_eq!((ran.persons(), ran.frames()), (1, 20), "{}", ran.said);
    let boxes = ran.rows("tracks.csv");
    assert!(boxes.len() >= 18, "{} boxes", boxes.len());
    for row in boxes {
        let scaled = [row[2], row[3], row[4], row[5]].map(|pixels| 4.0 * pixels);
        for (found, expected) in scaled.into_iter().zip([213.0, 92.0, 86.0, 86.0]) {
            assert!((found - expected).abs() < 1.0, "{scaled:?}");
        }
    }
}

#[test]
fn a_network_of_which_the_shape_does_not_tell_the_family_is_told_apart_or_refused() {
    let Some(network) = field("network-family-by-shape/boxes-score-label.onnx") else { return };
    let Some(log) = field("fallback-reason-false/depth-mono16.mcap") else { return };
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/onnx.toml");
    let [found, named] = ["", ", family = \"yolov10\""].map(|family| {
        let config = format!(
            "extends = \"{}\"\n[[detectors]]\nplugin = \"onnx\"\n\
             config = {{ model = \"{}\"{family} }}\n",
            shipped.display(),
            network.display()
        );
        run(&config, &log, &[])
    });
    let is_refused = found.code == 2 && found.said.contains("yolov10");
    if !is_refused {
        has_the_box(&found);
    }
    assert_eq!(named.code, 0, "{}", named.said);
    has_the_box(&named);
}

#[test]
fn depth_with_a_calibration_of_another_size_names_both() {
    let Some(log) = field("depth-calibration-other-size/colour-size.mcap") else { return };
    let words = [
        "/camera/depth/camera_info is calibrated for 128x96, but the images are 192x108",
        "/camera/depth/image_rect_raw",
    ];
    all_say(&log, &words);
}

#[test]
fn a_scan_that_cannot_be_is_refused_by_its_field() {
    let Some(log) = field("scan-impossible/increment-zero.mcap") else { return };
    let ran = run("extends = \"laser-follow.toml\"\n", &log, &[]);
    assert_ne!(ran.code, 0, "{}", ran.said);
    ran.says(&["angle_increment is 0"]);
    let chosen = run("", &log, &[]);
    assert_ne!(chosen.code, 0, "{}", chosen.said);
    chosen.says(&["angle_increment is 0"]);
    let doctor = self::ran("doctor", "extends = \"laser-follow.toml\"\n", &log, &[]);
    doctor.says(&["angle_increment is 0", "/scan: no usable scan", "0 frames of 60"]);
    doctor.says(&["the config needs laser; nothing in the log can be used"]);
    let inspected = tagalong().arg("inspect").arg(&log).output().unwrap();
    let listed = text(&inspected.stdout);
    assert!(listed.contains("a pipeline can use: nothing\n"), "{listed}");
    for untrue in ["over 0 degrees", "no problem found"] {
        assert!(!doctor.said.contains(untrue), "{}", doctor.said);
    }
}
