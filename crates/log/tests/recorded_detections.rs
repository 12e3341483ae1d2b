//! Recorded detections: their classes, their rates and the layouts of their messages.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

#[path = "common/mod.rs"]
mod common;

use common::{LogWriter, SavedLog, at, started};
use nalgebra::{Isometry3, Vector3};
use serde::Serialize;
use tagalong_core::Stamp;
use tagalong_log::msgs::{
    BoundingBox2D, Detection2D, Detection2DArray, Header, Image, ObjectHypothesis,
    ObjectHypothesisWithPose, Point2D, Pose2D, PoseWithCovariance, encode,
};
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, StampSource};

const TOPIC: &str = "/detections";

fn stamp(index: u32) -> Stamp {
    at(0.1 * f64::from(index))
}

/// Returns the recorded detections of each frame; `None` for frames without a message.
fn read(mut log: LogWriter, frames: u32, classes: &[&str]) -> (Vec<Option<usize>>, FrameSource) {
    // Behind the detections, because an image does not wait for them until the end of the log.
    (0..frames).for_each(|index| log.colour(stamp(index)));
    let input = InputSettings {
        detections_topic: Some(TOPIC.into()),
        detection_classes: classes.iter().map(|class| (*class).to_owned()).collect(),
        ..InputSettings::default()
    };
    let inputs = Inputs::NONE.require(Input::Colour).require(Input::Detections);
    let mut source = log.save().open(&input, inputs).unwrap();
    let frames = std::iter::from_fn(|| source.next_frame());
    let counts = frames.map(|found| found.frame.recorded().map(<[_]>::len)).collect();
    (counts, source)
}

fn array(stamp: Stamp, classes: &[&str]) -> Detection2DArray {
    let header = Header::new(stamp, "colour");
    let detections = classes.iter().map(|class| {
        let hypothesis = ObjectHypothesis { class_id: (*class).to_owned(), score: 0.9 };
        let pose = PoseWithCovariance::default();
        let center = Pose2D { position: Point2D { x: 8.0, y: 6.0 }, theta: 0.0 };
        Detection2D {
            header: header.clone(),
            results: vec![ObjectHypothesisWithPose { hypothesis, pose }],
            bbox: BoundingBox2D { center, size_x: 4.0, size_y: 6.0 },
            id: String::new(),
        }
    });
    Detection2DArray { header: header.clone(), detections: detections.collect() }
}

#[test]
fn detections_that_are_slower_than_the_images_are_told() {
    for (interval, told) in [(1, None), (3, Some("has messages for 7 of 20 images"))] {
        let mut log = started();
        for index in (0..20).step_by(interval) {
            log.message(TOPIC, stamp(index), &array(stamp(index), &["person"]));
        }
        let (counts, source) = read(log, 20, &[]);
        assert_eq!(counts.iter().flatten().count(), 20_usize.div_ceil(interval));
        let note = source.notes().iter().find(|note| note.contains("has messages for"));
        assert_eq!(note.is_some(), told.is_some(), "{:?}", source.notes());
        assert!(note.is_none_or(|note| note.contains(told.unwrap())), "{note:?}");
    }
}

#[test]
fn people_are_taken_and_other_classes_are_named() {
    for (classes, settings, taken) in [
        (&["person", "chair"][..], &[][..], 1),
        (&["Pedestrian", "HUMAN", "dog"], &[], 2),
        (&["0", "56"], &[], 1),
        (&["", ""], &[], 2),
        (&["person", "chair"], &["chair"], 1),
        (&["1", "0"], &["1"], 1),
        (&["upper_body", "hand"], &["upper body", "hand"], 2),
        (&["car", "truck"], &[], 0),
    ] {
        let mut log = started();
        log.message(TOPIC, stamp(0), &array(stamp(0), classes));
        let (counts, source) = read(log, 1, settings);
        assert_eq!(counts, [Some(taken)], "{classes:?} {settings:?}");
        let others = classes.len() - taken;
        let counted = source.counters().get("detections_of_other_classes").copied().unwrap_or(0);
        assert_eq!(counted, others as u64, "{classes:?}");
        let told = source.notes().iter().any(|note| note.contains("detection_classes"));
        assert_eq!(told, others > 0, "{:?}", source.notes());
    }
}

#[test]
fn detections_that_the_settings_name_are_listed_as_usable() {
    let mut log = started();
    log.message(TOPIC, stamp(0), &array(stamp(0), &["person"]));
    log.colour(stamp(0));
    let saved = log.save();
    let [named, unnamed] = [Some(TOPIC), None].map(|topic| {
        let detections_topic = topic.map(str::to_owned);
        let input = InputSettings { detections_topic, ..InputSettings::default() };
        tagalong_log::inspect(&saved.path, &input, &Default::default()).unwrap().usable
    });
    assert_eq!(named, ["colour", "detections"]);
    assert_eq!(unnamed, ["colour"]);
}

#[test]
fn detections_that_no_setting_names_come_with_the_command_that_uses_them() {
    for (topic, lines) in [
        (TOPIC, &["`tagalong run recorded LOG` uses them"][..]),
        ("/boxes", &["`extends = \"recorded.toml\"`", "`input.detections_topic = \"/boxes\"`"]),
    ] {
        let mut log = started();
        log.message(topic, stamp(0), &array(stamp(0), &["person"]));
        log.colour(stamp(0));
        let saved = log.save();
        let input = InputSettings::default();
        let found = tagalong_log::inspect(&saved.path, &input, &Default::default()).unwrap();
        let told = found.inputs.topics.iter().find(|told| told.topic == topic).unwrap();
        let remedy = told.remedy.as_ref().unwrap();
        assert!(lines.iter().all(|line| remedy.contains(line)), "{remedy}");
        assert_eq!(remedy.contains("detections_topic"), topic != TOPIC, "{remedy}");
    }
}

#[test]
fn boxes_that_cannot_be_are_lost_with_the_cause() {
    let nan = f64::NAN;
    for (x, y, width, height, counter) in [
        (8.0, nan, 4.0, 6.0, "detections_invalid"),
        (8.0, 6.0, f64::INFINITY, 6.0, "detections_invalid"),
        (8.0, 6.0, 0.0, 0.0, "detections_invalid"),
        (8.0, 6.0, 4.0, -6.0, "detections_invalid"),
        (0.5, 0.5, 0.2, 0.6, "detections_as_fractions"),
        (0.1, 0.9, 1.0, 1.0, "detections_as_fractions"),
    ] {
        let mut message = array(stamp(0), &["person", "person"]);
        let center = Pose2D { position: Point2D { x, y }, theta: 0.0 };
        message.detections[0].bbox = BoundingBox2D { center, size_x: width, size_y: height };
        let mut log = started();
        log.message(TOPIC, stamp(0), &message);
        let (counts, source) = read(log, 1, &[]);
        assert_eq!(counts, [Some(1)], "{x} {y} {width} {height}");
        assert_eq!(source.counters().get(counter), Some(&1), "{:?}", source.counters());
        assert!(source.data_lost(), "{:?}", source.notes());
    }
}

#[test]
fn boxes_that_mean_something_else_are_told_by_their_values() {
    for (bbox, score, is_lost, told) in [
        ([8.0, 6.0, 4.0, 6.0], 0.9, false, ""),
        ([9.0, 3.0, 14.0, 9.0], 0.9, true, "if their middle and size are two corners"),
        ([6.0, 14.0, 6.0, 4.0], 0.9, true, "are inside with x and y exchanged"),
        ([80.0, 60.0, 40.0, 60.0], 0.9, true, "as far as to x = 100 and y = 90"),
        ([6.0, 8.0, 8.0, 4.0], 0.9, false, "the detector writes y before x"),
        ([8.0, 6.0, 4.0, 6.0], 90.0, false, "scores from 90.00 to 90.00 are no probabilities"),
    ] {
        let mut log = started();
        for index in 0..8 {
            let mut message = array(stamp(index), &["person"]);
            let [x, y, size_x, size_y] = bbox;
            let center = Pose2D { position: Point2D { x, y }, theta: 0.0 };
            message.detections[0].bbox = BoundingBox2D { center, size_x, size_y };
            message.detections[0].results[0].hypothesis.score = score;
            log.message(TOPIC, stamp(index), &message);
        }
        let (counts, source) = read(log, 8, &[]);
        assert_eq!(counts, [Some(1); 8], "{told}");
        let notes = source.notes();
        let is_told = notes.iter().any(|note| note.starts_with(TOPIC) && note.contains(told));
        assert_eq!(is_told, !told.is_empty(), "{bbox:?}: {notes:?}");
        assert_eq!(source.data_lost(), is_lost, "{bbox:?}: {notes:?}");
    }
}

#[test]
fn no_message_is_no_look_and_an_empty_one_is_nobody() {
    for every in [1, 2, 3, 5, 7] {
        let mut log = started();
        for index in (0..10).step_by(every) {
            let classes: &[&str] = if index == 0 { &[] } else { &["person"] };
            let index = index as u32;
            log.message(TOPIC, stamp(index), &array(stamp(index), classes));
        }
        let (counts, _) = read(log, 10, &[]);
        for (index, count) in counts.iter().enumerate() {
            let expected = (index % every == 0).then_some(usize::from(index > 0));
            assert_eq!(*count, expected, "frame {index}, every {every}");
        }
    }
}

/// Writes eight images, and detections of each with these stamps behind them.
fn stamped(stamp_of: impl Fn(u32) -> Stamp, is_set_in_header: bool) -> SavedLog {
    let mut log = started();
    for index in 0..8 {
        let mut message = array(stamp_of(index), &["person"]);
        if !is_set_in_header {
            message.header.stamp = Stamp::default().into();
        }
        log.message(TOPIC, stamp(index).plus_seconds(0.05), &message);
    }
    (0..8).for_each(|index| log.colour(stamp(index)));
    log.save()
}

/// Reads a log to its end; returns the number of frames with detections.
fn read_saved(saved: &SavedLog, input: &InputSettings) -> (usize, FrameSource) {
    let topic = Some(TOPIC.to_owned());
    let input = InputSettings { detections_topic: topic, ..input.clone() };
    let inputs = Inputs::NONE.require(Input::Colour).require(Input::Detections);
    let mut source = saved.open(&input, inputs).unwrap();
    let frames = std::iter::from_fn(|| source.next_frame());
    (frames.filter(|found| found.frame.recorded().is_some()).count(), source)
}

#[test]
fn detections_that_belong_to_no_frame_are_lost_with_the_offset_and_the_remedy() {
    for (offset_s, offset, remedy) in [
        (0.04, "0.040 s after", "`pair_tolerance_s = 0.06`"),
        (-2.0, "2.05 s earlier than those of the frames", "and set `pair_tolerance_s = 0.07`"),
        (3600.0, "3599.95 s later than those of the frames", "`--stamps recording`"),
        (-1.6e9, "s earlier than those of the frames", "and set `pair_tolerance_s = 0.07`"),
    ] {
        let saved = stamped(|index| stamp(index).plus_seconds(offset_s), true);
        let (seen, source) = read_saved(&saved, &InputSettings::default());
        assert_eq!(seen, 0, "{offset_s}");
        assert!(source.data_lost(), "{offset_s}: {:?}", source.notes());
        assert_eq!(source.counters()["detections_without_frame"], 8);
        let told = source.account().used_as("detections").unwrap().to_string();
        assert!(told.contains(offset) && told.contains(remedy), "{offset_s}: {told}");
        assert!(source.notes().contains(&told), "{:?}", source.notes());
    }
}

#[test]
fn boxes_in_images_of_another_camera_are_left_out() {
    let beside = Isometry3::translation(0.05, 0.0, 0.0);
    let behind = Isometry3::rotation(Vector3::new(0.0, 3.0, 0.0));
    for (frame, taken) in [
        ("colour", 4),
        ("/colour", 4),
        ("", 4),
        ("camera_link", 4),
        ("base_link", 4),
        ("yolo", 4),
        ("beside_optical_frame", 4),
        ("unknown_optical_frame", 4),
        ("behind_optical_frame", 0),
        ("/behind_optical_frame", 0),
        ("rear", 0),
    ] {
        let mut log = started();
        log.fixed("colour", "beside_optical_frame", &beside);
        log.fixed("colour", "behind_optical_frame", &behind);
        log.fixed("colour", "camera_link", &behind);
        for index in 0..4 {
            let mut message = array(stamp(index), &["person"]);
            message.header.frame_id = frame.to_owned();
            log.message(TOPIC, stamp(index), &message);
            let header = Header::new(stamp(index), "rear");
            let image = Image::packed(header, "rgb8", 2, 1, &[0; 6]);
            log.message("/rear_camera/color/image_raw", stamp(index), &image);
        }
        (0..4).for_each(|index| log.colour(stamp(index)));
        let colour_topic = Some("/camera/color/image_raw".to_owned());
        let input = InputSettings { colour_topic, ..InputSettings::default() };
        let (seen, source) = read_saved(&log.save(), &input);
        assert_eq!(seen, taken, "{frame}: {:?}", source.notes());
        assert_eq!(source.data_lost(), taken == 0, "{frame}");
        let told = source.notes().iter().any(|note| note.contains("of another camera, whose"));
        assert_eq!(told, taken == 0, "{frame}: {:?}", source.notes());
        let told = source.notes().iter().any(|note| note.contains("is in no other message"));
        assert_eq!(told, frame.starts_with("unknown"), "{frame}: {:?}", source.notes());
    }
}

#[test]
fn the_remedy_for_another_clock_works() {
    let saved = stamped(|index| Stamp::default().plus_seconds(10.0 + 0.1 * f64::from(index)), true);
    let stamps = StampSource::Recording;
    let input = InputSettings { stamps, pair_tolerance_s: 0.07, ..InputSettings::default() };
    let (seen, source) = read_saved(&saved, &input);
    assert_eq!(seen, 8);
    assert!(!source.data_lost(), "{:?}", source.notes());
    // Where it is not enough, it is not told again.
    let input = InputSettings { stamps, ..InputSettings::default() };
    let (seen, source) = read_saved(&saved, &input);
    let told = source.account().used_as("detections").unwrap().to_string();
    assert_eq!(seen, 0);
    assert!(told.contains("by their times of recording") && !told.contains("--stamps"), "{told}");
}

#[test]
fn stamps_of_the_detections_stand_in_for_one_that_the_array_lacks() {
    let (seen, source) = read_saved(&stamped(stamp, false), &InputSettings::default());
    assert_eq!(seen, 8, "{:?}", source.notes());
    assert!(!source.data_lost());
    let unset = stamped(|_| Stamp::default(), false);
    let (seen, source) = read_saved(&unset, &InputSettings::default());
    assert_eq!(seen, 0);
    let told = source.account().used_as("detections").unwrap().to_string();
    assert!(source.data_lost() && told.contains("its stamps are not set"), "{told}");
}

/// Foxy's hypothesis: a text and a score beside the pose.
#[derive(Serialize)]
struct FoxyHypothesis {
    id: String,
    score: f64,
    pose: PoseWithCovariance,
}

#[derive(Serialize)]
struct FlatPose {
    x: f64,
    y: f64,
    theta: f64,
}

#[derive(Serialize)]
struct FlatBox {
    center: FlatPose,
    size_x: f64,
    size_y: f64,
}

const FLAT_BOX: FlatBox =
    FlatBox { center: FlatPose { x: 8.0, y: 6.0, theta: 0.0 }, size_x: 4.0, size_y: 6.0 };

#[derive(Serialize)]
struct Foxy<'a> {
    header: Header,
    results: Vec<FoxyHypothesis>,
    bbox: FlatBox,
    source_img: Image<'a>,
    is_tracking: bool,
    tracking_id: String,
}

fn foxy() -> Vec<u8> {
    let header = Header::new(stamp(0), "colour");
    let pose = PoseWithCovariance::default();
    let hypothesis = FoxyHypothesis { id: "person".into(), score: 0.9, pose };
    let one = Foxy {
        header: header.clone(),
        results: vec![hypothesis],
        bbox: FLAT_BOX,
        source_img: Image::default(),
        is_tracking: false,
        tracking_id: String::new(),
    };
    encode(&(header, vec![one]))
}

#[derive(Serialize)]
struct YoloBox {
    center: Pose2D,
    size: Point2D,
}

#[derive(Serialize)]
struct Yolo {
    class_id: i32,
    class_name: String,
    score: f64,
    id: String,
    bbox: YoloBox,
}

fn yolo_of(classes: &[(i32, &str)]) -> Vec<u8> {
    let center = Pose2D { position: Point2D { x: 8.0, y: 6.0 }, theta: 0.0 };
    let detections = classes.iter().map(|(class_id, class_name)| Yolo {
        class_id: *class_id,
        class_name: (*class_name).to_owned(),
        score: 0.9,
        id: "7".into(),
        bbox: YoloBox { center, size: Point2D { x: 4.0, y: 6.0 } },
    });
    encode(&(Header::new(stamp(0), "colour"), detections.collect::<Vec<_>>()))
}

fn yolo() -> Vec<u8> {
    yolo_of(&[(0, "person")])
}

#[test]
fn a_class_without_a_name_is_that_of_its_number() {
    for (classes, people) in [
        (&[(0, ""), (56, ""), (2, "")][..], 1),
        (&[(0, "person"), (56, "chair")], 1),
        (&[(0, "chair"), (1, "person")], 1),
        (&[(3, ""), (4, "")], 0),
    ] {
        let mut log = started();
        let kind = ("yolo_msgs/msg/DetectionArray", YOLO);
        log.defined(TOPIC, kind, "cdr", stamp(0), &yolo_of(classes));
        let (counts, source) = read(log, 1, &[]);
        assert_eq!(counts, [Some(people)], "{classes:?}: {:?}", source.notes());
    }
}

const YOLO: &str = include_str!("../msgs/DetectionArray-yolo.msg");

/// Returns a message as ROS 1 Noetic writes it, with a number as the class.
fn noetic(class: i64) -> Vec<u8> {
    let mut header = Vec::new();
    let time = stamp(0);
    let seconds = (time.nanos() / 1_000_000_000) as u32;
    let nanos = (time.nanos() % 1_000_000_000) as u32;
    for word in [7_u32, seconds, nanos, 6] {
        header.extend(word.to_le_bytes());
    }
    header.extend(b"colour");
    let mut out = header.clone();
    out.extend(1_u32.to_le_bytes());
    out.extend(&header);
    out.extend(1_u32.to_le_bytes());
    out.extend(class.to_le_bytes());
    out.extend(0.9_f64.to_le_bytes());
    out.extend([0_u8; (7 + 36) * 8]);
    for value in [8.0_f64, 6.0, 0.0, 4.0, 6.0] {
        out.extend(value.to_le_bytes());
    }
    out.extend(&header);
    // Height, width, no encoding, byte, step, no data.
    out.extend([0_u8; 4 + 4 + 4 + 1 + 4 + 4]);
    out
}

const FOXY: &str = include_str!("../msgs/Detection2DArray-foxy.msg");
const NOETIC: &str = include_str!("../msgs/Detection2DArray-noetic.msg");

#[test]
fn older_and_other_layouts_are_read_by_the_definition_in_the_log() {
    let boxes = "vision_msgs/msg/Detection2DArray";
    for (name, definition, encoding, data) in [
        (boxes, FOXY, "cdr", foxy()),
        // A database has no definitions: the layouts that are known are tried.
        (boxes, "", "cdr", foxy()),
        ("vision_msgs/Detection2DArray", NOETIC, "ros1", noetic(0)),
        ("vision_msgs/Detection2DArray", "", "ros1", noetic(0)),
        ("yolo_msgs/msg/DetectionArray", YOLO, "cdr", yolo()),
        (boxes, "", "cdr", encode(&array(stamp(0), &["person"]))),
    ] {
        let mut log = started();
        log.defined(TOPIC, (name, definition), encoding, stamp(0), &data);
        let (counts, source) = read(log, 1, &[]);
        assert_eq!(counts, [Some(1)], "{name} {encoding}: {:?}", source.notes());
        assert!(!source.data_lost(), "{:?}", source.notes());
    }
}

#[test]
fn a_layout_that_is_not_known_is_a_loss_with_its_reason() {
    let mut log = started();
    let mut data = foxy();
    data.truncate(data.len() - 40);
    log.defined(TOPIC, ("vision_msgs/msg/Detection2DArray", FOXY), "cdr", stamp(0), &data);
    let (counts, source) = read(log, 1, &[]);
    assert_eq!(counts, [None]);
    let told = source.notes().iter().any(|note| note.contains("it ends early"));
    assert!(source.data_lost() && told, "{:?}", source.notes());
}
