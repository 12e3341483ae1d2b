//! Recording times in place of the stamps of messages.

use tagalong_core::Stamp;

use crate::msgs::{ROS1_MARK, Time};
use crate::scan::Type;
use crate::sensors::is_type;
use crate::walk::Message;

/// Returns a message with its recording time as the stamp; `None` for messages that do not begin
/// with a header.
pub(super) fn restamp(message: &Message<'_>) -> Option<Vec<u8>> {
    let schema = &message.channel.schema_name;
    let has_header = match Type::of(schema) {
        Type::Image
        | Type::CompressedImage
        | Type::Video
        | Type::DisparityImage
        | Type::PointCloud
        | Type::CameraInfo
        | Type::Odometry
        | Type::Sensor => true,
        Type::Tf | Type::Number => false,
        Type::Other => is_type(schema, "sensor_msgs/Range"),
    };
    if !has_header {
        return None;
    }
    let mut data = message.data.to_vec();
    let time = Time::from(Stamp::from_nanos(message.log_time));
    // The encapsulation header, or in ROS 1 a mark and the sequence number, precedes the stamp.
    let is_ros1 = data.starts_with(&ROS1_MARK);
    // Only a video message begins with the stamp itself.
    let has_sequence = is_ros1 && !schema.ends_with("/CompressedVideo");
    let at = if has_sequence { 8 } else { 4 };
    let is_big_endian = !is_ros1 && data.get(1) == Some(&0);
    let (sec, nanosec) = if is_big_endian {
        (time.sec.to_be_bytes(), time.nanosec.to_be_bytes())
    } else {
        (time.sec.to_le_bytes(), time.nanosec.to_le_bytes())
    };
    data.get_mut(at..at + 4)?.copy_from_slice(&sec);
    data.get_mut(at + 4..at + 8)?.copy_from_slice(&nanosec);
    Some(data)
}
