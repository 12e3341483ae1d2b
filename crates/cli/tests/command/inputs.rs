//! A pipeline receives exactly the images that it declares: one without depth gives the same bytes
//! on a log with depth and on the same log without.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tagalong_core::Stamp;
use tagalong_log::msgs::{CameraInfo, CompressedImage, Header, Image, decode};
use tagalong_log::write::MessageLog;
use tagalong_log::{Channel, Limits, LogWalker, Message};

use crate::common::broken::{self, Changes};
use crate::common::{Drawn, code, messages_of, tagalong, text};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A folder with a log, and the same log without its topics of depth.
struct Home(tempfile::TempDir);

impl Home {
    /// A person crossing a small room, seen by an RGB-D camera.
    fn simulated() -> Self {
        let home = tempfile::tempdir().unwrap();
        let scene = "seed = 3\nduration_s = 2.0\n[room]\nsize_m = [7.0, 5.0]\nclutter = 2\n\
            [camera]\nwidth = 320\nheight = 240\nrate_hz = 10.0\n[robot]\nstart = [0.8, 2.5]\n\
            [[people]]\npath = [[3.4, 1.8], [3.4, 3.4]]\nspeed_mps = 0.5\n";
        fs::write(home.path().join("scene.toml"), scene).unwrap();
        let home = Self(home);
        let said = home.tell(&["simulate", "scene.toml", "-o", "with.mcap"]);
        assert_eq!(said.0, 0, "{}", said.1);
        home.strip()
    }

    /// A real recording; `None`, with a message, where there is none.
    fn real(log: &str) -> Option<Self> {
        let log = tagalong_conformance::testdata::find(&format!("logs/{log}"))?;
        let home = tempfile::tempdir().unwrap();
        // Ten images tell whether depth makes a difference.
        let start = Changes { first_s: Some(5.0), ..Changes::default() };
        broken::write(&log, &home.path().join("with.mcap"), &start);
        Some(Self(home).strip())
    }

    fn strip(self) -> Self {
        let changes = Changes { without: &["depth"], ..Changes::default() };
        broken::write(&self.path("with.mcap"), &self.path("without.mcap"), &changes);
        self
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn tell(&self, args: &[&str]) -> (i32, String) {
        let output = tagalong().args(args).current_dir(self.0.path()).output().unwrap();
        (code(&output), text(&output.stderr) + &text(&output.stdout))
    }

    /// All results on people of a run with this config: its tracks in both files, and the
    /// candidates in its report.
    fn run(&self, config: &str, log: &str) -> [String; 3] {
        fs::write(self.path("config.toml"), config).unwrap();
        let (code, said) = self.tell(&["run", "config.toml", log, "-o", "out", "--overwrite"]);
        assert_eq!(code, 0, "{log}: {said}");
        let [report, boxes, places] = ["report.json", "tracks.csv", "tracks-metres.csv"]
            .map(|name| fs::read_to_string(self.path("out").join(name)).unwrap());
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        let found = ["frames", "persons", "candidates", "funnel"].map(|key| report[key].clone());
        [boxes, places, format!("{found:?}")]
    }
}

fn config(name: &str) -> String {
    fs::read_to_string(root().join("configs").join(format!("{name}.toml"))).unwrap()
}

/// One config that never uses depth, and one with `without`.
fn without_depth() -> [String; 2] {
    let told = format!("without = [\"depth\"]\n{}", config("rgbd-compressive"));
    [config("mono"), told]
}

fn same_on_both(home: &Home) {
    let mut rows = 0;
    for config in without_depth() {
        let with = home.run(&config, "with.mcap");
        let without = home.run(&config, "without.mcap");
        rows += with[0].lines().count();
        for (with, without) in with.iter().zip(&without) {
            assert_eq!(with, without, "{config}");
        }
    }
    assert!(rows > 5, "next to nobody is tracked: {rows} boxes");
}

#[test]
fn a_pipeline_without_depth_is_the_same_on_a_log_that_has_it() {
    let home = Home::simulated();
    same_on_both(&home);
    let uses = config("rgbd-compressive");
    let with = home.run(&uses, "with.mcap");
    let without = home.run(&uses, "without.mcap");
    assert_ne!(with[2], without[2], "one that uses depth sees the difference");
}

#[test]
fn a_pipeline_without_depth_is_the_same_on_a_real_log_that_has_it() {
    if let Some(home) = Home::real("lab2-camera2.mcap") {
        same_on_both(&home);
    }
}

#[test]
fn the_reason_for_which_a_better_pipeline_fails_is_told() {
    let home = Home::simulated();
    let changes = Changes { without: &["camera_info"], ..Changes::default() };
    broken::write(&home.path("with.mcap"), &home.path("uncalibrated.mcap"), &changes);
    let (code, said) = home.tell(&["run", "uncalibrated.mcap", "-o", "out"]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("the log has colour, depth and odometry: taking mono"), "{said}");
    let reason = "depth-verified would do better, but: the log has no calibration \
                  (sensor_msgs/CameraInfo) of ";
    assert!(said.contains(reason), "{said}");
    assert!(said.contains("; record its topic with the images"), "{said}");
}

#[test]
fn a_pipeline_that_requires_depth_is_refused_without() {
    let home = Home::simulated();
    fs::write(home.path("config.toml"), config("depth-ekf")).unwrap();
    let (code, said) = home.tell(&["run", "config.toml", "without.mcap", "-o", "out"]);
    assert_eq!(code, 1, "{said}");
    assert!(said.contains("has no depth images"), "{said}");
    assert!(said.contains("as `depth_topic` under [input]"), "{said}");
    assert!(!home.path("out").exists(), "a refused run leaves nothing behind");
    let (code, said) = home.tell(&["check", "config.toml", "without.mcap"]);
    assert_eq!(code, 1, "{said}");
    assert!(
        said.contains("config.toml: valid; needs depth\n"),
        "the config itself is right: {said}"
    );
}

#[test]
fn check_says_what_is_needed_and_what_is_used() {
    let home = tempfile::tempdir().unwrap();
    let path = home.path().join("config.toml");
    let bumper = "[[collision_monitor.sources]]\nname = \"hazards\"\ntype = \"bumper\"\n\
                  topic = \"/hazards\"\n";
    let named_topic = format!("{}[input]\ndepth_topic = \"/depth\"\n", config("rgbd-compressive"));
    for (config, words) in [
        (config("mono"), "valid; needs colour\n"),
        (config("rgbd-compressive"), "needs colour; uses depth if the log has it"),
        (named_topic, "valid; needs colour and depth\n"),
        (config("follow-depth"), "valid; needs depth and odometry; uses colour and laser if"),
        (
            format!("{}\n{bumper}", config("follow-depth")),
            "valid; needs depth and obstacle-sources and odometry; uses colour",
        ),
        (
            format!("without = [\"depth\"]\n{}", config("rgbd-ekf")),
            "`depth-template` requires depth images",
        ),
    ] {
        fs::write(&path, config).unwrap();
        let output = tagalong().arg("check").arg(&path).output().unwrap();
        let said = text(&output.stdout) + &text(&output.stderr);
        assert!(said.contains(words), "{words} in {said}");
    }
}

#[test]
fn a_low_camera_gets_the_pipeline_of_depth_that_suits_it() {
    let home = tempfile::tempdir().unwrap();
    for (height_m, expected) in [("0.4", "depth-net-ekf"), ("1.2", "depth-alone")] {
        let scene = format!(
            "duration_s = 1.0\n[camera]\nwidth = 120\nheight = 90\ncolour = false\n\
             height_m = {height_m}\n[[people]]\npath = [[3.2, 3.0], [8.0, 3.0]]\n"
        );
        fs::write(home.path().join("scene.toml"), scene).unwrap();
        let simulate = ["simulate", "scene.toml", "-o", "walk.mcap", "--overwrite"];
        let made = tagalong().args(simulate).current_dir(&home).output().unwrap();
        assert_eq!(code(&made), 0, "{}", text(&made.stderr));
        let ran = ["run", "walk.mcap", "-o", "out", "--overwrite"];
        let told = text(&tagalong().args(ran).current_dir(&home).output().unwrap().stderr);
        assert!(told.contains(&format!("taking {expected}, because")), "{height_m}: {told}");
    }
}

#[test]
fn a_log_of_a_scanner_alone_gets_a_pipeline_by_its_odometry() {
    for (log, expected) in [("laser-moving", "laser-legs"), ("laser-following", "laser-follow")] {
        let Some(path) = tagalong_conformance::testdata::find(&format!("laser/{log}.mcap")) else {
            return;
        };
        let home = tempfile::tempdir().unwrap();
        let output =
            tagalong().arg("run").arg(path).args(["-o", "out"]).current_dir(&home).output();
        let told = messages_of(&output.unwrap(), 0);
        assert!(told.contains(&format!("taking {expected}, because")), "{told}");
        let tracks = fs::read_to_string(home.path().join("out/tracks-metres.csv")).unwrap();
        assert!(tracks.lines().count() > 300, "{} lines", tracks.lines().count());
    }
}

#[test]
fn a_config_that_asks_for_odometry_says_where_there_is_none() {
    let Some(log) = tagalong_conformance::testdata::find("laser/laser-following.mcap") else {
        return;
    };
    let home = Home(tempfile::tempdir().unwrap());
    let log = log.to_str().unwrap();
    let (code, said) = home.tell(&["run", "laser-legs", "-o", "out", log]);
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("is for a robot with odometry"), "{said}");
    let (_, said) = home.tell(&["doctor", "laser-legs", log]);
    assert!(said.contains("the log has no odometry"), "{said}");
    let (_, said) = home.tell(&["run", "laser-follow", "-o", "other", log]);
    assert!(!said.contains("is for a robot with odometry"), "{said}");
}

#[test]
fn a_camera_for_a_log_of_scans_is_refused_with_the_way_out() {
    let Some(log) = tagalong_conformance::testdata::find("laser/laser-following.mcap") else {
        return;
    };
    let home = tempfile::tempdir().unwrap();
    for (config, words) in [
        (&[][..], &["no camera `/front`", "leave out --camera"][..]),
        (&["laser-follow"], &["laser-follow uses none, but laser: leave out --camera"]),
    ] {
        let mut command = tagalong();
        command.arg("run").args(config).arg(&log).args(["--camera", "/front"]);
        let output = command.current_dir(&home).output().unwrap();
        assert_ne!(code(&output), 0, "{}", text(&output.stdout));
        let why = text(&output.stderr);
        words.iter().for_each(|word| assert!(why.contains(word), "{word} in {why}"));
    }
}

/// Writes a log with a second camera, /rear, that sees the same as the first, and with a third one
/// whose images cannot be read.
fn write_cameras(path: &Path) {
    let drawn = path.with_extension("one.mcap");
    Drawn::of(8).write(&drawn);
    let mut log = MessageLog::create(path).unwrap();
    let mut walker = LogWalker::open(&drawn, &Limits::default()).unwrap();
    while let Some(message) = walker.next() {
        log.copy(&message).unwrap();
        let topic = &message.channel.topic;
        let Some(rest) = topic.strip_prefix("/camera/") else { continue };
        let rear = Channel { topic: format!("/rear/{rest}"), ..(**message.channel).clone() };
        log.copy(&Message { channel: &Arc::new(rear), ..message }).unwrap();
        if rest == "color/image_raw" {
            let side = Channel { topic: "/side/image_raw".into(), ..(**message.channel).clone() };
            let data = &message.data[..60];
            log.copy(&Message { channel: &Arc::new(side), data, ..message }).unwrap();
        }
    }
    log.finish().unwrap();
}

#[test]
fn each_camera_has_a_run_of_its_own() {
    let home = Home(tempfile::tempdir().unwrap());
    write_cameras(&home.path("two.mcap"));
    let (code, said) = home.tell(&["run", "two.mcap", "--each-camera", "-o", "out"]);
    assert_eq!(code, 3, "the third camera is reported, and part of it is lost: {said}");
    let [front, rear] = ["camera", "rear"].map(|camera| {
        let path = home.path(&format!("out/{camera}/tracks.csv"));
        fs::read_to_string(path).unwrap_or_else(|_| panic!("{camera}: {said}"))
    });
    assert_eq!(front, rear);
    assert!(said.contains("camera /side"), "{said}");
    // Without -o the folders have the names of log, config and camera.
    let (_, said) = home.tell(&["run", "depth-ekf", "two.mcap", "--each-camera"]);
    for camera in ["camera", "rear"] {
        let folder = home.path(&format!("runs/two-depth-ekf-{camera}"));
        assert!(folder.join("report.json").exists(), "{said}");
    }
    let (_, said) = home.tell(&["run", "two.mcap", "--camera", "/back"]);
    assert!(said.contains("no camera `/back`; --camera can be one of: "), "{said}");
    assert!(said.contains("/rear") && !said.contains("no built-in pipeline fits"), "{said}");
    let (code, said) = home.tell(&["run", "two.mcap", "--each-camera", "--camera", "/rear"]);
    assert!(code == 2 && said.contains("cannot be used with"), "{said}");
}

/// Reason for which depth of a log cannot be used.
struct Cause {
    name: &'static str,
    /// Writes a message of a topic of depth in another way; the number counts those of its topic.
    write: fn(&mut MessageLog, &Message<'_>, u64),
    /// Words of the sentence about the better pipeline: the cause, and the remedy. Without any, nothing
    /// stands in its way.
    words: &'static [&'static str],
}

const DEPTH_IMAGES: &str = "/camera/depth/image_raw";
/// Columns and rows of images that no integer ratio brings to the size of the calibration.
const OTHER_SIZE: (u32, u32) = (96, 72);

const CAUSES: [Cause; 14] = [
    Cause {
        name: "unknown encoding",
        write: |log, message, _| changed(log, message, |image| image.encoding = "16SC1".into()),
        words: &["encoding `16SC1` is not known", "depth as 16UC1 or 32FC1"],
    },
    Cause {
        name: "no calibration",
        write: |log, message, _| {
            if is_image(message) {
                smaller(log, message, "depth_optical");
            }
        },
        words: &["no calibration (sensor_msgs/CameraInfo) belongs to it", "`depth_info_topic`"],
    },
    Cause {
        name: "calibration of zeros",
        write: |log, message, _| {
            calibrated(log, message, |info| (info.k, info.p) = Default::default());
        },
        words: &["K[0] and K[4] are 0", "calibrate it or publish its camera_info"],
    },
    Cause {
        name: "calibration of another size",
        write: |log, message, _| {
            calibrated(log, message, |info| (info.width, info.height) = (128, 100));
        },
        words: &["is calibrated for 128x100, but the images are 96x72", "of this resolution"],
    },
    Cause {
        name: "stamps of another clock",
        write: |log, message, _| changed(log, message, |image| later(&mut image.header, 3600.0)),
        words: &["another clock", "`--stamps recording`"],
    },
    Cause {
        name: "stamps that are not set",
        write: |log, message, _| {
            changed(log, message, |image| {
                image.header = Header::new(Stamp::default(), "camera_optical")
            });
        },
        words: &["its stamps never change", "`--stamps recording`"],
    },
    Cause {
        name: "stamps between those of colour",
        write: |log, message, _| changed(log, message, |image| later(&mut image.header, 0.04)),
        words: &["they come 0.040 s after it", "set `pair_tolerance_s = 0.06`"],
    },
    Cause {
        name: "no transform",
        write: |log, message, _| {
            if is_image(message) {
                smaller(log, message, "depth_optical");
            } else {
                let mut info: CameraInfo = decode(message.data).unwrap();
                (info.width, info.height) = OTHER_SIZE;
                info.header.frame_id = "depth_optical".into();
                log.send_like(message, &info).unwrap();
            }
        },
        words: &["tf does not connect its frame `depth_optical` with", "record /tf_static"],
    },
    Cause {
        name: "JPEG",
        write: |log, message, _| {
            if is_image(message) {
                as_jpeg(log, message);
            }
        },
        words: &["JPEG keeps 8 of the 16 bits of depth", "or its compressedDepth"],
    },
    Cause {
        name: "rate",
        write: |log, message, number| {
            if number % 5 == 0 {
                log.copy(message).unwrap();
            }
        },
        words: &[],
    },
    Cause {
        name: "type of another package",
        write: |log, message, _| of_type(log, message, "my_msgs/msg/Image"),
        words: &["its type is not read", "republish it as sensor_msgs/Image"],
    },
    Cause {
        name: "colour and depth in one message",
        write: |log, message, _| of_type(log, message, "realsense2_camera_msgs/msg/RGBD"),
        words: &["colour and depth in one message", "record the topics of the images themselves"],
    },
    Cause {
        name: "packets of a lidar",
        write: |log, message, _| of_type(log, message, "velodyne_msgs/msg/VelodyneScan"),
        words: &[],
    },
    Cause {
        name: "video of another codec",
        write: |log, message, _| of_type(log, message, "theora_image_transport/msg/Packet"),
        words: &[],
    },
];

fn is_image(message: &Message<'_>) -> bool {
    message.channel.topic == DEPTH_IMAGES
}

/// Writes an image of depth with a change, and a calibration as it is.
fn changed(log: &mut MessageLog, message: &Message<'_>, change: fn(&mut Image<'_>)) {
    if !is_image(message) {
        return log.copy(message).unwrap();
    }
    let mut image: Image<'_> = decode(message.data).unwrap();
    change(&mut image);
    log.send_like(message, &image).unwrap();
}

fn later(header: &mut Header, seconds: f64) {
    *header = Header::new(header.stamp().plus_seconds(seconds), &header.frame_id);
}

/// Writes an image of depth that has fewer pixels and another frame.
fn smaller(log: &mut MessageLog, message: &Message<'_>, frame: &str) {
    let image: Image<'_> = decode(message.data).unwrap();
    let (width, height) = OTHER_SIZE;
    let data = 2800_u16.to_le_bytes().repeat((width * height) as usize);
    let header = Header::new(image.header.stamp(), frame);
    log.send_like(message, &Image::packed(header, "16UC1", width, height, &data)).unwrap();
}

/// Writes a calibration with a change, and smaller images of depth.
fn calibrated(log: &mut MessageLog, message: &Message<'_>, change: fn(&mut CameraInfo)) {
    if is_image(message) {
        return smaller(log, message, "camera_optical");
    }
    let mut info: CameraInfo = decode(message.data).unwrap();
    change(&mut info);
    log.send_like(message, &info).unwrap();
}

/// Writes an image of depth as JPEG.
fn as_jpeg(log: &mut MessageLog, message: &Message<'_>) {
    let image: Image<'_> = decode(message.data).unwrap();
    let grey = image::GrayImage::from_pixel(image.width, image.height, image::Luma([90]));
    let mut data = Vec::new();
    grey.write_to(&mut std::io::Cursor::new(&mut data), image::ImageFormat::Jpeg).unwrap();
    let format = "16UC1; jpeg compressed mono8".into();
    let compressed = CompressedImage { header: image.header, format, data: &data };
    log.send_like(message, &compressed).unwrap();
}

/// Writes an image of depth as a message of a type that is not read.
fn of_type(log: &mut MessageLog, message: &Message<'_>, schema_name: &str) {
    if is_image(message) {
        let like = (**message.channel).clone();
        let other = Channel { schema_name: schema_name.into(), definition: "".into(), ..like };
        log.copy(&Message { channel: &Arc::new(other), ..*message }).unwrap();
    }
}

/// Writes a log of colour and depth, of which depth cannot be used for a reason.
fn write_unusable(home: &Path, cause: &Cause) {
    let drawn = home.join("drawn.mcap");
    Drawn::of(20).write(&drawn);
    let mut log = MessageLog::create(&home.join("log.mcap")).unwrap();
    let mut walker = LogWalker::open(&drawn, &Limits::default()).unwrap();
    let mut images = 0;
    while let Some(message) = walker.next() {
        if message.channel.topic.starts_with("/camera/depth") {
            images += u64::from(is_image(&message));
            (cause.write)(&mut log, &message, images);
        } else {
            log.copy(&message).unwrap();
        }
    }
    log.finish().unwrap();
}

#[test]
fn each_reason_against_depth_is_told_and_never_that_colour_is_alone() {
    for cause in CAUSES {
        let home = tempfile::tempdir().unwrap();
        write_unusable(home.path(), &cause);
        for args in [
            &["run", "log.mcap", "-o", "out"][..],
            &["inspect", "log.mcap"],
            &["doctor", "log.mcap"],
        ] {
            let output = tagalong().args(args).current_dir(&home).output().unwrap();
            let said = text(&output.stderr) + &text(&output.stdout);
            let name = format!("{}, {}", cause.name, args[0]);
            for alone in ["colour alone", "images alone", "colour or grey"] {
                assert!(!said.contains(alone), "{name}: {said}");
            }
            assert!(said.contains(DEPTH_IMAGES), "{name}: {said}");
            if args[0] == "inspect" {
                continue;
            }
            let better = said.lines().find(|line| line.contains("would do better"));
            let Some(better) = better.filter(|_| !cause.words.is_empty()) else {
                assert!(better.is_none() && cause.words.is_empty(), "{name}: {said}");
                continue;
            };
            assert!(better.contains(DEPTH_IMAGES), "{name}: {better}");
            for words in cause.words {
                assert!(better.contains(words), "{name}: `{words}` is not in {better}");
            }
        }
    }
}

#[test]
fn frames_at_the_rate_of_slow_depth_are_told() {
    let home = tempfile::tempdir().unwrap();
    let rate = CAUSES.iter().find(|cause| cause.name == "rate").unwrap();
    write_unusable(home.path(), rate);
    let output =
        tagalong().args(["run", "log.mcap", "-o", "out"]).current_dir(&home).output().unwrap();
    let said = text(&output.stderr) + &text(&output.stdout);
    assert_eq!(code(&output), 0, "{said}");
    assert!(said.contains("16 of 20 images make no frame"), "{said}");
    assert!(
        said.contains("it has 2.0 images a second, and /camera/color/image_raw 10.0"),
        "{said}"
    );
}
