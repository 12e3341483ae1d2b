//! ROS 2 messages that Tagalong reads and writes, in their CDR layout.
//!
//! The structs have the fields of the ROS definitions, in the same order. CDR has no field names:
//! the order *is* the format. [`decode`] reads the encapsulation header and either byte order;
//! [`encode`] writes little endian.
//!
//! Image payloads are borrowed from the message, so that decoding an image message costs no more
//! than decoding its header.

mod common;
mod contact;
mod definition;
mod geometry;
mod people;
mod ros1;
mod scene;
mod sensor;
mod video;
mod vision;

pub use common::{BoolMsg, Float32Msg, Header, StringMsg, Time};
pub use contact::{BumperEvent, BumperState, ContactCount, HazardDetection, HazardDetectionVector};
pub(crate) use definition::{Definition, Value};
pub use geometry::{
    Odometry, Point, Pose, PoseArray, PoseStamped, PoseWithCovariance, Quaternion, TFMessage,
    Transform, TransformStamped, Twist, TwistStamped, TwistWithCovariance, Vector3,
};
pub use people::{People, PersonMsg};
use re_cdr::{BigEndian, LittleEndian};
pub use scene::{
    ArrowPrimitive, Color, ColorRgba, CylinderPrimitive, ImageAnnotations, LinePrimitive, Marker,
    MarkerArray, Pixel, PointsAnnotation, SceneEntity, SceneEntityDeletion, SceneUpdate,
    TextAnnotation, TextPrimitive,
};
pub use sensor::{
    CameraInfo, CompressedImage, DisparityImage, Image, JointState, LaserScan, PointCloud2,
    PointField, Range, RegionOfInterest,
};
use serde::{Deserialize, Serialize};
pub use video::{CompressedVideo, FfmpegPacket};
pub use vision::{
    BoundingBox2D, BoundingBox3D, Detection2D, Detection2DArray, Detection3D, Detection3DArray,
    ObjectHypothesis, ObjectHypothesisWithPose, Point2D, Pose2D,
};

/// Message type that can be a channel of a log.
pub trait Message {
    /// ROS name, for example `sensor_msgs/msg/Image`.
    const TYPE: &'static str;
    /// Definition including those of all contained types, in the concatenated `ros2msg` form.
    const DEFINITION: &'static str;
}

macro_rules! message {
    ($type:ty, $name:literal, $file:literal) => {
        impl $crate::msgs::Message for $type {
            const TYPE: &'static str = $name;
            const DEFINITION: &'static str = include_str!(concat!("../../msgs/", $file));
        }
    };
}
use message;

/// Reason why a message could not be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CdrError {
    /// The encapsulation header is missing, or is not that of plain CDR.
    #[error("not a CDR message: it starts with {0:02x?}; expected 00 00 or 00 01")]
    Encapsulation(Vec<u8>),
    /// The bytes end early or do not fit the type.
    #[error("the message does not fit its type: {0}")]
    Content(String),
}

/// Bytes that replace the encapsulation header of CDR in front of a message that is serialised as
/// in ROS 1.
pub(crate) const ROS1_MARK: [u8; 4] = *b"ros1";

/// Reads a message with its four-byte encapsulation header, or one of a ROS 1 bag as
/// [`crate::LogWalker`] delivers it.
///
/// # Errors
/// [`CdrError`]. Bytes after the message are allowed, because some writers add padding.
///
/// ```
/// use tagalong_log::msgs::{StringMsg, decode, encode};
/// let sent = StringMsg { data: "hello".into() };
/// assert_eq!(decode::<StringMsg>(&encode(&sent)).unwrap(), sent);
/// ```
pub fn decode<'de, T: Deserialize<'de>>(message: &'de [u8]) -> Result<T, CdrError> {
    let (header, body) =
        message.split_at_checked(4).ok_or_else(|| CdrError::Encapsulation(message.to_vec()))?;
    if header == ROS1_MARK {
        return ros1::from_bytes(body).map_err(CdrError::Content);
    }
    let read = match header[..2] {
        [0, 0] => re_cdr::from_bytes::<T, BigEndian>(body),
        [0, 1] => re_cdr::from_bytes::<T, LittleEndian>(body),
        _ => return Err(CdrError::Encapsulation(header.to_vec())),
    };
    read.map(|(value, _)| value).map_err(|error| CdrError::Content(error.to_string()))
}

/// Writes a message with its encapsulation header, little endian.
pub fn encode<T: Serialize>(message: &T) -> Vec<u8> {
    framed([0, 1], re_cdr::to_vec::<T, LittleEndian>(message))
}

/// Writes a message big endian, as some bridges do.
pub fn encode_big_endian<T: Serialize>(message: &T) -> Vec<u8> {
    framed([0, 0], re_cdr::to_vec::<T, BigEndian>(message))
}

#[expect(clippy::expect_used, reason = "writing to memory fails only for types CDR cannot express")]
fn framed(representation: [u8; 2], body: re_cdr::Result<Vec<u8>>) -> Vec<u8> {
    let body = body.expect("the structs of this module are expressible in CDR");
    let mut out = Vec::with_capacity(body.len() + 4);
    out.extend_from_slice(&representation);
    out.extend_from_slice(&[0, 0]);
    out.extend_from_slice(&body);
    out
}

#[cfg(test)]
mod tests;
