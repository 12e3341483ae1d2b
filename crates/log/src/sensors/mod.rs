//! Sensors whose messages enter a frame in addition to its images.
//!
//! A new message type with its sensor needs two new files, each with a line or two in the `lib.rs`
//! or `mod.rs` beside it:
//!
//! 1. `crates/core/src/NAME.rs`: the data as plugins receive it, with
//!    [`tagalong_core::Sensor::INPUT`] set to `Input::Named("NAME")`.
//! 2. `crates/log/src/sensors/NAME.rs`: the message (a struct with the fields of the ROS message in
//!    the same order), a [`SensorReader`] that converts it, and the entry for [`SENSORS`].
//!
//! For live use on a robot it also needs an arm of `listen` in `bridges/ros2/src/network.rs`, and
//! for users a row in `docs/logs.md`.
//!
//! A topic is found by its type, or named as `topics.NAME` under `[input]`. Images have no entries
//! here: the frames are made from them, and the cameras from their calibrations
//! (`crates/log/src/images`).

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

/// The table of all sensors other than cameras.
pub(crate) const SENSORS: &[SensorType] = &[laser::ENTRY, detections::ENTRY, points::ENTRY];

/// Entry of the table: the message types of a sensor, and how to read them.
#[derive(Clone, Copy)]
pub(crate) struct SensorType {
    /// Input by which plugins declare that they use the data.
    pub(crate) input: Input,
    /// Types of the messages: package and name, written as in ROS 1.
    pub(crate) messages: &'static [&'static str],
    /// Name of the data in error messages.
    pub(crate) wanted: &'static str,
    /// Rank of a topic by its name in lower case; the one with the highest rank is read unless the
    /// settings name another. `None`: the topic is read only if it is named.
    pub(crate) rank: Option<fn(&str) -> i32>,
    /// Reads the header of a message in the first pass; `None` if the message is only counted.
    pub(crate) header: fn(&Message<'_>) -> Result<Option<Header>, CdrError>,
    /// Returns the impossible field of a message, for the table of topics.
    pub(crate) fault: fn(&[u8]) -> Option<String>,
    /// Creates the reader of a topic for the type of its messages.
    pub(crate) reader: fn(&str, &InputSettings) -> Box<dyn SensorReader>,
}

/// Reader of the messages of one topic.
pub(crate) trait SensorReader: Send + Sync {
    /// Adds a message.
    ///
    /// # Errors
    /// A message that cannot be decoded; the caller counts it.
    fn take(&mut self, message: &Message<'_>, tally: &mut Tally) -> Result<(), CdrError>;

    /// Selects the message for a frame, given the stamp of the next frame. It is called for every
    /// frame, even if the frame turns out to be unusable.
    fn pair(&mut self, stamp: Stamp, next: Option<Stamp>, tolerance_s: f64) {
        let _ = (stamp, next, tolerance_s);
    }

    /// Returns the sensors of a frame with the data of this one added, if there are any.
    fn add_to(&self, sensors: Sensors, moment: &Moment<'_>, tally: &mut Tally) -> Sensors;

    /// Returns false if a live frame should wait for a message of this sensor.
    fn is_ready(&self, stamp: Stamp, tolerance_s: f64) -> bool {
        let _ = (stamp, tolerance_s);
        true
    }

    /// Sets the messages from before `newest` aside for [`SensorReader::restore`], because the
    /// clock has jumped back. A sensor without an order of its own notes the jump, and drops what
    /// came before it then.
    fn set_aside(&mut self, newest: Stamp) {
        let _ = newest;
    }

    /// Continues with the messages that were set aside.
    fn restore(&mut self) {}

    /// Receives the frames of the cameras in a log, before the first message.
    fn know_cameras(&mut self, cameras: &CameraFrames) {
        let _ = cameras;
    }

    /// Counts, at the end of a log, the messages that were assigned to no frame.
    fn close(&mut self, topic: &str, tally: &mut Tally) {
        let _ = (topic, tally);
    }
}

/// The moment of a frame, with the transforms that are known at that time.
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
    /// Returns the pose that the robot had at another time, in the robot frame of this moment.
    pub(crate) fn robot_from(&self, then: Stamp) -> Isometry2<f64> {
        let pose = self.odom_from_robot;
        pose(self.stamp).inverse() * pose(then)
    }
}

impl SensorType {
    /// Returns the sensor to which a message type belongs.
    pub(crate) fn of_message(schema: &str) -> Option<&'static Self> {
        SENSORS.iter().find(|sensor| sensor.reads(schema))
    }

    /// Returns true for the messages of the sensor, by their type with or without the middle part.
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

/// Checks that the table of sensors has an entry with this name whose topic has no key of its own.
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
