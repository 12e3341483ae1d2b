//! Further sources of obstacles: range sensors, bumpers, and scanners and depth cameras beside those
//! of the frames.

use tagalong_core::{ObstacleData, ObstacleReading, ObstacleReadings, RangeReading};
use tagalong_log::msgs::{
    BoolMsg, BumperEvent, HazardDetection, HazardDetectionVector, Range, StringMsg,
};
use tagalong_log::{ObstacleKind, ObstacleTopic};

use super::*;

const BOOL: &str = "std_msgs/msg/Bool";

fn source(name: &str, kind: ObstacleKind, topic: &str) -> ObstacleTopic {
    ObstacleTopic::new(name, kind, topic)
}

fn input_with(sources: &[ObstacleTopic]) -> InputSettings {
    InputSettings { sources: sources.to_vec(), ..InputSettings::default() }
}

/// Opens a log with these sources.
fn open_with(log: LogWriter, sources: &[ObstacleTopic]) -> (FrameSource, SavedLog) {
    let saved = log.save();
    (saved.open(&input_with(sources), Inputs::ANY).unwrap(), saved)
}

/// Returns the readings of each frame.
fn readings(frames: &[LogFrame]) -> Vec<Vec<ObstacleReading>> {
    let readings = frames.iter().map(|found| found.frame.sensor::<ObstacleReadings>().unwrap());
    readings.map(|readings| readings.0.to_vec()).collect()
}

fn ranges(readings: &[Vec<ObstacleReading>]) -> Vec<RangeReading> {
    let ranges = readings.iter().flatten().map(|reading| match &reading.data {
        ObstacleData::Range(range) => *range,
        other => panic!("no range: {other:?}"),
    });
    ranges.collect()
}

/// Returns the state of the bumper in each frame; `None` where it has delivered nothing.
fn presses(readings: &[Vec<ObstacleReading>]) -> Vec<Option<bool>> {
    let first = readings.iter().map(|readings| readings.first());
    first.map(|it| Some(matches!(it?.data, ObstacleData::Bumper(true)))).collect()
}

fn range(stamp: f64, metres: f32) -> Range {
    Range {
        header: Header::new(at(stamp), "sonar"),
        radiation_type: 0,
        field_of_view: 0.5,
        min_range: 0.02,
        max_range: 4.0,
        range: metres,
    }
}

/// Writes a ride at half a metre per second with frames ten times a second.
fn ride(log: &mut LogWriter, tick: u32) {
    let t = 0.1 * f64::from(tick);
    log.odometry(at(t), 0.5 * t, 0.0);
    log.colour(at(t));
}

#[test]
fn a_range_is_where_the_robot_is_at_the_time_of_the_frame() {
    let sonar = source("sonar", ObstacleKind::Range, "/sonar");
    let mount = Some([0.3, 0.1, 0.2, 0.0, 0.0, 90.0]);
    let by_mount = ObstacleTopic { mount, ..sonar.clone() };
    for sonar in [sonar, by_mount] {
        let mut log = started();
        let turned = Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        log.fixed("base_link", "sonar", &Isometry3::new(Vector3::new(0.3, 0.1, 0.2), turned));
        for tick in 0..20 {
            // It comes 0.06 s before the frame, in which the robot drives 3 cm.
            let t = 0.1 * f64::from(tick) - 0.06;
            log.message("/sonar", at(t), &range(t, 1.5));
            ride(&mut log, tick);
        }
        let (mut source, _saved) = open_with(log, &[sonar]);
        assert_eq!(source.facts().obstacle_topics["sonar"], "/sonar");
        let found = frames(&mut source);
        let all = readings(&found);
        for readings in &all {
            let [reading] = &readings[..] else { panic!("one reading: {readings:?}") };
            assert_eq!(&*reading.source, "sonar");
            assert!((reading.age_s - 0.06).abs() < 1e-6, "{} s", reading.age_s);
        }
        // Before the first frame the place of the robot is not known.
        for reading in ranges(&all[1..]) {
            let place = reading.robot_from_sensor * Point3::new(1.5, 0.0, 0.0);
            assert!((place.x - 0.27).abs() < 1e-6, "{place}");
            assert!((place.y - 1.6).abs() < 1e-6 && (place.z - 0.2).abs() < 1e-9, "{place}");
            assert_eq!((reading.min_m, reading.max_m), (f64::from(0.02_f32), 4.0));
        }
        assert!(!source.data_lost());
    }
}

#[test]
fn a_range_that_falls_silent_stays_with_its_age() {
    let mut log = started();
    log.fixed("base_link", "sonar", &Isometry3::identity());
    for tick in 0..30 {
        ride(&mut log, tick);
        if (5..10).contains(&tick) {
            let t = 0.1 * f64::from(tick);
            log.message("/sonar", at(t), &range(t, 1.5));
        }
    }
    let (mut source, _saved) = open_with(log, &[source("sonar", ObstacleKind::Range, "/sonar")]);
    let all = readings(&frames(&mut source));
    assert!(all[..5].iter().all(Vec::is_empty), "it has not delivered yet");
    for (tick, readings) in all.iter().enumerate().skip(9) {
        let [reading] = &readings[..] else { panic!("a reading at {tick}") };
        let expected_s = 0.1 * tick as f64 - 0.9;
        assert!((reading.age_s - expected_s).abs() < 1e-6, "{} at {tick}", reading.age_s);
        assert_eq!(reading.stamp, all[9][0].stamp, "it is the same reading at {tick}");
    }
}

#[test]
fn ranges_say_what_rep_117_says_and_impossible_ones_are_counted() {
    let mut log = started();
    log.fixed("base_link", "sonar", &Isometry3::identity());
    let written = [1.0, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 0.0];
    for (tick, metres) in (0..).zip(written) {
        let t = f64::from(tick);
        log.colour(at(t));
        log.message("/sonar", at(t), &range(t, metres));
    }
    let bent = Range { field_of_view: f32::NAN, ..range(4.1, 2.0) };
    let turned = Range { min_range: 5.0, ..range(4.1, 2.0) };
    [bent, turned].iter().for_each(|range| log.message("/sonar", at(4.1), range));
    let (mut source, _saved) = open_with(log, &[source("sonar", ObstacleKind::Range, "/sonar")]);
    let found = ranges(&readings(&frames(&mut source)));
    let metres: Vec<f64> = found.iter().map(|reading| reading.range_m).collect();
    // Minus infinity is nearer than the sensor measures.
    assert_eq!(metres[..3], [1.0, f64::INFINITY, f64::from(0.02_f32)]);
    assert!(metres[3].is_nan() && metres[4] == 0.0);
    assert_eq!(count(&source, "ranges_invalid"), 2);
    assert!(source.data_lost());
}

#[test]
fn stamps_an_hour_ahead_or_standing_still_make_no_reading_young() {
    for (ahead, still) in [(3600.0, false), (0.0, true)] {
        let mut log = started();
        log.fixed("base_link", "sonar", &Isometry3::identity());
        for tick in 0..20 {
            ride(&mut log, tick);
            let t = 0.1 * f64::from(tick);
            let stamp = if still { 0.0 } else { t + ahead };
            log.message("/sonar", at(t), &range(stamp, 1.5));
        }
        let (mut source, _saved) =
            open_with(log, &[source("sonar", ObstacleKind::Range, "/sonar")]);
        let all = readings(&frames(&mut source));
        if still {
            assert!((all[19][0].age_s - 1.9).abs() < 1e-6);
        } else {
            assert!(all.iter().all(Vec::is_empty));
            assert_eq!(count(&source, "source_readings_ahead"), 20);
            let ahead = "source `sonar` is stamped 3600.0 s after";
            let told = source.notes().iter().filter(|note| note.contains(ahead));
            assert_eq!(told.count(), 1, "{:?}", source.notes());
        }
    }
}

/// Returns the scan of a scanner with three rays, of which the middle one meets something.
fn scan_of(frame: &str, t: f64, metres: f32) -> LaserScan {
    LaserScan {
        header: Header::new(at(t), frame),
        angle_min: -0.5,
        angle_max: 0.5,
        angle_increment: 0.5,
        range_min: 0.1,
        range_max: 20.0,
        ranges: vec![f32::INFINITY, metres, 0.05],
        ..LaserScan::default()
    }
}

#[test]
fn a_second_scanner_is_read_beside_the_first() {
    let mut log = started();
    log.fixed("base_link", "front", &Isometry3::translation(0.2, 0.0, 0.1));
    let back = Vector3::new(0.0, 0.0, std::f64::consts::PI);
    log.fixed("base_link", "rear", &Isometry3::new(Vector3::new(-0.2, 0.0, 0.1), back));
    for tick in 0..10 {
        ride(&mut log, tick);
        let t = 0.1 * f64::from(tick);
        // The rear one has more messages, and a name that would be chosen.
        for later in [0.0, 0.02] {
            log.message("/a/scan", at(t + later), &scan_of("rear", t + later, 1.0));
        }
        log.message("/b/scan", at(t), &scan_of("front", t, 3.0));
    }
    let (mut source, _saved) = open_with(log, &[source("rear", ObstacleKind::Scan, "/a/scan")]);
    assert_eq!(source.facts().laser_topic.as_deref(), Some("/b/scan"));
    let found = frames(&mut source);
    for (found, readings) in found.iter().zip(readings(&found)) {
        assert!((found.frame.laser().unwrap().points[0].x - 3.2).abs() < 1e-6);
        let [ObstacleReading { data: ObstacleData::Scan(rear), .. }] = &readings[..] else {
            panic!("one scan: {readings:?}")
        };
        let point = rear.points[0];
        assert!((point.x + 1.2).abs() < 1e-6 && point.y.abs() < 1e-6, "{point}");
        assert_eq!((rear.rays[..].to_vec(), rear.unread.len()), (vec![1], 2));
    }
}

/// A source that is not where it was is no less wrong than a camera of the frames that is not.
#[test]
fn c1_a_further_sensor_that_moves_in_tf_static_is_held_as_a_changed_calibration() {
    for is_source in [true, false] {
        let mut log = started();
        log.fixed("base_link", "front", &Isometry3::translation(0.2, 0.0, 0.1));
        log.fixed("base_link", "rear", &Isometry3::translation(-0.2, 0.0, 0.1));
        for tick in 0..10 {
            ride(&mut log, tick);
            let t = 0.1 * f64::from(tick);
            if tick == 5 {
                log.fixed_at(at(t), "base_link", "rear", &Isometry3::translation(-0.2, 0.3, 0.1));
            }
            log.message("/a/scan", at(t), &scan_of("front", t, 3.0));
            log.message("/b/scan", at(t), &scan_of("rear", t, 1.0));
        }
        let rear = source("rear", ObstacleKind::Scan, "/b/scan");
        let sources = if is_source { vec![rear] } else { Vec::new() };
        let (mut source, _saved) = open_with(log, &sources);
        let found = frames(&mut source);
        assert_eq!(found[0].frame.further_scans().len(), usize::from(!is_source));
        let changed: Vec<bool> =
            found.iter().map(|found| found.frame.calibration_changed).collect();
        assert_eq!((changed[3], changed[9]), (false, true), "{is_source} {changed:?}");
        let told = source.notes().join("\n");
        assert!(told.contains("tf_static moves `rear` in `base_link`"), "{told}");
    }
}

#[test]
fn c1_a_further_camera_whose_calibration_changes_is_held_as_a_changed_calibration() {
    let mut log = started();
    for tick in 0..10 {
        ride(&mut log, tick);
        let t = 0.1 * f64::from(tick);
        let info = info_of("rear", &camera(8, 6, if tick < 5 { 7.0 } else { 9.0 }));
        let header = Header::new(at(t), "rear");
        log.message("/rear/depth/camera_info", at(t), &CameraInfo { header, ..info });
        rear_depth(&mut log, t, 1.5);
    }
    let mount = Some([-0.3, 0.0, 0.5, 0.0, 0.0, 180.0]);
    let rear = source("rear", ObstacleKind::Depth, "/rear/depth/aligned");
    let (mut source, _saved) = open_with(log, &[ObstacleTopic { mount, ..rear }]);
    let found = frames(&mut source);
    let changed: Vec<bool> = found.iter().map(|found| found.frame.calibration_changed).collect();
    assert_eq!((changed[4], changed[9]), (false, true), "{changed:?}");
    let told = source.notes().join("\n");
    assert!(told.contains("/rear/depth/camera_info: the calibration changes"), "{told}");
}

/// Writes a depth image of a camera at the back.
fn rear_depth(log: &mut LogWriter, t: f64, metres: f32) {
    let data: Vec<u8> = [metres; 8 * 6].iter().flat_map(|v| v.to_le_bytes()).collect();
    let message = Image::packed(Header::new(at(t), "rear"), "32FC1", 8, 6, &data);
    log.message("/rear/depth/aligned", at(t), &message);
}

#[test]
fn a_depth_camera_at_the_back_is_no_depth_of_the_frames() {
    let mut log = started();
    log.info("/rear/depth/camera_info", "rear", &camera(8, 6, 7.0));
    for tick in 0..10 {
        ride(&mut log, tick);
        let t = 0.1 * f64::from(tick);
        log.depth(at(t), "colour", 2.0);
        rear_depth(&mut log, t, 1.5);
        rear_depth(&mut log, t + 0.03, 1.5);
    }
    let mount = Some([-0.3, 0.0, 0.5, 0.0, 0.0, 180.0]);
    let rear = source("rear", ObstacleKind::Depth, "/rear/depth/aligned");
    let (mut source, _saved) = open_with(log, &[ObstacleTopic { mount, ..rear.clone() }]);
    assert_eq!(source.facts().depth_topic.as_deref(), Some("/camera/depth/image_raw"));
    let found = frames(&mut source);
    assert_eq!(found[0].frame.depth().unwrap().get(3, 3), Some(2.0));
    for readings in readings(&found) {
        let [ObstacleReading { data: ObstacleData::Depth { image, camera }, .. }] = &readings[..]
        else {
            panic!("one depth image: {readings:?}")
        };
        assert_eq!((image.width(), image.get(4, 3)), (8, Some(1.5)));
        let place = camera.robot_from_camera * Point3::new(0.0, 0.0, 1.5);
        assert!((place.x + 1.8).abs() < 1e-6 && (place.z - 0.5).abs() < 1e-9, "{place}");
    }
    // Without a calibration or a mount it is left out, and told.
    let mut log = started();
    rear_depth(&mut log, 0.1, 1.5);
    log.colour(at(0.1));
    let (mut source, _saved) = open_with(log, &[rear]);
    assert!(readings(&frames(&mut source))[0].is_empty());
    let told = source.notes().join("\n");
    assert!(told.contains("calibration (sensor_msgs/CameraInfo) of source `rear`"), "{told}");
    assert!(told.contains("`info_topic`"), "{told}");
}

#[test]
fn a_sensor_without_a_pose_is_counted_and_told() {
    let mut log = started();
    for tick in 0..5 {
        ride(&mut log, tick);
        let t = 0.1 * f64::from(tick);
        log.message("/sonar", at(t), &range(t, 1.5));
    }
    let (mut source, _saved) = open_with(log, &[source("sonar", ObstacleKind::Range, "/sonar")]);
    assert!(readings(&frames(&mut source)).iter().all(Vec::is_empty));
    assert_eq!(count(&source, "source_readings_without_pose"), 5);
    let told = source.notes().iter().filter(|note| note.contains("give its pose as `mount`"));
    assert_eq!(told.count(), 1, "{:?}", source.notes());
}

#[test]
fn an_event_of_a_bumper_holds_until_it_is_released() {
    for (kind, name) in [
        ("kobuki_ros_interfaces/msg/BumperEvent", "ROS 2"),
        ("kobuki_msgs/BumperEvent", "ROS 1, converted"),
    ] {
        let mut log = started();
        for tick in 0..30 {
            ride(&mut log, tick);
            let events = match tick {
                10 => vec![(0, BumperEvent::PRESSED), (1, BumperEvent::PRESSED)],
                12 => vec![(0, BumperEvent::RELEASED)],
                20 => vec![(1, BumperEvent::RELEASED)],
                _ => Vec::new(),
            };
            for (bumper, state) in events {
                let event = BumperEvent { bumper, state };
                log.typed("/bumper", kind, at(0.1 * f64::from(tick) + 0.05), &event);
            }
        }
        let (mut source, _saved) =
            open_with(log, &[source("bumper", ObstacleKind::Bumper, "/bumper")]);
        let all = readings(&frames(&mut source));
        assert!(all.iter().flatten().all(|reading| reading.age_s == 0.0), "silence is no fault");
        let pressed: Vec<bool> = presses(&all).into_iter().map(Option::unwrap).collect();
        let expected: Vec<bool> = (0..30).map(|tick| (11..=20).contains(&tick)).collect();
        assert_eq!(pressed, expected, "{name}");
    }
}

#[test]
fn a_bool_has_the_time_at_which_it_came() {
    let mut log = started();
    for tick in 0..30 {
        ride(&mut log, tick);
        let t = 0.1 * f64::from(tick);
        if tick < 20 {
            log.typed("/bumper", BOOL, at(t + 0.05), &BoolMsg { data: tick >= 10 });
        }
    }
    let (mut source, _saved) = open_with(log, &[source("bumper", ObstacleKind::Bumper, "/bumper")]);
    let all = readings(&frames(&mut source));
    assert_eq!(presses(&all)[5], Some(false));
    assert_eq!(presses(&all)[29], Some(true), "it holds, and says how old it is");
    assert!((all[29][0].age_s - 0.95).abs() < 1e-6, "{}", all[29][0].age_s);
}

#[test]
fn a_bump_of_a_create_3_is_a_press() {
    let mut log = started();
    for tick in 0..20 {
        ride(&mut log, tick);
        let header = Header::new(at(0.1 * f64::from(tick)), "base_link");
        let kind = if tick == 10 { HazardDetection::BUMP } else { 2 };
        let detections = vec![HazardDetection { header: header.clone(), kind }];
        let hazards = HazardDetectionVector { header, detections };
        let name = "irobot_create_msgs/msg/HazardDetectionVector";
        log.typed("/hazard_detection", name, at(0.1 * f64::from(tick)), &hazards);
    }
    let (mut source, _saved) =
        open_with(log, &[source("bumper", ObstacleKind::Bumper, "/hazard_detection")]);
    let found = presses(&readings(&frames(&mut source)));
    let expected: Vec<Option<bool>> = (0..20).map(|tick| Some(tick == 10)).collect();
    assert_eq!(found, expected);
}

#[test]
fn t6_a_source_without_messages_is_told_with_the_topics_that_have_them() {
    let mut log = started();
    log.colour(at(0.1));
    log.message("/ultrasound", at(0.1), &range(0.1, 1.5));
    let sources = [
        source("sonar", ObstacleKind::Range, "/sonar"),
        source("rear", ObstacleKind::Scan, "/rear"),
        // A program fills it in itself.
        source("own", ObstacleKind::Range, ""),
    ];
    let (mut source, _saved) = open_with(log, &sources);
    assert!(readings(&frames(&mut source))[0].is_empty());
    assert_eq!(count(&source, "sources_without_messages"), 2);
    let told = source.notes().join("\n");
    let sonar = "no message of source `sonar` on /sonar; of sensor_msgs/Range there are \
                 /ultrasound (1 message)";
    assert!(told.contains(sonar), "{told}");
    let rear = "no message of source `rear` on /rear; no topic has sensor_msgs/LaserScan";
    assert!(told.contains(rear), "{told}");
}

#[test]
fn a_source_of_another_type_is_refused_by_name() {
    let mut log = started();
    log.colour(at(0.1));
    log.message("/sonar", at(0.1), &StringMsg { data: "near".into() });
    let input = input_with(&[source("sonar", ObstacleKind::Range, "/sonar")]);
    let saved = log.save();
    let told = saved.open(&input, Inputs::ANY).err().unwrap().to_string();
    assert!(
        told.contains("source `sonar` of [[collision_monitor.sources]] names /sonar"),
        "{told}"
    );
    assert!(told.contains("std_msgs/msg/String; it has to be one of: sensor_msgs/Range"), "{told}");
    // A pipeline without a controller does not read them.
    let mut source = saved.open(&input, Inputs::NONE.require(Input::Colour)).unwrap();
    assert!(source.next_frame().unwrap().frame.sensor::<ObstacleReadings>().is_err());
}

#[test]
fn messages_of_sources_that_are_cut_are_lost_data() {
    let mut log = started();
    log.colour(at(0.1));
    log.message("/sonar", at(0.1), &range(0.1, 1.5));
    log.bytes::<Range>("/sonar", at(0.15), &[0, 1, 0, 0, 7, 7]);
    let (source, _saved) = open_with(log, &[source("sonar", ObstacleKind::Range, "/sonar")]);
    assert_eq!(count(&source, "messages_undecodable"), 1);
    assert!(source.data_lost());
}
