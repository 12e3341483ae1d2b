//! Changes since the previous image, with a robot that moved between the two.

use crate::circular::Run;
use crate::warp::{Sweep, Warp};

/// Largest difference of a colour value from the previous image that is no change, grey levels: what
/// noise and interpolation leave.
const SAME: f32 = 12.0;

/// Comparator of an image with the previous one. Unlike the background, the previous image has no
/// errors of many motions, and no people of long ago.
#[derive(Clone, Debug, Default)]
pub(crate) struct Changes {
    /// Colours of the previous image, three per pixel.
    previous: Vec<f32>,
    /// 1 where the last image differs from it, else 0; empty if they were not compared.
    changed: Vec<u8>,
}

impl Changes {
    /// Compares an image with the previous one, which is moved with the robot as `sweep` estimates
    /// it. Nothing is compared with the first image.
    pub(crate) fn compare(&mut self, sweep: &mut Sweep, warps: &[Warp], colours: &[u8]) {
        self.changed.clear();
        if self.previous.is_empty() {
            return;
        }
        sweep.apply(warps, colours, &mut self.previous, &mut []);
        let pixels = colours.chunks_exact(3).zip(self.previous.chunks_exact(3));
        let differs = |(now, before): (&[u8], &[f32])| {
            now.iter().zip(before).any(|(now, before)| (f32::from(*now) - before).abs() > SAME)
        };
        self.changed.extend(pixels.map(|pixel| u8::from(differs(pixel))));
    }

    /// Ends an image: the next one is compared with it.
    pub(crate) fn keep(&mut self, colours: &[u8]) {
        self.previous.clear();
        self.previous.extend(colours.iter().map(|colour| f32::from(*colour)));
    }

    /// Forgets the last comparison.
    pub(crate) fn clear(&mut self) {
        self.changed.clear();
    }

    /// Returns the changed part of the pixels that are 1 in `solid` in a run of columns; 1 if the
    /// images were not compared.
    pub(crate) fn part(&self, run: Run, width: usize, solid: &[u8]) -> f64 {
        let rows = solid.chunks_exact(width.max(1)).zip(self.changed.chunks_exact(width.max(1)));
        let (mut all, mut changed) = (0_u32, 0_u32);
        for (solid, differs) in rows {
            for column in run.columns(width).filter(|column| solid[*column] != 0) {
                all += 1;
                changed += u32::from(differs[column]);
            }
        }
        if all == 0 { 1.0 } else { f64::from(changed) / f64::from(all) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 6;

    /// Two rows of grey with other values in some columns.
    fn image(columns: &[usize], value: u8) -> Vec<u8> {
        let row = |column: usize| [if columns.contains(&column) { value } else { 100 }; 3];
        (0..2 * WIDTH).flat_map(|pixel| row(pixel % WIDTH)).collect()
    }

    #[test]
    fn the_part_is_that_of_the_solid_pixels_that_changed_across_the_seam() {
        let (mut changes, mut sweep) = (Changes::default(), Sweep::default());
        let run = Run { first: 5, length: 3 };
        let solid = [1, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 0];
        changes.compare(&mut sweep, &[], &image(&[], 0));
        assert_eq!(changes.part(run, WIDTH, &solid), 1.0, "there is no previous image");
        changes.keep(&image(&[], 0));
        // Columns 5, 0 and 1 have four solid pixels, of which column 5 has one.
        changes.compare(&mut sweep, &[], &image(&[5, 3], 113));
        assert_eq!(changes.part(run, WIDTH, &solid), 0.25);
        changes.compare(&mut sweep, &[], &image(&[5, 3], 112));
        assert_eq!(changes.part(run, WIDTH, &solid), 0.0, "this is noise");
        changes.clear();
        assert_eq!(changes.part(run, WIDTH, &solid), 1.0);
    }
}
