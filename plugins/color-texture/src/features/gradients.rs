use std::f32::consts::PI;

use super::window::{Grid, SIDE};

/// Rows and columns of a block, in cells of the window.
const BLOCK: usize = 4;
/// Blocks along each side.
const BLOCKS: usize = SIDE / BLOCK;
/// Directions in 180 degrees.
const DIRECTIONS: usize = 9;

/// Numbers of the gradients.
pub const COUNT: usize = BLOCKS * BLOCKS * DIRECTIONS;

/// Gradients weaker than this on average are noise: grey values per cell.
const NOISE: f32 = 1.0;

/// Histograms of gradient directions without sign, one a block, each divided by
/// the strength around it (after Dalal and Triggs, CVPR 2005).
pub fn push(grey: &Grid<f32>, out: &mut Vec<f32>) {
    let histograms = histograms(grey);
    let strength: [f32; BLOCKS * BLOCKS] =
        std::array::from_fn(|block| histograms[block].iter().sum());
    for (block, histogram) in histograms.iter().enumerate() {
        let around = around(&strength, block) + NOISE * (BLOCK * BLOCK) as f32;
        out.extend(histogram.iter().map(|v| v / around));
    }
}

fn histograms(grey: &Grid<f32>) -> [[f32; DIRECTIONS]; BLOCKS * BLOCKS] {
    let mut histograms = [[0.0; DIRECTIONS]; BLOCKS * BLOCKS];
    for cell in 0..SIDE * SIDE {
        let (row, column) = (cell / SIDE, cell % SIDE);
        let [dx, dy] = gradient(grey, row, column);
        let turn = dy.atan2(dx).rem_euclid(PI) / PI * DIRECTIONS as f32 - 0.5;
        let lower = turn.floor();
        let part = turn - lower;
        let first = (lower as i32).rem_euclid(DIRECTIONS as i32) as usize;
        let histogram = &mut histograms[row / BLOCK * BLOCKS + column / BLOCK];
        let length = dx.hypot(dy);
        histogram[first] += (1.0 - part) * length;
        histogram[(first + 1) % DIRECTIONS] += part * length;
    }
    histograms
}

/// Half the difference of the neighbours; one-sided at the border.
fn gradient(grey: &Grid<f32>, row: usize, column: usize) -> [f32; 2] {
    let at = |row: usize, column: usize| grey[row.min(SIDE - 1) * SIDE + column.min(SIDE - 1)];
    [
        0.5 * (at(row, column + 1) - at(row, column.saturating_sub(1))),
        0.5 * (at(row + 1, column) - at(row.saturating_sub(1), column)),
    ]
}

/// Mean strength of a block and its neighbours.
fn around(strength: &[f32; BLOCKS * BLOCKS], block: usize) -> f32 {
    let span = |k: usize| k.saturating_sub(1)..(k + 2).min(BLOCKS);
    let (rows, columns) = (span(block / BLOCKS), span(block % BLOCKS));
    let count = (rows.len() * columns.len()) as f32;
    let each = rows.flat_map(|row| columns.clone().map(move |column| row * BLOCKS + column));
    each.map(|block| strength[block]).sum::<f32>() / count
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
