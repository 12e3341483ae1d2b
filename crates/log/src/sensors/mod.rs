//! Sensors whose messages enter a frame beside its images.
//!
//! A new message type with its sensor takes two new files, each with a line or two in the `lib.rs`
//! or `mod.rs` beside it:
//!
//! 1. `crates/core/src/NAME.rs`: the data as plugins receive them, with
//!    [`tagalong_core::Sensor::INPUT`] set to `Input::Named("NAME")`.
//! 2. `crates/log/src/sensors/NAME.rs`: the message (a struct with the fields of the ROS message in
//!    their order), a [`SensorReader`] that makes the data of it, and the entry for [`SENSORS`].
//!
//! Live on a robot it also takes an arm of `listen` in `bridges/ros2/src/network.rs`, and for users a
//! row in `docs/logs.md`.
//!
//! `laser.rs` and `points.rs` take the message nearest in time (`recent.rs`), `detections.rs` pairs one
//! message with each frame.
//! A topic is found by type, or named as `topics.NAME` under `[input]`. Images are no entries: they
//! make the frames, and their calibrations the cameras (`crates/log/src/images`).

mod box_layout;
mod detections;
pub(crate) mod laser;
pub(crate) mod points;
pub(crate) mod recent;
mod scan_faults;
pub(crate) mod sweep;

use std::sync::Arc;

use nalgebra::Isometry2;
use tagalong_config::check_settings;
use tagalong_core::{Input, Sensors, Stamp};
use tagalong_geometry::Camera;

use crate::camera_frames::CameraFrames;
use crate::msgs::{CdrError, Header};
use crate::tally::Tally;
use crate::tf::TfBuffer;
use crate::walk::Message;
use crate::{InputSettings, LogError};

/// The table of all sensors beside the images.
pub(crate) const SENSORS: &[SensorType] = &[laser::ENTRY, detections::ENTRY, points::ENTRY];

/// Entry of the table: the message types of a sensor, and how they are read.
#[derive(Clone, Copy)]
pub(crate) struct SensorType {
    /// Input that plugins declare for the data.
    pub(crate) input: Input,
    /// Types of the messages: package and name, as ROS 1 writes them.
    pub(crate) messages: &'static [&'static str],
    /// The data in words, for errors.
    pub(crate) wanted: &'static str,
    /// Rank of a topic by its name in lower case; the highest one is read unless the settings name
    /// another. `None`: only a named topic is read.
    pub(crate) rank: Option<fn(&str) -> i32>,
    /// Reads the header of a message in the first pass; `None` if the message is only counted.
    pub(crate) header: fn(&Message<'_>) -> Result<Option<Header>, CdrError>,
    /// Returns the field of a message that cannot be, for the account of the topics.
    pub(crate) fault: fn(&[u8]) -> Option<String>,
    /// Creates the reader of a topic from the type of its messages.
    pub(crate) reader: fn(&str, &InputSettings) -> Box<dyn SensorReader>,
}

/// Reader of the messages of one topic.
pub(crate) trait SensorReader: Send + Sync {
    /// Takes in a message.
    ///
    /// # Errors
    /// A message that cannot be decoded, which is counted by the caller.
    fn take(&mut self, message: &Message<'_>, tally: &mut Tally) -> Result<(), CdrError>;

    /// Selects the message of a frame, given the stamp of the next frame. It is called for every
    /// frame, also one that turns out to be unusable.
    fn pair(&mut self, stamp: Stamp, next: Option<Stamp>, tolerance_s: f64) {
        let _ = (stamp, next, tolerance_s);
    }

    /// Returns the sensors of a frame with the data of this one, if there are any.
    fn add_to(&self, sensors: Sensors, moment: &Moment<'_>, tally: &mut Tally) -> Sensors;

    /// Returns false if a live frame should wait for a message of this sensor.
    fn is_ready(&self, stamp: Stamp, tolerance_s: f64) -> bool {
        let _ = (stamp, tolerance_s);
        true
    }

    /// Keeps the messages from before `newest` for [`SensorReader::restore`], because the clock has
    /// jumped back.
    fn set_aside(&mut self, newest: Stamp) {
        let _ = newest;
    }

    /// Returns to the messages that were set aside.
    fn restore(&mut self) {}

    /// Learns the frames of the cameras of a log, before the first message.
    fn know_cameras(&mut self, cameras: &CameraFrames) {
        let _ = cameras;
    }

    /// Counts at the end of a log what found no frame.
    fn close(&mut self, topic: &str, tally: &mut Tally) {
        let _ = (topic, tally);
    }
}

/// The moment of a frame, and the transforms that are known of it.
pub(crate) struct Moment<'a> {
    /// Topic of the sensor.
    pub(crate) topic: &'a str,
    /// Stamp of the frame.
    pub(crate) stamp: Stamp,
    /// Camera of the frame.
    pub(crate) camera: &'a Arc<Camera>,
    /// Frame id of the robot.
    pub(crate) robot_frame: &'a str,
    /// Transforms of the log.
    pub(crate) tf: &'a TfBuffer,
    /// Pose of the robot in the odometry frame.
    pub(crate) odom_from_robot: &'a dyn Fn(Stamp) -> Isometry2<f64>,
}

impl Moment<'_> {
    /// Returns the pose of the robot of another time in the robot frame of this one.
    pub(crate) fn robot_from(&self, then: Stamp) -> Isometry2<f64> {
        let pose = self.odom_from_robot;
        pose(self.stamp).inverse() * pose(then)
    }
}

impl SensorType {
    /// Returns the sensor that a message type belongs to.
    pub(crate) fn of_message(schema: &str) -> Option<&'static Self> {
        SENSORS.iter().find(|sensor| sensor.reads(schema))
    }

    /// Returns true for the messages of the sensor, by their type with or without its middle part.
    pub(crate) fn reads(&self, schema: &str) -> bool {
        self.messages.iter().any(|message| is_type(schema, message))
    }

    /// Returns the key under `[input]` that names the topic.
    pub(crate) fn key(&self) -> String {
        match self.input {
            Input::Named(name) => format!("topics.{name}"),
            known => format!("{}_topic", known.name()),
        }
    }
}

/// Compares a message type of a log (`sensor_msgs/msg/LaserScan`, in ROS 1 without the middle
/// part) with a package and a name.
pub(crate) fn is_type(schema: &str, wanted: &str) -> bool {
    let [schema, wanted] = [schema, wanted].map(|name| {
        let (package, rest) = name.split_once('/')?;
        Some((package, rest.rsplit('/').next()?))
    });
    schema.is_some() && schema == wanted
}

impl InputSettings {
    /// Checks the values.
    ///
    /// # Errors
    /// [`LogError::Settings`], which names the key.
    pub fn check(&self) -> Result<(), LogError> {
        check_settings(self).map_err(|error| LogError::Settings(error.to_string()))?;
        self.topics.keys().try_for_each(|name| check_sensor(name))
    }
}

/// Checks that the table of sensors has one of this name whose topic has no key of its own.
fn check_sensor(name: &str) -> Result<(), LogError> {
    let keys: Vec<String> = SENSORS.iter().map(SensorType::key).collect();
    let wanted = format!("topics.{name}");
    if keys.contains(&wanted) {
        return Ok(());
    }
    let hint = keys.join(", ");
    Err(LogError::Settings(format!("`{wanted}`: no sensor of that name is read; sensors: {hint}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_types_are_known_with_and_without_their_middle_part() {
        fn input_of(schema: &str) -> Option<Input> {
            SensorType::of_message(schema).map(|sensor| sensor.input)
        }

        for schema in ["sensor_msgs/msg/LaserScan", "sensor_msgs/LaserScan"] {
            assert_eq!(input_of(schema), Some(Input::Laser));
        }
        assert_eq!(input_of("vision_msgs/msg/Detection3DArray"), Some(Input::Detections));
        for other in ["LaserScan", "", "sensor_msgs/msg/Image", "my_msgs/msg/LaserScan"] {
            assert_eq!(input_of(other), None, "{other}");
        }
    }

    #[test]
    fn each_sensor_has_an_input_and_messages_of_its_own() {
        for (k, sensor) in SENSORS.iter().enumerate() {
            for other in &SENSORS[..k] {
                assert_ne!(sensor.input, other.input);
                assert_ne!(sensor.key(), other.key());
                assert!(!sensor.messages.iter().any(|message| other.reads(message)));
            }
        }
        assert_eq!(SENSORS.iter().map(SensorType::key).collect::<Vec<_>>()[0], "laser_topic");
    }
}
