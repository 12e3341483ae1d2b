//! Aggregated channels: brightness, gradients and their directions, averaged over small cells and
//! normalised by their neighbourhood (after P. Dollar et al., *Fast feature pyramids for object
//! detection*, PAMI 36, 2014).

use std::ops::Range;

use crate::Spans;
use crate::gradients::{Gradients, LANES, Votes, votes};
use crate::hog::CELL as HOG_CELL;

/// Side of a cell, pixels.
pub(crate) const CELL: usize = HOG_CELL / HALVES;
/// Number of these cells along a side of a cell of histograms.
const HALVES: usize = 2;
/// Number of directions, over half a turn.
const BINS: usize = 6;
/// Number of values in a cell: brightness, length of gradients, and length by direction.
pub(crate) const DEPTH: usize = 2 + BINS;
/// Constant that is added to the mean gradient around a cell before gradients are divided by it,
/// for grey values from 0 to 1: faint gradients are not amplified.
const FAINT: f32 = 0.005;

/// Channels of an image, cell by cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channels {
    columns: usize,
    rows: usize,
    values: Vec<f32>,
    /// Scratch: lengths of gradients around a cell, and input of a pass.
    around: Vec<f32>,
    before: Vec<f32>,
    gradients: Gradients,
    /// Scratch: sums of each column in a row of cells.
    columns_of: Vec<Columns>,
}

/// Sums of neighbouring columns of pixels: brightness, length of gradients, and length by
/// direction.
type Columns = Votes<DEPTH>;

impl Channels {
    /// Computes the channels of another image: `pixels` of grey values, `width` to a row. The
    /// outermost pixels belong to no cell; they serve for the gradients of their neighbours. Only
    /// cells in `spans` are computed; the others are zero.
    pub fn fill(&mut self, pixels: &[f32], width: usize, spans: &Spans) {
        self.columns = HALVES * (width.saturating_sub(2) / HOG_CELL);
        self.rows = HALVES * spans.cells().len();
        self.values.clear();
        self.values.resize(self.columns * self.rows * DEPTH, 0.0);
        if self.values.is_empty() {
            return;
        }
        for y in 0..self.rows {
            self.add(&pixels[y * CELL * width..], width, y, &spans.cells()[y / HALVES]);
        }
        self.compare();
        self.before.resize(self.values.len(), 0.0);
        let size = (self.columns, self.rows);
        smooth(&mut self.values, &mut self.before, size, DEPTH, &[0.25, 0.5, 0.25]);
    }

    /// Computes row `y` of cells from the rows of pixels that begin above it.
    fn add(&mut self, pixels: &[f32], width: usize, y: usize, span: &Range<usize>) {
        let lanes = span.len() * HOG_CELL / LANES;
        self.columns_of.clear();
        self.columns_of.resize(lanes, [[0.0; LANES]; DEPTH]);
        for y in 0..CELL {
            let rows = [0, 1, 2].map(|row| (y + row) * width);
            let rows = rows.map(|at| at + span.start * HOG_CELL..at + span.end * HOG_CELL + 2);
            let rows = rows.map(|part| &pixels[part]);
            self.gradients.fill(rows, 0, lanes);
            add_row(&self.gradients, &rows[1][1..], &mut self.columns_of);
        }
        let [from, to] = [span.start, span.end].map(|x| (y * self.columns + HALVES * x) * DEPTH);
        let row = &mut self.values[from..to];
        sum_columns(&self.columns_of, row);
    }

    /// Divides gradients by the mean around their cell.
    fn compare(&mut self) {
        self.around.clear();
        self.around.extend(self.values.chunks_exact(DEPTH).map(|cell| cell[1]));
        self.before.resize(self.values.len(), 0.0);
        let weights = [1.0, 2.0, 3.0, 2.0, 1.0].map(|w: f32| w / 9.0);
        smooth(&mut self.around, &mut self.before, (self.columns, self.rows), 1, &weights);
        for (cell, around) in self.values.chunks_exact_mut(DEPTH).zip(&self.around) {
            let scale = 1.0 / (around + FAINT);
            cell[1..].iter_mut().for_each(|value| *value *= scale);
        }
    }

    /// Returns the values from cell (x, y) on.
    pub fn from(&self, x: usize, y: usize) -> &[f32] {
        &self.values[(y * self.columns + x) * DEPTH..]
    }

    /// Copies the values into planes.
    pub(crate) fn planes(&self, planes: &mut Planes) {
        // Planes never shrink, so that places in them stay valid from one size of the image to the
        // next.
        let half = (self.columns.div_ceil(2) + LANES).max(planes.half);
        planes.half = half;
        let rows = self.values.chunks_exact((self.columns * DEPTH).max(1)).take(self.rows);
        planes.values.resize((self.rows * 2 * DEPTH * half).max(planes.values.len()), 0.0);
        for (row, planes) in rows.zip(planes.values.chunks_exact_mut(2 * DEPTH * half)) {
            for (x, pair) in row.chunks(2 * DEPTH).enumerate() {
                for (number, value) in pair.iter().enumerate() {
                    planes[number * half + x] = *value;
                }
            }
        }
    }
}

/// Values of cells, row by row: those of one kind of all even columns, and those of all odd ones.
/// Windows begin at even columns, so the values of neighbouring windows are adjacent in memory.
/// Planes are as long as those of the largest image so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Planes {
    half: usize,
    values: Vec<f32>,
}

impl Planes {
    /// Returns the number on which the places of values depend.
    pub(crate) fn layout(&self) -> usize {
        self.half
    }

    /// Returns the place of value `k` of cell (x, y). Places in a window add up with that of its
    /// first cell.
    pub(crate) fn place(&self, x: usize, y: usize, k: usize) -> usize {
        ((y * 2 + x % 2) * DEPTH + k) * self.half + x / 2
    }

    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }
}

/// Computes weighted means over neighbours in columns and then in rows; at the border the weights
/// of the missing neighbours are shared by the others. `scratch` is at least as long as the values.
fn smooth(
    values: &mut [f32],
    scratch: &mut [f32],
    (columns, rows): (usize, usize),
    depth: usize,
    weights: &[f32],
) {
    let row = columns * depth;
    for y in 0..rows {
        let (first, used, scale) = present(y, rows, weights);
        let out = &mut scratch[y * row..(y + 1) * row];
        out.fill(0.0);
        for (from, weight) in (first..).zip(used) {
            add_scaled(out, &values[from * row..(from + 1) * row], scale * weight);
        }
    }
    let reach = weights.len() / 2;
    for (from, to) in scratch.chunks_exact(row).zip(values.chunks_exact_mut(row)).take(rows) {
        to.fill(0.0);
        let whole = reach.min(columns)..columns.saturating_sub(reach).max(reach.min(columns));
        // Columns away from the border have all neighbours: they are added in one pass per weight.
        for (k, weight) in weights.iter().enumerate().filter(|_| !whole.is_empty()) {
            let begin = (whole.start + k - reach) * depth;
            let inner = &mut to[whole.start * depth..whole.end * depth];
            let length = inner.len();
            add_scaled(inner, &from[begin..begin + length], *weight);
        }
        for x in (0..whole.start).chain(whole.end..columns) {
            let (first, used, scale) = present(x, columns, weights);
            for (neighbour, weight) in (first..).zip(used) {
                let from = &from[neighbour * depth..(neighbour + 1) * depth];
                add_scaled(&mut to[x * depth..(x + 1) * depth], from, scale * weight);
            }
        }
    }
}

/// Returns the first existing neighbour, the weights of the existing ones, and the factor by which
/// these sum to 1.
fn present(at: usize, length: usize, weights: &[f32]) -> (usize, &[f32], f32) {
    let reach = weights.len() / 2;
    let first = at.saturating_sub(reach);
    let last = (at + reach).min(length - 1);
    let used = &weights[first + reach - at..=last + reach - at];
    (first, used, 1.0 / used.iter().sum::<f32>())
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn add_scaled(to: &mut [f32], from: &[f32], scale: f32) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to += scale * from);
}

/// Adds a row of pixels to the sums of their columns.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn add_row(gradients: &Gradients, grey: &[f32], columns: &mut [Columns]) {
    let grey = grey.chunks(LANES);
    for (((length, turn), grey), columns) in gradients.lanes().zip(grey).zip(columns) {
        let [brightness, lengths, directions @ ..] = columns;
        brightness.iter_mut().zip(grey).for_each(|(sum, grey)| *sum += grey);
        let votes: Votes<BINS> = votes(length, turn, 0.0);
        for lane in 0..LANES {
            lengths[lane] += length[lane];
        }
        for (sums, votes) in directions.iter_mut().zip(&votes) {
            for lane in 0..LANES {
                sums[lane] += votes[lane];
            }
        }
    }
}

/// Computes the values of cells from the sums of their columns: means of grey values from 0 to 1
/// and of their gradients.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn sum_columns(columns: &[Columns], row: &mut [f32]) {
    let share = 1.0 / (255.0 * (CELL * CELL) as f32);
    for (cells, columns) in row.chunks_mut(DEPTH * LANES / CELL).zip(columns) {
        for (side, cell) in cells.chunks_exact_mut(DEPTH).enumerate() {
            for (number, lanes) in cell.iter_mut().zip(columns) {
                // Centred differences span two pixels and were not halved before.
                *number = 0.5 * share * lanes[side * CELL..][..CELL].iter().sum::<f32>();
            }
            cell[0] *= 2.0; // Brightness is no difference of two pixels.
        }
    }
}
