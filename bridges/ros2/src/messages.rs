//! Conversion of messages from DDS to the frame source.
//!
//! DDS delivers messages that own their bytes, while the log reader takes the serialised bytes.
//! Images and points, which it borrows, therefore have counterparts here that own their bytes and
//! have the same serialised form, and received messages are encoded again: this costs a copy of an
//! image, a tenth of a millisecond.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_bytes::ByteBuf;
use tagalong::core::Stamp;
use tagalong::log::msgs::{Header, LaserScan, PointField, Time};

/// Number of images, or point clouds, that wait for the thread that makes frames.
pub(crate) const IMAGES: usize = 2;
/// Number of other messages that wait.
pub(crate) const OTHERS: usize = 64;

/// A message from which frames can be made.
pub(crate) trait FrameMessage: DeserializeOwned + Serialize + Send + 'static {
    /// Returns the time of the measurement.
    fn stamp(&self) -> Stamp;

    /// Returns the maximum number of messages of this type that wait; only the newest images are
    /// useful.
    fn room(&self) -> usize {
        IMAGES
    }
}

/// `sensor_msgs/Image` that owns its pixels, with the same fields as `Image` of the log reader.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct OwnedImage {
    header: Header,
    height: u32,
    width: u32,
    encoding: String,
    is_bigendian: u8,
    step: u32,
    data: ByteBuf,
}

/// `sensor_msgs/CompressedImage` that owns its bytes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct OwnedCompressedImage {
    header: Header,
    format: String,
    data: ByteBuf,
}

/// `foxglove_msgs/CompressedVideo` that owns its packet.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct OwnedVideo {
    timestamp: Time,
    frame_id: String,
    data: ByteBuf,
    format: String,
}

/// `ffmpeg_image_transport_msgs/FFMPEGPacket` that owns its packet.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct OwnedFfmpegPacket {
    header: Header,
    width: i32,
    height: i32,
    encoding: String,
    pts: u64,
    flags: u8,
    is_bigendian: bool,
    data: ByteBuf,
}

/// `sensor_msgs/PointCloud2` that owns its points.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct OwnedPointCloud {
    header: Header,
    height: u32,
    width: u32,
    fields: Vec<PointField>,
    is_bigendian: bool,
    point_step: u32,
    row_step: u32,
    data: ByteBuf,
    is_dense: bool,
}

/// `std_msgs/Bool`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Bool {
    pub(crate) data: bool,
}

/// `std_msgs/Empty`, which is one byte in DDS.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Empty {
    structure_needs_at_least_one_member: u8,
}

/// `nav2_msgs/SpeedLimit`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct SpeedLimit {
    pub(crate) header: Header,
    /// True if the limit is a percentage of the maximum speed.
    pub(crate) percentage: bool,
    /// The limit, m/s or per cent; 0 for none.
    pub(crate) speed_limit: f64,
}

impl SpeedLimit {
    /// Returns the limit for a robot with this maximum speed, m/s; infinite for none.
    pub(crate) fn mps(&self, max_speed_mps: f64) -> f64 {
        match self.speed_limit {
            // As in Nav2.
            0.0 => f64::INFINITY,
            percent if self.percentage => percent / 100.0 * max_speed_mps,
            speed => speed,
        }
    }
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct DiagnosticArray {
    pub(crate) header: Header,
    pub(crate) status: Vec<DiagnosticStatus>,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct DiagnosticStatus {
    /// 0 ok, 1 warning, 2 error, 3 stale.
    pub(crate) level: u8,
    pub(crate) name: String,
    pub(crate) message: String,
    pub(crate) hardware_id: String,
    pub(crate) values: Vec<KeyValue>,
}

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct KeyValue {
    pub(crate) key: String,
    pub(crate) value: String,
}

impl FrameMessage for OwnedImage {
    fn stamp(&self) -> Stamp {
        self.header.stamp()
    }
}

impl FrameMessage for OwnedCompressedImage {
    fn stamp(&self) -> Stamp {
        self.header.stamp()
    }

    fn room(&self) -> usize {
        // Some drivers publish video packets as images, and each packet refers to earlier ones.
        let is_video =
            [&[0, 0, 0, 1][..], &[0, 0, 1]].iter().any(|code| self.data.starts_with(code));
        if is_video { OTHERS } else { IMAGES }
    }
}

impl FrameMessage for OwnedVideo {
    fn stamp(&self) -> Stamp {
        self.timestamp.into()
    }

    fn room(&self) -> usize {
        OTHERS
    }
}

impl FrameMessage for OwnedFfmpegPacket {
    fn stamp(&self) -> Stamp {
        self.header.stamp()
    }

    fn room(&self) -> usize {
        OTHERS
    }
}

impl FrameMessage for OwnedPointCloud {
    fn stamp(&self) -> Stamp {
        self.header.stamp()
    }
}

impl FrameMessage for LaserScan {
    fn stamp(&self) -> Stamp {
        self.header.stamp()
    }

    fn room(&self) -> usize {
        OTHERS
    }
}

/// Converts `sensor_msgs::msg::dds_::Image_`, a type name in DDS, to `sensor_msgs/msg/Image`.
pub(crate) fn ros_type(dds: &str) -> Option<String> {
    let (package, name) = dds.split_once("::msg::dds_::")?;
    Some(format!("{package}/msg/{}", name.strip_suffix('_')?))
}

/// Converts `rt/odom`, a topic name in DDS, to `/odom`.
pub(crate) fn ros_topic(dds: &str) -> Option<&str> {
    dds.strip_prefix("rt").filter(|name| name.starts_with('/'))
}

#[cfg(test)]
mod tests {
    use tagalong::log::msgs::{
        CompressedImage, CompressedVideo, FfmpegPacket, Image, PointCloud2, decode, encode,
    };

    use super::*;

    /// Returns a message as the log reader reads it from the bytes of its counterpart, encoded again.
    macro_rules! read_again {
        ($borrowing:ident, $bytes:expr) => {
            encode(&decode::<$borrowing<'_>>($bytes).unwrap())
        };
    }

    #[test]
    fn what_owns_its_bytes_lies_on_the_wire_as_what_borrows_them() {
        let stamp = Stamp::from_nanos(7);
        let header = Header::new(stamp, "camera");
        let image = OwnedImage {
            header: header.clone(),
            height: 1,
            width: 3,
            encoding: "mono8".into(),
            is_bigendian: 0,
            step: 3,
            data: ByteBuf::from([1, 2, 3]),
        };
        let bytes = encode(&image);
        assert_eq!(read_again!(Image, &bytes), bytes);
        assert_eq!(decode::<Image<'_>>(&bytes).unwrap().data, [1, 2, 3]);
        let data = ByteBuf::from([9; 5]);
        let compressed =
            OwnedCompressedImage { header: header.clone(), format: "jpeg".into(), data };
        let bytes = encode(&compressed);
        assert_eq!(read_again!(CompressedImage, &bytes), bytes);
        assert_eq!(compressed.room(), IMAGES);
        let data = ByteBuf::from([0, 0, 1, 0x65]);
        let packet = OwnedCompressedImage { data: data.clone(), ..compressed };
        assert_eq!(packet.room(), OTHERS);
        let video =
            OwnedVideo { timestamp: stamp.into(), data: data.clone(), ..OwnedVideo::default() };
        let bytes = encode(&video);
        assert_eq!((read_again!(CompressedVideo, &bytes), video.stamp()), (bytes, stamp));
        let packet = OwnedFfmpegPacket { header, pts: 5, data, ..OwnedFfmpegPacket::default() };
        let bytes = encode(&packet);
        assert_eq!((read_again!(FfmpegPacket, &bytes), packet.stamp()), (bytes, stamp));
        let header = Header::new(stamp, "lidar");
        let cloud = encode(&PointCloud2::of_points(header, &[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]));
        assert_eq!(encode(&decode::<OwnedPointCloud>(&cloud).unwrap()), cloud);
    }

    #[test]
    fn a_speed_limit_is_a_speed_a_part_or_none() {
        for (percentage, speed_limit, mps) in [
            (false, 0.3, 0.3),
            (true, 50.0, 0.4),
            (false, 0.0, f64::INFINITY),
            (true, 0.0, f64::INFINITY),
        ] {
            let limit = SpeedLimit { header: Header::default(), percentage, speed_limit };
            assert_eq!(limit.mps(0.8), mps, "{percentage} {speed_limit}");
        }
    }

    #[test]
    fn names_of_dds_are_those_of_ros_in_disguise() {
        let image = "sensor_msgs::msg::dds_::Image_";
        assert_eq!(ros_type(image).as_deref(), Some("sensor_msgs/msg/Image"));
        assert_eq!(ros_type("rcl_interfaces::srv::dds_::GetParameters_Request_"), None);
        assert_eq!((ros_topic("rt/odom"), ros_topic("rq/odom")), (Some("/odom"), None));
        assert_eq!(ros_topic("ros_discovery_info"), None);
    }
}
