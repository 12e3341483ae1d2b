use serde::{Deserialize, Serialize};

use super::{Header, Pose, PoseWithCovariance, Vector3, message};

/// `vision_msgs/ObjectHypothesis`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesis {
    /// Class of the object.
    pub class_id: String,
    /// Confidence.
    pub score: f64,
}

/// `vision_msgs/ObjectHypothesisWithPose`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ObjectHypothesisWithPose {
    /// Class with its confidence.
    pub hypothesis: ObjectHypothesis,
    /// Pose of the object.
    pub pose: PoseWithCovariance,
}

/// `vision_msgs/BoundingBox3D`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBox3D {
    /// Centre of the box.
    pub center: Pose,
    /// Size along its axes, m.
    pub size: Vector3,
}

/// `vision_msgs/Detection3D`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection3D {
    /// Time and frame.
    pub header: Header,
    /// Hypotheses about its class.
    pub results: Vec<ObjectHypothesisWithPose>,
    /// Bounding box.
    pub bbox: BoundingBox3D,
    /// ID over time.
    pub id: String,
}

/// `vision_msgs/Detection3DArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection3DArray {
    /// Time and frame.
    pub header: Header,
    /// All detections of one moment.
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
    /// Position.
    pub position: Point2D,
    /// Rotation, rad.
    pub theta: f64,
}

/// `vision_msgs/BoundingBox2D`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct BoundingBox2D {
    /// Centre of the box, pixels.
    pub center: Pose2D,
    /// Width, pixels.
    pub size_x: f64,
    /// Height, pixels.
    pub size_y: f64,
}

/// `vision_msgs/Detection2D`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection2D {
    /// Time and image.
    pub header: Header,
    /// Hypotheses about its class.
    pub results: Vec<ObjectHypothesisWithPose>,
    /// Bounding box in the image.
    pub bbox: BoundingBox2D,
    /// ID over time.
    pub id: String,
}

/// `vision_msgs/Detection2DArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Detection2DArray {
    /// Time and image.
    pub header: Header,
    /// All detections of one moment.
    pub detections: Vec<Detection2D>,
}

message!(Detection2DArray, "vision_msgs/msg/Detection2DArray", "Detection2DArray.msg");
message!(Detection3DArray, "vision_msgs/msg/Detection3DArray", "Detection3DArray.msg");
