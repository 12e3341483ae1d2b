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

message!(Detection3DArray, "vision_msgs/msg/Detection3DArray", "Detection3DArray.msg");
