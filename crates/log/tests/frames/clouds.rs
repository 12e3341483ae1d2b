//! Points of depth cameras in place of depth images, and points of lidars.

use std::borrow::Cow;

use tagalong_core::PointCloud;
use tagalong_geometry::Lens;
use tagalong_log::inspect;
use tagalong_log::msgs::{PointCloud2, PointField};

use super::*;

const SIZE: (u32, u32) = (24, 16);
const FOCAL_PX: f64 = 20.0;

/// Returns points of a wall, in the rows and columns of a camera; x ahead if `is_body`.
fn wall(frame: &str, stamp: Stamp, is_body: bool) -> PointCloud2<'static> {
    let lens = camera(SIZE.0 as usize, SIZE.1 as usize, FOCAL_PX);
    let mut data = Vec::new();
    for row in 0..SIZE.1 {
        for column in 0..SIZE.0 {
            let ahead = 2.0 + 0.05 * f64::from(column);
            let ray = lens.ray(Point2::new(column.into(), row.into())) * ahead;
            let point = if is_body { [ray.z, -ray.x, -ray.y] } else { [ray.x, ray.y, ray.z] };
            data.extend(point.iter().flat_map(|value| (*value as f32).to_le_bytes()));
        }
    }
    let fields = [("x", 0), ("y", 4), ("z", 8)];
    PointCloud2 {
        header: Header::new(stamp, frame),
        height: SIZE.1,
        width: SIZE.0,
        fields: fields.map(|(name, offset)| PointField::float32(name, offset)).to_vec(),
        point_step: 12,
        row_step: 12 * SIZE.0,
        data: Cow::Owned(data),
        ..PointCloud2::default()
    }
}

fn log_with(cloud: &PointCloud2<'_>) -> LogWriter {
    let mut log = LogWriter::plain();
    log.fixed("base_link", &cloud.header.frame_id, &level_pose());
    log.message("/camera/points", at(0.1), cloud);
    log
}

fn opened(log: LogWriter) -> Result<(FrameSource, LogFrame), String> {
    first_depth(log, &InputSettings::default())
}

#[test]
fn ordered_points_are_depth_and_tell_their_own_lens() {
    // Simulators call a frame optical whose points have x ahead.
    for is_body in [false, true] {
        let (source, found) =
            opened(log_with(&wall("camera_optical_frame", at(0.1), is_body))).unwrap();
        let depth = found.frame.depth().unwrap();
        assert_eq!((depth.width(), depth.height()), (24, 16));
        assert!((depth.get(10, 3).unwrap() - 2.5).abs() < 1e-6);
        let Lens::Pinhole(lens) = &found.frame.camera.lens else { panic!("a pinhole") };
        assert!((lens.fx - FOCAL_PX).abs() < 1e-3 && (lens.cx - 11.5).abs() < 1e-3, "{lens:?}");
        assert_eq!(
            source.facts().calibration_topic.as_deref(),
            Some("/camera/points (by its points)")
        );
    }
}

#[test]
fn depth_images_are_taken_before_points() {
    let mut log = log_with(&wall("colour", at(0.1), false));
    log.info("/camera/depth/camera_info", "colour", &camera(16, 12, 14.0));
    log.depth(at(0.1), "colour", 3.0);
    let (_, found) = opened(log).unwrap();
    assert_eq!(found.frame.depth().unwrap().get(3, 3), Some(3.0));
}

#[test]
fn points_that_are_no_image_are_refused_with_the_reason() {
    let mut lidar = wall("lidar", at(0.1), false);
    (lidar.width, lidar.height, lidar.row_step) = (24 * 16, 1, 12 * 24 * 16);
    let error = opened(log_with(&lidar)).err().unwrap();
    assert!(error.contains("/camera/points") && error.contains("height 1"), "{error}");
    let body = wall("camera_link", at(0.1), true);
    let error = opened(log_with(&body)).err().unwrap();
    assert!(error.contains("x ahead (frame `camera_link`)"), "{error}");
    // They can be read as those of a lidar, and a log whose depth is an image is not blamed for them.
    let mut log = log_with(&lidar);
    log.info("/camera/depth/camera_info", "lidar", &camera(16, 12, 14.0));
    log.depth(at(0.1), "lidar", 3.0);
    let saved = log.save();
    let told = inspect(&saved.path, &InputSettings::default(), &Limits::default()).unwrap();
    let entry = told.inputs.topics.iter().find(|entry| entry.topic == "/camera/points").unwrap();
    assert_eq!(entry.used_as.as_deref(), Some("points"), "{entry}");
    assert!(!entry.to_string().contains("calibration"), "{entry}");
    let (source, _) = opened({
        let mut log = log_with(&lidar);
        log.info("/camera/depth/camera_info", "lidar", &camera(16, 12, 14.0));
        log.depth(at(0.1), "lidar", 3.0);
        log
    })
    .unwrap();
    assert_eq!(count(&source, "messages_not_read"), 0);
}

#[test]
fn damaged_points_are_counted_and_the_others_are_read() {
    let mut log = log_with(&wall("camera_optical_frame", at(0.1), false));
    let mut damaged = wall("camera_optical_frame", at(0.2), false);
    damaged.data.to_mut().truncate(100);
    log.message("/camera/points", at(0.2), &damaged);
    log.message("/camera/points", at(0.3), &wall("camera_optical_frame", at(0.3), false));
    let (mut source, _) = opened(log).unwrap();
    let frames = std::iter::from_fn(|| source.next_frame()).count();
    assert_eq!((frames, count(&source, "images_of_wrong_layout")), (1, 1));
}

/// Returns the points of a wall as a lidar delivers them: in one row, with x ahead, two of them
/// without a reflection.
fn lidar(stamp: Stamp) -> PointCloud2<'static> {
    let mut cloud = wall("lidar", stamp, true);
    (cloud.width, cloud.height, cloud.row_step) = (SIZE.0 * SIZE.1, 1, 12 * SIZE.0 * SIZE.1);
    cloud.data.to_mut()[..12].fill(0);
    cloud.data.to_mut()[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    cloud
}

/// A log of a lidar 0.8 m above the floor and 0.1 m before the middle of the robot.
fn lidar_log() -> LogWriter {
    let mut log = LogWriter::plain();
    log.fixed("base_link", "lidar", &Isometry3::translation(0.1, 0.0, 0.8));
    log.message("/points", at(0.1), &lidar(at(0.1)));
    log.message("/points", at(0.2), &lidar(at(0.2)));
    log
}

fn opened_with(log: LogWriter, inputs: Inputs) -> Result<FrameSource, String> {
    let saved = log.save();
    FrameSource::open(&saved.path, &InputSettings::default(), &Limits::default(), inputs)
        .map_err(|error| error.to_string())
}

const POINTS: Inputs = Inputs::NONE.require(Input::POINTS);

#[test]
fn points_of_a_lidar_make_frames_in_the_frame_of_the_robot() {
    let mut source = opened_with(lidar_log(), POINTS).unwrap();
    let found = source.next_frame().unwrap();
    let cloud = found.frame.sensor::<PointCloud>().unwrap();
    assert_eq!(cloud.points.len() as u32, SIZE.0 * SIZE.1 - 2, "two have no reflection");
    assert!((cloud.scanner - Point3::new(0.1, 0.0, 0.8)).norm() < 1e-9);
    let ray = camera(SIZE.0 as usize, SIZE.1 as usize, FOCAL_PX).ray(Point2::new(2.0, 0.0)) * 2.1;
    let right = Point3::new(ray.z + 0.1, -ray.x, 0.8 - ray.y);
    assert!((cloud.points[0] - right).norm() < 1e-6, "{} {right}", cloud.points[0]);
    assert!(found.frame.camera.is_blind() && source.next_frame().is_some());
    assert!(source.account().lines()[0].starts_with("points: /points"), "{:?}", source.account());
}

#[test]
fn points_of_a_lidar_are_those_nearest_to_an_image() {
    let mut log = lidar_log();
    log.info("/camera/color/camera_info", "colour", &camera(16, 12, 14.0));
    log.fixed("base_link", "colour", &level_pose());
    log.colour(at(0.22));
    log.colour(at(0.9));
    let mut source = opened_with(log, POINTS.accept(Input::Colour)).unwrap();
    assert!(source.next_frame().unwrap().frame.sensor::<PointCloud>().is_ok());
    let late = source.next_frame().unwrap();
    assert!(late.frame.sensor::<PointCloud>().is_err(), "it is 0.7 s younger than the points");
    assert_eq!(count(&source, "frames_without_points"), 1);
}

#[test]
fn a_lidar_without_a_pose_is_an_error_and_one_that_is_not_used_is_told() {
    let mut log = LogWriter::plain();
    log.message("/points", at(0.1), &lidar(at(0.1)));
    let error = opened_with(log, POINTS).err().unwrap();
    assert!(error.contains("pose of the lidar") && error.contains("/tf_static"), "{error}");
    let mut log = lidar_log();
    log.info("/camera/color/camera_info", "colour", &camera(16, 12, 14.0));
    log.colour(at(0.1));
    let source = opened_with(log, Inputs::NONE.require(Input::Colour)).unwrap();
    let told = source.account().lines().join("\n");
    assert!(told.contains("/points") && told.contains("uses no points of a lidar"), "{told}");
}

#[test]
fn damaged_points_of_a_lidar_are_counted() {
    let mut log = lidar_log();
    let mut damaged = lidar(at(0.3));
    damaged.data.to_mut().truncate(100);
    log.message("/points", at(0.3), &damaged);
    let mut source = opened_with(log, POINTS).unwrap();
    let frames = std::iter::from_fn(|| source.next_frame()).count();
    assert_eq!((frames, count(&source, "clouds_invalid")), (2, 1));
}
