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
    /// How many are in a row.
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
        for cell in 0..self.grey.len() {
            let (row, column) = (cell / self.columns, cell % self.columns);
            let [dx, dy] = self.gradient(row, column);
            let turn = dy.atan2(dx).rem_euclid(PI) / PI * DIRECTIONS as f32 - 0.5;
            let lower = turn.floor();
            let part = turn - lower;
            let first = (lower as i32).rem_euclid(DIRECTIONS as i32) as usize;
            let histogram = &mut histograms[row / self.block[0] * across + column / self.block[1]];
            let length = dx.hypot(dy);
            histogram[first] += (1.0 - part) * length;
            histogram[(first + 1) % DIRECTIONS] += part * length;
        }
        histograms
    }

    /// Half the difference of the neighbours; one-sided at the border.
    fn gradient(&self, row: usize, column: usize) -> [f32; 2] {
        let (columns, rows) = (self.columns, self.grey.len() / self.columns);
        let at = |row: usize, column: usize| {
            self.grey[row.min(rows - 1) * columns + column.min(columns - 1)]
        };
        [
            0.5 * (at(row, column + 1) - at(row, column.saturating_sub(1))),
            0.5 * (at(row + 1, column) - at(row.saturating_sub(1), column)),
        ]
    }

    /// Mean strength of a block and its neighbours.
    fn around(&self, strength: &[f32], block: usize) -> f32 {
        let [down, across] = self.size();
        let span = |k: usize, end: usize| k.saturating_sub(1)..(k + 2).min(end);
        let (rows, columns) = (span(block / across, down), span(block % across, across));
        let count = (rows.len() * columns.len()) as f32;
        let each = rows.flat_map(|row| columns.clone().map(move |column| row * across + column));
        each.map(|block| strength[block]).sum::<f32>() / count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_vertical_edge_has_the_direction_of_its_gradient_whatever_the_light() {
        let edge = |dark: f32, bright: f32| -> Vec<f32> {
            let grey = std::array::from_fn(|c| if c % SIDE < 18 { dark } else { bright });
            let mut out = Vec::new();
            push(&grey, &mut out);
            out
        };
        let (weak, strong, inverted) = (edge(80.0, 140.0), edge(20.0, 240.0), edge(240.0, 20.0));
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
