//! Topics of sensors whose message types are not read: each has a line in the account, with the
//! reason and what to record in its place.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

#[path = "common/mod.rs"]
mod common;

use common::{LogWriter, at, started, sweep};
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, TopicUse};

/// Starts a log of four colour images.
fn log_of_colour() -> LogWriter {
    let mut log = started();
    for index in 0..4 {
        log.colour(at(0.1 * f64::from(index)));
    }
    log
}

fn entry<'a>(source: &'a FrameSource, topic: &str) -> &'a TopicUse {
    let mut topics = source.account().topics.iter();
    topics.find(|told| told.topic == topic).unwrap_or_else(|| panic!("{topic} is not told"))
}

#[test]
fn each_type_that_is_not_read_is_told_with_what_to_record() {
    for (kind, encoding, could_be, words) in [
        ("realsense2_camera_msgs/msg/RGBD", "cdr", Some("depth"), "the topics of the images"),
        ("rtabmap_msgs/msg/RGBDImage", "cdr", Some("depth"), "colour and depth in one message"),
        ("rtabmap_ros/RGBDImage", "ros1", Some("depth"), "colour and depth in one message"),
        ("theora_image_transport/Packet", "ros1", None, "republish"),
        ("wfov_camera_msgs/WFOVImage", "ros1", None, "sensor_msgs/Image"),
        ("sensor_msgs/msg/PointCloud", "cdr", Some("points"), "PointCloud2"),
        ("draco_msgs/msg/CompressedPointCloud2", "cdr", Some("points"), "the raw topic"),
        ("sensor_msgs/msg/MultiEchoLaserScan", "cdr", Some("laser"), "`laser_proc`"),
        ("velodyne_msgs/VelodyneScan", "ros1", Some("points"), "sensor_msgs/PointCloud2"),
        ("ouster_sensor_msgs/msg/PacketMsg", "cdr", Some("points"), "raw packets of a lidar"),
        ("livox_ros_driver2/msg/CustomMsg", "cdr", Some("points"), "`xfer_format`"),
        ("radar_msgs/msg/RadarScan", "cdr", None, "readings of a radar"),
        ("event_camera_msgs/msg/EventPacket", "cdr", None, "events"),
        ("foxglove.PointCloud", "protobuf", Some("points"), "are in `protobuf`"),
        ("foxglove_msgs/msg/PointCloud", "cdr", Some("points"), "another package"),
        ("sensor_msgs/msg/PointCloud2", "json", Some("points"), "are in `json`"),
        ("foxglove.CompressedImage", "protobuf", None, "convert the log"),
        ("foxglove.RawImage", "protobuf", None, "convert the log"),
        ("foxglove_msgs/msg/CompressedImage", "cdr", None, "as sensor_msgs/CompressedImage"),
        ("jsk_recognition_msgs/BoundingBoxArray", "ros1", None, "Detection2DArray"),
        ("foxglove.Detection2DArray", "protobuf", None, "convert the log"),
    ] {
        let mut log = log_of_colour();
        log.foreign("/other", kind, encoding, at(0.0), &[0, 1, 0, 0]);
        let saved = log.save();
        let source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        let told = entry(&source, "/other");
        assert_eq!((told.used_as.as_ref(), told.could_be), (None, could_be), "{told}");
        assert!(told.to_string().contains(words), "{told}");
        assert!(told.remedy.is_some(), "{kind}: {told}");
    }
}

#[test]
fn depth_of_a_type_that_is_not_read_could_be_depth() {
    for kind in ["my_msgs/msg/Image", "foxglove_msgs/msg/RawImage", "my_msgs/msg/DisparityImage"] {
        let mut log = log_of_colour();
        log.foreign("/camera/depth/image", kind, "cdr", at(0.0), &[0, 1, 0, 0]);
        let source = log.save().open(&InputSettings::default(), Inputs::ANY).unwrap();
        let told = entry(&source, "/camera/depth/image");
        assert_eq!(told.could_be, Some("depth"), "{told}");
        assert!(told.remedy.as_ref().unwrap().contains("republish it as s"), "{told}");
    }
}

#[test]
fn a_required_sensor_in_another_type_is_named_by_the_error() {
    for (kind, input) in [
        ("realsense2_camera_msgs/msg/RGBD", Input::Depth),
        ("sensor_msgs/msg/MultiEchoLaserScan", Input::Laser),
        ("velodyne_msgs/msg/VelodyneScan", Input::POINTS),
    ] {
        let mut log = log_of_colour();
        log.foreign("/other", kind, "cdr", at(0.0), &[0, 1, 0, 0]);
        let inputs = Inputs::ANY.require(input);
        let error = log.save().open(&InputSettings::default(), inputs).err().unwrap().to_string();
        let words = format!("/other ({kind}) cannot be read: its type is not read");
        assert!(error.contains(&words) && error.contains("record "), "{error}");
    }
}

#[test]
fn a_type_that_contains_images_is_told_whatever_its_name() {
    let own = "sensor_msgs/Image left\nsensor_msgs/Image right\n===\nMSG: sensor_msgs/Image\n";
    let scans = "LaserScan[] scans\n===\nMSG: sensor_msgs/LaserScan\n";
    let marker = "sensor_msgs/CompressedImage texture\n===\nMSG: sensor_msgs/CompressedImage\n";
    for (kind, definition, words) in [
        ("my_msgs/msg/Views", own, "its messages hold images (sensor_msgs/Image)"),
        ("my_msgs/msg/Sweeps", scans, "its messages hold scans (sensor_msgs/LaserScan)"),
        ("visualization_msgs/msg/Marker", marker, ""),
        ("my_msgs/msg/Text", "string data\n", ""),
    ] {
        let mut log = log_of_colour();
        log.defined("/other", (kind, definition), "cdr", at(0.0), &[0, 1, 0, 0]);
        let source = log.save().open(&InputSettings::default(), Inputs::ANY).unwrap();
        if words.is_empty() {
            assert!(source.account().topics.iter().all(|told| told.topic != "/other"), "{kind}");
        } else {
            assert!(entry(&source, "/other").to_string().contains(words), "{kind}");
        }
    }
}

#[test]
fn messages_that_are_not_read_cost_a_pipeline_of_scans_nothing() {
    let mut log = LogWriter::plain();
    log.foreign("/packets", "velodyne_msgs/msg/VelodyneScan", "cdr", at(0.0), &[0, 1, 0, 0]);
    log.message("/scan", at(0.0), &sweep(at(0.0), "base_link"));
    let mut source = log.save().open(&InputSettings::default(), Inputs::ANY).unwrap();
    while source.next_frame().is_some() {}
    assert!(!source.data_lost(), "{:?}", source.notes());
}
