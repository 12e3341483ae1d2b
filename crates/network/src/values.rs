//! Recognition of the family from the numbers in the outputs, where shapes are alike, and of the
//! unit of boxes: pixels of the input, or fractions of its sides.

use std::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::decode::{Columns, columns_of, scores_and_sides};
use crate::family::{NANODET_M_BINS, STRIDES, count_cells};
use crate::{Family, InputSize, Tensor};

/// Maximum offset in cells, and maximum logarithm of a size in cells, in a raw grid: a box is not
/// `exp(16)` cells wide, and pixels exceed this value in all but the first cells.
const MAX_RAW: f32 = 16.0;
/// Tolerance for rounded probabilities.
const ROUNDING: f32 = 1e-3;
/// Tolerance for rounded corners, pixels.
const ROUNDING_PX: f32 = 1.0;
/// Number of columns for the four of the box and the 80 classes of COCO: without and with an
/// objectness.
const COCO_COLUMNS: [usize; 2] = [84, 85];

/// Returns true if the numbers in the outputs, whose shapes are those of a family, are plausible
/// for it.
pub(crate) fn fits(family: Family, outputs: &[(&str, &Tensor)], input: InputSize) -> bool {
    let [(_, output)] = outputs else {
        // Several outputs are recognised by their names, or by their shapes for each stride.
        return family != Family::NanoDetM || scores_and_sides(outputs, input).is_some();
    };
    if is_empty(output) {
        return true;
    }
    match family {
        Family::Yolox => is_raw_grid(output, input) || has_boxes(output, 5, input),
        Family::YoloV8 if is_transposed(output, input) => has_boxes(output, 4, input),
        Family::YoloV8 => is_grid_of_columns(output, input),
        Family::NanoDetM => bins_of(output).is_some(),
        Family::YoloV10 => is_list(output, input),
        _ => true,
    }
}

/// Returns true for an output of zeros only. Lists are empty in this way if nothing was found, and
/// then do not show their family.
pub(crate) fn is_empty(output: &Tensor) -> bool {
    output.values().iter().all(|value| *value == 0.0)
}

/// Returns true if the output of YOLOv8 has a row for each box. If it has as many rows as columns,
/// the numbers decide.
pub(crate) fn is_transposed(output: &Tensor, input: InputSize) -> bool {
    let cells = count_cells(input, &STRIDES);
    let &[1, rows, width] = output.shape() else { return false };
    rows == cells && (width != cells || has_boxes(output, 4, input))
}

/// Returns true for a probability, with a tolerance for rounding.
pub(crate) fn is_score(value: f32) -> bool {
    (-ROUNDING..=1.0 + ROUNDING).contains(&value)
}

/// Returns true for a class index.
fn is_label(value: f32) -> bool {
    value >= 0.0 && value.fract() == 0.0
}

/// Returns true for a grid with offsets and logarithms of sizes in cells, and scores.
fn is_raw_grid(output: &Tensor, input: InputSize) -> bool {
    let is_raw = output.rows().all(|row| {
        let (place, scores) = row.split_at(4);
        place.iter().all(|value| value.abs() <= MAX_RAW) && scores.iter().copied().all(is_score)
    });
    is_raw && unit_of_rows(output, input) != Some(BoxUnit::Fractions)
}

/// Returns true for a grid with centres and sizes, and scores; `first` is the first column of a
/// class.
fn has_boxes(output: &Tensor, first: usize, input: InputSize) -> bool {
    let width = output.shape().last().copied().unwrap_or(0);
    let other = COCO_COLUMNS[usize::from(first == 4)];
    width > first
        && width != other
        && unit_of_rows(output, input).is_some()
        && output.rows().all(|row| row[4..].iter().copied().all(is_score))
}

/// Returns true for a grid with a column for each box: centres and sizes, and scores of the first
/// class. The rows below may be those of other classes, of joints, or of an angle.
fn is_grid_of_columns(output: &Tensor, input: InputSize) -> bool {
    let has_scores = output.rows().nth(4).is_some_and(|row| row.iter().copied().all(is_score));
    has_scores && unit_of_columns(output, input).is_some()
}

/// Returns the bins of a distribution in the rows of NanoDet before Plus, which begin with scores.
pub(crate) fn bins_of(output: &Tensor) -> Option<usize> {
    let width = output.shape().last().copied()?;
    NANODET_M_BINS.into_iter().find(|bins| {
        let Some(classes) = width.checked_sub(4 * bins).filter(|classes| *classes > 0) else {
            return false;
        };
        let are_scores = output.rows().all(|row| row[..classes].iter().copied().all(is_score));
        let mut sides = output.rows().flat_map(|row| &row[classes..]);
        are_scores && sides.any(|value| !is_score(*value))
    })
}

/// Returns true for a list of boxes given by corners, with scores and classes.
fn is_list(output: &Tensor, input: InputSize) -> bool {
    let Columns { first, score, label } = columns_of(output);
    let side = input.width.max(input.height) as f32;
    output.rows().all(|row| {
        let [left, top, right, bottom] = [0, 1, 2, 3].map(|k| row[first + k]);
        let is_inside =
            [left, top, right, bottom].iter().all(|at| (-side..=2.0 * side).contains(at));
        let is_box = right >= left - ROUNDING_PX && bottom >= top - ROUNDING_PX;
        let has_image = first == 0 || is_label(row[0]);
        is_inside && is_box && has_image && is_score(row[score]) && is_label(row[label])
    })
}

/// Maximum offset of a raw grid, cells: positions in pixels exceed it in all but the first cells.
const MAX_OFFSET: f32 = 16.0;
/// Range of fractions, with a margin for boxes that are partly outside. A box within this number of
/// pixels is too small for a person.
const FRACTIONS: RangeInclusive<f32> = -0.5..=1.5;
/// Minimum difference between the mean positions of the two halves of a grid, as a fraction: about
/// one half if boxes are in their cells, and zero if the numbers are offsets.
const LEAST_SPREAD: f64 = 0.25;
/// Fraction of the boxes of a grid that must have a positive size. Networks without distributions
/// give some negative ones.
const MOST: f64 = 0.9;

/// Order of the coordinates of corners in a list of boxes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum BoxOrder {
    /// Left, top, right, bottom.
    #[default]
    Xyxy,
    /// Top, left, bottom, right.
    Yxyx,
}

impl BoxOrder {
    /// Returns four coordinates as left, top, right and bottom.
    pub(crate) fn sorted(self, corners: &[f32]) -> [f32; 4] {
        let places = match self {
            Self::Xyxy => [0, 1, 2, 3],
            Self::Yxyx => [1, 0, 3, 2],
        };
        places.map(|k| corners[k])
    }
}

/// Unit of the boxes of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum BoxUnit {
    /// Pixels of the input.
    Pixels,
    /// Fractions of the width and the height of the input, 0 to 1.
    Fractions,
}

/// Centres and sizes of the boxes of a grid.
struct Grid {
    places: Vec<[f32; 4]>,
    /// True if there is a column for each box; grids with offsets never have that.
    has_columns: bool,
}

impl Grid {
    /// Reads the boxes of an output with a row for each; an output of another shape has none.
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

    /// Reads the boxes of an output with a column for each.
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

    /// Returns true if positions exceed the range of offsets, and a centre near the far end of the
    /// image exceeds the size of its box, which never happens if the numbers are corners.
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

    /// Returns true if all positions are fractions, and those of the cells with the first stride
    /// cover the image from one side to the other, as offsets never do.
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

/// Returns the unit of a grid with a row of centre and size for each box; `None` for offsets in
/// cells and other numbers.
pub(crate) fn unit_of_rows(output: &Tensor, input: InputSize) -> Option<BoxUnit> {
    Grid::of_rows(output, input).unit(input)
}

/// Returns the unit of a grid with a column for each box, as [`unit_of_rows`] does.
pub(crate) fn unit_of_columns(output: &Tensor, input: InputSize) -> Option<BoxUnit> {
    Grid::of_columns(output, input).unit(input)
}

/// Returns the unit of a list of corners: fractions if all boxes with a score of at least
/// `min_score` have fractions; `None` without such boxes.
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
    use crate::family::recognise;

    const INPUT: InputSize = InputSize { width: 64, height: 64, channels_last: false };

    /// Returns the family of one output whose rows are made by `row`.
    fn of_rows(shape: &[usize], row: impl Fn(usize) -> Vec<f32>) -> Result<Family, String> {
        let rows = shape[shape.len() - 2];
        let values = (0..rows).flat_map(row).collect();
        let output = Tensor::new(shape.to_vec(), values).unwrap();
        recognise(&[("output", &output)], INPUT)
    }

    /// Returns the middle and the size, pixels, of a box at a cell of a grid of 64 x 64 pixels.
    fn pixels(cell: usize) -> Vec<f32> {
        let (cell, side, stride) = match cell {
            0..64 => (cell, 8, 8.0),
            64..80 => (cell - 64, 4, 16.0),
            _ => (cell - 80, 2, 32.0),
        };
        let [x, y] = [cell % side, cell / side].map(|at| (at as f32 + 0.5) * stride);
        vec![x, y, 1.2 * stride, 1.5 * stride]
    }

    /// Returns a raw offset and a raw size.
    fn offsets(cell: usize) -> Vec<f32> {
        vec![0.3, 0.7, -0.2 * (cell % 3) as f32, 0.6]
    }

    fn corners(cell: usize) -> Vec<f32> {
        let [x, y, width, height] = pixels(cell)[..] else { unreachable!() };
        vec![x - width / 2.0, y - height / 2.0, x + width / 2.0, y + height / 2.0]
    }

    fn with(place: Vec<f32>, scores: &[f32]) -> Vec<f32> {
        [place, scores.to_vec()].concat()
    }

    #[test]
    fn grids_of_one_shape_are_told_apart() {
        fn coco(width: usize) -> Result<Family, String> {
            of_rows(&[1, 84, width], |cell| with(pixels(cell), &vec![0.1; width - 4]))
        }

        let six = [1, 84, 6];
        let raw = of_rows(&six, |cell| with(offsets(cell), &[0.1, 0.4]));
        assert_eq!(raw, Ok(Family::Yolox));
        let list = of_rows(&six, |cell| with(corners(cell), &[0.1, 0.0]));
        assert_eq!(list, Ok(Family::YoloV10), "DeepStream");
        let last = of_rows(&six, |cell| with(corners(cell), &[0.0, 0.1]));
        assert_eq!(last, Ok(Family::YoloV10), "the score last");
        let why = of_rows(&six, |cell| with(pixels(cell), &[0.1, 0.4])).unwrap_err();
        assert!(why.contains("`yolox` (YOLOX) or `yolov8`"), "{why}");
        let one = of_rows(&[1, 84, 5], |cell| with(pixels(cell), &[0.1]));
        assert_eq!(one, Ok(Family::YoloV8), "an objectness needs a class");
        assert_eq!((coco(84), coco(85)), (Ok(Family::YoloV8), Ok(Family::Yolox)));
    }

    /// The list of `network-family-by-shape` of the field data: one box, and nothing else.
    #[test]
    fn a_list_with_a_row_for_each_cell_is_no_grid() {
        fn row(cell: usize) -> Vec<f32> {
            match cell {
                0 => vec![15.0, 5.0, 35.0, 60.0, 0.9, 0.0],
                _ => vec![0.0; 6],
            }
        }

        assert_eq!(of_rows(&[1, 84, 6], row), Ok(Family::YoloV10));
    }

    #[test]
    fn lists_of_one_box_are_told_from_other_rows() {
        fn list(row: &[f32]) -> Result<Family, String> {
            of_rows(&[1, row.len()], |_| row.to_vec())
        }

        assert_eq!(list(&[0.0, 10.0, 5.0, 30.0, 60.0, 0.0, 0.8]), Ok(Family::YoloV10));
        assert_eq!(list(&[10.0, 5.0, 30.0, 60.0, 0.8, 0.0]), Ok(Family::YoloV10));
        assert!(list(&[0.2, -0.1, 0.3, 0.6, 0.1, -0.2, 0.8]).is_err());
        assert!(list(&[0.2, 0.1, 0.1, 0.6, 0.1, 0.2]).is_err());
    }

    /// A list in which nothing was found is zeros alone, whatever grid has as many rows.
    #[test]
    fn zeros_are_those_of_every_family_with_the_shape() {
        for (width, families) in [
            (6, ["`yolox`", "`yolov8`", "`yolov10`"].as_slice()),
            (7, &["`yolox`", "`yolov8`", "`yolov10`"]),
            (85, &["`yolox`", "`yolov8`", "`nanodet-m`"]),
        ] {
            let why = of_rows(&[1, 84, width], |_| vec![0.0; width]).unwrap_err();
            assert!(families.iter().all(|family| why.contains(family)), "{why}");
            assert!(why.contains("all zero") && why.contains("set `family`"), "{why}");
        }
    }

    #[test]
    fn lists_of_one_image_may_begin_with_its_number() {
        fn row(cell: usize) -> Vec<f32> {
            match cell {
                0 => vec![0.0, 15.0, 5.0, 35.0, 60.0, 0.0, 0.9],
                _ => vec![0.0; 7],
            }
        }

        assert_eq!(of_rows(&[1, 84, 7], row), Ok(Family::YoloV10), "as many as cells");
        assert_eq!(of_rows(&[1, 30, 7], row), Ok(Family::YoloV10));
    }

    /// Returns the family of a grid with a column for each box, of these scores and other rows.
    fn of_columns(place: impl Fn(usize) -> Vec<f32>, others: &[f32]) -> Result<Family, String> {
        let boxes: Vec<Vec<f32>> = (0..84).map(|cell| with(place(cell), others)).collect();
        let height = 4 + others.len();
        let values = (0..height).flat_map(|part| boxes.iter().map(move |row| row[part])).collect();
        recognise(&[("output", &Tensor::new(vec![1, height, 84], values).unwrap())], INPUT)
    }

    #[test]
    fn grids_of_columns_have_boxes_and_scores() {
        assert_eq!(of_columns(pixels, &[0.1, 0.4]), Ok(Family::YoloV8));
        assert_eq!(of_columns(pixels, &[0.1, 30.0, 20.0]), Ok(Family::YoloV8), "a joint");
        for (place, scores) in [
            (&pixels as &dyn Fn(usize) -> Vec<f32>, [-6.0, 3.0]),
            (&offsets, [0.1, 0.4]),
            (&|_| vec![-900.0; 4], [0.1, 0.4]),
        ] {
            let why = of_columns(place, &scores).unwrap_err();
            assert!(
                why.contains("the shape of `yolov8`") && why.contains("not its numbers"),
                "{why}"
            );
        }
    }

    /// Returns the middle and the size of a box at a cell as fractions of the image.
    fn fractions(cell: usize) -> Vec<f32> {
        pixels(cell).into_iter().map(|part| part / 64.0).collect()
    }

    #[test]
    fn grids_in_fractions_of_the_image_are_no_offsets() {
        fn of(width: usize) -> Result<Family, String> {
            of_rows(&[1, 84, width], |cell| with(fractions(cell), &vec![0.1; width - 4]))
        }

        assert_eq!((of(84), of(85)), (Ok(Family::YoloV8), Ok(Family::Yolox)));
        assert_eq!(of(5), Ok(Family::YoloV8));
        let why = of(6).unwrap_err();
        assert!(why.contains("`yolox` (YOLOX) or `yolov8`"), "{why}");
        assert_eq!(of_columns(fractions, &[0.1, 0.4]), Ok(Family::YoloV8));
    }

    #[test]
    fn numbers_of_no_family_are_refused() {
        let why = of_rows(&[1, 84, 6], |_| vec![-900.0; 6]).unwrap_err();
        assert!(
            why.contains("the shape of `yolox`") && why.contains("but not its numbers"),
            "{why}"
        );
    }

    #[test]
    fn nanodet_before_plus_is_known_by_its_distributions() {
        fn logits(count: usize) -> Vec<f32> {
            (0..count).map(|k| k as f32 - 3.0).collect::<Vec<f32>>()
        }

        fn by_stride(scores: f32) -> Result<Family, String> {
            fn tensor(cells: usize, row: &[f32]) -> Tensor {
                Tensor::new(vec![1, cells, row.len()], row.repeat(cells)).unwrap()
            }
            let outputs =
                [4, 64, 16].map(|cells| [tensor(cells, &logits(44)), tensor(cells, &[scores; 80])]);
            let named: Vec<(&str, &Tensor)> =
                outputs.iter().flatten().map(|output| ("", output)).collect();
            recognise(&named, INPUT)
        }

        for bins in NANODET_M_BINS {
            assert_eq!(
                of_rows(&[1, 84, 80 + 4 * bins], |_| with(vec![0.1; 80], &logits(4 * bins))),
                Ok(Family::NanoDetM)
            );
        }
        assert_eq!(by_stride(0.1), Ok(Family::NanoDetM));
        assert!(by_stride(-4.0).unwrap_err().contains("not its numbers"), "logits");
    }
}

#[cfg(test)]
mod unit_tests {
    use super::*;

    fn list(rows: &[[f32; 6]]) -> Tensor {
        Tensor::new(vec![1, rows.len(), 6], rows.concat()).unwrap()
    }

    #[test]
    fn a_list_has_the_unit_of_its_confident_boxes() {
        fn of(rows: &[[f32; 6]]) -> Option<BoxUnit> {
            unit_of_list(&list(rows), 0.5)
        }

        let fraction = [0.25, 0.3, 0.4, 1.02, 0.9, 0.0];
        let pixels = [40.0, 48.0, 64.0, 160.0, 0.9, 3.0];
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
