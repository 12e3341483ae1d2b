//! Areas of an image made unrecognisable.

use std::ops::Range;

use tagalong_core::Image;
use tagalong_eval::Region;

/// Blocks along the shorter side of an area: a face of so few blocks is not recognised.
const BLOCKS: f64 = 5.0;
/// Least side of a block, pixels.
const MIN_BLOCK_PX: usize = 4;

/// Pixel that can be averaged.
pub(super) trait Averaged: Copy {
    /// Sums of the channels.
    fn add_to(self, sums: &mut [u64; 3]);
    /// Mean of so many pixels.
    fn mean(sums: &[u64; 3], count: u64) -> Self;
}

impl Averaged for u8 {
    fn add_to(self, sums: &mut [u64; 3]) {
        sums[0] += u64::from(self);
    }

    fn mean(sums: &[u64; 3], count: u64) -> Self {
        (sums[0] / count) as Self
    }
}

impl Averaged for [u8; 3] {
    fn add_to(self, sums: &mut [u64; 3]) {
        sums.iter_mut().zip(self).for_each(|(sum, value)| *sum += u64::from(value));
    }

    fn mean(sums: &[u64; 3], count: u64) -> Self {
        sums.map(|sum| (sum / count) as u8)
    }
}

/// Returns the columns or rows that a range covers, of so many.
fn covered(from: f64, to: f64, size: usize) -> Range<usize> {
    let from = from.floor().clamp(0.0, size as f64) as usize;
    from..(to.ceil().clamp(0.0, size as f64) as usize).max(from)
}

/// Replaces the pixels of an area by the means of its blocks; what lies outside of the image is left
/// alone.
pub(super) fn pixelate<P: Averaged>(image: &mut Image<P>, area: &Region) {
    let width = image.width();
    let columns = covered(area.x, area.x + area.width, width);
    let rows = covered(area.y, area.y + area.height, image.height());
    let side = ((area.width.min(area.height) / BLOCKS) as usize).max(MIN_BLOCK_PX);
    let pixels = image.pixels_mut();
    for top in rows.clone().step_by(side) {
        for left in columns.clone().step_by(side) {
            let block = Block {
                rows: top..rows.end.min(top + side),
                columns: left..columns.end.min(left + side),
            };
            block.average(pixels, width);
        }
    }
}

struct Block {
    rows: Range<usize>,
    columns: Range<usize>,
}

impl Block {
    fn average<P: Averaged>(&self, pixels: &mut [P], width: usize) {
        let mut sums = [0; 3];
        for row in self.rows.clone() {
            let row = &pixels[row * width..][self.columns.clone()];
            row.iter().for_each(|pixel| pixel.add_to(&mut sums));
        }
        let count = (self.rows.len() * self.columns.len()) as u64;
        if count == 0 {
            return;
        }
        let mean = P::mean(&sums, count);
        for row in self.rows.clone() {
            pixels[row * width..][self.columns.clone()].fill(mean);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_area_is_left_with_the_means_of_its_blocks() {
        let mut image = Image::from_fn(40, 30, |x, y| [(x * 5) as u8, (y * 5) as u8, 7]);
        let before = image.clone();
        pixelate(&mut image, &Region::new(10.0, 5.0, 20.0, 20.0));
        for (x, y) in [(9, 10), (30, 10), (20, 4), (20, 25)] {
            assert_eq!(image.get(x, y), before.get(x, y), "outside");
        }
        // Blocks of 4 x 4: columns 10 to 13 of 50, 55, 60 and 65.
        assert_eq!(image.get(10, 5), Some([57, 32, 7]));
        assert_eq!(image.get(13, 8), image.get(10, 5));
        assert_ne!(image.get(14, 8), image.get(10, 5));
    }

    #[test]
    fn an_area_beyond_the_image_is_cut() {
        let mut image = Image::from_fn(20, 20, |x, y| (x * y) as u8);
        pixelate(&mut image, &Region::new(-10.0, -5.0, 16.0, 500.0));
        assert_eq!(image.get(6, 3), Some(18));
        pixelate(&mut image, &Region::new(100.0, 100.0, 5.0, 5.0));
        pixelate(&mut image, &Region::new(-50.0, 3.0, 5.0, 5.0));
    }
}
