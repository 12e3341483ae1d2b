//! Aggregated channels: brightness, gradients and their directions, averaged over
//! small cells and compared with what is around (after P. Dollar et al., *Fast
//! feature pyramids for object detection*, PAMI 36, 2014).

use std::f32::consts::PI;

use crate::hog::CELL as HOG_CELL;

/// Side of a cell, pixels.
pub(crate) const CELL: usize = HOG_CELL / 2;
/// Directions, over half a turn.
const BINS: usize = 6;
/// Numbers of a cell: brightness, length of gradients, and length by direction.
pub(crate) const DEPTH: usize = 2 + BINS;
/// Gradients that are no longer than this, of grey values from 0 to 1, are
/// compared with this and not with those around.
const FAINT: f32 = 0.005;

/// The channels of an image, cell by cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Channels {
    columns: usize,
    rows: usize,
    values: Vec<f32>,
    /// Scratch: the lengths of gradients around a cell, and what a pass reads.
    around: Vec<f32>,
    before: Vec<f32>,
}

impl Channels {
    /// Takes the place of the channels of another image: `pixels` of grey values,
    /// `width` to a row. The outermost pixels belong to no cell; they are there
    /// for the gradients of their neighbours.
    pub fn fill(&mut self, pixels: &[f32], width: usize) {
        let height = pixels.len() / width.max(1);
        self.columns = width.saturating_sub(2) / CELL;
        self.rows = height.saturating_sub(2) / CELL;
        self.values.clear();
        self.values.resize(self.columns * self.rows * DEPTH, 0.0);
        if self.values.is_empty() {
            return;
        }
        for y in 0..self.rows * CELL {
            let rows = [0, 1, 2].map(|row| &pixels[(y + row) * width..(y + row + 1) * width]);
            self.add(rows, y / CELL);
        }
        self.compare();
        self.before.clone_from(&self.values);
        smooth(
            &self.before,
            &mut self.values,
            (self.columns, self.rows),
            DEPTH,
            &[0.25, 0.5, 0.25],
        );
    }

    /// Adds a row of pixels to its cells.
    fn add(&mut self, [above, row, below]: [&[f32]; 3], cell_row: usize) {
        let start = cell_row * self.columns * DEPTH;
        let share = 1.0 / (255.0 * (CELL * CELL) as f32);
        for (cell, values) in
            self.values[start..].chunks_exact_mut(DEPTH).take(self.columns).enumerate()
        {
            for x in cell * CELL..(cell + 1) * CELL {
                values[0] += share * row[x + 1];
                let gx = 0.5 * share * (row[x + 2] - row[x]);
                let gy = 0.5 * share * (below[x + 1] - above[x + 1]);
                let length = (gx * gx + gy * gy).sqrt();
                if length > 0.0 {
                    let (bins, part) = direction(gx, gy);
                    values[1] += length;
                    values[2 + bins[0]] += length * (1.0 - part);
                    values[2 + bins[1]] += length * part;
                }
            }
        }
    }

    /// Divides gradients by what is usual around their cell.
    fn compare(&mut self) {
        self.before.clear();
        self.before.extend(self.values.chunks_exact(DEPTH).map(|cell| cell[1]));
        self.around.clear();
        self.around.resize(self.before.len(), 0.0);
        let weights = [1.0, 2.0, 3.0, 2.0, 1.0].map(|w: f32| w / 9.0);
        smooth(&self.before, &mut self.around, (self.columns, self.rows), 1, &weights);
        for (cell, around) in self.values.chunks_exact_mut(DEPTH).zip(&self.around) {
            cell[1..].iter_mut().for_each(|value| *value /= around + FAINT);
        }
    }

    /// Numbers in a row of cells.
    pub fn stride(&self) -> usize {
        self.columns * DEPTH
    }

    /// The numbers from cell (x, y) on.
    pub fn from(&self, x: usize, y: usize) -> &[f32] {
        &self.values[(y * self.columns + x) * DEPTH..]
    }
}

/// The two nearest directions, and the share of the second.
fn direction(gx: f32, gy: f32) -> ([usize; 2], f32) {
    let angle = gy.atan2(gx);
    let angle = if angle < 0.0 { angle + PI } else { angle };
    let at = angle * (BINS as f32 / PI);
    let below = (at as usize).min(BINS);
    ([below % BINS, (below + 1) % BINS], at - below as f32)
}

/// A weighted mean over neighbours in rows and then in columns; at the border
/// what is there counts more.
fn smooth(
    from: &[f32],
    to: &mut [f32],
    (columns, rows): (usize, usize),
    depth: usize,
    weights: &[f32],
) {
    let reach = weights.len() / 2;
    let pass = |from: &[f32], to: &mut [f32], at: usize, length: usize, step: usize, i: usize| {
        let first = i.saturating_sub(reach);
        let last = (i + reach).min(length - 1);
        let used = &weights[first + reach - i..=last + reach - i];
        let total: f32 = used.iter().sum();
        for channel in 0..depth {
            let neighbours = used.iter().enumerate();
            let sum: f32 =
                neighbours.map(|(k, w)| w * from[at + (first + k) * step * depth + channel]).sum();
            to[at + i * step * depth + channel] = sum / total;
        }
    };
    let mut across = vec![0.0_f32; from.len()];
    for y in 0..rows {
        (0..columns).for_each(|x| pass(from, &mut across, y * columns * depth, columns, 1, x));
    }
    for x in 0..columns {
        (0..rows).for_each(|y| pass(&across, to, x * depth, rows, columns, y));
    }
}
