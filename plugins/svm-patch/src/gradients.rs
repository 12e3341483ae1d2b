//! Histograms of the gradient directions of a patch (N. Dalal and B. Triggs, CVPR 2005).

use std::f32::consts::TAU;

use crate::patch::{PIXELS, Patch, SIDE};

/// Pixels along a side of a cell.
const CELL: usize = 4;
/// Cells along a side of the patch.
const CELLS: usize = SIDE / CELL;
/// Directions in a full turn: dark before bright differs from bright before dark.
const DIRECTIONS: usize = PIXELS / (CELLS * CELLS);
/// Mean gradient strength below which a gradient is noise, grey values per pixel.
const NOISE: f32 = 1.0;

/// Returns the histograms cell by cell, each the square root of its share of the gradient strength
/// around it; the whole vector has length 1, or is zero where there are no gradients.
pub fn of(grey: &Patch) -> Patch {
    let histograms = histograms(grey);
    let mut out = [0.0; PIXELS];
    for (cell, histogram) in out.chunks_exact_mut(DIRECTIONS).enumerate() {
        // The noise term keeps flat cells near zero, instead of scaling their noise up to full
        // strength.
        let around = strength_around(&histograms, cell) + NOISE * (CELL * CELL) as f32;
        let own = &histograms[cell * DIRECTIONS..(cell + 1) * DIRECTIONS];
        histogram.iter_mut().zip(own).for_each(|(out, own)| *out = (own / around).sqrt());
    }
    let length = out.iter().map(|v| v * v).sum::<f32>().sqrt();
    if length > 0.0 {
        out.iter_mut().for_each(|v| *v /= length);
    }
    out
}

fn histograms(grey: &Patch) -> Patch {
    let mut histograms = [0.0; PIXELS];
    for at in 0..PIXELS {
        let row = at / SIDE;
        let column = at % SIDE;
        let [dx, dy] = gradient(grey, row, column);
        let turn = dy.atan2(dx).rem_euclid(TAU) / TAU * DIRECTIONS as f32;
        let lower = turn.floor();
        let first = lower as usize % DIRECTIONS;
        let cell = row / CELL * CELLS + column / CELL;
        let histogram = &mut histograms[cell * DIRECTIONS..(cell + 1) * DIRECTIONS];
        let strength = dx.hypot(dy);
        // Linear interpolation between two directions: a small rotation changes the histogram a
        // little.
        histogram[first] += (1.0 - (turn - lower)) * strength;
        histogram[(first + 1) % DIRECTIONS] += (turn - lower) * strength;
    }
    histograms
}

/// Returns half the difference of the neighbours; one-sided at the border.
fn gradient(grey: &Patch, row: usize, column: usize) -> [f32; 2] {
    let [up, left] = [row, column].map(|at| at.saturating_sub(1));
    [
        0.5 * (clamped_grey(grey, row, column + 1) - clamped_grey(grey, row, left)),
        0.5 * (clamped_grey(grey, row + 1, column) - clamped_grey(grey, up, column)),
    ]
}

/// Returns a value, or the nearest one in the last row and column.
#[inline]
fn clamped_grey(grey: &Patch, row: usize, column: usize) -> f32 {
    grey[row.min(SIDE - 1) * SIDE + column.min(SIDE - 1)]
}

/// Returns the mean gradient strength of a cell and its neighbours.
fn strength_around(histograms: &Patch, cell: usize) -> f32 {
    fn span(k: usize) -> std::ops::Range<usize> {
        k.saturating_sub(1)..(k + 2).min(CELLS)
    }
    let rows = span(cell / CELLS);
    let columns = span(cell % CELLS);
    let count = (rows.len() * columns.len()) as f32;
    let cells = rows.flat_map(|row| columns.clone().map(move |column| row * CELLS + column));
    let strengths = cells
        .map(|cell| -> f32 { histograms[cell * DIRECTIONS..(cell + 1) * DIRECTIONS].iter().sum() });
    strengths.sum::<f32>() / count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_one_direction_and_the_opposite_ramp_the_opposite_one() {
        fn ramp(slope: f32) -> Patch {
            std::array::from_fn(|at| 100.0 + slope * (at % SIDE) as f32)
        }

        for (slope, direction) in [(5.0, 0), (-5.0, DIRECTIONS / 2)] {
            let described = of(&ramp(slope));
            for histogram in described.chunks_exact(DIRECTIONS) {
                let sum: f32 = histogram.iter().sum();
                assert!(histogram[direction] > 0.1 && sum - histogram[direction] < 0.01);
            }
            assert!((described.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-4);
        }
    }

    #[test]
    fn an_edge_shows_in_its_cells_alone() {
        let edge: Patch = std::array::from_fn(|at| if at % SIDE < 10 { 50.0 } else { 150.0 });
        let described = of(&edge);
        for (cell, histogram) in described.chunks_exact(DIRECTIONS).enumerate() {
            let shows = histogram.iter().any(|v| *v > 0.0);
            assert_eq!(shows, cell % CELLS == 2, "cell {cell}");
        }
    }

    /// The descriptor by its definition, cell by cell, in double precision.
    fn slow(grey: &Patch) -> Vec<f64> {
        fn grey_at(grey: &Patch, row: i64, column: i64) -> f64 {
            let [row, column] = [row, column].map(|at| at.clamp(0, SIDE as i64 - 1) as usize);
            f64::from(grey[row * SIDE + column])
        }
        let mut cells = vec![vec![0.0; DIRECTIONS]; CELLS * CELLS];
        let mut strengths = [0.0; CELLS * CELLS];
        for row in 0..SIDE as i64 {
            for column in 0..SIDE as i64 {
                let [right, left] = [column + 1, column - 1].map(|x| grey_at(grey, row, x));
                let [below, above] = [row + 1, row - 1].map(|y| grey_at(grey, y, column));
                let dx = (right - left) / 2.0;
                let dy = (below - above) / 2.0;
                let cell = (row / 4 * 5 + column / 4) as usize;
                let strength = (dx * dx + dy * dy).sqrt();
                strengths[cell] += strength;
                let turn = dy.atan2(dx).to_degrees().rem_euclid(360.0) / 22.5;
                let part = turn.fract();
                cells[cell][turn as usize % 16] += (1.0 - part) * strength;
                cells[cell][(turn as usize + 1) % 16] += part * strength;
            }
        }
        let mut all = Vec::new();
        for (cell, own) in cells.iter().enumerate() {
            let near = (0..25_usize).filter(|other| {
                (other / 5).abs_diff(cell / 5) <= 1 && (other % 5).abs_diff(cell % 5) <= 1
            });
            let near: Vec<f64> = near.map(|other| strengths[other]).collect();
            let around = near.iter().sum::<f64>() / near.len() as f64;
            // The noise: one grey value per pixel in each of the 16 pixels.
            all.extend(own.iter().map(|own| (own / (around + 16.0)).sqrt()));
        }
        let length = all.iter().map(|v| v * v).sum::<f64>().sqrt();
        all.iter().map(|v| v / length).collect()
    }

    #[test]
    fn the_histograms_are_those_of_the_definition() {
        let mut state = 1_u32;
        // Strong in one part and weak in the others, so that the noise counts.
        let grey: Patch = std::array::from_fn(|at| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let weight = if at < PIXELS / 3 { 1.0 } else { 0.02 };
            weight * (state >> 24) as f32
        });
        for (fast, slow) in of(&grey).iter().zip(slow(&grey)) {
            assert!((f64::from(*fast) - slow).abs() < 1e-4, "{fast} {slow}");
        }
    }
}
