//! Colour filter arrays: bilinear interpolation, as OpenCV's `cvtColor`.

use tagalong_core::RgbImage;

use super::raw::{Rows, exact};

/// Channels of a pixel.
const RED: usize = 0;
const GREEN: usize = 1;
const BLUE: usize = 2;

/// Colours of the first two pixels of the first two rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pattern([[usize; 2]; 2]);

impl Pattern {
    /// Returns the pattern of an encoding; `None` for any other encoding.
    pub(super) fn of(encoding: &str) -> Option<Self> {
        Some(Self(match encoding {
            "bayer_rggb8" => [[RED, GREEN], [GREEN, BLUE]],
            "bayer_bggr8" => [[BLUE, GREEN], [GREEN, RED]],
            "bayer_gbrg8" => [[GREEN, BLUE], [RED, GREEN]],
            "bayer_grbg8" => [[GREEN, RED], [BLUE, GREEN]],
            _ => return None,
        }))
    }

    fn at(self, x: usize, y: usize) -> usize {
        self.0[y % 2][x % 2]
    }
}

/// Interpolates the colours. The outermost pixels are those next to them.
pub(super) fn interpolate(rows: &Rows<'_>, pattern: Pattern) -> RgbImage {
    let (width, height) = (rows.width, rows.height);
    let inner = |at: usize, size: usize| at.clamp(1, size.max(3) - 2);
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            pixels.push(colours(rows, pattern, inner(x, width), inner(y, height)));
        }
    }
    exact(width, height, pixels)
}

/// Returns the colours of a pixel from itself and its neighbours.
fn colours(rows: &Rows<'_>, pattern: Pattern, x: usize, y: usize) -> [u8; 3] {
    // An image of one or two rows has no neighbours on one side.
    let value =
        |x: usize, y: usize| u16::from(rows.row(y.min(rows.height - 1))[x.min(rows.width - 1)]);
    let beside = (value(x - 1, y) + value(x + 1, y)).div_ceil(2);
    let above = (value(x, y - 1) + value(x, y + 1)).div_ceil(2);
    let corners =
        [value(x - 1, y - 1), value(x + 1, y - 1), value(x - 1, y + 1), value(x + 1, y + 1)];
    let around = [value(x - 1, y), value(x + 1, y), value(x, y - 1), value(x, y + 1)];
    let fourth = |values: [u16; 4]| (values.iter().sum::<u16>() + 2) / 4;
    let own = pattern.at(x, y);
    let mut out = [0; 3];
    out[own] = value(x, y) as u8;
    if own == GREEN {
        out[pattern.at(x + 1, y)] = beside as u8;
        out[pattern.at(x, y + 1)] = above as u8;
    } else {
        out[GREEN] = fourth(around) as u8;
        out[pattern.at(x + 1, y + 1)] = fourth(corners) as u8;
    }
    out
}
