//! Depth at the centres of all windows of one size.
//!
//! Windows are a quarter of their square apart, and the depth of a window is read at five by five
//! points that are an eighth of the square apart. Neighbouring windows therefore share points: all
//! windows together are read on one lattice, each point once. Counts of the readings before and
//! behind a range show whether the median of a window's readings lies within it.

use std::ops::{Range, RangeInclusive};

use tagalong_core::DepthImage;

use crate::Grid;

/// Number of places along a side of a window.
const TAPS: usize = 5;
/// Number of places from a window to the next one.
const STRIDE: usize = 2;
/// Number of places to a side of the square, and from its edge to the first place.
const PLACES: f64 = 8.0;
const EDGE: f64 = 2.0;
/// Fewest readings of a window that has a depth.
const LEAST_READINGS: u32 = 8;

/// Counts of readings packed into one number: all, those before a range, those behind.
type Counts = u32;
const BITS: u32 = 8;

/// Readings of all windows of one size; the memory is reused for the next size.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lattice {
    /// Image column of each column of places.
    columns: Vec<usize>,
    /// Depths row by row, m; NaN outside of the image.
    readings: Vec<f32>,
    counts: Vec<Counts>,
    /// Scratch: counts of a row of windows, and of the places between them.
    sums: Vec<Counts>,
    /// For each window, row by row: true if its depth lies within the range.
    is_within: Vec<bool>,
    /// Number of windows in a row.
    across: usize,
}

impl Lattice {
    /// Reads the depths of the windows of a grid, and tests if they lie within a range, m.
    pub(crate) fn fill(&mut self, depth: &DepthImage, grid: &Grid, range_m: RangeInclusive<f64>) {
        let [across, down] = [&grid.columns, &grid.rows].map(|cells| cells.clone().count());
        let first = grid.square(grid.columns.start, grid.rows.start);
        self.read(depth, places(first.x, first.width, across), places(first.y, first.width, down));
        let least = *range_m.start() as f32;
        let most = *range_m.end() as f32;
        count(&self.readings, least, most, &mut self.counts);
        self.across = across;
        self.is_within.clear();
        for y in 0..down {
            let rows = self.window_rows(y).map(|row| &self.counts[row]);
            add_places(rows, &mut self.sums);
            self.is_within.extend(self.sums.iter().step_by(STRIDE).copied().map(is_middle_within));
        }
    }

    fn read(
        &mut self,
        depth: &DepthImage,
        columns: impl Iterator<Item = usize>,
        rows: impl Iterator<Item = usize>,
    ) {
        self.columns.clear();
        self.columns.extend(columns);
        self.readings.clear();
        for y in rows {
            let row = if y < depth.height() { depth.row(y) } else { &[] };
            self.readings
                .extend(self.columns.iter().map(|x| row.get(*x).copied().unwrap_or(f32::NAN)));
        }
    }

    /// Returns the depth of a window, m: the median of its readings, if that is within the range.
    /// Windows are counted row by row.
    pub(crate) fn surface_m(&self, window: usize) -> Option<f64> {
        self.is_within.get(window).filter(|is_within| **is_within)?;
        let x = window % self.across;
        let y = window / self.across;
        let mut readings = [f32::NAN; TAPS * TAPS];
        for (readings, row) in readings.chunks_exact_mut(TAPS).zip(self.window_rows(y)) {
            readings.copy_from_slice(&self.readings[row][STRIDE * x..][..TAPS]);
        }
        Some(f64::from(median(readings)))
    }

    /// Returns the ranges of the rows of places that belong to row `y` of windows.
    fn window_rows(&self, y: usize) -> [Range<usize>; TAPS] {
        let width = self.columns.len();
        std::array::from_fn(|row| {
            let row = STRIDE * y + row;
            row * width..(row + 1) * width
        })
    }
}

/// Returns the columns or rows of the image at which `windows` are read, the first of which begins
/// at `from`; negative ones become larger than any image.
fn places(from: f64, side: f64, windows: usize) -> impl Iterator<Item = usize> {
    let count = if windows == 0 { 0 } else { STRIDE * (windows - 1) + TAPS };
    (0..count).map(move |k| (from + side * (EDGE + k as f64) / PLACES).floor() as i64 as usize)
}

#[inline(always)]
fn is_reading(metres: f32) -> bool {
    (metres > 0.0) & (metres < f32::INFINITY)
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn count(readings: &[f32], least: f32, most: f32, counts: &mut Vec<Counts>) {
    counts.resize(readings.len(), 0);
    for (count, metres) in counts.iter_mut().zip(readings) {
        let before = *metres < least;
        let behind = *metres > most;
        let one = 1 | Counts::from(before) << BITS | Counts::from(behind) << (2 * BITS);
        *count = if is_reading(*metres) { one } else { 0 };
    }
}

/// Sums the counts of five by five places, for each place at which they begin.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn add_places(rows: [&[Counts]; TAPS], sums: &mut Vec<Counts>) {
    let [a, b, c, d, e] = rows;
    sums.resize(a.len(), 0);
    for (i, sum) in sums.iter_mut().enumerate() {
        *sum = a[i] + b[i] + c[i] + d[i] + e[i];
    }
    // In place: each sum reads only counts that were not overwritten before.
    for i in 0..(sums.len() + 1).saturating_sub(TAPS) {
        sums[i] = sums[i] + sums[i + 1] + sums[i + 2] + sums[i + 3] + sums[i + 4];
    }
    sums.truncate((sums.len() + 1).saturating_sub(TAPS));
}

/// Returns the median of the valid readings (of an even number the farther one). The bits of
/// positive numbers are in the order of the numbers.
fn median(readings: [f32; TAPS * TAPS]) -> f32 {
    fn key(metres: f32) -> u32 {
        if is_reading(metres) { metres.to_bits() } else { u32::MAX }
    }

    let mut keys = readings.map(key);
    keys.sort_unstable();
    f32::from_bits(keys[keys.partition_point(|key| *key < u32::MAX) / 2])
}

/// Returns true if there are enough readings, and the median (of an even number the farther one) is
/// neither before the range nor behind it.
fn is_middle_within(counts: Counts) -> bool {
    let [all, before, behind] = [0, 1, 2].map(|kind| counts >> (kind * BITS) & ((1 << BITS) - 1));
    let middle = all / 2;
    all >= LEAST_READINGS && before <= middle && behind < all - middle
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn windows_on_a_lattice_show_what_each_alone_shows(
            side in 4.01..20.0f64, width in 3..60usize, height in 3..40usize,
            holes in 2..9usize, near in 0.0..4.0f32, long in 0.0..3.0f32,
        ) {
            let depth = DepthImage::from_fn(width, height, |x, y| match (x * 7 + y * 13) % holes {
                0 => f32::NAN,
                1 => 0.0,
                _ => ((x * 31 + y * 17) % 50) as f32 * 0.1,
            });
            let range = f64::from(near)..=f64::from(near + long);
            let grid = Grid::new((width + 2, height + 2), side);
            let mut lattice = Lattice::default();
            lattice.fill(&depth, &grid, range.clone());
            let mut found = Vec::new();
            let slow: Vec<Option<f64>> = grid
                .windows(|square| {
                    found.push(lattice.surface_m(found.len()));
                    Some(depth.surface_m(square).filter(|m| range.contains(m)))
                })
                .map(|window| window.depth_m)
                .collect();
            prop_assert_eq!(found, slow);
        }
    }
}
