//! Frames from small invented logs.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod cameras;
mod clocks;
mod clouds;
#[path = "../common/mod.rs"]
mod common;
mod lost_pairs;
mod obstacles;
mod odometry_age;
mod scan_motion;
mod topics;

use common::{INFO, LogWriter, SavedLog, at, camera, info_of, level_pose, started};
use mcap::WriteOptions;
use nalgebra::{Isometry3, Point2, Point3, Vector3};
use tagalong_core::{DepthImage, Stamp};
use tagalong_geometry::Camera;
use tagalong_log::msgs::{
    CameraInfo, CompressedImage, CompressedVideo, DisparityImage, FfmpegPacket, Header, Image,
    LaserScan, Message, encode_big_endian,
};
use tagalong_log::{
    CameraSettings, DisparitySettings, FrameSource, Input, InputSettings, Inputs, Limits, LogError,
    LogFrame, MountSettings,
};

const DEPTH: Inputs = Inputs::ANY.require(Input::Colour).require(Input::Depth);

fn open(log: LogWriter, inputs: Inputs) -> (FrameSource, SavedLog) {
    let saved = log.save();
    (saved.open(&InputSettings::default(), inputs).unwrap(), saved)
}

/// Returns the first frame of a log with depth, and the source.
fn first_depth(log: LogWriter, input: &InputSettings) -> Result<(FrameSource, LogFrame), String> {
    let source = log.save().open(input, Inputs::ANY.require(Input::Depth));
    let mut source = source.map_err(|error| error.to_string())?;
    let frame = source.next_frame().ok_or_else(|| format!("{:?}", source.notes()))?;
    Ok((source, frame))
}

fn frames(source: &mut FrameSource) -> Vec<LogFrame> {
    std::iter::from_fn(|| source.next_frame()).collect()
}

fn indices(frames: &[LogFrame]) -> Vec<u64> {
    frames.iter().map(|found| found.frame.index).collect()
}

fn count(source: &FrameSource, name: &str) -> u64 {
    source.counters().get(name).copied().unwrap_or(0)
}

#[test]
fn colour_without_depth_is_counted_and_keeps_its_index() {
    let mut log = started();
    for i in 0..10 {
        let stamp = at(f64::from(i) * 0.033);
        log.colour(stamp);
        if i % 2 == 0 {
            log.depth(stamp.plus_seconds(0.008), "colour", 2.0 + i as f32);
        }
    }
    let bytes = log.finish();
    let saved = SavedLog::new(&bytes);
    let input = InputSettings::default();
    let mut source = saved.open(&input, DEPTH).unwrap();
    let found = frames(&mut source);
    assert_eq!(indices(&found), [1, 3, 5, 7, 9]);
    assert_eq!(found[2].frame.depth().unwrap().get(3, 3), Some(6.0));
    assert_eq!(count(&source, "colour_without_depth"), 5);
    assert_eq!(count(&source, "depth_without_colour"), 0);
    assert!((found[1].frame.motion.dt - 0.066).abs() < 1e-9);
    assert!(!source.data_lost());
    let mut source = saved.open(&input, Inputs::ANY.require(Input::Colour)).unwrap();
    let found = frames(&mut source);
    assert_eq!(found.len(), 10);
    assert!(found[0].frame.depth().is_ok() && found[1].frame.depth().is_err());
}

#[test]
fn skew_beyond_the_tolerance_pairs_nothing() {
    for (skew, expected) in [(0.0, 4), (0.029, 4), (-0.029, 4), (0.05, 0)] {
        let mut log = started();
        for i in 0..4 {
            let stamp = at(1.0 + f64::from(i) * 0.25);
            log.colour(stamp);
            log.depth(stamp.plus_seconds(skew), "colour", 2.0);
        }
        let (mut source, _saved) = open(log, DEPTH);
        assert_eq!(frames(&mut source).len(), expected, "{skew}");
        assert_eq!(count(&source, "colour_without_depth"), 4 - expected as u64);
        assert_eq!(count(&source, "depth_without_colour"), 4 - expected as u64);
    }
}

/// Writes colour images with these stamps in this order.
fn run_of(stamps: &[f64]) -> (FrameSource, SavedLog) {
    let mut log = started();
    stamps.iter().for_each(|stamp| {
        log.colour(at(*stamp));
        log.depth(at(*stamp + 0.001), "colour", *stamp as f32 + 1.0);
    });
    open(log, DEPTH)
}

fn stamps(frames: &[LogFrame]) -> Vec<f64> {
    let seconds = frames.iter().map(|found| found.frame.stamp.seconds_since(at(0.0)));
    seconds.map(|seconds| (seconds * 1000.0).round() / 1000.0).collect()
}

#[test]
fn disorder_within_the_window_is_undone_to_the_byte() {
    let (mut sorted, _a) = run_of(&[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
    let (mut mixed, _b) = run_of(&[0.3, 0.1, 0.2, 0.4, 0.6, 0.5]);
    let sorted = frames(&mut sorted);
    let mixed = frames(&mut mixed);
    assert_eq!(stamps(&sorted), stamps(&mixed));
    for (a, b) in sorted.iter().zip(&mixed) {
        assert_eq!(a.frame.index, b.frame.index);
        assert_eq!(a.frame.motion, b.frame.motion);
        assert_eq!(a.frame.colour().unwrap(), b.frame.colour().unwrap());
        assert_eq!(a.frame.depth().unwrap(), b.frame.depth().unwrap());
    }
}

#[test]
fn repeated_frames_are_delivered_once() {
    let (mut source, _saved) = run_of(&[0.1, 0.2, 0.2, 0.3, 0.3, 0.4]);
    let found = frames(&mut source);
    assert_eq!(stamps(&found), [0.1, 0.2, 0.3, 0.4]);
    assert_eq!(indices(&found), [1, 2, 3, 4]);
    assert_eq!(count(&source, "duplicate_frames"), 2);
}

#[test]
fn a_frame_that_is_very_late_is_dropped() {
    let mut late: Vec<f64> = (1..12).map(|i| f64::from(i) * 0.1).collect();
    late.insert(9, 0.15);
    let (mut source, _saved) = run_of(&late);
    let found = frames(&mut source);
    assert_eq!(found.len(), 11);
    assert!(stamps(&found).is_sorted());
    assert_eq!(count(&source, "late_frames"), 1);
}

#[test]
fn a_clock_that_jumps_back_loses_no_frame() {
    for back in [10.0, 86_400.0] {
        let first: Vec<f64> = (1..8).map(|i| 90_000.0 + f64::from(i) * 0.1).collect();
        let second: Vec<f64> = first.iter().map(|t| t - back).collect();
        let (mut source, _saved) = run_of(&[first.clone(), second.clone()].concat());
        let found = frames(&mut source);
        let written: Vec<f64> =
            first.iter().chain(&second).map(|t| (t * 1000.0).round() / 1000.0).collect();
        assert_eq!(stamps(&found), written);
        assert_eq!(count(&source, "time_jumps_back"), 1);
        let notes = source.notes().join("\n");
        assert!(notes.contains("are set back to"), "{notes}");
        assert!(found.iter().all(|found| found.frame.motion.dt >= 0.0));
        assert_eq!(found[7].frame.motion.dt, 0.0);
    }
}

#[test]
fn odometry_is_taken_at_the_stamps_of_the_images() {
    let mut log = started();
    for i in 0..40 {
        let t = f64::from(i) * 0.05;
        log.odometry(at(t), 0.4 * t, 0.2 * t);
        if i % 5 == 3 {
            log.colour(at(t - 0.02));
        }
    }
    let (mut source, _saved) = open(log, Inputs::ANY.require(Input::Colour));
    let found = frames(&mut source);
    assert_eq!(found.len(), 8);
    assert!(!source.notes().iter().any(|note| note.contains("at rest")));
    for found in &found {
        let t = found.frame.stamp.seconds_since(at(0.0));
        assert!((found.odom_from_robot.translation.x - 0.4 * t).abs() < 1e-6);
        assert!((found.odom_from_robot.rotation.angle() - 0.2 * t).abs() < 1e-6);
        assert!(!found.odom_stale);
    }
    let motion = &found[4].frame.motion;
    assert!((motion.dt - 0.25).abs() < 1e-9 && (motion.turn - 0.05).abs() < 1e-6);
    assert!(motion.covariance[(0, 0)] > 0.0);
    assert_eq!(found[0].frame.motion.dt, 0.0);
}

/// Simulates a scanner 0.2 m ahead of the robot's centre that measures a wall 5 m ahead of the
/// start, ten times a second, while the robot drives towards it at 0.4 m/s.
fn with_scanner(log: &mut LogWriter) {
    for i in 0..20 {
        let t = f64::from(i) * 0.1;
        log.odometry(at(t), 0.4 * t, 0.0);
        let scan = LaserScan {
            header: Header::new(at(t), "laser"),
            angle_increment: 0.1,
            range_min: 0.1,
            range_max: 20.0,
            ranges: vec![(4.8 - 0.4 * t) as f32, f32::INFINITY],
            ..LaserScan::default()
        };
        log.message("/scan", at(t), &scan);
        log.colour(at(t + 0.05));
    }
}

#[test]
fn what_a_laser_met_is_where_it_is_at_the_time_of_the_image() {
    let mut log = started();
    let ahead = Isometry3::translation(0.2, 0.0, 0.15);
    log.fixed("base_link", "laser", &ahead);
    with_scanner(&mut log);
    let (mut source, _saved) = open(log, Inputs::ANY);
    assert_eq!(source.facts().laser_topic.as_deref(), Some("/scan"));
    let found = frames(&mut source);
    assert_eq!(found.len(), 20);
    for found in &found {
        let t = found.frame.stamp.seconds_since(at(0.0));
        let scan = found.frame.laser().unwrap();
        let [wall] = scan.points[..] else { panic!("one ray met something") };
        let off_s = found.frame.stamp.seconds_since(scan.stamp.unwrap());
        assert!((off_s - 0.05).abs() < 1e-6, "the stamp is that of the scan: {off_s}");
        assert!((wall.x - (5.0 - 0.4 * t)).abs() < 1e-5 && (wall.z - 0.15).abs() < 1e-6, "{wall}");
    }
    assert_eq!(count(&source, "frames_without_laser"), 0);
}

#[test]
fn a_laser_without_a_place_or_silent_for_long_is_told() {
    let mut log = started();
    with_scanner(&mut log);
    log.colour(at(3.0));
    let (mut source, _saved) = open(log, Inputs::ANY);
    assert!(frames(&mut source).iter().all(|found| found.frame.laser().is_none()));
    assert_eq!(count(&source, "laser_scans_without_pose"), 20);
    assert_eq!(count(&source, "frames_without_laser"), 1);
    assert_eq!(source.notes().iter().filter(|note| note.contains("laser scanner")).count(), 1);
}

#[test]
fn gaps_and_jumps_of_odometry_are_told() {
    let mut log = started();
    for i in 0..60 {
        let seconds = f64::from(i) * 0.1;
        if !(10..30).contains(&i) {
            // The odometry jumps by 5 m at 4.5 s.
            log.odometry(at(seconds), if i < 45 { 0.0 } else { 5.0 }, 0.0);
        }
        log.colour(at(seconds + 0.01));
    }
    let (mut source, _saved) = open(log, Inputs::ANY);
    let found = frames(&mut source);
    let stale: Vec<u64> =
        found.iter().filter(|found| found.odom_stale).map(|found| found.frame.index - 1).collect();
    // Up to half a second the last motion is continued; the motion of the frame behind a gap is
    // unknown.
    assert_eq!(stale, [&(14..=30).collect::<Vec<u64>>()[..], &[44, 45]].concat());
    assert_eq!(count(&source, "odometry_gap_frames"), 16);
    assert_eq!(count(&source, "odometry_jump_frames"), 2);
    assert!(found.iter().all(|found| found.frame.motion.forward.abs() < 0.5));
}

#[test]
fn without_odometry_the_robot_rests_and_this_is_said_once() {
    let (mut source, _saved) = run_of(&[0.1, 0.2, 0.3]);
    let found = frames(&mut source);
    assert!(found.iter().all(|f| f.odom_from_robot == nalgebra::Isometry2::identity()));
    assert_eq!(source.notes().iter().filter(|note| note.contains("at rest")).count(), 1);
}

#[test]
fn tf_can_be_the_odometry() {
    let mut log = started();
    for i in 0..20 {
        let t = f64::from(i) * 0.1;
        let pose = Isometry3::new(Vector3::new(t, 0.0, 0.0), Vector3::zeros());
        log.moving("odom", "base_link", at(t), &pose);
        if i % 2 == 1 {
            log.colour(at(t - 0.05));
        }
    }
    let (mut source, _saved) = open(log, Inputs::ANY);
    let found = frames(&mut source);
    assert!((found[3].odom_from_robot.translation.x - 0.65).abs() < 1e-6);
    assert!((found[3].frame.motion.forward - 0.2).abs() < 1e-6);
}

#[test]
fn both_byte_orders_and_every_compression_give_the_same_frames() {
    for (name, compression) in common::compressions() {
        let options = WriteOptions::new().compression(compression);
        let mut log = LogWriter::new(options);
        let info = info_of("colour", &camera(16, 12, 14.0));
        log.bytes::<CameraInfo>(INFO, at(0.0), &encode_big_endian(&info));
        let data: Vec<u8> = (0..16 * 12 * 3).map(|v| v as u8).collect();
        let mut image = Image::packed(Header::new(at(1.0), "colour"), "bgr8", 16, 12, &data);
        log.bytes::<Image<'_>>("/camera/color/image_raw", at(1.0), &encode_big_endian(&image));
        image.header = Header::new(at(2.0), "colour");
        log.message("/camera/color/image_raw", at(2.0), &image);
        let (mut source, _saved) = open(log, Inputs::ANY.require(Input::Colour));
        let found = frames(&mut source);
        assert_eq!(stamps(&found), [1.0, 2.0], "{name}");
        assert_eq!(found[0].frame.colour().unwrap(), found[1].frame.colour().unwrap());
        assert_eq!(found[0].frame.colour().unwrap().get(0, 0), Some([2, 1, 0]));
    }
}

#[test]
fn messages_that_do_not_decode_are_dropped_and_counted() {
    let mut log = started();
    log.colour(at(0.1));
    log.bytes::<Image<'_>>("/camera/color/image_raw", at(0.2), &[0, 1, 0, 0, 1, 2, 3]);
    log.bytes::<Image<'_>>("/camera/color/image_raw", at(0.3), &[0, 3, 0, 0, 1, 2, 3]);
    log.colour(at(0.4));
    let (mut source, _saved) = open(log, Inputs::ANY);
    assert_eq!(frames(&mut source).len(), 2);
    assert_eq!(count(&source, "messages_undecodable"), 2);
    assert!(source.data_lost());
}

#[test]
fn images_of_another_size_are_refused() {
    let mut log = started();
    log.colour(at(0.1));
    log.colour_of(at(0.2), 20, 12);
    log.colour(at(0.3));
    let (mut source, _saved) = open(log, Inputs::ANY);
    assert_eq!(indices(&frames(&mut source)), [1, 3]);
    assert_eq!(count(&source, "images_of_other_size"), 1);

    let mut log = started();
    log.colour_of(at(0.2), 20, 12);
    let error = log.save().open(&InputSettings::default(), Inputs::ANY).err().unwrap();
    assert!(matches!(error, LogError::Calibration { .. }));
    assert!(error.to_string().contains("16x12, but the images are 20x12"), "{error}");
}

#[test]
fn a_bad_calibration_names_topic_and_field() {
    let mut log = LogWriter::plain();
    let mut info = info_of("colour", &camera(16, 12, 14.0));
    info.k[0] = f64::NAN;
    log.message(INFO, at(0.0), &info);
    log.colour(at(0.1));
    let error = log.save().open(&InputSettings::default(), Inputs::ANY).err().unwrap();
    assert!(error.to_string().contains("topic /camera/color/camera_info: K = NaN"), "{error}");
}

#[test]
fn c1_a_calibration_that_changes_on_the_way_marks_the_frames_after_it() {
    let mut log = started();
    for i in 0..10 {
        let stamp = at(f64::from(i) * 0.1);
        // The same numbers again are no change.
        let focal = if i < 6 { 14.0 } else { 20.0 };
        let header = Header::new(stamp, "colour");
        log.message(
            INFO,
            stamp,
            &CameraInfo { header, ..info_of("colour", &camera(16, 12, focal)) },
        );
        log.colour(stamp);
    }
    let (mut source, _saved) = open(log, Inputs::ANY);
    let found = frames(&mut source);
    let changed: Vec<u64> =
        found.iter().filter(|f| f.frame.calibration_changed).map(|f| f.frame.index).collect();
    assert_eq!(changed, [7, 8, 9, 10]);
    assert!(found.iter().all(|f| f.frame.camera.focal_px() == 14.0), "the first one is used");
    assert!(source.data_lost());
    assert_eq!(count(&source, "camera_info_changes"), 4);
}

#[test]
fn the_pose_of_the_camera_can_be_given() {
    let mut log = LogWriter::plain();
    log.info(INFO, "colour", &camera(16, 12, 14.0));
    log.colour(at(0.1));
    log.depth(at(0.1), "colour", 2.0);
    let saved = log.save();
    let mount = MountSettings { height_m: 1.5, pitch_down_deg: 10.0, roll_deg: -3.0, name: None };
    let input =
        InputSettings { camera: Some(CameraSettings::Mounted(mount)), ..InputSettings::default() };
    let mut source = saved.open(&input, DEPTH).unwrap();
    let camera = source.next_frame().unwrap().frame.camera.clone();
    assert!((camera.height_m() - 1.5).abs() < 1e-12);
    assert!((camera.pitch_down_rad().to_degrees() - 10.0).abs() < 1e-9);
    assert!((camera.roll_rad().to_degrees() + 3.0).abs() < 1e-9);
    assert!(source.facts().camera_source.contains("[input.camera]"));
    // A wall gives no floor: without another source of the pose, the run cannot start.
    let error = saved.open(&InputSettings::default(), DEPTH).err().unwrap();
    assert!(error.to_string().contains("camera pose"), "{error}");
    assert!(error.to_string().contains("[input.camera]"), "{error}");
}

#[test]
fn the_given_pose_of_the_camera_goes_before_that_of_tf() {
    let mut log = started();
    log.colour(at(0.1));
    let saved = log.save();
    let mount = MountSettings { height_m: 0.7, ..MountSettings::default() };
    for (camera, height_m) in [(Some(CameraSettings::Mounted(mount)), 0.7), (None, 1.2)] {
        let input = InputSettings { camera, ..InputSettings::default() };
        let found = saved.open(&input, Inputs::ANY).unwrap().next_frame().unwrap();
        assert!((found.frame.camera.height_m() - height_m).abs() < 1e-12);
    }
}

#[test]
fn depth_is_moved_onto_colour_as_the_settings_say() {
    let mut log = started();
    log.colour(at(0.1));
    let values: Vec<f32> = (0..16 * 12).map(|i| 1.0 + i as f32).collect();
    log.depth_of(at(0.1), "colour", 16, 12, &values);
    let input = InputSettings { depth_offset_px: [3, -2], ..InputSettings::default() };
    let frame = log.save().open(&input, DEPTH).unwrap().next_frame().unwrap().frame;
    let depth = frame.depth().unwrap();
    assert_eq!(depth.get(3, 0), Some(1.0 + 2.0 * 16.0));
    assert_eq!(depth.get(15, 9), Some(1.0 + 11.0 * 16.0 + 12.0));
    assert!(depth.get(2, 5).unwrap().is_nan() && depth.get(5, 10).unwrap().is_nan());
}

/// Renders a floor 1.2 m below and a wall 4 m ahead of the colour camera, from a camera with the
/// given pose in the colour camera.
fn room(from: &Camera, colour_from_camera: &Isometry3<f64>) -> DepthImage {
    DepthImage::from_fn(from.width, from.height, |x, y| {
        let ray = colour_from_camera.rotation * from.ray(Point2::new(x as f64, y as f64));
        let eye = colour_from_camera.translation.vector;
        let floor = Some((1.2 - eye.y) / ray.y).filter(|t| *t > 0.0);
        let wall = (4.0 - eye.z) / ray.z;
        floor.map_or(wall, |floor| floor.min(wall)) as f32
    })
}

#[test]
fn depth_of_another_camera_is_registered_through_tf() {
    let colour = camera(80, 60, 70.0);
    let depth = camera(96, 72, 80.0);
    let shift = Isometry3::new(Vector3::new(0.05, -0.01, 0.0), Vector3::new(0.01, -0.02, 0.0));
    let mut log = LogWriter::plain();
    log.info(INFO, "colour", &colour);
    log.info("/camera/depth/camera_info", "depth", &depth);
    log.fixed("base_link", "colour", &level_pose());
    log.fixed("colour", "depth", &shift);
    log.colour_of(at(0.1), 80, 60);
    log.depth_of(at(0.11), "depth", 96, 72, room(&depth, &shift).pixels());
    let (mut source, _saved) = open(log, DEPTH);
    let frame = source.next_frame().unwrap().frame;
    let got = frame.depth().unwrap();
    let want = room(&colour, &Isometry3::identity());
    assert_eq!((got.width(), got.height()), (80, 60));
    let seen = got.pixels().iter().filter(|d| d.is_finite()).count();
    let wrong = got
        .pixels()
        .iter()
        .zip(want.pixels())
        .filter(|(got, want)| got.is_finite() && (*got - *want).abs() > 0.02 * *want + 0.02)
        .count();
    assert!(seen > 4400 && wrong < 60, "{seen} seen, {wrong} wrong");
    assert_eq!(count(&source, "depth_registered"), 1);
}

#[test]
fn depth_that_cannot_be_registered_is_told() {
    let mut log = started();
    log.colour(at(0.1));
    log.depth_of(at(0.1), "depth", 8, 6, &[2.0; 48]);
    let (mut source, _saved) = open(log, DEPTH);
    assert!(source.next_frame().is_none());
    assert_eq!(count(&source, "depth_not_registrable"), 1);
    assert!(source.data_lost());
}

#[test]
fn a_log_of_depth_alone_gives_frames() {
    let mut log = LogWriter::plain();
    log.info("/camera/depth/camera_info", "depth", &camera(16, 12, 14.0));
    log.fixed("base_link", "depth", &level_pose());
    (0..6).for_each(|i| log.depth(at(f64::from(i) * 0.1), "depth", 3.0));
    let (mut source, _saved) = open(log, Inputs::ANY.require(Input::Depth));
    let found = frames(&mut source);
    assert_eq!(found.len(), 6);
    assert!(found[0].frame.colour().is_err() && found[0].frame.depth().is_ok());
}

#[test]
fn a_truncated_log_gives_what_is_whole_and_says_so() {
    let mut log = started();
    for i in 0..20 {
        log.colour(at(f64::from(i) * 0.1));
        log.depth(at(f64::from(i) * 0.1), "colour", 2.0);
        log.flush();
    }
    let bytes = log.finish();
    let saved = SavedLog::new(&bytes[..bytes.len() * 6 / 10]);
    let mut source = saved.open(&InputSettings::default(), DEPTH).unwrap();
    let found = frames(&mut source);
    assert!((5..15).contains(&found.len()), "{}", found.len());
    assert!(source.data_lost());
    assert_eq!(count(&source, "truncated"), 1);
}

#[test]
fn two_readings_are_the_same() {
    let stamps: Vec<f64> = (0..12).map(|i| f64::from(i * 7 % 12) * 0.1).collect();
    let (mut first, _a) = run_of(&stamps);
    let (mut second, _b) = run_of(&stamps);
    let a = frames(&mut first);
    let b = frames(&mut second);
    assert_eq!(self::stamps(&a), self::stamps(&b));
    assert_eq!(first.counters(), second.counters());
    assert_eq!(first.facts().sha256, second.facts().sha256);
    assert_eq!(first.facts().sha256.len(), 64);
}

#[test]
fn settings_that_cannot_work_name_their_key() {
    let saved = started().save();
    let input = InputSettings { pair_tolerance_s: f64::NAN, ..InputSettings::default() };
    let error = saved.open(&input, Inputs::ANY).err().unwrap();
    assert!(error.to_string().contains("pair_tolerance_s"), "{error}");
}

#[test]
fn a_file_that_shrinks_while_it_is_read_is_noticed() {
    let mut log = started();
    for i in 0..200 {
        log.colour_of(at(f64::from(i) * 0.1), 16, 12);
        log.depth(at(f64::from(i) * 0.1), "colour", 2.0);
        log.flush();
    }
    let (mut source, saved) = open(log, DEPTH);
    let length = std::fs::metadata(&saved.path).unwrap().len();
    let file = std::fs::OpenOptions::new().write(true).open(&saved.path).unwrap();
    file.set_len(length / 2).unwrap();
    let found = frames(&mut source);
    assert!((50..150).contains(&found.len()), "{}", found.len());
    assert!(source.data_lost());
    assert_eq!(count(&source, "log_changed_while_read"), 1);
}

/// Writes a log of colour and depth with damage in the second colour image behind its header.
fn with_damage() -> LogWriter {
    let mut log = started();
    for i in 0..3 {
        let stamp = at(f64::from(i) * 0.1);
        if i == 1 {
            let header = Header::new(stamp, "colour");
            let short = Image { step: 48, ..Image::packed(header, "rgb8", 16, 12, &[7; 48]) };
            log.message("/camera/color/image_raw", stamp, &short);
        } else {
            log.colour(stamp);
        }
        log.depth(stamp, "colour", 2.0);
    }
    log
}

#[test]
fn images_that_are_not_declared_are_not_read() {
    let depth = Inputs::NONE.require(Input::Depth);
    let (mut source, _saved) = open(with_damage(), depth);
    let found = frames(&mut source);
    assert_eq!(indices(&found), [1, 2, 3], "colour counts the frames, and is not decoded");
    assert!(found.iter().all(|item| item.frame.depth().is_ok() && item.frame.colour().is_err()));
    assert_eq!((found[1].frame.camera.width, found[1].frame.camera.height), (16, 12));
    assert!(!source.data_lost());

    let (mut source, _saved) = open(with_damage(), Inputs::NONE.require(Input::Colour));
    let found = frames(&mut source);
    assert_eq!(indices(&found), [1, 3], "what is required and damaged is lost");
    assert!(found.iter().all(|item| item.frame.depth().is_err() && item.frame.colour().is_ok()));
    assert!(source.data_lost() && source.facts().depth_topic.is_none());
    assert_eq!(count(&source, "colour_without_depth"), 0);

    let (mut source, _saved) = open(with_damage(), depth.accept(Input::Colour));
    let found = frames(&mut source);
    assert_eq!(indices(&found), [1, 2, 3], "what is only accepted is missing where damaged");
    assert!(found[1].frame.colour().is_err() && found[2].frame.colour().is_ok());
    assert!(source.data_lost());
}

/// Writes frames `from` to `to`, ten a second, with odometry; the odometry's channel comes first or
/// last, so that the files of one log number their channels differently.
fn part(from: u32, to: u32, odometry_first: bool) -> LogWriter {
    let mut log = LogWriter::plain();
    if odometry_first {
        log.odometry(at(0.1 * f64::from(from) - 0.05), 0.0, 0.0);
    }
    log.info(INFO, "colour", &camera(16, 12, 14.0));
    log.fixed("base_link", "colour", &level_pose());
    for i in from..to {
        let stamp = at(0.1 * f64::from(i));
        log.colour(stamp);
        log.depth(stamp, "colour", 2.0 + i as f32);
        log.odometry(stamp, 0.05 * f64::from(i), 0.0);
    }
    log
}

#[test]
fn the_parts_of_a_folder_are_one_log() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("drive_0.mcap"), part(0, 5, false).finish()).unwrap();
    std::fs::write(folder.path().join("drive_1.mcap"), part(5, 9, true).finish()).unwrap();
    let mut split = common::open(folder.path(), &InputSettings::default(), DEPTH).unwrap();
    let (mut whole, _saved) = open(part(0, 9, false), DEPTH);
    let expected = frames(&mut whole);
    let found = frames(&mut split);
    assert_eq!(indices(&found), (1..=9).collect::<Vec<_>>());
    for (found, expected) in found.iter().zip(&expected) {
        assert_eq!(found.frame.stamp, expected.frame.stamp);
        assert_eq!(found.frame.depth().unwrap(), expected.frame.depth().unwrap());
        assert_eq!(found.odom_from_robot, expected.odom_from_robot);
    }
    assert!(!split.data_lost(), "{:?}", split.notes());
    assert_eq!(split.progress(), 1.0);
    assert_eq!(split.facts().path, folder.path());
}

#[test]
fn a_part_that_is_cut_or_missing_costs_its_own_frames() {
    let folder = tempfile::tempdir().unwrap();
    let first = part(0, 5, false).finish();
    std::fs::write(folder.path().join("drive_0.mcap"), &first[..first.len() - 40]).unwrap();
    std::fs::write(folder.path().join("drive_2.mcap"), part(10, 14, true).finish()).unwrap();
    let listed = "  relative_file_paths:\n    - drive_0.mcap\n    - drive_1.mcap\n    - \
                  drive_2.mcap\n";
    std::fs::write(folder.path().join("metadata.yaml"), listed).unwrap();
    let mut source = common::open(folder.path(), &InputSettings::default(), DEPTH).unwrap();
    assert_eq!(frames(&mut source).len(), 9);
    assert!(source.data_lost());
    assert_eq!(count(&source, "missing_files"), 1);
    let notes = source.notes().join("\n");
    assert!(notes.contains("drive_1.mcap") && notes.contains("drive_0.mcap: "), "{notes}");
}
