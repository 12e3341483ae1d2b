//! Disparity: `stereo_msgs/DisparityImage`, and plain images of disparity. Depth is focal length
//! times baseline, divided by disparity.
//!
//! Disparities are in pixels, or in fractions of them: floating-point and 8-bit disparities are
//! whole pixels, `16SC1` sixteenths, as OpenCV's block matchers write them. For unsigned 16 bits
//! there are several conventions (16 or 256 parts of a pixel), so the unit has to be given.

use tagalong_core::{DepthImage, Image as Plane};

use super::raw::Rows;
use super::{ImageError, Pixels, check_size, decode_compressed, decode_raw};
use crate::Limits;
use crate::msgs::{CompressedImage, DisparityImage, Image, RegionOfInterest};

/// Unit of `16SC1`, pixels.
const SIXTEENTH_PX: f64 = 1.0 / 16.0;

/// Depth computed from disparities.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct DepthFromDisparity {
    /// Depth, m.
    pub depth: DepthImage,
    /// Number of pixels without a valid disparity.
    pub invalid: usize,
}

/// Focal length and baseline of a stereo camera.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct StereoGeometry {
    /// Focal length along columns, pixels.
    pub focal_px: f64,
    /// Distance of the right camera from the left one, m.
    pub baseline_m: f64,
}

/// Returns true for encodings of a `sensor_msgs/Image` that may hold disparities.
pub(crate) fn may_be_disparity(encoding: &str) -> bool {
    ["32FC1", "mono8", "8UC1", "16SC1", "mono16", "16UC1"].contains(&encoding)
}

/// Decodes a disparity image with the geometry that it contains. A disparity is invalid if it is
/// not positive and finite, outside of the range that was searched, or outside of the valid window;
/// a range or window of size 0 means that there is none. `unit_px` (pixels per unit) replaces the
/// convention of the encoding, `depth_unit_m` the metre as unit of the baseline.
///
/// # Errors
/// [`ImageError`]: as for [`decode_raw`]; focal length or baseline that are not positive; unsigned
/// 16 bits without `unit_px`.
pub fn decode_disparity(
    message: &DisparityImage<'_>,
    unit_px: Option<f64>,
    depth_unit_m: Option<f64>,
    limits: &Limits,
) -> Result<DepthFromDisparity, ImageError> {
    let baseline_m = f64::from(message.t) * depth_unit_m.unwrap_or(1.0);
    let geometry = StereoGeometry { focal_px: message.f.into(), baseline_m };
    let values = values_of(&message.image, unit_px, limits)?;
    let least = message.min_disparity;
    let most = message.max_disparity;
    let least = if least.is_finite() { least } else { 0.0 };
    // Drivers that do not know the range leave it at 0.
    let range = least..=if most > least { most } else { f32::MAX };
    let window = &message.valid_window;
    geometry.depth(&values, |x, y, disparity| range.contains(&disparity) && holds(window, x, y))
}

/// Decodes an image whose pixels are disparities, and which does not contain its geometry.
///
/// # Errors
/// As [`decode_disparity`].
pub fn decode_plain_disparity(
    image: &Image<'_>,
    geometry: StereoGeometry,
    unit_px: Option<f64>,
    limits: &Limits,
) -> Result<DepthFromDisparity, ImageError> {
    geometry.depth(&values_of(image, unit_px, limits)?, |_, _, _| true)
}

/// Decodes a compressed image whose pixels are disparities. It must be a PNG, because JPEG changes
/// them.
///
/// # Errors
/// As [`decode_disparity`].
pub fn decode_compressed_disparity(
    image: &CompressedImage<'_>,
    geometry: StereoGeometry,
    unit_px: Option<f64>,
    limits: &Limits,
) -> Result<DepthFromDisparity, ImageError> {
    if image.data.starts_with(&[0xff, 0xd8]) {
        return Err(ImageError::Codec("disparities as JPEG, which changes their values".into()));
    }
    let pixels = decode_compressed(image, Some(1.0), limits)?;
    let unit_px = match pixels {
        Pixels::Depth(_) => unit_px.ok_or_else(|| ImageError::Unit("16-bit PNG".into()))?,
        _ => unit_px.unwrap_or(1.0),
    };
    geometry.depth(&in_pixels(&pixels, unit_px, &image.format)?, |_, _, _| true)
}

impl StereoGeometry {
    fn depth(
        &self,
        disparities: &Plane<f32>,
        is_valid: impl Fn(usize, usize, f32) -> bool,
    ) -> Result<DepthFromDisparity, ImageError> {
        let Self { focal_px, baseline_m } = *self;
        let product = focal_px * baseline_m;
        if !(focal_px > 0.0 && baseline_m > 0.0 && product.is_finite()) {
            return Err(ImageError::Geometry { focal_px, baseline_m });
        }
        let mut invalid = 0;
        let depth = DepthImage::from_fn(disparities.width(), disparities.height(), |x, y| {
            let disparity = disparities.row(y)[x];
            let depth = (product / f64::from(disparity)) as f32;
            // A tiny disparity may overflow to infinity.
            if disparity > 0.0 && depth.is_finite() && depth > 0.0 && is_valid(x, y, disparity) {
                return depth;
            }
            invalid += 1;
            f32::NAN
        });
        Ok(DepthFromDisparity { depth, invalid })
    }
}

/// Returns true for pixels inside of a window; a window without an area contains none.
fn holds(window: &RegionOfInterest, x: usize, y: usize) -> bool {
    window.width == 0
        || window.height == 0
        || is_within(x, window.x_offset, window.width)
            && is_within(y, window.y_offset, window.height)
}

fn is_within(at: usize, from: u32, size: u32) -> bool {
    (u64::from(from)..u64::from(from) + u64::from(size)).contains(&(at as u64))
}

/// Returns the disparities of an uncompressed image, pixels.
fn values_of(
    image: &Image<'_>,
    unit_px: Option<f64>,
    limits: &Limits,
) -> Result<Plane<f32>, ImageError> {
    let encoding = &image.encoding;
    if !may_be_disparity(encoding) {
        return Err(ImageError::NoDisparity(encoding.clone()));
    }
    match (encoding.as_str(), unit_px) {
        ("16SC1", unit) => signed(image, unit.unwrap_or(SIXTEENTH_PX), limits),
        ("mono16" | "16UC1", None) => Err(ImageError::Unit(encoding.clone())),
        (_, unit) => {
            let pixels = decode_raw(image, Some(1.0), limits)?;
            in_pixels(&pixels, unit.unwrap_or(1.0), encoding)
        }
    }
}

fn signed(image: &Image<'_>, unit_px: f64, limits: &Limits) -> Result<Plane<f32>, ImageError> {
    check_size(image.width.into(), image.height.into(), 4, limits)?;
    let rows = Rows::new(image, image.height as usize, 2 * image.width as usize)?;
    let read = if image.is_bigendian != 0 { i16::from_be_bytes } else { i16::from_le_bytes };
    Ok(rows.plane(|p: [u8; 2]| (f64::from(read(p)) * unit_px) as f32))
}

/// Scales values to pixels.
fn in_pixels(values: &Pixels, unit_px: f64, encoding: &str) -> Result<Plane<f32>, ImageError> {
    match values {
        Pixels::Grey(grey) => Ok(grey.map(|value| (f64::from(value) * unit_px) as f32)),
        Pixels::Depth(values) => Ok(values.map(|value| (f64::from(value) * unit_px) as f32)),
        Pixels::Colour(_) => Err(ImageError::NoDisparity(encoding.to_owned())),
    }
}
