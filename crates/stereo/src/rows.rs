//! Access to some rows of an image at a time, with its border continued outside.

use tagalong_core::GreyImage;

/// Number of rows and columns that can be read on each side.
const REACH: usize = 2;

/// Row of an image with its neighbours.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    padded: [Vec<u8>; 2 * REACH + 1],
}

impl Rows {
    /// Loads row `y` and its neighbours.
    pub fn load(&mut self, image: &GreyImage, y: usize) {
        for (row, padded) in self.padded.iter_mut().enumerate() {
            let y = (y + row).saturating_sub(REACH).min(image.height() - 1);
            pad(image.row(y), padded);
        }
    }

    /// Returns the number of columns of the image.
    pub fn width(&self) -> usize {
        self.padded[0].len().saturating_sub(2 * REACH)
    }

    /// Returns the values `dx` columns right of and `dy` rows below the row's pixels, each at most
    /// 2; more values follow after the last pixel's.
    pub fn from(&self, dx: i32, dy: i32) -> &[u8] {
        fn at(offset: i32) -> usize {
            (REACH as i32 + offset) as usize
        }

        &self.padded[at(dy)][at(dx)..]
    }
}

fn pad(row: &[u8], padded: &mut Vec<u8>) {
    padded.clear();
    padded.resize(REACH, row[0]);
    padded.extend_from_slice(row);
    padded.resize(row.len() + 2 * REACH, row[row.len() - 1]);
}

/// Reverses a row if `mirrored` is given, and appends that many copies of its last value.
pub fn mirror(row: &mut Vec<u8>, mirrored: Option<usize>) {
    let Some(room) = mirrored else { return };
    row.reverse();
    let last = row.last().copied().unwrap_or(0);
    row.resize(row.len() + room, last);
}
