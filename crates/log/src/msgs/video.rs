//! Video packets.

use serde::{Deserialize, Serialize};

use super::{Header, Time, message};

/// `foxglove_msgs/CompressedVideo`: the packet of one picture, without B-frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CompressedVideo<'a> {
    /// Time of the picture.
    pub timestamp: Time,
    /// Frame of the camera.
    pub frame_id: String,
    /// Packet.
    #[serde(with = "serde_bytes", borrow)]
    pub data: &'a [u8],
    /// Codec: `h264`, `h265`, `vp9` or `av1`.
    pub format: String,
}

message!(CompressedVideo<'_>, "foxglove_msgs/msg/CompressedVideo", "CompressedVideo.msg");

/// `ffmpeg_image_transport_msgs/FFMPEGPacket`: the packet of one picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FfmpegPacket<'a> {
    /// Time of the picture, and frame of the camera.
    pub header: Header,
    /// Columns of the picture.
    pub width: i32,
    /// Rows of the picture.
    pub height: i32,
    /// Codec with the format of the pixels, for example `h264;yuv420p;bgr8;bgr8`, or the name of the
    /// encoder, for example `libx264`.
    pub encoding: String,
    /// Time of the picture in the stream.
    pub pts: u64,
    /// Flags of the encoder.
    pub flags: u8,
    /// Byte order of the original image.
    pub is_bigendian: bool,
    /// Packet.
    #[serde(with = "serde_bytes", borrow)]
    pub data: &'a [u8],
}

message!(FfmpegPacket<'_>, "ffmpeg_image_transport_msgs/msg/FFMPEGPacket", "FFMPEGPacket.msg");
