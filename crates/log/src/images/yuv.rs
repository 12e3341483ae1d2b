//! YUV images with subsampled chroma: BT.601 in the range 16 to 235, as in OpenCV's `cvtColor`.

use tagalong_core::RgbImage;

use super::ImageError;
use super::raw::{Rows, exact};
use crate::msgs::Image;

/// Number of fractional bits of the factors.
const SHIFT: i32 = 20;
const BRIGHTNESS: i32 = 1_220_542;
const RED_OF_V: i32 = 1_673_527;
const GREEN_OF_U: i32 = -409_993;
const GREEN_OF_V: i32 = -852_492;
const BLUE_OF_U: i32 = 2_116_026;

/// Order of luma and chroma in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// Four bytes for two pixels, with the positions of both Y, U and V.
    Packed([usize; 4]),
    /// All of Y, then a row of chroma pairs for every two rows; with the position of U in a pair.
    TwoPlanes(usize),
    /// All of Y, then a chroma pair for each pixel; with the position of U in a pair.
    FullPlanes(usize),
}

impl Order {
    /// Returns the order of an encoding; `None` for any other encoding.
    pub(super) fn of(encoding: &str) -> Option<Self> {
        Some(match encoding {
            // ROS calls it `yuv422`; drivers name it by the order of the bytes.
            "yuv422" | "uyvy" => Self::Packed([1, 3, 0, 2]),
            "yuv422_yuy2" | "yuyv" => Self::Packed([0, 2, 1, 3]),
            "nv12" => Self::TwoPlanes(0),
            "nv21" => Self::TwoPlanes(1),
            "nv24" => Self::FullPlanes(0),
            _ => return None,
        })
    }
}

/// Decodes an image.
///
/// # Errors
/// An odd size where pixels share their chroma, and data whose length contradicts the size.
pub(super) fn decode(image: &Image<'_>, order: Order) -> Result<RgbImage, ImageError> {
    let width = image.width as usize;
    let height = image.height as usize;
    let pixels = match order {
        Order::Packed(places) => {
            check_even(image, false)?;
            packed(&Rows::new(image, height, 2 * width)?, places)
        }
        Order::TwoPlanes(u) => {
            check_even(image, true)?;
            two_planes(&Rows::new(image, height + height / 2, width)?, u)
        }
        Order::FullPlanes(u) => full_planes(image, u)?,
    };
    Ok(exact(width, height, pixels))
}

/// Checks that the number of columns is even, and also that of rows if rows share their chroma.
fn check_even(image: &Image<'_>, halves_rows: bool) -> Result<(), ImageError> {
    let Image { width, height, encoding, .. } = image;
    if !width.is_multiple_of(2) || (halves_rows && !height.is_multiple_of(2)) {
        return Err(ImageError::Layout(format!("{width}x{height} pixels of {encoding} are odd")));
    }
    Ok(())
}

fn packed(rows: &Rows<'_>, [first, second, u, v]: [usize; 4]) -> Vec<[u8; 3]> {
    let mut out = Vec::with_capacity(rows.width * rows.height);
    for y in 0..rows.height {
        let (pairs, _) = rows.row(y).as_chunks::<4>();
        out.extend(
            pairs
                .iter()
                .flat_map(|p| [colour(p[first], p[u], p[v]), colour(p[second], p[u], p[v])]),
        );
    }
    out
}

fn two_planes(rows: &Rows<'_>, u: usize) -> Vec<[u8; 3]> {
    let mut out = Vec::with_capacity(rows.width * rows.height);
    for y in 0..rows.height {
        let pairs = rows.row(rows.height + y / 2);
        let bright = rows.row(y).iter().enumerate();
        out.extend(bright.map(|(x, y)| {
            let pair = x - x % 2;
            colour(*y, pairs[pair + u], pairs[pair + 1 - u])
        }));
    }
    out
}

/// Decodes planes of the same resolution. A line of chroma pairs is as long as two lines of luma.
fn full_planes(image: &Image<'_>, u: usize) -> Result<Vec<[u8; 3]>, ImageError> {
    let width = image.width as usize;
    let height = image.height as usize;
    // Drivers disagree on `step`, which by the usual definition is the same for all planes; if the
    // lines have no padding, the length of the data decides.
    let is_dense = image.data.len() == 3 * width * height;
    let step = if is_dense { image.width } else { image.step };
    let rows = Rows::new(&Image { step, ..image.clone() }, 3 * height, width)?;
    let mut out = Vec::with_capacity(width * height);
    for y in 0..height {
        let pairs = rows.rows_from(height + 2 * y, 2);
        let bright = rows.row(y).iter().enumerate();
        out.extend(bright.map(|(x, y)| colour(*y, pairs[2 * x + u], pairs[2 * x + 1 - u])));
    }
    Ok(out)
}

fn colour(y: u8, u: u8, v: u8) -> [u8; 3] {
    let u = i32::from(u) - 128;
    let v = i32::from(v) - 128;
    let bright = (i32::from(y) - 16).max(0) * BRIGHTNESS + (1 << (SHIFT - 1));
    let tints = [RED_OF_V * v, GREEN_OF_V * v + GREEN_OF_U * u, BLUE_OF_U * u];
    tints.map(|tint| ((bright + tint) >> SHIFT).clamp(0, 255) as u8)
}
