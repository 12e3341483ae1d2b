//! Changes since a previous image, compensated for the motion of the robot.

use std::collections::VecDeque;

use tagalong_core::EgoMotion;

use crate::circular::Run;
use crate::warp::{Sweep, Warp};

/// Largest difference of a colour value from the previous image that is no change, grey levels: what
/// noise and interpolation leave.
const SAME: f32 = 12.0;

/// Most images that are remembered.
const MOST_IMAGES: usize = 16;
/// Least time between two images in which a person moves visibly, s.
const STEP_S: f64 = 0.2;

/// Comparator of an image with the last one that is old enough for a person to have moved since. Unlike
/// the background, that image has no errors of many motions, and no people of long ago.
#[derive(Clone, Debug, Default)]
pub(crate) struct Changes {
    /// Images that are too young, and before them one that is not; oldest first.
    past: VecDeque<Past>,
    /// Room of the image that was forgotten last, for the next one.
    room: Vec<u8>,
    /// The image that is compared, as it looks from the robot's new place.
    moved: Vec<f32>,
    /// 1 where the last image differs from it, else 0; empty if they were not compared.
    changed: Vec<u8>,
}

/// An image with the motion of the robot since then.
#[derive(Clone, Debug)]
struct Past {
    colours: Vec<u8>,
    since: Option<EgoMotion>,
}

impl Changes {
    /// Adds a motion of the robot, and forgets images that are older than needed.
    pub(crate) fn move_by(&mut self, motion: &EgoMotion) {
        fn is_old(past: &Past) -> bool {
            past.since.is_some_and(|since| since.dt >= STEP_S)
        }

        for past in &mut self.past {
            past.since = Some(past.since.map_or(*motion, |since| since.then(motion)));
        }
        while self.past.get(1).is_some_and(is_old) {
            self.forget_oldest();
        }
    }

    /// Returns the motion since the image that is compared; `None` if all are too young.
    pub(crate) fn motion(&self) -> Option<EgoMotion> {
        self.past.front()?.since.filter(|since| since.dt >= STEP_S)
    }

    /// Compares an image with that of [`Changes::motion`], which is moved with the robot as `sweep`
    /// estimates it. Without such an image nothing is compared.
    pub(crate) fn compare(&mut self, sweep: &mut Sweep, warps: &[Warp], colours: &[u8]) {
        fn differs((now, before): (&[u8], &[f32])) -> bool {
            now.iter().zip(before).any(|(now, before)| (f32::from(*now) - before).abs() > SAME)
        }

        self.changed.clear();
        let Some(past) = self.motion().and(self.past.front()) else { return };
        self.moved.clear();
        self.moved.extend(past.colours.iter().map(|colour| f32::from(*colour)));
        sweep.apply(warps, colours, &mut self.moved, &mut []);
        let pixels = colours.chunks_exact(3).zip(self.moved.chunks_exact(3));
        self.changed.extend(pixels.map(|pixel| u8::from(differs(pixel))));
    }

    /// Ends an image: later ones are compared with it.
    pub(crate) fn keep(&mut self, colours: &[u8]) {
        // Those of a camera that is faster than 75 images a second are not compared.
        while self.past.len() >= MOST_IMAGES {
            self.forget_oldest();
        }
        let mut kept = std::mem::take(&mut self.room);
        kept.clear();
        kept.extend_from_slice(colours);
        self.past.push_back(Past { colours: kept, since: None });
    }

    fn forget_oldest(&mut self) {
        if let Some(oldest) = self.past.pop_front() {
            self.room = oldest.colours;
        }
    }

    /// Forgets the last comparison.
    pub(crate) fn clear(&mut self) {
        self.changed.clear();
    }

    /// Returns the changed part of the pixels that are 1 in `solid` in a run of columns; 1 if the
    /// images were not compared.
    pub(crate) fn part(&self, run: Run, width: usize, solid: &[u8]) -> f64 {
        let rows = solid.chunks_exact(width.max(1)).zip(self.changed.chunks_exact(width.max(1)));
        let mut all = 0_u32;
        let mut changed = 0_u32;
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
        let pixels = (0..2 * WIDTH)
            .flat_map(|pixel| [if columns.contains(&(pixel % WIDTH)) { value } else { 100 }; 3]);
        pixels.collect()
    }

    #[test]
    fn the_part_is_that_of_the_solid_pixels_that_changed_across_the_seam() {
        let mut changes = Changes::default();
        let mut sweep = Sweep::default();
        let run = Run { first: 5, length: 3 };
        let solid = [1, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 0];
        changes.compare(&mut sweep, &[], &image(&[], 0));
        assert_eq!(changes.part(run, WIDTH, &solid), 1.0, "there is no previous image");
        changes.keep(&image(&[], 0));
        changes.move_by(&EgoMotion::at_rest(STEP_S));
        // Columns 5, 0 and 1 have four solid pixels, of which column 5 has one.
        changes.compare(&mut sweep, &[], &image(&[5, 3], 113));
        assert_eq!(changes.part(run, WIDTH, &solid), 0.25);
        changes.compare(&mut sweep, &[], &image(&[5, 3], 112));
        assert_eq!(changes.part(run, WIDTH, &solid), 0.0, "this is noise");
        changes.clear();
        assert_eq!(changes.part(run, WIDTH, &solid), 1.0);
    }

    #[test]
    fn images_of_a_fast_camera_are_compared_with_one_that_is_old_enough() {
        let mut changes = Changes::default();
        let mut sweep = Sweep::default();
        let run = Run { first: 0, length: WIDTH };
        let solid = [1; 2 * WIDTH];
        let step = EgoMotion { forward: 0.05, turn: 0.1, ..EgoMotion::at_rest(0.08) };
        // Each image shows another column. That of three steps ago is the first to be old enough.
        for (column, expected) in [(0, 6.0), (1, 6.0), (2, 6.0), (0, 0.0), (1, 0.0), (3, 2.0)] {
            changes.move_by(&step);
            changes.compare(&mut sweep, &[], &image(&[column], 200));
            changes.keep(&image(&[column], 200));
            let part = changes.part(run, WIDTH, &solid) * WIDTH as f64;
            assert!((part - expected).abs() < 1e-9, "{column}: {part}");
        }
    }

    #[test]
    fn motions_after_each_other_add_up_in_the_frame_of_the_first() {
        let quarter = EgoMotion {
            forward: 1.0,
            turn: std::f64::consts::FRAC_PI_2,
            ..EgoMotion::at_rest(0.1)
        };
        let both = quarter.then(&quarter);
        assert!((both.forward - 1.0).abs() < 1e-9 && (both.left - 1.0).abs() < 1e-9, "{both:?}");
        assert!((both.turn - std::f64::consts::PI).abs() < 1e-9 && (both.dt - 0.2).abs() < 1e-9);
    }
}
