//! Cells and blocks.

use std::f32::consts::PI;

/// Side of a cell, pixels.
pub(crate) const CELL: usize = 8;
/// Directions, over half a turn.
pub(crate) const BINS: usize = 9;
/// Numbers of a block: 2x2 cells.
pub(crate) const BLOCK: usize = 4 * BINS;
/// No number of a normalised block is larger (L2-Hys).
const CLIP: f32 = 0.2;

/// The normalised blocks of an image; neighbours share cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Blocks {
    columns: usize,
    rows: usize,
    values: Vec<f32>,
    /// Histograms of the cells.
    cells: Vec<f32>,
}

impl Blocks {
    /// Takes the place of the blocks of another image: `pixels` of grey values,
    /// `width` to a row. The outermost pixels belong to no cell; they are there
    /// for the gradients of their neighbours.
    pub fn fill(&mut self, pixels: &[f32], width: usize) {
        let (inner, height) = (width.max(2) - 2, pixels.len() / width.max(1));
        let (across, down) = (inner / CELL, height.saturating_sub(2) / CELL);
        self.cells.clear();
        self.cells.resize(across * down * BINS, 0.0);
        (self.columns, self.rows) = (across.saturating_sub(1), down.saturating_sub(1));
        self.values.clear();
        self.values.resize(self.columns * self.rows * BLOCK, 0.0);
        if self.values.is_empty() {
            return;
        }
        let roots: Vec<f32> = pixels.iter().map(|grey| grey.max(0.0).sqrt()).collect();
        let places: Vec<(usize, f32)> = (0..inner).map(|x| place(x, across)).collect();
        for y in 0..height - 2 {
            let rows = [0, 1, 2].map(|row| &roots[(y + row) * width..(y + row + 1) * width]);
            self.vote(rows, place(y, down), &places, (across, down));
        }
        self.normalise(across);
    }

    /// Each gradient of a row votes for the two directions and the four cells
    /// that are nearest, by its length.
    fn vote(
        &mut self,
        [above, row, below]: [&[f32]; 3],
        (cell_y, next_y): (usize, f32),
        places: &[(usize, f32)],
        (across, down): (usize, usize),
    ) {
        for (x, &(cell_x, next_x)) in places.iter().enumerate() {
            let (gx, gy) = (row[x + 2] - row[x], below[x + 1] - above[x + 1]);
            let length = (gx * gx + gy * gy).sqrt();
            if length < 1e-6 {
                continue;
            }
            let (bins, shares) = directions(gx, gy);
            for (cy, wy) in [(cell_y, 1.0 - next_y), (cell_y + 1, next_y)] {
                for (cx, wx) in [(cell_x, 1.0 - next_x), (cell_x + 1, next_x)] {
                    // Cells are numbered from 1: outside ones get no votes.
                    if cx == 0 || cy == 0 || cx > across || cy > down {
                        continue;
                    }
                    let cell = ((cy - 1) * across + cx - 1) * BINS;
                    let vote = length * wx * wy;
                    self.cells[cell + bins.0] += vote * shares.0;
                    self.cells[cell + bins.1] += vote * shares.1;
                }
            }
        }
    }

    /// L2-Hys: divided by the length, clipped, divided again.
    fn normalise(&mut self, across: usize) {
        for (index, block) in self.values.chunks_exact_mut(BLOCK).enumerate() {
            let (x, y) = (index % self.columns, index / self.columns);
            for (corner, part) in block.chunks_exact_mut(BINS).enumerate() {
                let cell = (y + corner / 2) * across + x + corner % 2;
                part.copy_from_slice(&self.cells[cell * BINS..(cell + 1) * BINS]);
            }
            let scale = 1.0 / (norm(block) + 0.1 * BLOCK as f32 / 255.0_f32.sqrt());
            block.iter_mut().for_each(|v| *v = (*v * scale).min(CLIP));
            let scale = 1.0 / (norm(block) + 1e-3);
            block.iter_mut().for_each(|v| *v *= scale);
        }
    }

    /// Blocks in a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Rows of blocks.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The numbers of `count` neighbouring blocks in a row.
    pub fn run(&self, x: usize, y: usize, count: usize) -> &[f32] {
        let start = (y * self.columns + x) * BLOCK;
        &self.values[start..start + count * BLOCK]
    }
}

/// The cell before a pixel, numbered from 1, and the share of the next one.
fn place(pixel: usize, cells: usize) -> (usize, f32) {
    let at = (pixel as f32 + 0.5) / CELL as f32 + 0.5;
    let cell = at as usize;
    (cell.min(cells + 1), at - cell as f32)
}

/// The two nearest directions and their shares; opposite ones are the same.
fn directions(gx: f32, gy: f32) -> ((usize, usize), (f32, f32)) {
    let mut angle = gy.atan2(gx);
    if angle < 0.0 {
        angle += PI;
    }
    let at = angle * (BINS as f32 / PI) - 0.5;
    let below = at.floor();
    let share = at - below;
    let bin = (below as i32).rem_euclid(BINS as i32) as usize;
    ((bin, (bin + 1) % BINS), (1.0 - share, share))
}

fn norm(values: &[f32]) -> f32 {
    values.iter().map(|v| v * v).sum::<f32>().sqrt()
}
