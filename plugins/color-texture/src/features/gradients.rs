use std::f32::consts::PI;

use super::window::{Grid, SIDE};

/// Rows and columns of a block, in cells of the window.
const BLOCK: usize = 4;
/// Blocks along each side.
const BLOCKS: usize = SIDE / BLOCK;
/// Directions in 180 degrees.
pub const DIRECTIONS: usize = 9;

/// Numbers of the gradients.
pub const COUNT: usize = BLOCKS * BLOCKS * DIRECTIONS;

/// Gradients weaker than this on average are noise: grey values per cell.
const NOISE: f32 = 1.0;

/// Histograms of gradient directions without sign, one a block, each divided by
/// the strength around it (after Dalal and Triggs, CVPR 2005).
pub fn push(grey: &Grid<f32>, out: &mut Vec<f32>) {
    Blocks { grey, columns: SIDE, block: [BLOCK, BLOCK] }.push(out);
}

/// An image of whole blocks.
pub struct Blocks<'a> {
    /// Intensities, row by row.
    pub grey: &'a [f32],
    /// Number of blocks in a row.
    pub columns: usize,
    /// Rows and columns of a block.
    pub block: [usize; 2],
}

impl Blocks<'_> {
    /// Writes the histograms, block by block, and returns the strength of each block: the
    /// sum of its gradients, grey values a cell.
    pub fn push(&self, out: &mut Vec<f32>) -> Vec<f32> {
        let histograms = self.histograms();
        let strength: Vec<f32> = histograms.iter().map(|h| h.iter().sum()).collect();
        // Noise of even blocks must not be normalised to full strength.
        let noise = NOISE * (self.block[0] * self.block[1]) as f32;
        for (block, histogram) in histograms.iter().enumerate() {
            let around = self.around(&strength, block) + noise;
            out.extend(histogram.iter().map(|v| v / around));
        }
        strength
    }

    /// Rows and columns of blocks.
    fn size(&self) -> [usize; 2] {
        let rows = self.grey.len() / self.columns;
        [rows / self.block[0], self.columns / self.block[1]]
    }

    fn histograms(&self) -> Vec<[f32; DIRECTIONS]> {
        let [down, across] = self.size();
        let mut histograms = vec![[0.0; DIRECTIONS]; down * across];
        let mut gradients = vec![[0.0; 2]; self.columns];
        for row in 0..self.grey.len() / self.columns {
            self.gradients(row, &mut gradients);
            let blocks = &mut histograms[row / self.block[0] * across..][..across];
            for (histogram, gradients) in blocks.iter_mut().zip(gradients.chunks(self.block[1])) {
                gradients.iter().for_each(|gradient| add(histogram, *gradient));
            }
        }
        histograms
    }

    /// Half the difference of the neighbours; one-sided at the border. Then as direction,
    /// in bins, and length.
    fn gradients(&self, row: usize, out: &mut [[f32; 2]]) {
        let columns = self.columns;
        let last = self.grey.len() / self.columns - 1;
        let [above, here, below] = [row.saturating_sub(1), row, (row + 1).min(last)]
            .map(|row| &self.grey[row * columns..(row + 1) * columns]);
        let left = std::iter::once(&here[0]).chain(here);
        let right = here[1..].iter().chain(here.last());
        let across = left.zip(right).map(|(left, right)| 0.5 * (right - left));
        let down = above.iter().zip(below).map(|(above, below)| 0.5 * (below - above));
        for (out, gradient) in out.iter_mut().zip(across.zip(down)) {
            *out = gradient.into();
        }
        out.iter_mut().for_each(|[dx, dy]| {
            let length = (*dx * *dx + *dy * *dy).sqrt();
            (*dx, *dy) = (direction(*dx, *dy) / PI * DIRECTIONS as f32, length);
        });
    }

    /// Mean strength of a block and its neighbours.
    fn around(&self, strength: &[f32], block: usize) -> f32 {
        let [down, across] = self.size();
        fn span(k: usize, end: usize) -> std::ops::Range<usize> {
            k.saturating_sub(1)..(k + 2).min(end)
        }
        let rows = span(block / across, down);
        let columns = span(block % across, across);
        let count = (rows.len() * columns.len()) as f32;
        let each = rows.flat_map(|row| columns.clone().map(move |column| row * across + column));
        each.map(|block| strength[block]).sum::<f32>() / count
    }
}

/// Shares a gradient, as direction in bins and length, between the bins next to it.
fn add(histogram: &mut [f32; DIRECTIONS], [direction, length]: [f32; 2]) {
    // Interpolated between neighbouring directions, so that a small turn changes little.
    let turn = direction + (DIRECTIONS as f32 - 0.5);
    let lower = turn as usize;
    let part = turn.fract();
    histogram[lower % DIRECTIONS] += (1.0 - part) * length;
    histogram[(lower + 1) % DIRECTIONS] += part * length;
}

/// Angle of a line, 0 to pi, to 0.0003 rad; a polynomial without branches, so that many
/// are found at once.
fn direction(dx: f32, dy: f32) -> f32 {
    let x = dx.abs();
    let y = dy.abs();
    let ratio = x.min(y) / x.max(y).max(f32::MIN_POSITIVE);
    let square = ratio * ratio;
    let arc = ratio
        * (0.999_866
            + square
                * (-0.330_299_5
                    + square * (0.180_141 + square * (-0.085_133 + square * 0.020_835_1))));
    let steep = if y > x { 0.5 * PI - arc } else { arc };
    if dx * dy < 0.0 { PI - steep } else { steep }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Returns the intensity of a pixel, or of the nearest one of the last row and column.
    fn intensity_at(blocks: &Blocks<'_>, row: usize, column: usize) -> f32 {
        let last = blocks.grey.len() / blocks.columns - 1;
        blocks.grey[row.min(last) * blocks.columns + column.min(blocks.columns - 1)]
    }

    /// Slowly, by the library's functions.
    fn histograms(blocks: &Blocks<'_>) -> Vec<[f32; DIRECTIONS]> {
        let rows = blocks.grey.len() / blocks.columns;
        let columns = blocks.columns;
        let [down, across] = blocks.size();
        let mut histograms = vec![[0.0; DIRECTIONS]; down * across];
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |c| (row, c))) {
            let [up, left] = [row, column].map(|at| at.saturating_sub(1));
            let dx =
                0.5 * (intensity_at(blocks, row, column + 1) - intensity_at(blocks, row, left));
            let dy =
                0.5 * (intensity_at(blocks, row + 1, column) - intensity_at(blocks, up, column));
            let turn = dy.atan2(dx).rem_euclid(PI) / PI * DIRECTIONS as f32 - 0.5;
            let first = (turn.floor() as i32).rem_euclid(DIRECTIONS as i32) as usize;
            let part = turn - turn.floor();
            let length = dx.hypot(dy);
            let histogram =
                &mut histograms[row / blocks.block[0] * across + column / blocks.block[1]];
            histogram[first] += (1.0 - part) * length;
            histogram[(first + 1) % DIRECTIONS] += part * length;
        }
        histograms
    }

    proptest! {
        #[test]
        fn the_fast_histograms_are_the_slow_ones(
            grey in prop::collection::vec(0u8.., 24 * 18), wide: bool,
        ) {
            let grey: Vec<f32> = grey.into_iter().map(f32::from).collect();
            let (columns, block) = if wide { (24, [6, 4]) } else { (18, [8, 6]) };
            let blocks = Blocks { grey: &grey, columns, block };
            for (fast, slow) in blocks.histograms().iter().zip(histograms(&blocks)) {
                let all: f32 = slow.iter().sum();
                for (a, b) in fast.iter().zip(slow) {
                    prop_assert!((a - b).abs() <= 1e-3 * all.max(1.0), "{a} {b} of {all}");
                }
            }
        }
    }

    #[test]
    fn a_vertical_edge_has_the_direction_of_its_gradient_whatever_the_light() {
        fn edge(dark: f32, bright: f32) -> Vec<f32> {
            let grey = std::array::from_fn(|c| if c % SIDE < 18 { dark } else { bright });
            let mut out = Vec::new();
            push(&grey, &mut out);
            out
        }

        let weak = edge(80.0, 140.0);
        let strong = edge(20.0, 240.0);
        let inverted = edge(240.0, 20.0);
        assert_eq!(weak.len(), COUNT);
        let block = 3 * BLOCKS + 4;
        let here = &strong[block * DIRECTIONS..][..DIRECTIONS];
        // Direction 0 is shared by the first and the last bin.
        assert!(here[0] > 0.5 && here[8] > 0.5 && here[4] < 1e-6, "{here:?}");
        for k in 0..COUNT {
            assert!((weak[k] - strong[k]).abs() < 0.2, "{k}");
            assert!((inverted[k] - strong[k]).abs() < 1e-4, "{k}");
        }
    }
}
