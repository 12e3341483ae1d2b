//! Messages of bumpers. Of some types only the beginning is read, which contains all that is
//! needed.

use serde::{Deserialize, Serialize};

use super::Header;

/// `kobuki_ros_interfaces/BumperEvent`, and `kobuki_msgs/BumperEvent` of ROS 1: published when one
/// of the bumpers is pressed or released.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BumperEvent {
    /// Number of the bumper.
    pub bumper: u8,
    /// [`BumperEvent::PRESSED`] or [`BumperEvent::RELEASED`].
    pub state: u8,
}

impl BumperEvent {
    /// State of a bumper that is released.
    pub const RELEASED: u8 = 0;
    /// State of a bumper that is pressed.
    pub const PRESSED: u8 = 1;
}

/// `irobot_create_msgs/HazardDetectionVector`: all hazards that are detected at present.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HazardDetectionVector {
    /// Time and frame.
    pub header: Header,
    /// The hazards.
    pub detections: Vec<HazardDetection>,
}

/// `irobot_create_msgs/HazardDetection`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HazardDetection {
    /// Time and sensor.
    pub header: Header,
    /// Kind of the hazard, for example [`HazardDetection::BUMP`].
    #[serde(rename = "type")]
    pub kind: u8,
}

impl HazardDetection {
    /// Kind of the hazard that the bumper reports.
    pub const BUMP: u8 = 1;
}

/// Beginning of `turtlebot3_msgs/SensorState`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct BumperState {
    /// Time and frame.
    pub header: Header,
    /// One bit for each bumper that is pressed.
    pub bumper: u8,
}

/// Beginning of `gazebo_msgs/ContactsState` and of `ros_gz_interfaces/Contacts`: the length of their
/// list of contacts.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ContactCount {
    /// Time and frame.
    pub header: Header,
    /// Number of contacts.
    pub contacts: u32,
}
