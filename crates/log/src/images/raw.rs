//! `sensor_msgs/Image`: rows of `step` bytes.

use tagalong_core::Image as Plane;

use super::{ImageError, Pixels, check_size, metres, metres_of_float};
use crate::Limits;
use crate::msgs::Image;

/// Returns the columns and rows of an uncompressed image.
///
/// # Errors
/// [`ImageError`]: a size of 0 or beyond the limits.
pub fn size_of_raw(image: &Image<'_>, limits: &Limits) -> Result<(usize, usize), ImageError> {
    check_size(image.width.into(), image.height.into(), 3, limits)?;
    Ok((image.width as usize, image.height as usize))
}

/// Decodes an uncompressed image. Depth is scaled by `depth_unit_m` (metres per unit), or by the
/// convention of the encoding: 1 mm for `16UC1`, 1 m for `32FC1`.
///
/// # Errors
/// [`ImageError`]: unknown encoding, size beyond the limits, `step` or data
/// length that contradict the size.
pub fn decode_raw(
    image: &Image<'_>,
    depth_unit_m: Option<f64>,
    limits: &Limits,
) -> Result<Pixels, ImageError> {
    let bytes_per_pixel = match image.encoding.as_str() {
        "mono8" | "8UC1" => 1,
        "16UC1" => 2,
        "mono16" if depth_unit_m.is_some() => 2,
        "rgb8" | "bgr8" | "8UC3" => 3,
        "rgba8" | "bgra8" | "32FC1" => 4,
        _ => return Err(ImageError::Encoding(image.encoding.clone())),
    };
    check_size(image.width.into(), image.height.into(), bytes_per_pixel.max(3), limits)?;
    let rows = Rows::new(image, bytes_per_pixel as usize)?;
    let big = image.is_bigendian != 0;
    let pixels = match image.encoding.as_str() {
        "rgb8" => Pixels::Colour(rows.plane(|p: [u8; 3]| p)),
        "bgr8" | "8UC3" => Pixels::Colour(rows.plane(|[b, g, r]: [u8; 3]| [r, g, b])),
        "rgba8" => Pixels::Colour(rows.plane(|[r, g, b, _]: [u8; 4]| [r, g, b])),
        "bgra8" => Pixels::Colour(rows.plane(|[b, g, r, _]: [u8; 4]| [r, g, b])),
        "mono8" | "8UC1" => Pixels::Grey(rows.plane(|[v]: [u8; 1]| v)),
        "32FC1" => {
            let unit = depth_unit_m.unwrap_or(1.0) as f32;
            let read = if big { f32::from_be_bytes } else { f32::from_le_bytes };
            Pixels::Depth(rows.plane(|p: [u8; 4]| metres_of_float(read(p), unit)))
        }
        _ => {
            let unit = depth_unit_m.unwrap_or(0.001) as f32;
            let read = if big { u16::from_be_bytes } else { u16::from_le_bytes };
            Pixels::Depth(rows.plane(|p: [u8; 2]| metres(read(p), unit)))
        }
    };
    Ok(pixels)
}

/// Rows of an image with a checked layout.
struct Rows<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    step: usize,
    row_bytes: usize,
}

impl<'a> Rows<'a> {
    fn new(image: &Image<'a>, bytes_per_pixel: usize) -> Result<Self, ImageError> {
        let (width, height) = (image.width as usize, image.height as usize);
        let (step, row_bytes) = (image.step as usize, width * bytes_per_pixel);
        // In 64 bits, where the product of two 32-bit numbers cannot overflow.
        let expected = u64::from(image.step) * u64::from(image.height);
        if step < row_bytes {
            return Err(ImageError::Layout(format!(
                "step {step} is less than a row ({row_bytes})"
            )));
        }
        if image.data.len() as u64 != expected {
            let got = image.data.len();
            return Err(ImageError::Layout(format!("{got} bytes of data instead of {expected}")));
        }
        Ok(Self { data: image.data, width, height, step, row_bytes })
    }

    fn plane<const N: usize, P: Copy>(&self, pixel: impl Fn([u8; N]) -> P) -> Plane<P> {
        let mut out = Vec::with_capacity(self.width * self.height);
        for row in self.data.chunks_exact(self.step) {
            let (pixels, _) = row[..self.row_bytes].as_chunks::<N>();
            out.extend(pixels.iter().map(|p| pixel(*p)));
        }
        exact(self.width, self.height, out)
    }
}

/// Makes an image from pixels that are known to be `width * height`.
#[expect(clippy::expect_used, reason = "the callers have made exactly this many pixels")]
pub(super) fn exact<P: Copy>(width: usize, height: usize, pixels: Vec<P>) -> Plane<P> {
    Plane::from_pixels(width, height, pixels).expect("width * height pixels")
}
