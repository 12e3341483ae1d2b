use serde::{Deserialize, Serialize};

use super::{Header, Pose, PoseWithCovariance, Vector3, message};

/// `vision_msgs/ObjectHypothesis`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesis {
    /// What it is.
    pub class_id: String,
    /// How sure.
    pub score: f64,
}

/// `vision_msgs/ObjectHypothesisWithPose`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesisWithPose {
    /// What it is.
    pub hypothesis: ObjectHypothesis,
    /// Where it is.
    pub pose: PoseWithCovariance,
}

/// `vision_msgs/BoundingBox3D`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBox3D {
    /// Middle of the box.
    pub center: Pose,
    /// Its size along its axes, m.
    pub size: Vector3,
}

/// `vision_msgs/Detection3D`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection3D {
    /// When and in which frame.
    pub header: Header,
    /// What it may be.
    pub results: Vec<ObjectHypothesisWithPose>,
    /// The space it takes.
    pub bbox: BoundingBox3D,
    /// Its identity over time.
    pub id: String,
}

/// `vision_msgs/Detection3DArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection3DArray {
    /// When and in which frame.
    pub header: Header,
    /// All detections of the moment.
    pub detections: Vec<Detection3D>,
}

/// `vision_msgs/Point2D`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point2D {
    /// Column.
    pub x: f64,
    /// Row.
    pub y: f64,
}

/// `vision_msgs/Pose2D`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Pose2D {
    /// Where.
    pub position: Point2D,
    /// Turned by, rad.
    pub theta: f64,
}

/// `vision_msgs/BoundingBox2D`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBox2D {
    /// Middle of the box, pixels.
    pub center: Pose2D,
    /// Its width, pixels.
    pub size_x: f64,
    /// Its height, pixels.
    pub size_y: f64,
}

/// `vision_msgs/Detection2D`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection2D {
    /// When and in which image.
    pub header: Header,
    /// What it may be.
    pub results: Vec<ObjectHypothesisWithPose>,
    /// The part of the image it takes.
    pub bbox: BoundingBox2D,
    /// Its identity over time.
    pub id: String,
}

/// `vision_msgs/Detection2DArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection2DArray {
    /// When and in which image.
    pub header: Header,
    /// All detections of the moment.
    pub detections: Vec<Detection2D>,
}

message!(Detection2DArray, "vision_msgs/msg/Detection2DArray", "Detection2DArray.msg");
message!(Detection3DArray, "vision_msgs/msg/Detection3DArray", "Detection3DArray.msg");
