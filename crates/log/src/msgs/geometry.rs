use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use serde::{Deserialize, Serialize};
use tagalong_core::Stamp;

use super::{Header, message};

/// `geometry_msgs/Point`, m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Along X.
    pub x: f64,
    /// Along Y.
    pub y: f64,
    /// Along Z.
    pub z: f64,
}

/// `geometry_msgs/Vector3`.
pub type Vector3 = Point;

/// `geometry_msgs/Quaternion`; a valid one has length 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quaternion {
    /// Vector part, X.
    pub x: f64,
    /// Vector part, Y.
    pub y: f64,
    /// Vector part, Z.
    pub z: f64,
    /// Scalar part.
    pub w: f64,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

/// `geometry_msgs/Pose`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Origin, m.
    pub position: Point,
    /// Rotation.
    pub orientation: Quaternion,
}

/// `geometry_msgs/PoseArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseArray {
    /// Time and frame.
    pub header: Header,
    /// The poses.
    pub poses: Vec<Pose>,
}

/// `geometry_msgs/Transform`, with the CDR layout of a [`Pose`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Origin of the child in the parent, m.
    pub translation: Vector3,
    /// Rotation of the child in the parent.
    pub rotation: Quaternion,
}

/// Returns the isometry with this position and rotation; `None` if a number is not finite or the
/// norm of the quaternion differs from 1 by 0.1 or more.
fn isometry(position: Point, rotation: Quaternion) -> Option<Isometry3<f64>> {
    let q = nalgebra::Quaternion::new(rotation.w, rotation.x, rotation.y, rotation.z);
    let at = nalgebra::Vector3::new(position.x, position.y, position.z);
    let sane = at.iter().all(|v| v.is_finite()) && (q.norm() - 1.0).abs() < 0.1;
    // Normalises the quaternion, because publishers round it.
    sane.then(|| Isometry3::from_parts(at.into(), UnitQuaternion::from_quaternion(q)))
}

fn parts(isometry: &Isometry3<f64>) -> (Point, Quaternion) {
    let Translation3 { vector: at } = isometry.translation;
    let q = isometry.rotation.quaternion();
    (Point { x: at.x, y: at.y, z: at.z }, Quaternion { x: q.i, y: q.j, z: q.k, w: q.w })
}

impl Pose {
    /// Returns the pose as an isometry; `None` if it is invalid.
    pub fn isometry(&self) -> Option<Isometry3<f64>> {
        isometry(self.position, self.orientation)
    }
}

impl From<&Isometry3<f64>> for Pose {
    fn from(value: &Isometry3<f64>) -> Self {
        let (position, orientation) = parts(value);
        Self { position, orientation }
    }
}

impl Transform {
    /// Returns `parent_from_child`; `None` if it is invalid.
    pub fn isometry(&self) -> Option<Isometry3<f64>> {
        isometry(self.translation, self.rotation)
    }
}

impl From<&Isometry3<f64>> for Transform {
    fn from(value: &Isometry3<f64>) -> Self {
        let (translation, rotation) = parts(value);
        Self { translation, rotation }
    }
}

/// `geometry_msgs/TransformStamped`: `header.frame_id` is the parent.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Time and parent frame.
    pub header: Header,
    /// Child frame.
    pub child_frame_id: String,
    /// `parent_from_child`.
    pub transform: Transform,
}

/// `tf2_msgs/TFMessage`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TFMessage {
    /// Transforms.
    pub transforms: Vec<TransformStamped>,
}

message!(TFMessage, "tf2_msgs/msg/TFMessage", "TFMessage.msg");

impl TFMessage {
    /// Creates a message with one transform.
    pub fn of_link(at: Stamp, parent: &str, child: &str, pose: &Isometry3<f64>) -> Self {
        let link = TransformStamped {
            header: Header::new(at, parent),
            child_frame_id: child.to_owned(),
            transform: pose.into(),
        };
        Self { transforms: vec![link] }
    }
}

/// `geometry_msgs/PoseStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped {
    /// Time and frame.
    pub header: Header,
    /// Pose.
    pub pose: Pose,
}

message!(PoseStamped, "geometry_msgs/msg/PoseStamped", "PoseStamped.msg");

/// `geometry_msgs/PoseWithCovariance`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// Pose.
    pub pose: Pose,
    /// Covariance of (x, y, z, rotation about X, Y, Z), row by row.
    pub covariance: [[f64; 6]; 6],
}

/// `geometry_msgs/Twist`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Linear velocity, m/s.
    pub linear: Vector3,
    /// Angular velocity, rad/s.
    pub angular: Vector3,
}

/// `geometry_msgs/TwistStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistStamped {
    /// Time and frame.
    pub header: Header,
    /// Velocities.
    pub twist: Twist,
}

message!(TwistStamped, "geometry_msgs/msg/TwistStamped", "TwistStamped.msg");

/// `geometry_msgs/TwistWithCovariance`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// Velocities.
    pub twist: Twist,
    /// Covariance of the velocities, row by row.
    pub covariance: [[f64; 6]; 6],
}

/// `nav_msgs/Odometry`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// Time and odometry frame.
    pub header: Header,
    /// Robot frame.
    pub child_frame_id: String,
    /// `odom_from_robot`.
    pub pose: PoseWithCovariance,
    /// Velocities in the robot frame.
    pub twist: TwistWithCovariance,
}

message!(Odometry, "nav_msgs/msg/Odometry", "Odometry.msg");

impl Odometry {
    /// Creates a message with a pose and no velocities.
    pub fn of_pose(at: Stamp, odom: &str, robot: &str, odom_from_robot: &Isometry3<f64>) -> Self {
        Self {
            header: Header::new(at, odom),
            child_frame_id: robot.to_owned(),
            pose: PoseWithCovariance { pose: odom_from_robot.into(), ..Default::default() },
            twist: TwistWithCovariance::default(),
        }
    }
}
