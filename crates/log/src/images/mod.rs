//! From image messages to images.
//!
//! Depth becomes metres along the optical axis with NaN for "no reading": 0 and
//! 65535 of integer depth, and 0, negative, infinite and NaN values of floating
//! depth (REP 117 and 118 give infinities a meaning of their own, which no
//! detector here has a use for).

mod compressed;
mod raw;
mod rvl;

pub use compressed::{decode_compressed, encode_rvl, size_of_compressed};
pub use raw::{decode_raw, size_of_raw};
use tagalong_core::{DepthImage, GreyImage, RgbImage};

use crate::Limits;

/// A decoded image.
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
    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Colour(image) => (image.width(), image.height()),
            Self::Grey(image) => (image.width(), image.height()),
            Self::Depth(image) => (image.width(), image.height()),
        }
    }
}

/// Why an image message was not decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// An encoding that is not known, or not as depth.
    #[error(
        "encoding `{0}`; known: rgb8, bgr8, rgba8, bgra8, mono8, 8UC1, 8UC3, 16UC1, 32FC1 \
         (mono16 only where `depth_unit_m` says that it is depth), jpeg, png, compressedDepth"
    )]
    Encoding(String),
    /// Larger than the limits allow.
    #[error("{width}x{height} pixels exceed the limit")]
    TooLarge {
        /// Columns claimed.
        width: u64,
        /// Rows claimed.
        height: u64,
    },
    /// `step` or the length of the data contradict the size.
    #[error("{0}")]
    Layout(String),
    /// The compressed bytes are damaged or of a kind that is not handled.
    #[error("{0}")]
    Codec(String),
}

impl ImageError {
    /// The name under which such messages are counted.
    pub fn counter(&self) -> &'static str {
        match self {
            Self::Encoding(_) => "images_of_unknown_encoding",
            Self::TooLarge { .. } => "images_too_large",
            Self::Layout(_) => "images_of_wrong_layout",
            Self::Codec(_) => "images_undecodable",
        }
    }
}

/// What an encoding or format holds, as far as its name tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Colour or intensity.
    Picture,
    /// Depth.
    Depth,
    /// Not known.
    Unknown,
}

/// What images of a `sensor_msgs/Image` encoding hold. `depth_unit_m` is the
/// setting that makes `mono16` depth.
pub fn content_of_encoding(encoding: &str, depth_unit_m: Option<f64>) -> Content {
    match encoding {
        "rgb8" | "bgr8" | "rgba8" | "bgra8" | "mono8" | "8UC1" | "8UC3" => Content::Picture,
        "16UC1" | "32FC1" => Content::Depth,
        "mono16" if depth_unit_m.is_some() => Content::Depth,
        _ => Content::Unknown,
    }
}

/// What images of a `sensor_msgs/CompressedImage` format hold.
pub fn content_of_format(format: &str) -> Content {
    let lower = format.to_ascii_lowercase();
    let depth = lower.contains("compresseddepth") || lower.starts_with("16uc1");
    match (depth, lower.contains("jpeg") || lower.contains("jpg") || lower.contains("png")) {
        (true, _) => Content::Depth,
        (false, true) => Content::Picture,
        (false, false) => Content::Unknown,
    }
}

/// Checks a size against the limits; the product is taken in 64 bits.
fn check_size(
    width: u64,
    height: u64,
    bytes_per_pixel: u64,
    limits: &Limits,
) -> Result<(), ImageError> {
    let side = u64::from(limits.image_side_px);
    let sides_fit = width <= side && height <= side;
    let bytes = width.saturating_mul(height).saturating_mul(bytes_per_pixel);
    if !sides_fit || bytes > limits.image_bytes {
        return Err(ImageError::TooLarge { width, height });
    }
    if width == 0 || height == 0 {
        return Err(ImageError::Layout(format!("an image of {width}x{height} pixels")));
    }
    Ok(())
}

/// Integer depth to metres.
fn metres(value: u16, unit_m: f32) -> f32 {
    if value == 0 || value == u16::MAX { f32::NAN } else { f32::from(value) * unit_m }
}

/// Floating depth to metres.
fn metres_of_float(value: f32, unit_m: f32) -> f32 {
    if value.is_finite() && value > 0.0 { value * unit_m } else { f32::NAN }
}

#[cfg(test)]
mod tests;
