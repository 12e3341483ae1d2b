//! Kinds of topics, as shown by types, encodings and first messages, and their ranks by name.

use tagalong_core::Input;

use super::name::{Stream, TopicName};
use crate::InputSettings;
use crate::images::{Content, H264, VIDEO_REMEDY, may_be_disparity, refusal_of};
use crate::scan::{Topic, Type};
use crate::sensors::{SENSORS, SensorType};

pub(super) fn is_picture(topic: &Topic) -> bool {
    matches!(topic.kind, Type::Image | Type::CompressedImage | Type::Video)
}

/// Returns true for images, including disparity images and the points of depth cameras.
pub(super) fn is_image(topic: &Topic) -> bool {
    let is_cloud = topic.kind == Type::PointCloud && !topic.is_lidar();
    is_picture(topic) || topic.kind == Type::DisparityImage || is_cloud
}

/// Returns true for pictures that can be read, as far as is known before the first one.
pub(super) fn is_usable_picture(topic: &Topic) -> bool {
    is_picture(topic) && (topic.content == Content::Picture || topic.pixels.is_none())
}

/// Returns true for images that can be read as depth if the settings name them. They include grey
/// images of 16 bits and infrared ones, because the choice of the user has priority.
pub(super) fn is_usable_depth(topic: &Topic, input: &InputSettings) -> bool {
    let is_disparity = input.disparity.is_some() && disparity_rank("disparity", topic).is_some();
    let may_be = topic.is_deep_grey || topic.is_other_stream;
    let is_depth = topic.content == Content::Depth || topic.pixels.is_none() || may_be;
    is_image(topic) && (is_depth || is_disparity)
}

/// Returns true for images whose pixels may be depth or disparities, if necessary after a change of
/// settings.
pub(super) fn could_be_depth(topic: &Topic) -> bool {
    is_image(topic) && (topic.content != Content::Picture || remedy_as_depth(topic).is_some())
}

/// Returns the setting with which images of another appearance are read as depth.
pub(super) fn remedy_as_depth(topic: &Topic) -> Option<&'static str> {
    match topic.pixels.as_deref()? {
        _ if topic.is_deep_grey || topic.is_other_stream => {
            Some("name it as `depth_topic` under [input]")
        }
        "mono8" | "8UC1" | "16SC1" => Some("and its pixels are disparities, add [input.disparity]"),
        _ => None,
    }
}

/// Returns type and encoding of the messages of a topic.
pub(crate) fn kind_of(topic: &Topic) -> String {
    match (&topic.pixels, topic.encoding.as_str()) {
        (Some(pixels), _) => format!("{}, {pixels}", topic.schema),
        (None, "cdr" | "ros1" | "") => topic.schema.clone(),
        (None, encoding) => format!("{}, {encoding}", topic.schema),
    }
}

/// Names of messages with images or scans, in any package and encoding.
const SENSOR_MESSAGES: [&str; 5] =
    ["Image", "RawImage", "CompressedImage", "DisparityImage", "LaserScan"];
/// Names of messages with video.
const VIDEO_MESSAGES: [&str; 3] = ["CompressedVideo", "FFMPEGPacket", "H264Packet"];
/// Remedy for video whose first parameters are not in the log.
const NO_KEY_REMEDY: &str = "no key picture with its parameters is in the log, and those after it refer to \
                             one: record from the start of the stream, or let the encoder repeat them";

/// Reason for pictures of depth, coloured for display, and their remedy.
const DEPTH_AS_PICTURE: &str = "its name says depth, but its pixels are a picture, which has no \
                                distances";
const DEPTH_AS_PICTURE_REMEDY: &str = "record the raw topic, or its compressedDepth";

/// Remedy for depth as JPEG.
const JPEG_REMEDY: &str = "JPEG keeps 8 of the 16 bits of depth, so the distances are lost: record \
                           the raw topic, or its compressedDepth";
/// Remedy for grey images of 16 bits in a codec that is used for depth.
const DEEP_REMEDY: &str = "grey images of 16 bits are no colour images; they could be depth: if \
                           they are, name the topic as `depth_topic` under [input], with its unit \
                           as `depth_unit_m`";

/// Remedy for images with the encoding of depth whose name says that they are something else.
const OTHER_STREAM_REMEDY: &str = "its name says infrared or confidence, and its encoding would be that of depth, too: \
                                   if it is depth, name the topic as `depth_topic` under [input]";

/// Returns the name of the messages of a topic without their package.
fn message_name(topic: &Topic) -> &str {
    topic.schema.rsplit(['/', '.']).next().unwrap_or_default()
}

/// Returns the reason why images or scans of a topic cannot be read, with the remedy; `None` if
/// they can, and for all other topics.
pub(crate) fn unreadable(topic: &Topic) -> Option<String> {
    let name = message_name(topic);
    let is_decoded = topic.kind == Type::Video && topic.pixels.as_deref() == Some(H264);
    if is_decoded && topic.size.is_none() {
        return Some(topic.video_fault.clone().unwrap_or_else(|| NO_KEY_REMEDY.to_owned()));
    }
    if VIDEO_MESSAGES.contains(&name) && !is_decoded {
        return Some(VIDEO_REMEDY.to_owned());
    }
    match (&topic.pixels, topic.kind) {
        (_, Type::PointCloud) => topic.cloud_fault.clone(),
        (Some(_), _) if topic.is_jpeg_depth => Some(JPEG_REMEDY.to_owned()),
        (Some(_), _) if topic.is_deep_grey && topic.content == Content::Unknown => {
            Some(DEEP_REMEDY.to_owned())
        }
        (Some(_), _) if topic.is_other_stream => Some(OTHER_STREAM_REMEDY.to_owned()),
        (Some(pixels), _) if topic.content == Content::Unknown => Some(refusal_of(pixels)),
        (None, Type::Other) if SENSOR_MESSAGES.contains(&name) => {
            let read_as = match name {
                "RawImage" => "sensor_msgs/Image".to_owned(),
                "DisparityImage" => "stereo_msgs/DisparityImage".to_owned(),
                name => format!("sensor_msgs/{name}"),
            };
            Some(match unread_encoding(&topic.encoding) {
                None => {
                    format!("its type is not read: record or republish it as {read_as}")
                }
                Some((why, remedy)) => format!("{why}: {remedy}"),
            })
        }
        _ => None,
    }
}

/// Returns the reason why messages in an encoding cannot be read, whatever their type, and the
/// remedy.
pub(super) fn unread_encoding(encoding: &str) -> Option<(String, &'static str)> {
    if matches!(encoding, "cdr" | "ros1") {
        return None;
    }
    let why = format!(
        "its messages are in `{encoding}`, but only those of ROS 2 (`cdr`) and ROS 1 (`ros1`) can \
         be read"
    );
    Some((why, "record with `ros2 bag record`, or convert the log"))
}

/// Returns the reason and the remedy for pictures or video under a name of depth; `None` for all
/// other topics, and for those that a setting declares to be disparities.
pub(super) fn depth_as_picture(name: &str, topic: &Topic) -> Option<(&'static str, &'static str)> {
    let is_picture = topic.content == Content::Picture && !topic.is_deep_grey;
    let is_named = TopicName::of(name).stream == Stream::Depth;
    let may_be_disparity = disparity_rank(name, topic).is_some();
    if !is_named || may_be_disparity || !(is_picture || is_video(topic)) {
        return None;
    }
    Some((DEPTH_AS_PICTURE, DEPTH_AS_PICTURE_REMEDY))
}

/// Returns true for video, whether or not it is decoded.
fn is_video(topic: &Topic) -> bool {
    let name = message_name(topic);
    let is_theora = topic.pixels.as_deref().is_some_and(|pixels| pixels.contains("theora"));
    topic.kind == Type::Video || VIDEO_MESSAGES.contains(&name) || is_theora
}

/// Names of messages with detections of objects or people, in any package.
const DETECTION_MESSAGES: [&str; 22] = [
    "BoundingBoxArray",
    "BoundingBoxes",
    "Detection2DArray",
    "Detection3DArray",
    "DetectionArray",
    "SpatialDetectionArray",
    "DetectedObjectArray",
    "DetectedObjects",
    "DetectedPersons",
    "LegArray",
    "ObjectsInBoxes",
    "ObjectsStamped",
    "OpenPoseHumanList",
    "People",
    "PersonArray",
    "PositionMeasurementArray",
    "PredictedObjects",
    "TrackDetection2DArray",
    "TrackedObjects",
    "TrackedPersons",
    "YoloDetections",
    "YoloResult",
];

/// Returns the reason why detections of a topic cannot be read; `None` if they can, and for all
/// other topics.
pub(super) fn unread_detections(topic: &Topic) -> Option<String> {
    if topic.kind != Type::Other || !DETECTION_MESSAGES.contains(&message_name(topic)) {
        return None;
    }
    Some(match unread_encoding(&topic.encoding) {
        None => format!(
            "its type is not read; {} are: convert the messages to one of them",
            detection_types()
        ),
        Some((why, remedy)) => format!("{why}: {remedy}"),
    })
}

/// Returns the types of detections that are read.
pub(super) fn detection_types() -> String {
    let sensor = SENSORS.iter().find(|sensor| sensor.input == Input::Detections);
    sensor.map(|sensor| sensor.messages.join(", ")).unwrap_or_default()
}

pub(super) fn is_info(topic: &Topic) -> bool {
    topic.kind == Type::CameraInfo
}

pub(super) fn is_odometry(topic: &Topic) -> bool {
    topic.kind == Type::Odometry
}

/// Returns true for a topic with messages of this sensor, in an encoding that can be read. Points
/// count as those of a lidar only if they are not those of a camera.
pub(super) fn is_of(sensor: &SensorType, topic: &Topic) -> bool {
    let is_sensor =
        topic.kind == Type::Sensor || topic.kind == Type::PointCloud && topic.is_lidar();
    is_sensor && sensor.reads(&topic.schema)
}

pub(super) fn has(name: &str, words: &[&str]) -> bool {
    words.iter().any(|word| name.contains(word))
}

/// Returns the rank of pictures by their name; `None` for other images.
pub(super) fn colour_rank(name: &str, topic: &Topic) -> Option<i32> {
    if !is_picture(topic) || topic.content != Content::Picture {
        return None;
    }
    if depth_as_picture(name, topic).is_some() {
        return None;
    }
    let name = &name.to_lowercase();
    // A name for colour has priority over one for a side, and over an uncompressed image.
    let mut rank = -2 * i32::from(has(name, &["rear", "back"]));
    rank += 8 * i32::from(has(name, &["color", "colour", "rgb"]));
    rank += 4 * i32::from(has(name, &["left", "front", "rect"]));
    rank -= 6 * i32::from(has(
        name,
        &["infra", "/ir", "depth", "disparity", "fisheye", "mono", "debug"],
    ));
    rank -= 6 * i32::from(has(name, &["annotated", "overlay", "result", "detection"]));
    rank += i32::from(topic.kind == Type::Image);
    // Video is coarser than the images of the same camera on a topic beside it.
    rank -= i32::from(topic.kind == Type::Video);
    Some(rank)
}

/// Returns the rank of depth images by their name; `None` for other images.
pub(super) fn depth_rank(name: &str, topic: &Topic) -> Option<i32> {
    if !is_image(topic) || topic.content != Content::Depth {
        return None;
    }
    let name = &name.to_lowercase();
    let mut rank = 0;
    rank += 8 * i32::from(has(name, &["aligned", "registered"]));
    rank += 4 * i32::from(name.contains("depth"));
    rank -= 6 * i32::from(has(name, &["infra", "/ir", "confidence", "debug", "disparity"]));
    rank += i32::from(topic.kind == Type::Image);
    // Points contain the same depth as the images, in many times the bytes.
    rank -= 10 * i32::from(topic.kind == Type::PointCloud);
    Some(rank)
}

/// Returns the rank of images that the settings declare to be disparities, by their name.
pub(super) fn disparity_rank(name: &str, topic: &Topic) -> Option<i32> {
    let pixels = topic.pixels.as_deref().unwrap_or_default();
    let may_be = match topic.kind {
        Type::Image => may_be_disparity(pixels),
        Type::CompressedImage => pixels.contains("png"),
        _ => false,
    };
    (may_be && name.to_lowercase().contains("disp")).then(|| i32::from(topic.kind == Type::Image))
}

pub(super) fn odometry_rank(name: &str, topic: &Topic) -> Option<i32> {
    let name = &name.to_lowercase();
    let filtered = has(name, &["filtered", "fused"]);
    (topic.kind == Type::Odometry).then(|| i32::from(!has(name, &["visual"])) + i32::from(filtered))
}
