//! Frames of messages that arrive live, compared with those of the same messages in a log.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use std::io::Cursor;

use common::{SavedLog, at, started, sweep};
use nalgebra::Isometry3;
use tagalong_core::{ObstacleData, ObstacleReadings, Stamp};
use tagalong_log::msgs::{BoolMsg, BumperEvent, Header, Range, encode};
use tagalong_log::{
    Input, InputSettings, Inputs, Limits, Listening, LiveSource, LogError, LogFrame,
};
use tagalong_log::{LogWalker, ObstacleKind, ObstacleTopic};

const DEPTH: Inputs = Inputs::ANY.require(Input::Colour).require(Input::Depth);

/// Returns a log with colour and depth ten times a second, and odometry five times as often.
fn driven(frames: i32) -> Vec<u8> {
    let mut log = started();
    for i in 0..5 * frames {
        let t = f64::from(i) * 0.02;
        log.odometry(at(t), 0.4 * t, 0.2 * t);
        if i % 5 == 3 {
            log.colour(at(t - 0.01));
            log.depth(at(t - 0.005), "colour", 2.0 + i as f32);
        }
    }
    log.finish()
}

/// Calls `hear` with topic, type and bytes of all messages of a log.
fn replay(log: &[u8], mut hear: impl FnMut(&str, &str, &[u8])) {
    let mut walker = LogWalker::new(Cursor::new(log), &Limits::default()).unwrap();
    while let Some(message) = walker.next() {
        hear(&message.channel.topic, &message.channel.schema_name, message.data);
    }
}

fn listen(log: &[u8], input: &InputSettings, inputs: Inputs) -> Listening {
    let mut listening = Listening::new("the robot", input, &Limits::default(), inputs).unwrap();
    replay(log, |topic, kind, data| {
        listening.announce(topic, kind);
        listening.take(topic, data);
    });
    listening
}

/// Replays the log once to start, and then once more for the frames.
fn live(log: &[u8], inputs: Inputs) -> (Vec<LogFrame>, LiveSource) {
    let mut source = listen(log, &InputSettings::default(), inputs).start().unwrap();
    let mut frames = Vec::new();
    replay(log, |topic, _, data| {
        source.take(topic, data);
        frames.extend(source.newest_frame());
    });
    (frames, source)
}

fn count(source: &LiveSource, name: &str) -> u64 {
    source.counters().get(name).copied().unwrap_or(0)
}

#[test]
fn whoever_keeps_up_gets_the_frames_of_the_log() {
    let log = driven(12);
    let saved = SavedLog::new(&log);
    let mut source = saved.open(&InputSettings::default(), DEPTH).unwrap();
    let (found, live) = live(&log, DEPTH);
    assert_eq!(found.len(), 12);
    for frame in &found {
        let recorded = source.next_frame().unwrap();
        assert_eq!(frame.frame.index, recorded.frame.index);
        assert_eq!(frame.frame.stamp, recorded.frame.stamp);
        assert_eq!(frame.frame.camera, recorded.frame.camera);
        assert_eq!(frame.frame.motion, recorded.frame.motion);
        assert_eq!(frame.frame.colour().unwrap(), recorded.frame.colour().unwrap());
        assert_eq!(frame.frame.depth().unwrap(), recorded.frame.depth().unwrap());
        assert!(!frame.odom_stale && !frame.frame.odometry_jumped);
    }
    assert_eq!(count(&live, "frames_skipped"), 0);
    let facts = live.facts();
    assert_eq!((facts.colour_topic.as_deref(), facts.width), (Some("/camera/color/image_raw"), 16));
}

#[test]
fn whoever_is_slow_gets_the_newest_frame() {
    let log = driven(12);
    let mut source = listen(&log, &InputSettings::default(), DEPTH).start().unwrap();
    replay(&log, |topic, _, data| source.take(topic, data));
    let newest = source.newest_frame().unwrap();
    assert!((newest.frame.stamp.seconds_since(at(0.0)) - 1.15).abs() < 1e-6);
    assert_eq!(count(&source, "frames_skipped"), 11);
    assert!(source.newest_frame().is_none());
}

#[test]
fn an_image_whose_depth_does_not_come_holds_nobody_up() {
    let mut log = started();
    for i in 0..12 {
        log.colour(at(f64::from(i) * 0.1));
        if i % 2 == 0 {
            log.depth(at(f64::from(i) * 0.1 + 0.01), "colour", 2.0);
        }
    }
    let (found, live) = live(&log.finish(), DEPTH);
    assert_eq!(found.len(), 6);
    assert_eq!(count(&live, "frames_skipped"), 5);
}

#[test]
fn a_jump_of_odometry_is_told_with_its_frame() {
    let mut log = started();
    for i in 0..20 {
        log.odometry(at(f64::from(i) * 0.1), if i < 10 { 0.0 } else { 5.0 }, 0.0);
        log.colour(at(f64::from(i) * 0.1));
        log.depth(at(f64::from(i) * 0.1), "colour", 2.0);
    }
    let (found, _) = live(&log.finish(), DEPTH);
    let jumped: Vec<u64> =
        found.iter().filter(|f| f.frame.odometry_jumped).map(|f| f.frame.index).collect();
    assert_eq!((found.len(), jumped), (20, vec![11]));
}

/// Returns the error of a start without an input.
fn missing(listening: &Listening) -> String {
    match listening.start().err() {
        Some(error @ LogError::Missing { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_missing_is_named_until_it_comes() {
    let log = driven(3);
    let input = InputSettings::default();
    let mut listening = Listening::new("the robot", &input, &Limits::default(), DEPTH).unwrap();
    let text = missing(&listening);
    assert!(text.starts_with("`the robot` has no colour images"), "{text}");
    let depth = "/camera/depth/image_raw";
    replay(&log, |topic, kind, data| {
        listening.announce(topic, kind);
        if topic != depth {
            listening.take(topic, data);
        }
    });
    let text = missing(&listening);
    assert!(text.contains("has no depth images"), "{text}");
    assert!(text.contains("/camera/depth/image_raw (sensor_msgs/msg/Image; 0 messages)"), "{text}");
    replay(&log, |topic, _, data| listening.take(topic, data));
    assert!(listening.start().is_ok());
    let named = InputSettings { odometry_topic: Some("/odometry".into()), ..input };
    let error = listen(&log, &named, DEPTH).start().err().unwrap();
    assert!(matches!(error, LogError::UnknownTopic { .. }), "{error}");
    assert!(error.to_string().contains("did you mean `/odom`?"), "{error}");
}

/// The frames say which sensors they should have, so that one that never delivers is not taken for one
/// that the robot does not have.
#[test]
fn frames_name_a_scanner_that_is_announced_and_never_delivers() {
    let log = driven(6);
    for laser_topic in [None, Some("/scan".to_owned())] {
        let is_named = laser_topic.is_some();
        let input = InputSettings { laser_topic, ..InputSettings::default() };
        let mut listening = listen(&log, &input, DEPTH);
        listening.announce("/scan", "sensor_msgs/msg/LaserScan");
        let mut source = listening.start().unwrap();
        replay(&log, |topic, _, data| source.take(topic, data));
        let frame = source.newest_frame().unwrap().frame;
        assert_eq!(frame.expected.uses(Input::Laser), is_named);
        assert!(frame.expected.uses(Input::Depth) && frame.laser().is_none());
    }
}

/// The clock is set back by two seconds, and the scanner falls silent: stamps of frames come near those
/// of its old scans once more.
#[test]
fn after_a_step_of_the_clock_old_scans_are_not_taken_for_new_ones() {
    let mut log = started();
    log.fixed("base_link", "laser", &Isometry3::translation(0.2, 0.0, 0.3));
    for i in 0..60 {
        let t = if i < 30 { 0.1 * f64::from(i) } else { 0.1 * f64::from(i) - 2.0 };
        log.odometry(at(t), 0.0, 0.0);
        if i < 30 {
            log.message("/scan", at(t), &sweep(at(t), "laser"));
        }
        log.colour(at(t));
        log.depth(at(t), "colour", 2.0);
    }
    let (found, _) = live(&log.finish(), DEPTH);
    let has_scan: Vec<bool> = found.iter().map(|found| found.frame.laser().is_some()).collect();
    assert!(has_scan[..30].iter().all(|has| *has), "{has_scan:?}");
    assert!(has_scan[30..].iter().all(|has| !*has), "{has_scan:?}");
}

/// Returns the frame of a colour and a depth image that arrive at this time.
fn frame_at(source: &mut LiveSource, stamp: Stamp, arrival_ns: u64) -> LogFrame {
    let mut next = started();
    next.colour(stamp);
    next.depth(stamp, "colour", 2.0);
    replay(&next.finish(), |topic, _, data| {
        if matches!(topic, "/camera/color/image_raw" | "/camera/depth/image_raw") {
            source.take_at(topic, data, arrival_ns);
        }
    });
    source.newest_frame().unwrap()
}

#[test]
fn sources_of_obstacles_are_waited_for_and_read() {
    let log = driven(6);
    let sonar = ObstacleTopic {
        mount: Some([0.2, 0.0, 0.1, 0.0, 0.0, 0.0]),
        ..ObstacleTopic::new("sonar", ObstacleKind::Range, "/sonar")
    };
    let bumper = ObstacleTopic::new("bumper", ObstacleKind::Bumper, "/bumper");
    let button = ObstacleTopic::new("button", ObstacleKind::Bumper, "/button");
    let sources = vec![sonar, bumper, button];
    let input = InputSettings { sources, ..InputSettings::default() };
    let mut listening = listen(&log, &input, DEPTH);
    assert!(missing(&listening).contains("no message of source `sonar` on /sonar"));
    let range = Range { field_of_view: 0.5, max_range: 4.0, range: 1.5, ..Range::default() };
    listening.announce("/sonar", "sensor_msgs/msg/Range");
    assert!(listening.wants("/sonar"));
    listening.take("/sonar", &encode(&range));
    // Events need not have come: a bumper that is not pressed is silent.
    assert!(missing(&listening).contains("source `bumper`"));
    listening.announce("/bumper", "kobuki_ros_interfaces/msg/BumperEvent");
    assert!(missing(&listening).contains("source `button`"));
    listening.announce("/button", "std_msgs/msg/Bool");
    listening.take("/button", &encode(&BoolMsg { data: false }));
    let mut source = listening.start().unwrap();
    let topics: Vec<&str> = source.topics().collect();
    assert!(["/sonar", "/bumper", "/button"].iter().all(|topic| topics.contains(topic)));
    let mut last = None;
    replay(&log, |topic, _, data| {
        source.take(topic, data);
        last = source.newest_frame().or(last.take());
        if topic == "/camera/color/image_raw" && source.counters().contains_key("frames") {
            source.take_at("/button", &encode(&BoolMsg { data: true }), 1_000_000_000);
        }
    });
    source.take("/bumper", &encode(&BumperEvent { bumper: 1, state: BumperEvent::PRESSED }));
    let stamp = last.unwrap().frame.stamp.plus_seconds(0.1);
    let header = Header::new(stamp.plus_seconds(-0.05), "sonar");
    source.take("/sonar", &encode(&Range { header, ..range }));
    let found = frame_at(&mut source, stamp, 5_000_000_000);
    let readings = &found.frame.sensor::<ObstacleReadings>().unwrap().0;
    let names: Vec<&str> = readings.iter().map(|reading| &*reading.source).collect();
    assert_eq!(names, ["sonar", "bumper", "button"]);
    assert!((readings[0].age_s - 0.05).abs() < 1e-6, "{}", readings[0].age_s);
    assert!((stamp.seconds_since(readings[0].stamp) - 0.05).abs() < 1e-6);
    assert!(matches!(readings[1].data, ObstacleData::Bumper(true)) && readings[1].age_s == 0.0);
    assert!(matches!(readings[2].data, ObstacleData::Bumper(true)));
    // Without a time of its arrival it has that of the image before it.
    assert!((readings[2].age_s - 0.1).abs() < 1e-6, "{}", readings[2].age_s);
    source.take_at("/button", &encode(&BoolMsg { data: false }), 5_030_000_000);
    let found = frame_at(&mut source, stamp.plus_seconds(0.1), 5_100_000_000);
    let button = &found.frame.sensor::<ObstacleReadings>().unwrap().0[2];
    assert!(matches!(button.data, ObstacleData::Bumper(false)));
    assert!((button.age_s - 0.07).abs() < 1e-6, "{}", button.age_s);
}

#[test]
fn an_input_that_no_topic_can_carry_is_refused_before_the_first_frame() {
    const RADAR: Input = Input::Named("radar");
    let log = driven(3);
    let input = InputSettings::default();
    let refusal = missing(&listen(&log, &input, DEPTH.require(RADAR)));
    assert!(refusal.contains("has no input `radar`, because no topic is read for it"), "{refusal}");
    assert!(refusal.contains("`inputs.relax(..)`"), "{refusal}");
    assert!(listen(&log, &input, DEPTH.require(RADAR).relax(RADAR)).start().is_ok());
}

#[test]
fn our_own_tracks_are_nobodys_detections_unless_named() {
    let named = Some("/people/tracks".to_owned());
    for (detections_topic, wanted) in [(None, false), (named, true)] {
        let input = InputSettings { detections_topic, ..InputSettings::default() };
        let mut listening = Listening::new("x", &input, &Limits::default(), DEPTH).unwrap();
        assert!(!listening.wants("/people/tracks"));
        assert!(listening.announce("/people/tracks", "vision_msgs/msg/Detection3DArray"));
        assert!(!listening.announce("/people/tracks", "vision_msgs/msg/Detection3DArray"));
        assert_eq!(listening.wants("/people/tracks"), wanted);
    }
}
