use serde::{Deserialize, Serialize};
use tagalong_core::Stamp;

use super::message;

/// `builtin_interfaces/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds; negative times are before the epoch.
    pub sec: i32,
    /// Nanoseconds, below 10^9.
    pub nanosec: u32,
}

impl From<Stamp> for Time {
    /// Converts a stamp; it saturates in the year 2038, where ROS time ends.
    fn from(stamp: Stamp) -> Self {
        let sec = i32::try_from(stamp.nanos() / 1_000_000_000).unwrap_or(i32::MAX);
        Self { sec, nanosec: (stamp.nanos() % 1_000_000_000) as u32 }
    }
}

impl From<Time> for Stamp {
    /// Converts a time; times before the epoch become the epoch.
    fn from(time: Time) -> Self {
        let nanos = i64::from(time.sec) * 1_000_000_000 + i64::from(time.nanosec);
        Self::from_nanos(u64::try_from(nanos).unwrap_or(0))
    }
}

/// `std_msgs/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Time of the measurement.
    pub stamp: Time,
    /// Frame of the coordinates.
    pub frame_id: String,
}

impl Header {
    /// Creates a header.
    pub fn new(stamp: Stamp, frame_id: impl Into<String>) -> Self {
        Self { stamp: stamp.into(), frame_id: frame_id.into() }
    }

    /// Returns the stamp as a [`Stamp`].
    pub fn stamp(&self) -> Stamp {
        self.stamp.into()
    }
}

/// `std_msgs/String`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StringMsg {
    /// The text.
    pub data: String,
}

message!(StringMsg, "std_msgs/msg/String", "String.msg");

/// `std_msgs/Bool`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BoolMsg {
    /// The value.
    pub data: bool,
}

message!(BoolMsg, "std_msgs/msg/Bool", "Bool.msg");

/// `std_msgs/Float32`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Float32Msg {
    /// The value.
    pub data: f32,
}

message!(Float32Msg, "std_msgs/msg/Float32", "Float32.msg");
