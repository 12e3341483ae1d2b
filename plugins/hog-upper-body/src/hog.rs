//! Cells and blocks.

use crate::gradients::Gradients;
use crate::model::dot;

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
    /// Scratch: a row of pixels, its votes, and square roots of all pixels.
    gradients: Gradients,
    votes: Vec<f32>,
    roots: Vec<f32>,
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
        self.roots.clear();
        self.roots.extend(pixels.iter().map(|grey| grey.max(0.0).sqrt()));
        for y in 0..height - 2 {
            let rows = [0, 1, 2].map(|row| &self.roots[(y + row) * width..(y + row + 1) * width]);
            self.gradients.fill(rows);
            vote(&self.gradients, &mut self.votes, across);
            let (cell, share) = place(y);
            for (row, weight) in [(cell, 1.0 - share), (cell + 1, share)] {
                // Cells are numbered from 1: outside ones get no votes.
                if (1..=down).contains(&row) {
                    let cells = &mut self.cells[(row - 1) * across * BINS..row * across * BINS];
                    let votes = &self.votes[BINS..];
                    cells.iter_mut().zip(votes).for_each(|(cell, vote)| *cell += weight * vote);
                }
            }
        }
        self.normalise(across);
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
fn place(pixel: usize) -> (usize, f32) {
    let at = (pixel as f32 + 0.5) / CELL as f32 + 0.5;
    let cell = at as usize;
    (cell, at - cell as f32)
}

/// The votes of a row for its cells and for one outside at either end: each
/// gradient votes for the two directions and the two cells that are nearest, by
/// its length.
fn vote(gradients: &Gradients, votes: &mut Vec<f32>, across: usize) {
    votes.clear();
    votes.resize((across + 2) * BINS, 0.0);
    let pixels = gradients.length.iter().zip(&gradients.turn).take(across * CELL);
    for (x, (length, turn)) in pixels.enumerate() {
        let (cell, next) = place(x);
        // One more than the direction below, so that it is never negative.
        let at = turn * BINS as f32 + 0.5;
        let bin = at as usize;
        let share = at - bin as f32;
        let (below, above) = ((bin + BINS - 1) % BINS, bin % BINS);
        let here = length * (1.0 - next);
        let there = length * next;
        let start = cell * BINS;
        votes[start + below] += here * (1.0 - share);
        votes[start + above] += here * share;
        votes[start + BINS + below] += there * (1.0 - share);
        votes[start + BINS + above] += there * share;
    }
}

fn norm(values: &[f32]) -> f32 {
    dot(values, values).sqrt()
}
