//! Cells and normalised blocks of histograms of oriented gradients.

use crate::Spans;
use crate::gradients::{Gradients, LANES, Votes, votes};

/// Side of a cell, pixels.
pub(crate) const CELL: usize = 8;
/// Number of directions, over half a turn.
pub(crate) const BINS: usize = 9;
/// Number of values of a block: 2x2 cells.
pub(crate) const BLOCK: usize = 4 * BINS;
/// Largest value of a normalised block before it is normalised again (L2-Hys).
const CLIP: f32 = 0.2;
/// Middle of the first direction, in widths of a bin.
const FIRST: f32 = 0.5;
/// Number of pixels left of the first cell that are within half a cell of it.
const BEFORE: usize = CELL / 2;

/// Normalised blocks of an image; neighbours share cells.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Blocks {
    columns: usize,
    rows: usize,
    values: Vec<[f32; BLOCK]>,
    /// Histograms of the cells.
    cells: Vec<[f32; BINS]>,
    /// Scratch: square roots of all pixels, the gradients of a row, and their votes for the row of
    /// cells above them and for the one below.
    roots: Vec<f32>,
    gradients: Gradients,
    above: Vec<Votes<BINS>>,
    below: Vec<Votes<BINS>>,
}

impl Blocks {
    /// Computes the blocks of another image: `pixels` of grey values, `width` to a row. The
    /// outermost pixels belong to no cell; they serve for the gradients of their neighbours. Only
    /// cells in `spans` are computed; other blocks are undefined.
    pub fn fill(&mut self, pixels: &[f32], width: usize, spans: &Spans) {
        let across = width.saturating_sub(2) / CELL;
        let down = spans.cells().len();
        (self.columns, self.rows) = (across.saturating_sub(1), down.saturating_sub(1));
        // The last, additional block lets a product in full lanes read past the end of a window.
        self.values.resize(self.columns * self.rows + 1, [0.0; BLOCK]);
        if self.columns * self.rows == 0 {
            return;
        }
        self.root(pixels, width, spans);
        self.vote(width, spans);
        for (y, rows) in spans.cells().windows(2).enumerate() {
            let start = rows[0].start.max(rows[1].start);
            let end = rows[0].end.min(rows[1].end);
            let [above, below] =
                [y, y + 1].map(|y| self.cells.get(y * across + start..y * across + end));
            if let (Some(above), Some(below)) = (above, below) {
                let blocks = &mut self.values[y * self.columns + start..];
                normalise(above, below, blocks);
            }
        }
    }

    /// Computes the square roots of the pixels that are needed.
    fn root(&mut self, pixels: &[f32], width: usize, spans: &Spans) {
        self.roots.resize(pixels.len(), 0.0);
        let rows = pixels.chunks_exact(width).zip(self.roots.chunks_exact_mut(width));
        for (y, (pixels, roots)) in rows.enumerate() {
            let span = spans.pixels(y / CELL);
            let roots = roots[span.clone()].iter_mut();
            roots.zip(&pixels[span]).for_each(|(root, grey)| *root = grey.max(0.0).sqrt());
        }
    }

    /// Computes the histograms of all cells: each gradient votes for the two nearest directions and
    /// the four nearest cells.
    fn vote(&mut self, width: usize, spans: &Spans) {
        let across = self.columns + 1;
        self.cells.resize(across * spans.cells().len(), [0.0; BINS]);
        for votes in [&mut self.above, &mut self.below] {
            votes.clear();
            votes.resize(across + 1, [[0.0; LANES]; BINS]);
        }
        for (row, span) in spans.cells().iter().enumerate() {
            for pixel in 0..CELL {
                // From the middle of a cell on, pixels vote for the cells of the next row instead
                // of those above.
                if pixel == CELL / 2 {
                    self.finish(row, spans);
                }
                let y = row * CELL + pixel;
                let rows = [0, 1, 2].map(|row| (y + row) * width);
                let rows = rows.map(|at| at + span.start * CELL..at + span.end * CELL + 2);
                let rows = rows.map(|part| &self.roots[part]);
                self.gradients.fill(rows, BEFORE, span.len() + 1);
                let share = ramp((pixel + CELL / 2) % CELL);
                let votes = span.start..=span.end;
                let above = &mut self.above[votes.clone()];
                let below = &mut self.below[votes];
                add_votes(&self.gradients, share, above, below);
            }
        }
        self.finish(spans.cells().len(), spans);
    }

    /// Completes the row of cells above row `y`, which has all its votes. There is none above the
    /// first.
    fn finish(&mut self, y: usize, spans: &Spans) {
        if let Some(y) = y.checked_sub(1) {
            let span = &spans.cells()[y];
            let across = self.columns + 1;
            let cells = &mut self.cells[y * across + span.start..y * across + span.end];
            let sides = self.above[span.start..=span.end].windows(2);
            cells.iter_mut().zip(sides).for_each(|(cell, sides)| *cell = histogram(sides));
        }
        std::mem::swap(&mut self.above, &mut self.below);
        self.below.fill([[0.0; LANES]; BINS]);
    }

    /// Returns the number of blocks in a row.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Returns the number of rows of blocks.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Returns the values from block (x, y) on; the last block is followed by an empty one.
    pub fn from(&self, x: usize, y: usize) -> &[f32] {
        self.values[y * self.columns + x..].as_flattened()
    }
}

/// Returns the share of the next cell in the vote of a pixel at this distance behind a cell's
/// middle.
const fn ramp(pixel: usize) -> f32 {
    (pixel as f32 + 0.5) / CELL as f32
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn add_votes(
    gradients: &Gradients,
    share: f32,
    above: &mut [Votes<BINS>],
    below: &mut [Votes<BINS>],
) {
    for (((length, turn), above), below) in gradients.lanes().zip(above).zip(below) {
        let votes: Votes<BINS> = votes(length, turn, FIRST);
        for (bin, votes) in votes.iter().enumerate() {
            for lane in 0..LANES {
                below[bin][lane] += share * votes[lane];
                above[bin][lane] += (1.0 - share) * votes[lane];
            }
        }
    }
}

/// Sums the histogram of a cell from the pixels left and right of its middle.
fn histogram(sides: &[Votes<BINS>]) -> [f32; BINS] {
    let mut cell = [0.0; BINS];
    for (bin, sum) in cell.iter_mut().enumerate() {
        let mut lanes = [0.0; LANES];
        for (lane, sum) in lanes.iter_mut().enumerate() {
            let share = ramp(lane);
            *sum = share * sides[0][bin][lane] + (1.0 - share) * sides[1][bin][lane];
        }
        *sum = lanes.iter().sum();
    }
    cell
}

/// Computes the blocks of two rows of cells. L2-Hys: divided by the length, clipped, divided again.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn normalise(above: &[[f32; BINS]], below: &[[f32; BINS]], blocks: &mut [[f32; BLOCK]]) {
    for ((above, below), out) in above.windows(2).zip(below.windows(2)).zip(blocks) {
        let mut block = [0.0; BLOCK];
        for (corner, cell) in above.iter().chain(below).enumerate() {
            block[corner * BINS..(corner + 1) * BINS].copy_from_slice(cell);
        }
        let scale = 1.0 / (norm(&block) + 0.1 * BLOCK as f32 / 255.0_f32.sqrt());
        block.iter_mut().for_each(|v| *v = (*v * scale).min(CLIP));
        // An empty block has no length to divide by.
        let scale = 1.0 / (norm(&block) + 1e-3);
        block.iter_mut().for_each(|v| *v *= scale);
        *out = block;
    }
}

#[inline(always)]
fn norm(block: &[f32; BLOCK]) -> f32 {
    let mut lanes = [0.0_f32; 4];
    for four in block.as_chunks::<4>().0 {
        lanes.iter_mut().zip(four).for_each(|(lane, v)| *lane += v * v);
    }
    lanes.iter().sum::<f32>().sqrt()
}
