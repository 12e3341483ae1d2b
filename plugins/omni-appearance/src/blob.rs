use serde::{Deserialize, Serialize};

use crate::Counts;
use crate::circular::{Run, mean};

/// Names of the features, in the order of [`Features::values`].
pub const FEATURES: [&str; 9] =
    ["width", "bottom", "pixels", "top", "middle", "core", "low", "inverse_core", "inverse_height"];

/// Part of the fullest column's pixels from which a column belongs to the core of a person: trunk
/// and head, without arms and remains of shadows.
const CORE: f64 = 0.4;
/// Fewest pixels in a row of the core.
const ROW_PIXELS: u32 = 2;

/// Measurements of a person in the panorama, in columns and rows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Features {
    /// Feature 1 of P5: number of columns from the first to the last.
    pub width: f64,
    /// Feature 2: rows from the lowest row of the person to the lower edge of the image.
    pub bottom: f64,
    /// Feature 3: number of pixels that differ.
    pub pixels: f64,
    /// Highest row.
    pub top: f64,
    /// Row above which half of the pixels are.
    pub middle: f64,
    /// Number of columns of the core.
    pub core: f64,
    /// Row above which 95 % of the pixels are.
    pub low: f64,
}

impl Features {
    /// Returns the features as numbers, the three of the paper first; two that fall with the
    /// distance are repeated as their inverses, which grow with it.
    pub fn values(&self) -> [f64; 9] {
        [
            self.width,
            self.bottom,
            self.pixels,
            self.top,
            self.middle,
            self.core,
            self.low,
            // At least one column and row: an empty extent must not divide by 0.
            1.0 / self.core.max(1.0),
            1.0 / (self.low - self.top).max(1.0),
        ]
    }

    /// Returns the lowest row of the person in an image with this many rows.
    pub fn lowest_row(&self, rows: usize) -> f64 {
        rows as f64 - 1.0 - self.bottom
    }
}

/// A run of columns that may be a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blob {
    /// Columns of the run.
    pub run: Run,
    /// Mean column, weighted by the pixels in each (P5, section 4.2).
    pub column: f64,
    /// Measurements of the run.
    pub features: Features,
    /// Mean colour of the upper half.
    pub colour: [f64; 3],
    /// Visible part of the person, from 0 to 1: the rest is hidden behind another tracked person.
    pub visible: f64,
}

impl Blob {
    /// Measures a run of columns; `None` if no row of it has enough pixels. `colours` is the image
    /// from which `counts` were computed.
    pub fn measure(run: Run, counts: &Counts, colours: &[u8]) -> Option<Self> {
        fn full(count: &u32) -> bool {
            *count >= ROW_PIXELS
        }

        let width = counts.columns.len();
        let fullest =
            run.columns(width).map(|column| pixels_of(counts, column)).fold(0.0, f64::max);
        // Bottom and top come from the core: an arm or a remnant of a shadow would shift them.
        let core: Vec<usize> = run
            .columns(width)
            .filter(|column| pixels_of(counts, *column) >= CORE * fullest)
            .collect();
        let rows: Vec<u32> = counts
            .solid
            .chunks_exact(width)
            .map(|row| core.iter().map(|column| u32::from(row[*column])).sum())
            .collect();
        let top = rows.iter().position(full)?;
        let lowest = rows.iter().rposition(full)?;
        let middle = above(&rows, 0.5);
        let features = Features {
            width: run.length as f64,
            bottom: (rows.len() - 1 - lowest) as f64,
            pixels: run.columns(width).map(|column| pixels_of(counts, column)).sum(),
            top: top as f64,
            middle,
            core: core.len() as f64,
            low: above(&rows, 0.95),
        };
        let upper = top..(middle as usize + 1).min(rows.len());
        let colour = mean_colour(&core, upper, counts, colours);
        let column = mean(&run, width, |column| pixels_of(counts, column));
        Some(Self { run, column, features, colour, visible: 1.0 })
    }
}

/// Returns the number of pixels of a column where a person may be.
fn pixels_of(counts: &Counts, column: usize) -> f64 {
    f64::from(counts.columns[column])
}

/// Returns the row above which this part of the pixels lies, interpolated between rows.
fn above(rows: &[u32], part: f64) -> f64 {
    let wanted = part * f64::from(rows.iter().sum::<u32>());
    let mut sum = 0.0;
    for (row, count) in rows.iter().enumerate() {
        let next = sum + f64::from(*count);
        if next >= wanted && *count > 0 {
            return row as f64 - 1.0 + (wanted - sum) / f64::from(*count);
        }
        sum = next;
    }
    rows.len() as f64 - 1.0
}

fn mean_colour(
    core: &[usize],
    rows: std::ops::Range<usize>,
    counts: &Counts,
    colours: &[u8],
) -> [f64; 3] {
    let width = counts.columns.len();
    let mut sums = [0.0; 3];
    let mut pixels = 0.0_f64;
    for at in rows.flat_map(|row| core.iter().map(move |column| row * width + column)) {
        if counts.solid[at] != 0 {
            pixels += 1.0;
            for (sum, colour) in sums.iter_mut().zip(&colours[3 * at..3 * at + 3]) {
                *sum += f64::from(*colour);
            }
        }
    }
    sums.map(|sum| sum / pixels.max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of 4 columns across the seam, rows 10 to 29 of 40, with an arm.
    fn counts() -> Counts {
        let mut solid = vec![0; 12 * 40];
        for row in 10..30 {
            [10, 11, 0, 1].iter().for_each(|column| solid[row * 12 + column] = 1);
        }
        (15..20).for_each(|row| solid[row * 12 + 2] = 1);
        let columns =
            (0..12).map(|c| (0..40).map(|row| u16::from(solid[row * 12 + c])).sum()).collect();
        Counts { taken: solid.clone(), solid, columns }
    }

    #[test]
    fn a_block_across_the_seam_is_measured() {
        let run = Run { first: 10, length: 5 };
        let blob = Blob::measure(run, &counts(), &[7; 3 * 12 * 40]).unwrap();
        let f = blob.features;
        assert_eq!((f.width, f.bottom, f.pixels, f.top, f.core), (5.0, 10.0, 85.0, 10.0, 4.0));
        assert_eq!((f.middle, f.low, f.lowest_row(40)), (19.0, 28.0, 29.0));
        // 20 pixels in each of the columns 10 to 13, 5 in column 14.
        let mean = (20.0 * (10.0 + 11.0 + 12.0 + 13.0) + 5.0 * 14.0) / 85.0;
        assert!((blob.column - mean).abs() < 1e-9);
        assert_eq!(blob.colour, [7.0; 3]);
    }

    #[test]
    fn the_row_above_which_a_part_lies_is_interpolated_and_the_last_one_without_pixels() {
        assert_eq!(above(&[0, 4, 4, 0], 0.75), 1.5);
        assert_eq!(above(&[0, 0, 0, 0], 0.75), 3.0);
    }

    #[test]
    fn too_little_is_nothing() {
        let thin = Run { first: 5, length: 2 };
        assert_eq!(Blob::measure(thin, &counts(), &[7; 3 * 12 * 40]), None);
    }
}
