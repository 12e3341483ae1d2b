//! Unit of boxes: pixels of the input, or fractions of its sides.

use std::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::decode::{Columns, columns_of};
use crate::family::{STRIDES, count_cells};
use crate::{InputSize, Tensor};

/// Largest offset of a raw grid, cells: places in pixels exceed it in all but the first cells.
const MAX_OFFSET: f32 = 16.0;
/// Range of fractions, with room for a box that is partly outside. A box within as many pixels is no
/// person.
const FRACTIONS: RangeInclusive<f32> = -0.5..=1.5;
/// Least difference between the mean places of the two halves of a grid, as a fraction: it is a half
/// where boxes are in their cells, and none where they are offsets.
const LEAST_SPREAD: f64 = 0.25;
/// Part of the boxes of a grid that have a size. Networks without distributions make some below zero.
const MOST: f64 = 0.9;

/// Unit of the boxes of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BoxUnit {
    /// Pixels of the input.
    Pixels,
    /// Fractions of the width and the height of the input, 0 to 1.
    Fractions,
}

/// Middles and sizes of the boxes of a grid.
struct Grid {
    places: Vec<[f32; 4]>,
    /// There is a column for each box, as in no grid with offsets.
    has_columns: bool,
}

impl Grid {
    /// Takes the boxes of an output with a row for each; none are in one with another shape.
    fn of_rows(output: &Tensor, input: InputSize) -> Self {
        let mut places = Vec::new();
        if let &[1, rows, width] = output.shape()
            && rows == count_cells(input, &STRIDES)
            && width >= 4
        {
            places.extend(output.rows().map(|row| [row[0], row[1], row[2], row[3]]));
        }
        Self { places, has_columns: false }
    }

    /// Takes the boxes of an output with a column for each.
    fn of_columns(output: &Tensor, input: InputSize) -> Self {
        let mut places = Vec::new();
        let rows: Vec<&[f32]> = output.rows().take(4).collect();
        if let (&[1, _, columns], &[x, y, width, height]) = (output.shape(), &rows[..])
            && columns == count_cells(input, &STRIDES)
        {
            places.extend((0..columns).map(|k| [x[k], y[k], width[k], height[k]]));
        }
        Self { places, has_columns: true }
    }

    fn unit(&self, input: InputSize) -> Option<BoxUnit> {
        if self.is_in_pixels() {
            Some(BoxUnit::Pixels)
        } else if self.is_in_fractions(input) {
            Some(BoxUnit::Fractions)
        } else {
            None
        }
    }

    /// Returns true if places exceed those of offsets, and near the far end of the image a middle
    /// exceeds the size of its box, as it never does where corners are meant.
    fn is_in_pixels(&self) -> bool {
        let mut sized = 0;
        let mut is_beyond = false;
        let mut is_middle = false;
        for [x, y, width, height] in &self.places {
            sized += usize::from(*width >= 0.0 && *height >= 0.0);
            is_beyond |= x.max(*y) > MAX_OFFSET;
            is_middle |= width < x || height < y;
        }
        let least = if self.has_columns { MOST } else { 1.0 };
        is_beyond && is_middle && sized as f64 >= least * self.places.len() as f64
    }

    /// Returns true if all places are fractions, and those of the cells with the first stride run
    /// from one side of the image to the other, as offsets never do.
    fn is_in_fractions(&self, input: InputSize) -> bool {
        let columns = input.width.div_ceil(STRIDES[0]);
        let rows = input.height.div_ceil(STRIDES[0]);
        let are_fractions = self.places.iter().flatten().all(|part| FRACTIONS.contains(part));
        if columns < 2 || rows < 2 || !are_fractions {
            return false;
        }
        let mut sums = [[0.0; 2]; 2];
        let mut counts = [[0.0; 2]; 2];
        for (cell, [x, y, ..]) in self.places.iter().take(rows * columns).enumerate() {
            let right = usize::from(2 * (cell % columns) >= columns);
            let lower = usize::from(2 * (cell / columns) >= rows);
            sums[0][right] += f64::from(*x);
            sums[1][lower] += f64::from(*y);
            counts[0][right] += 1.0;
            counts[1][lower] += 1.0;
        }
        [0, 1].into_iter().all(|axis| {
            let [near, far] = [0, 1].map(|half| sums[axis][half] / counts[axis][half]);
            far - near > LEAST_SPREAD
        })
    }
}

/// Returns the unit of a grid with a row of middle and size for each box; `None` for offsets in cells
/// and other numbers.
pub(crate) fn unit_of_rows(output: &Tensor, input: InputSize) -> Option<BoxUnit> {
    Grid::of_rows(output, input).unit(input)
}

/// Returns the unit of a grid with a column for each box, as [`unit_of_rows`] does.
pub(crate) fn unit_of_columns(output: &Tensor, input: InputSize) -> Option<BoxUnit> {
    Grid::of_columns(output, input).unit(input)
}

/// Returns the unit of a list of corners: fractions if those of all boxes with a score of at least
/// `min_score` are; `None` where there are no such boxes.
pub(crate) fn unit_of_list(output: &Tensor, min_score: f32) -> Option<BoxUnit> {
    let Columns { first, score, .. } = columns_of(output);
    let mut unit = None;
    for row in output.rows().filter(|row| row[score] >= min_score) {
        let corners = &row[first..first + 4];
        if corners.iter().any(|at| !FRACTIONS.contains(at)) {
            return Some(BoxUnit::Pixels);
        }
        if corners.iter().any(|at| *at != 0.0) {
            unit = Some(BoxUnit::Fractions);
        }
    }
    unit
}

#[cfg(test)]
mod tests {
    use super::*;

    fn list(rows: &[[f32; 6]]) -> Tensor {
        Tensor::new(vec![1, rows.len(), 6], rows.concat()).unwrap()
    }

    #[test]
    fn a_list_has_the_unit_of_its_confident_boxes() {
        let fraction = [0.25, 0.3, 0.4, 1.02, 0.9, 0.0];
        let pixels = [40.0, 48.0, 64.0, 160.0, 0.9, 3.0];
        let of = |rows: &[[f32; 6]]| unit_of_list(&list(rows), 0.5);
        assert_eq!(of(&[fraction, [0.0; 6]]), Some(BoxUnit::Fractions));
        assert_eq!(of(&[fraction, pixels]), Some(BoxUnit::Pixels));
        assert_eq!(of(&[[0.0; 6]; 3]), None, "nothing was found");
        let weak = [40.0, 48.0, 64.0, 160.0, 0.1, 0.0];
        assert_eq!(of(&[weak]), None);
        assert_eq!(of(&[weak, fraction]), Some(BoxUnit::Fractions));
        // Rows that fill up a list are no boxes.
        assert_eq!(unit_of_list(&list(&[[0.0; 6]; 3]), 0.0), None);
    }
}
