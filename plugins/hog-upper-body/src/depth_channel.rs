//! Depth around a person: a small set of separate trees, for frames with a depth image.
//!
//! A person is nearer than the surroundings to the left and right of the head and beside the hips,
//! and the depth of the body varies little. The values of a window are the depths of 8 by 8 cells
//! relative to the depth of its object, so they do not depend on light, clothes or distance.

use tagalong_core::DepthImage;
use tagalong_geometry::Rect;

use crate::coverage::{Coverage, SIDE, window_of};
use crate::trees::{self, Tree, Trees};

/// Number of cells along a side of a window.
const CELLS: usize = SIDE + 1;
/// Number of values of a window.
pub(crate) const DEPTH_NUMBERS: usize = CELLS * CELLS;
/// Places along a side of a cell at which depth is read.
const TAPS: usize = 2;
/// Differences in depth are limited to this: what is farther behind differs by chance, m.
const MOST_M: f64 = 1.0;
/// Value of a cell without depth: a question can tell it from all others.
const MISSING: f32 = 2.0;
/// Limit of the log-odds: the channel agrees or objects, and does not decide alone.
const MOST_LOG_ODDS: f64 = 4.0;

/// Trees over depth, with their calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthTrees {
    /// The trees.
    pub trees: Trees,
    /// Log-odds per unit of the sum.
    pub slope: f64,
    /// Log-odds at the sum 0.
    pub offset: f64,
}

impl DepthTrees {
    /// Creates trees that are not calibrated.
    pub fn new(trees: Vec<Tree>) -> Self {
        Self { trees: Trees::new(trees, f32::MIN), slope: 1.0, offset: 0.0 }
    }

    /// Returns the log-odds of a window with an upper-body square, which shows an object at a
    /// distance.
    pub fn log_odds(&self, depth: &DepthImage, square: &Rect, surface_m: f64) -> f64 {
        let sum = self.trees.sum_of(&depth_numbers(depth, square, surface_m));
        self.of_sum(f64::from(sum))
    }

    /// Returns the log-odds of a sum.
    pub(crate) fn of_sum(&self, sum: f64) -> f64 {
        (self.slope * sum + self.offset).clamp(-MOST_LOG_ODDS, MOST_LOG_ODDS)
    }

    /// Returns the largest log-odds.
    pub(crate) const fn most() -> f64 {
        MOST_LOG_ODDS
    }

    /// Parses the trees of a file.
    ///
    /// # Errors
    /// Bytes that are not trees; the message is one sentence.
    pub(crate) fn from_bytes(bytes: &[u8], slope: f64, offset: f64) -> Result<Self, String> {
        if !(slope > 0.0 && slope.is_finite() && offset.is_finite()) {
            return Err("the calibration of its depth channel is no calibration".into());
        }
        let trees = trees::parse(bytes, DEPTH_NUMBERS)?;
        Ok(Self { slope, offset, ..Self::new(trees) })
    }
}

/// Returns the values of a window, cell by cell: by how much the nearest of some readings is
/// farther than the object at `surface_m`, m.
pub(crate) fn depth_numbers(depth: &DepthImage, square: &Rect, surface_m: f64) -> Vec<f32> {
    let window = window_of(square, Coverage::UpperBody);
    let step = window.width / (CELLS * TAPS) as f64;
    let mut numbers = Vec::with_capacity(DEPTH_NUMBERS);
    for cell in 0..DEPTH_NUMBERS {
        let mut nearest = f32::INFINITY;
        for k in 0..TAPS * TAPS {
            let column = TAPS * (cell % CELLS) + k % TAPS;
            let row = TAPS * (cell / CELLS) + k / TAPS;
            let [x, y] = [(window.x, column), (window.y, row)]
                .map(|(from, tap)| (from + (tap as f64 + 0.5) * step).floor() as i64);
            // Cameras write 0 where they measured nothing.
            if let Some(metres) = depth.get(x, y).filter(|metres| *metres > 0.0) {
                nearest = nearest.min(metres);
            }
        }
        numbers.push(if nearest.is_finite() {
            (f64::from(nearest) - surface_m).clamp(-MOST_M, MOST_M) as f32
        } else {
            MISSING
        });
    }
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: Rect = Rect::new(32.0, 24.0, 32.0, 32.0);

    fn numbers(depth: impl Fn(usize, usize) -> f32) -> Vec<f32> {
        depth_numbers(&DepthImage::from_fn(96, 96, depth), &SQUARE, 2.0)
    }

    #[test]
    fn cells_are_relative_to_the_object_and_limited() {
        // The window is 64 pixels wide and begins at column 16; its left half shows a wall.
        let found = numbers(|x, _| if x < 48 { 9.0 } else { 2.25 });
        let row = [1.0, 1.0, 1.0, 1.0, 0.25, 0.25, 0.25, 0.25];
        assert!(found.chunks_exact(CELLS).all(|cells| cells == row), "{found:?}");
    }

    #[test]
    fn a_hole_is_no_distance_unless_all_readings_of_a_cell_lack() {
        let some = numbers(|x, y| if (x / 4 + y / 4) % 2 == 0 { 0.0 } else { 2.0 });
        assert!(some.iter().all(|value| *value == 0.0), "{some:?}");
        assert!(numbers(|_, _| 0.0).iter().all(|value| *value == MISSING));
    }

    #[test]
    fn the_channel_does_not_decide_alone() {
        let all = DepthTrees { slope: 1.0, offset: 9.0, ..DepthTrees::new(vec![Tree::default()]) };
        let depth = DepthImage::from_fn(96, 96, |_, _| 2.0);
        assert_eq!(all.log_odds(&depth, &SQUARE, 2.0), MOST_LOG_ODDS);
        assert_eq!(DepthTrees { offset: -9.0, ..all }.of_sum(0.0), -MOST_LOG_ODDS);
    }
}
