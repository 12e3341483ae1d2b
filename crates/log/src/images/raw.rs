//! `sensor_msgs/Image`: rows of `step` bytes.

use tagalong_core::Image as Plane;

use super::{ImageError, Pixels, bayer, check_size, is_deep, metres, metres_of_float, yuv};
use crate::Limits;
use crate::msgs::Image;

/// Bytes of a pixel of a decoded colour image.
const DECODED_BYTES: u64 = 3;

/// Returns the columns and rows of an uncompressed image.
///
/// # Errors
/// [`ImageError`]: a size of 0 or beyond the limits.
pub fn size_of_raw(image: &Image<'_>, limits: &Limits) -> Result<(usize, usize), ImageError> {
    check_size(image.width.into(), image.height.into(), DECODED_BYTES, limits)?;
    Ok((image.width as usize, image.height as usize))
}

/// Decodes an uncompressed image. Depth is scaled by `depth_unit_m` (metres per unit), or by the
/// convention of the encoding: 1 mm for `16UC1`, 1 m for `32FC1`. `mono16` is intensity without
/// `depth_unit_m`, and depth with it.
///
/// # Errors
/// [`ImageError`]: unknown encoding, size beyond the limits, `step` or data
/// length that contradict the size.
pub fn decode_raw(
    image: &Image<'_>,
    depth_unit_m: Option<f64>,
    limits: &Limits,
) -> Result<Pixels, ImageError> {
    let layout = Layout::of(&image.encoding)?;
    check_size(image.width.into(), image.height.into(), layout.bytes_per_pixel(), limits)?;
    let height = image.height as usize;
    let width = image.width as usize;
    let rows = match layout {
        Layout::Yuv(order) => return yuv::decode(image, order).map(Pixels::Colour),
        Layout::Bayer(pattern) => {
            let rows = Rows::new(image, height, width)?;
            return Ok(Pixels::Colour(bayer::interpolate(&rows, pattern)));
        }
        Layout::Packed(bytes) => Rows::new(image, height, width * bytes as usize)?,
    };
    let big = image.is_bigendian != 0;
    let pixels = match image.encoding.as_str() {
        "rgb8" => Pixels::Colour(rows.plane(|p: [u8; 3]| p)),
        "bgr8" | "8UC3" => Pixels::Colour(rows.plane(|[b, g, r]: [u8; 3]| [r, g, b])),
        "rgba8" => Pixels::Colour(rows.plane(|[r, g, b, _]: [u8; 4]| [r, g, b])),
        "bgra8" | "8UC4" => Pixels::Colour(rows.plane(|[b, g, r, _]: [u8; 4]| [r, g, b])),
        "mono8" | "8UC1" => Pixels::Grey(rows.plane(|[v]: [u8; 1]| v)),
        "32FC1" => {
            let unit = depth_unit_m.unwrap_or(1.0) as f32;
            Pixels::Depth(if big {
                rows.plane(|p: [u8; 4]| metres_of_float(f32::from_be_bytes(p), unit))
            } else {
                rows.plane(|p: [u8; 4]| metres_of_float(f32::from_le_bytes(p), unit))
            })
        }
        // 65535 becomes 255, as in cv_bridge.
        "mono16" if depth_unit_m.is_none() => {
            let read = if big { u16::from_be_bytes } else { u16::from_le_bytes };
            Pixels::Grey(rows.plane(|p: [u8; 2]| ((u32::from(read(p)) + 128) / 257) as u8))
        }
        _ => {
            let unit = depth_unit_m.unwrap_or(0.001) as f32;
            // The byte order is fixed in each loop: a loop that calls a function for it would not
            // become vector instructions.
            Pixels::Depth(if big {
                rows.plane(|p: [u8; 2]| metres(u16::from_be_bytes(p), unit))
            } else {
                rows.plane(|p: [u8; 2]| metres(u16::from_le_bytes(p), unit))
            })
        }
    };
    Ok(pixels)
}

/// Layout of the bytes of an encoding.
enum Layout {
    Yuv(yuv::Order),
    Bayer(bayer::Pattern),
    /// Consecutive pixels with this number of bytes each.
    Packed(u64),
}

impl Layout {
    fn of(encoding: &str) -> Result<Self, ImageError> {
        if let Some(order) = yuv::Order::of(encoding) {
            return Ok(Self::Yuv(order));
        }
        if let Some(pattern) = bayer::Pattern::of(encoding) {
            return Ok(Self::Bayer(pattern));
        }
        Ok(Self::Packed(match encoding {
            "mono8" | "8UC1" => 1,
            "16UC1" | "mono16" => 2,
            "rgb8" | "bgr8" | "8UC3" => 3,
            "rgba8" | "bgra8" | "8UC4" | "32FC1" => 4,
            deep if is_deep(deep) => return Err(ImageError::Deep(deep.to_owned())),
            other => return Err(ImageError::Encoding(other.to_owned())),
        }))
    }

    /// Returns the bytes per pixel in the message or after decoding, whichever is more.
    fn bytes_per_pixel(&self) -> u64 {
        match self {
            Self::Packed(bytes) => DECODED_BYTES.max(*bytes),
            Self::Yuv(_) | Self::Bayer(_) => DECODED_BYTES,
        }
    }
}

/// Rows of an image with a checked layout.
pub(super) struct Rows<'a> {
    data: &'a [u8],
    /// Columns of the image.
    pub(super) width: usize,
    /// Rows of the image.
    pub(super) height: usize,
    step: usize,
    row_bytes: usize,
}

impl<'a> Rows<'a> {
    /// Checks `count` rows of `row_bytes` each, followed by padding.
    pub(super) fn new(
        image: &Image<'a>,
        count: usize,
        row_bytes: usize,
    ) -> Result<Self, ImageError> {
        let width = image.width as usize;
        let height = image.height as usize;
        let step = image.step as usize;
        // Computed in 64 bits, where the product of two 32-bit numbers cannot overflow.
        let expected = u64::from(image.step) * count as u64;
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

    /// Returns a row without its padding.
    pub(super) fn row(&self, at: usize) -> &'a [u8] {
        &self.data[at * self.step..][..self.row_bytes]
    }

    /// Returns `count` rows with their padding.
    pub(super) fn rows_from(&self, at: usize, count: usize) -> &'a [u8] {
        &self.data[at * self.step..][..count * self.step]
    }

    pub(super) fn plane<const N: usize, P: Copy>(&self, pixel: impl Fn([u8; N]) -> P) -> Plane<P> {
        let mut out = Vec::with_capacity(self.width * self.height);
        for row in self.data.chunks_exact(self.step) {
            let (pixels, _) = row[..self.row_bytes].as_chunks::<N>();
            out.extend(pixels.iter().map(|p| pixel(*p)));
        }
        exact(self.width, self.height, out)
    }
}

/// Creates an image from pixels whose number is known to be `width * height`.
#[expect(clippy::expect_used, reason = "the callers have made exactly this many pixels")]
pub(super) fn exact<P: Copy>(width: usize, height: usize, pixels: Vec<P>) -> Plane<P> {
    Plane::from_pixels(width, height, pixels).expect("width * height pixels")
}
