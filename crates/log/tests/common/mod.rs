//! Small logs, written with the `mcap` crate.
#![allow(dead_code, reason = "each test program uses a part")]

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde::Serialize;
use tagalong_core::Stamp;
use tagalong_geometry::{Camera, Pinhole};
use tagalong_log::msgs::{
    CameraInfo, Header, Image, LaserScan, Message, Odometry, Pose, TFMessage, Transform,
    TransformStamped, encode,
};
use tagalong_log::{FrameSource, InputSettings, Inputs, Limits, LogError};

pub const INFO: &str = "/camera/color/camera_info";

/// Starts a log with a calibration and a fixed camera.
pub fn started() -> LogWriter {
    let mut log = LogWriter::plain();
    log.info(INFO, "colour", &camera(16, 12, 14.0));
    log.fixed("base_link", "colour", &level_pose());
    log
}

/// Returns a scan of a wall at 2 m, half a radian to each side.
pub fn sweep(stamp: Stamp, frame: &str) -> LaserScan {
    LaserScan {
        header: Header::new(stamp, frame),
        angle_min: -0.5,
        angle_max: 0.5,
        angle_increment: 0.01,
        range_min: 0.1,
        range_max: 10.0,
        ranges: vec![2.0; 101],
        ..LaserScan::default()
    }
}

pub fn at(seconds: f64) -> Stamp {
    Stamp::from_nanos(1_700_000_000_000_000_000).plus_seconds(seconds)
}

/// Writer of messages to an MCAP file in memory.
pub struct LogWriter {
    writer: Writer<Cursor<Vec<u8>>>,
    channels: BTreeMap<String, u16>,
    schemas: BTreeMap<&'static str, u16>,
}

impl LogWriter {
    pub fn new(options: WriteOptions) -> Self {
        let writer = options.profile("ros2").create(Cursor::new(Vec::new())).unwrap();
        Self { writer, channels: BTreeMap::new(), schemas: BTreeMap::new() }
    }

    pub fn plain() -> Self {
        Self::new(WriteOptions::new().compression(None))
    }

    fn channel(&mut self, topic: &str, name: &'static str, definition: &str) -> u16 {
        let writer = &mut self.writer;
        let schema = *self
            .schemas
            .entry(name)
            .or_insert_with(|| writer.add_schema(name, "ros2msg", definition.as_bytes()).unwrap());
        *self
            .channels
            .entry(topic.to_owned())
            .or_insert_with(|| writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).unwrap())
    }

    pub fn bytes<T: Message>(&mut self, topic: &str, stamp: Stamp, data: &[u8]) {
        let channel_id = self.channel(topic, T::TYPE, T::DEFINITION);
        self.write(channel_id, stamp, data);
    }

    fn write(&mut self, channel_id: u16, stamp: Stamp, data: &[u8]) {
        let time = stamp.nanos();
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&header, data).unwrap();
    }

    /// Writes a message of a type and in an encoding of any name.
    pub fn foreign(&mut self, topic: &str, name: &str, encoding: &str, stamp: Stamp, data: &[u8]) {
        let schema = self.writer.add_schema(name, "", b"").unwrap();
        let channel_id =
            self.writer.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap();
        self.write(channel_id, stamp, data);
    }

    /// Writes a message of a type whose definition is given.
    pub fn defined(
        &mut self,
        topic: &str,
        (name, definition): (&str, &str),
        encoding: &str,
        stamp: Stamp,
        data: &[u8],
    ) {
        let language = if encoding == "ros1" { "ros1msg" } else { "ros2msg" };
        let schema = self.writer.add_schema(name, language, definition.as_bytes()).unwrap();
        let channel_id =
            self.writer.add_channel(schema, topic, encoding, &BTreeMap::new()).unwrap();
        self.write(channel_id, stamp, data);
    }

    pub fn message<T: Message + Serialize>(&mut self, topic: &str, stamp: Stamp, message: &T) {
        self.bytes::<T>(topic, stamp, &encode(message));
    }

    /// Writes a message of a type for which there is no definition here.
    pub fn typed<T: Serialize>(
        &mut self,
        topic: &str,
        name: &'static str,
        stamp: Stamp,
        message: &T,
    ) {
        let channel_id = self.channel(topic, name, "");
        self.write(channel_id, stamp, &encode(message));
    }

    pub fn colour(&mut self, stamp: Stamp) {
        self.colour_of(stamp, 16, 12);
    }

    pub fn colour_of(&mut self, stamp: Stamp, width: u32, height: u32) {
        self.colour_with(stamp, "colour", width, height);
    }

    /// Writes a colour image of this frame.
    pub fn colour_from(&mut self, stamp: Stamp, frame: &str) {
        self.colour_with(stamp, frame, 16, 12);
    }

    fn colour_with(&mut self, stamp: Stamp, frame: &str, width: u32, height: u32) {
        let data = vec![(stamp.nanos() / 1_000_000 % 251) as u8; (3 * width * height) as usize];
        let message = Image::packed(Header::new(stamp, frame), "rgb8", width, height, &data);
        self.message("/camera/color/image_raw", stamp, &message);
    }

    /// Writes a depth image of one distance.
    pub fn depth(&mut self, stamp: Stamp, frame: &str, metres: f32) {
        let values = vec![metres; 16 * 12];
        self.depth_of(stamp, frame, 16, 12, &values);
    }

    pub fn depth_of(&mut self, stamp: Stamp, frame: &str, width: u32, height: u32, depth: &[f32]) {
        let data: Vec<u8> = depth.iter().flat_map(|v| v.to_le_bytes()).collect();
        let message = Image::packed(Header::new(stamp, frame), "32FC1", width, height, &data);
        self.message("/camera/depth/image_raw", stamp, &message);
    }

    pub fn info(&mut self, topic: &str, frame: &str, camera: &Camera) {
        self.message(topic, at(0.0), &info_of(frame, camera));
    }

    pub fn fixed(&mut self, parent: &str, child: &str, pose: &Isometry3<f64>) {
        self.fixed_at(at(0.0), parent, child, pose);
    }

    /// Writes a static transform at a later time of the log.
    pub fn fixed_at(&mut self, stamp: Stamp, parent: &str, child: &str, pose: &Isometry3<f64>) {
        self.message("/tf_static", stamp, &transform(parent, child, stamp, pose));
    }

    pub fn moving(&mut self, parent: &str, child: &str, stamp: Stamp, pose: &Isometry3<f64>) {
        self.message("/tf", stamp, &transform(parent, child, stamp, pose));
    }

    /// Writes a moving transform with any stamp at a time of the log.
    pub fn moving_of(
        &mut self,
        written: Stamp,
        (parent, child): (&str, &str),
        stamp: Stamp,
        pose: &Isometry3<f64>,
    ) {
        self.message("/tf", written, &transform(parent, child, stamp, pose));
    }

    pub fn odometry(&mut self, stamp: Stamp, x: f64, yaw: f64) {
        let pose = Isometry3::new(Vector3::new(x, 0.0, 0.0), Vector3::new(0.0, 0.0, yaw));
        self.odometry_of(stamp, stamp, Pose::from(&pose));
    }

    /// Writes a pose of odometry with any stamp and any numbers at a time of the log.
    pub fn odometry_of(&mut self, written: Stamp, stamp: Stamp, pose: Pose) {
        self.odometry_on("/odom", written, stamp, pose);
    }

    /// Writes a pose of odometry on a topic.
    pub fn odometry_on(&mut self, topic: &str, written: Stamp, stamp: Stamp, pose: Pose) {
        let mut odometry = Odometry { header: Header::new(stamp, "odom"), ..Odometry::default() };
        odometry.child_frame_id = "base_link".into();
        odometry.pose.pose = pose;
        self.message(topic, written, &odometry);
    }

    pub fn attachment(&mut self, data: &[u8]) {
        let attachment = mcap::Attachment {
            log_time: 0,
            create_time: 0,
            name: "notes".into(),
            media_type: "text/plain".into(),
            data: data.to_vec().into(),
        };
        self.writer.attach(&attachment).unwrap();
    }

    pub fn flush(&mut self) {
        self.writer.flush().unwrap();
    }

    pub fn finish(mut self) -> Vec<u8> {
        self.writer.finish().unwrap();
        self.writer.into_inner().into_inner()
    }

    pub fn save(self) -> SavedLog {
        SavedLog::new(&self.finish())
    }
}

fn transform(parent: &str, child: &str, stamp: Stamp, pose: &Isometry3<f64>) -> TFMessage {
    let transform = TransformStamped {
        header: Header::new(stamp, parent),
        child_frame_id: child.into(),
        transform: Transform::from(pose),
    };
    TFMessage { transforms: vec![transform] }
}

pub fn info_of(frame: &str, camera: &Camera) -> CameraInfo {
    let tagalong_geometry::Lens::Pinhole(lens) = &camera.lens else { panic!("pinhole") };
    let size = (camera.width, camera.height);
    CameraInfo::of_lens(&Header::new(at(0.0), frame), lens, size, 0.0)
}

/// Returns a level camera at a height of 1.2 m.
pub fn camera(width: usize, height: usize, focal: f64) -> Camera {
    Camera::mounted(Pinhole::centred(focal, width, height), width, height, 1.2, 0.0, 0.0)
}

pub fn level_pose() -> Isometry3<f64> {
    let pose = camera(1, 1, 1.0).robot_from_camera;
    Isometry3::from_parts(
        pose.translation,
        UnitQuaternion::new_normalize(*pose.rotation.quaternion()),
    )
}

/// Log in a temporary folder of its own, which is removed with it.
pub struct SavedLog {
    _folder: tempfile::TempDir,
    pub path: PathBuf,
}

impl SavedLog {
    pub fn new(bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("test.mcap");
        std::fs::write(&path, bytes).unwrap();
        Self { _folder: folder, path }
    }

    pub fn open(&self, input: &InputSettings, inputs: Inputs) -> Result<FrameSource, LogError> {
        open(&self.path, input, inputs)
    }
}

/// Opens a log with the usual limits.
pub fn open(path: &Path, input: &InputSettings, inputs: Inputs) -> Result<FrameSource, LogError> {
    FrameSource::open(path, input, &Limits::default(), inputs)
}

/// Returns each kind of compression of the chunks, with its name.
pub fn compressions() -> [(&'static str, Option<Compression>); 3] {
    [("none", None), ("lz4", Some(Compression::Lz4)), ("zstd", Some(Compression::Zstd))]
}
