//! Colour filter arrays (Bayer patterns): bilinear interpolation, as in OpenCV's `cvtColor`.

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

    /// Returns the colours of the first two pixels of a row and of the next row.
    fn rows(self, y: usize) -> [[usize; 2]; 2] {
        [self.0[y % 2], self.0[(y + 1) % 2]]
    }
}

/// Interpolates the colours. The outermost pixels repeat those next to them.
pub(super) fn interpolate(rows: &Rows<'_>, pattern: Pattern) -> RgbImage {
    let width = rows.width;
    let height = rows.height;
    let mut pixels = Vec::with_capacity(width * height);
    for y in 0..height {
        let y = y.clamp(1, height.max(3) - 2);
        // An image of one or two rows has no neighbours on one side.
        let lines = [y - 1, y, y + 1].map(|y| rows.row(y.min(height - 1)));
        let colours = pattern.rows(y);
        pixels.extend((0..width).map(|x| colours_at(lines, colours, x.clamp(1, width.max(3) - 2))));
    }
    exact(width, height, pixels)
}

/// Returns the colours of a pixel in the middle one of three rows from itself and its neighbours.
/// `pattern` has the colours of the middle row and of the lower one.
fn colours_at([upper, middle, lower]: [&[u8]; 3], pattern: [[usize; 2]; 2], x: usize) -> [u8; 3] {
    // The same holds for an image of one or two columns.
    let right = (x + 1).min(middle.len() - 1);
    let columns = [x - 1, x.min(right), right];
    let [above, own, below] = [upper, middle, lower].map(|row| columns.map(|x| u16::from(row[x])));
    let [colour, beside] = [pattern[0][x % 2], pattern[0][(x + 1) % 2]];
    let mut out = [0; 3];
    out[colour] = own[1] as u8;
    if colour == GREEN {
        out[beside] = (own[0] + own[2]).div_ceil(2) as u8;
        out[pattern[1][x % 2]] = (above[1] + below[1]).div_ceil(2) as u8;
    } else {
        out[GREEN] = mean_of([own[0], own[2], above[1], below[1]]);
        out[pattern[1][(x + 1) % 2]] = mean_of([above[0], above[2], below[0], below[2]]);
    }
    out
}

fn mean_of(values: [u16; 4]) -> u8 {
    ((values.iter().sum::<u16>() + 2) / 4) as u8
}
