//! Decoding of image messages.
//!
//! Depth is converted to metres along the optical axis, with NaN for "no reading": 0 and 65535 of
//! integer depth, and 0, negative, infinite and NaN values of floating-point depth (REP 117 and 118
//! give infinities a meaning of their own, which no detector here uses).
//!
//! The frames of a log are made from images, so a new message type with images needs changes in
//! more files than another sensor (`crates/log/src/sensors`):
//!
//! 1. `msgs`: a struct with the fields of the ROS message in their order, and its definition as a
//!    file in `crates/log/msgs`.
//! 2. Here: a file that decodes the pixels, and reads their size without decoding them.
//! 3. `scan.rs`: a variant of `Type`, its name in `Type::of`, and a `take_...` that reads encoding
//!    and size from the first message.
//! 4. `topics/kinds.rs`: `is_image`, and `is_picture` unless it is depth: the uses of the topic.
//! 5. `source/intake.rs` (`payload`) for the stamp, `source/assemble.rs` (`AnyImage` and `read`)
//!    for the pixels, `source/restamp.rs` for recording times.
//! 6. Live: `listen` in `bridges/ros2/src/network.rs`. Copies without faces:
//!    `crates/cli/src/commands/blur/topics.rs`. For users: the table of inputs in `docs/logs.md`.
//!
//! The compiler reports the missing arms of matches over `Type` in `scan.rs` and `restamp.rs`, and
//! of those over `AnyImage`. The other matches have a default arm, so that a forgotten type is not
//! read.

mod bayer;
mod cloud;
mod compressed;
mod deep_png;
mod disparity;
mod h264;
mod raw;
mod rvl;
mod video;
mod yuv;

pub use cloud::{
    CloudAxes, CloudCamera, camera_of_cloud, decode_cloud, points_of_cloud, size_of_cloud,
};
pub(crate) use compressed::{Codec, content_of_compressed};
pub use compressed::{decode_compressed, encode_rvl, size_of_compressed};
pub(crate) use disparity::may_be_disparity;
pub use disparity::{
    DepthFromDisparity, StereoGeometry, decode_compressed_disparity, decode_disparity,
    decode_plain_disparity,
};
pub(crate) use h264::{Picture, VideoDecoder, size_of_video};
pub use raw::{decode_raw, size_of_raw};
use tagalong_core::{DepthImage, GreyImage, RgbImage};
pub(crate) use video::{H264, NO_PARAMETERS, Packet, has_lengths, video_codec};

use crate::Limits;

/// Decoded image.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// Colour.
    Colour(RgbImage),
    /// Intensity.
    Grey(GreyImage),
    /// Depth.
    Depth(DepthImage),
}

impl Pixels {
    /// Returns columns and rows.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Colour(image) => (image.width(), image.height()),
            Self::Grey(image) => (image.width(), image.height()),
            Self::Depth(image) => (image.width(), image.height()),
        }
    }
}

/// Reason why an image message was not decoded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The encoding is unknown, or unknown for depth.
    #[error(
        "encoding `{0}` is not known: let the driver publish rgb8, bgr8, rgba8, bgra8, mono8, bayer_*8, \
         yuv422 (uyvy), yuv422_yuy2 (yuyv), nv12, nv21 or nv24, and depth as 16UC1 or 32FC1 (mono16 \
         where `depth_unit_m` is set); compressed as jpeg, png or compressedDepth"
    )]
    Encoding(String),
    /// Colour with 16 bits per channel.
    #[error(
        "encoding `{0}` has 16 bits a channel, which no pipeline uses: let the driver publish 8 \
         bits (rgb8 or bayer_rggb8, say)"
    )]
    Deep(String),
    /// An encoding that cannot hold disparities.
    #[error(
        "disparities as `{0}`; known: 32FC1, 8UC1, mono8, 16SC1, and 16UC1, mono16 where \
         `disparity.unit_px` is set under [input]"
    )]
    NoDisparity(String),
    /// Disparities whose unit has no convention.
    #[error(
        "disparities as `{0}`, which has no fixed unit: set `disparity.unit_px` under [input] \
         (0.0625 for 16 parts of a pixel, 0.00390625 for 256)"
    )]
    Unit(String),
    /// Disparities whose geometry gives no depth.
    #[error(
        "disparities with f = {focal_px} px and T = {baseline_m} m, which have to be positive: \
         publish them with the calibration of the stereo camera"
    )]
    Geometry {
        /// Focal length, pixels.
        focal_px: f64,
        /// Baseline, m.
        baseline_m: f64,
    },
    /// The image is larger than the limits allow.
    #[error("{width}x{height} pixels exceed the limit")]
    TooLarge {
        /// Columns in the message.
        width: u64,
        /// Rows in the message.
        height: u64,
    },
    /// `step` or the length of the data contradicts the size.
    #[error("{0}")]
    Layout(String),
    /// Points that do not form an image.
    #[error("{0}")]
    Cloud(String),
    /// The compressed bytes are damaged or of an unknown kind.
    #[error("{0}")]
    Codec(String),
}

impl ImageError {
    /// Returns the name under which such messages are counted.
    pub fn counter(&self) -> &'static str {
        match self {
            Self::Encoding(_) | Self::Deep(_) | Self::NoDisparity(_) | Self::Unit(_) => {
                "images_of_unknown_encoding"
            }
            Self::Geometry { .. } => "disparity_without_geometry",
            Self::TooLarge { .. } => "images_too_large",
            Self::Layout(_) => "images_of_wrong_layout",
            Self::Cloud(_) => "point_clouds_that_are_no_images",
            Self::Codec(_) => "images_undecodable",
        }
    }
}

/// Content of an encoding or format, if its name shows it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Content {
    /// Colour or intensity.
    Picture,
    /// Depth.
    Depth,
    /// Unknown.
    #[default]
    Unknown,
}

/// Returns the content of images of a `sensor_msgs/Image` encoding. `depth_unit_m` is the setting
/// that makes `mono16` depth.
pub fn content_of_encoding(encoding: &str, depth_unit_m: Option<f64>) -> Content {
    match encoding {
        "rgb8" | "bgr8" | "rgba8" | "bgra8" | "mono8" | "8UC1" | "8UC3" | "8UC4" => {
            Content::Picture
        }
        "16UC1" | "32FC1" => Content::Depth,
        "mono16" if depth_unit_m.is_some() => Content::Depth,
        "mono16" => Content::Picture,
        _ if bayer::Pattern::of(encoding).is_some() => Content::Picture,
        _ if yuv::Order::of(encoding).is_some() => Content::Picture,
        _ => Content::Unknown,
    }
}

/// Returns the reason why images of an encoding or format cannot be read, with the remedy.
pub(crate) fn refusal_of(pixels: &str) -> String {
    let lower = pixels.to_ascii_lowercase();
    let video = ["h264", "h265", "hevc", "avc", "ffmpeg", "theora", "av1", "vp8", "vp9"];
    if video.iter().any(|name| lower.contains(name)) {
        return VIDEO_REMEDY.to_owned();
    }
    if is_deep(pixels) {
        ImageError::Deep(pixels.to_owned()).to_string()
    } else {
        ImageError::Encoding(pixels.to_owned()).to_string()
    }
}

/// Remedy for video in a log.
pub(crate) const VIDEO_REMEDY: &str = "of video H.264 alone is decoded: record the camera's jpeg images (a topic `.../compressed`) instead; the video \
     of a log that exists can be republished as jpeg while it plays (`ros2 run image_transport republish \
     ffmpeg compressed`, or with `foxglove` or `theora` in place of `ffmpeg`) and recorded again";

/// Returns true for colour with 16 bits per channel.
fn is_deep(encoding: &str) -> bool {
    let colour = ["rgb", "bgr", "bayer_"].iter().any(|start| encoding.starts_with(start));
    (colour && encoding.ends_with("16")) || ["16UC3", "16UC4"].contains(&encoding)
}

/// Returns the content of images of a `sensor_msgs/CompressedImage` format.
pub fn content_of_format(format: &str) -> Content {
    let lower = format.to_ascii_lowercase();
    let starts = ["16uc1", "32fc1"].iter().any(|start| lower.starts_with(start));
    let depth = lower.contains("compresseddepth") || starts;
    match (depth, lower.contains("jpeg") || lower.contains("jpg") || lower.contains("png")) {
        (true, _) => Content::Depth,
        (false, true) => Content::Picture,
        (false, false) => Content::Unknown,
    }
}

/// Checks a size against the limits; the product is computed in 64 bits.
fn check_size(
    width: u64,
    height: u64,
    bytes_per_pixel: u64,
    limits: &Limits,
) -> Result<(), ImageError> {
    let side = u64::from(limits.image_side_px);
    let sides_fit = width <= side && height <= side;
    // Saturating, because a damaged header may claim any size.
    let bytes = width.saturating_mul(height).saturating_mul(bytes_per_pixel);
    if !sides_fit || bytes > limits.image_bytes {
        return Err(ImageError::TooLarge { width, height });
    }
    if width == 0 || height == 0 {
        return Err(ImageError::Layout(format!("an image of {width}x{height} pixels")));
    }
    Ok(())
}

/// Converts integer depth to metres.
fn metres(value: u16, unit_m: f32) -> f32 {
    if value == 0 || value == u16::MAX { f32::NAN } else { f32::from(value) * unit_m }
}

/// Converts floating depth to metres.
fn metres_of_float(value: f32, unit_m: f32) -> f32 {
    if value.is_finite() && value > 0.0 { value * unit_m } else { f32::NAN }
}

#[cfg(test)]
mod tests;
