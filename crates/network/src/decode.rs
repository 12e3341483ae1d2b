//! Decoding of the outputs of a family into boxes, in pixels of the network's input.

use nalgebra::Point2;
use tagalong_core::{Joint, Joints};
use tagalong_geometry::Rect;

use crate::family::{NANODET_BINS, NANODET_M_BINS, NANODET_STRIDES, STRIDES, count_cells};
use crate::values::{bins_of, is_score, is_transposed, unit_of_list, unit_of_rows};
use crate::{BoxOrder, BoxUnit, Family, InputSize, Tensor};

/// Number of joints of a person.
const JOINTS: usize = 17;
/// Rows of YOLOv8 for people with joints: the box, the score, and column, row and score of each joint.
const POSE_ROWS: usize = 5 + 3 * JOINTS;
/// Fraction of the height between the highest and the lowest joint by which a person extends above
/// the eyes, and below the ankles.
const ABOVE_EYES: f64 = 0.08;
const BELOW_ANKLES: f64 = 0.05;

/// Box with a score.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ScoredBox {
    /// Box around the whole person.
    pub rect: Rect,
    /// Probability of a person, 0 to 1.
    pub score: f32,
    /// Joints of the person, if the network finds them.
    pub joints: Option<Joints>,
}

/// Selection of boxes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted<'a> {
    /// Classes of people.
    pub classes: &'a [usize],
    /// Boxes with a lower score are left out.
    pub min_score: f32,
    /// Order of the corners of a list.
    pub order: BoxOrder,
}

impl Wanted<'_> {
    /// Returns the highest score of the classes of people.
    fn best(&self, score: impl Fn(usize) -> Option<f32>) -> f32 {
        // `f32::max` ignores NaN.
        self.classes.iter().filter_map(|class| score(*class)).fold(f32::NEG_INFINITY, f32::max)
    }

    fn has_label(&self, label: f32) -> bool {
        self.classes.iter().any(|class| (label - *class as f32).abs() < 0.5)
    }

    /// Returns the box if its score and its size are plausible.
    fn take(&self, score: f32, rect: impl FnOnce() -> Rect) -> Option<ScoredBox> {
        if score.is_nan() || score < self.min_score {
            return None;
        }
        let rect = rect();
        (rect.is_sane() && rect.area() > 0.0).then(|| ScoredBox {
            rect,
            score: score.min(1.0),
            joints: None,
        })
    }
}

/// Returns the boxes of people in outputs whose shapes fit the family ([`Family::classes`]), in
/// pixels of the input. If no unit of the boxes is given, it is recognised from the numbers in the
/// lists.
pub(crate) fn decode(
    family: Family,
    outputs: &[(&str, &Tensor)],
    input: InputSize,
    unit: Option<BoxUnit>,
    wanted: Wanted<'_>,
) -> Vec<ScoredBox> {
    let first = outputs.first().map(|(_, output)| *output);
    let list = first.filter(|_| family == Family::YoloV10);
    let unit = unit.or_else(|| unit_of_list(list?, wanted.min_score));
    let found = match family {
        Family::Yolox => first.map(|output| yolox(output, input, unit, wanted)),
        Family::YoloV8 => first.map(|output| {
            if is_transposed(output, input) {
                yolo_v8_rows(output, wanted)
            } else {
                yolo_v8(output, wanted)
            }
        }),
        Family::YoloV10 => first.map(|output| yolo_v10(output, wanted)),
        Family::NanoDet => first.map(|output| nanodet(output, input, wanted)),
        Family::NanoDetM => nanodet_m(outputs, input, wanted),
        Family::MoveNet => first.map(|output| movenet(output, input, wanted)),
        Family::RtDetr => outputs_named(outputs, ["labels", "boxes", "scores"])
            .map(|[labels, boxes, scores]| rt_detr(labels, boxes, scores, wanted)),
        Family::RfDetr => outputs_named(outputs, ["dets", "labels"])
            .map(|[boxes, labels]| rf_detr(boxes, labels, input, wanted)),
        Family::RtmDet => outputs_named(outputs, ["dets", "labels"])
            .map(|[boxes, labels]| rtmdet(boxes, labels, wanted)),
    };
    let mut found = found.unwrap_or_default();
    if family.has_unit() && unit == Some(BoxUnit::Fractions) {
        found.iter_mut().for_each(|person| scale(person, input));
    }
    found
}

/// Returns the outputs with these names, if the network has them all.
fn outputs_named<'a, const N: usize>(
    outputs: &[(&str, &'a Tensor)],
    names: [&str; N],
) -> Option<[&'a Tensor; N]> {
    let mut found = Vec::new();
    for name in names {
        found.push(outputs.iter().find(|(known, _)| *known == name)?.1);
    }
    found.try_into().ok()
}

/// Converts a box and its joints from fractions of the input to pixels.
fn scale(person: &mut ScoredBox, input: InputSize) {
    let [columns, rows] = [input.width as f64, input.height as f64];
    let Rect { x, y, width, height } = person.rect;
    person.rect = Rect::new(x * columns, y * rows, width * columns, height * rows);
    let joints = person.joints.take();
    person.joints =
        joints.map(|joints| joints.moved(|at| Point2::new(at.x * columns, at.y * rows)));
}

/// Returns column, row and stride of each grid cell, in the order of the outputs.
fn cells(input: InputSize, strides: &[usize]) -> impl Iterator<Item = [f64; 3]> + '_ {
    strides.iter().flat_map(move |&stride| {
        let columns = input.width.div_ceil(stride);
        let rows = input.height.div_ceil(stride);
        (0..rows * columns)
            .map(move |cell| [(cell % columns) as f64, (cell / columns) as f64, stride as f64])
    })
}

fn around(x: f64, y: f64, width: f64, height: f64) -> Rect {
    Rect::new(x - 0.5 * width, y - 0.5 * height, width, height)
}

/// Returns the box of a row that begins with its centre and its size.
fn around_row(row: &[f32]) -> Rect {
    let [x, y, width, height] = [0, 1, 2, 3].map(|k| f64::from(row[k]));
    around(x, y, width, height)
}

fn between(corners: &[f32]) -> Rect {
    let [left, top, right, bottom] = [0, 1, 2, 3].map(|k| f64::from(corners[k]));
    Rect::new(left, top, right - left, bottom - top)
}

fn yolox(
    output: &Tensor,
    input: InputSize,
    unit: Option<BoxUnit>,
    wanted: Wanted<'_>,
) -> Vec<ScoredBox> {
    if unit.or_else(|| unit_of_rows(output, input)).is_some() {
        let found = output.rows().filter_map(|row| {
            let score = row[4] * wanted.best(|class| row.get(5 + class).copied());
            wanted.take(score, || around_row(row))
        });
        return found.collect();
    }
    let found =
        output.rows().zip(cells(input, &STRIDES)).filter_map(|(row, [column, line, stride])| {
            let [x, y, width, height] = [0, 1, 2, 3].map(|k| f64::from(row[k]));
            let score = row[4] * wanted.best(|class| row.get(5 + class).copied());
            wanted.take(score, || {
                let x = (x + column) * stride;
                let y = (y + line) * stride;
                around(x, y, width.exp() * stride, height.exp() * stride)
            })
        });
    found.collect()
}

fn yolo_v8(output: &Tensor, wanted: Wanted<'_>) -> Vec<ScoredBox> {
    let rows: Vec<&[f32]> = output.rows().collect();
    let boxes = rows.first().map_or(0, |row| row.len());
    let has_joints = has_pose_rows(&rows);
    let found = (0..boxes).filter_map(|k| {
        let score = wanted.best(|class| rows.get(4 + class).map(|row| row[k]));
        let [x, y, width, height] = [0, 1, 2, 3].map(|part| f64::from(rows[part][k]));
        let person = wanted.take(score, || around(x, y, width, height))?;
        let joints = has_joints.then(|| {
            joints_of(|joint| {
                let first = 5 + 3 * joint;
                [rows[first][k], rows[first + 1][k], rows[first + 2][k]]
            })
        });
        Some(ScoredBox { joints, ..person })
    });
    found.collect()
}

/// Returns true if the rows after the score are those of joints rather than of classes, because
/// their coordinates are not scores.
fn has_pose_rows(rows: &[&[f32]]) -> bool {
    rows.len() == POSE_ROWS && rows[5].iter().any(|value| !is_score(*value))
}

/// Returns the joints of a person; each consists of column and row, pixels of the input, and score.
fn joints_of(joint: impl Fn(usize) -> [f32; 3]) -> Joints {
    let mut all = [Joint { at: Point2::origin(), score: 0.0 }; JOINTS];
    for (index, place) in all.iter_mut().enumerate() {
        let [x, y, score] = joint(index).map(f64::from);
        *place = Joint { at: Point2::new(x, y), score: score.clamp(0.0, 1.0) };
    }
    Joints::new(all)
}

fn yolo_v8_rows(output: &Tensor, wanted: Wanted<'_>) -> Vec<ScoredBox> {
    let found = output.rows().filter_map(|row| {
        let score = wanted.best(|class| row.get(4 + class).copied());
        wanted.take(score, || around_row(row))
    });
    found.collect()
}

/// Columns of a list of boxes.
pub(crate) struct Columns {
    /// Column of the first corner: 1 after the index of an image, otherwise 0.
    pub first: usize,
    pub score: usize,
    pub label: usize,
}

/// Returns the columns of a list. Most have the score before the class, some after it: in that case
/// one column has integers only, and the other has not.
pub(crate) fn columns_of(output: &Tensor) -> Columns {
    let first = usize::from(output.shape().last() == Some(&7));
    let [before, after] = [first + 4, first + 5];
    // Lists with the index of the image have the class first (YOLOv7), unless that column cannot be
    // a class.
    let is_last =
        has_whole_column(output, before) && (first == 1 || !has_whole_column(output, after));
    if is_last {
        Columns { first, score: after, label: before }
    } else {
        Columns { first, score: before, label: after }
    }
}

/// Returns true if a column has integers only.
fn has_whole_column(output: &Tensor, column: usize) -> bool {
    output.rows().all(|row| row[column].fract() == 0.0)
}

fn yolo_v10(output: &Tensor, wanted: Wanted<'_>) -> Vec<ScoredBox> {
    let Columns { first, score, label } = columns_of(output);
    let people = output.rows().filter(|row| wanted.has_label(row[label]));
    people
        .filter_map(|row| wanted.take(row[score], || between(&wanted.order.sorted(&row[first..]))))
        .collect()
}

fn nanodet(output: &Tensor, input: InputSize, wanted: Wanted<'_>) -> Vec<ScoredBox> {
    let grid = cells(input, &NANODET_STRIDES);
    let found = output.rows().zip(grid).filter_map(|(row, [column, line, stride])| {
        let (scores, sides) = row.split_at(row.len() - 4 * NANODET_BINS);
        let score = wanted.best(|class| scores.get(class).copied());
        wanted.take(score, || {
            let side: [f64; 4] = std::array::from_fn(|k| {
                stride * expectation(&sides[k * NANODET_BINS..][..NANODET_BINS])
            });
            let left = column * stride - side[0];
            let top = line * stride - side[1];
            let right = column * stride + side[2];
            let bottom = line * stride + side[3];
            Rect::new(left, top, right - left, bottom - top)
        })
    });
    found.collect()
}

/// Outputs of NanoDet before Plus for one stride.
pub(crate) struct StrideOutputs<'a> {
    stride: usize,
    scores: Vec<&'a [f32]>,
    sides: Vec<&'a [f32]>,
}

/// Returns the scores and the distributions for each stride; `None` if their numbers do not
/// distinguish them.
pub(crate) fn scores_and_sides<'a>(
    outputs: &[(&str, &'a Tensor)],
    input: InputSize,
) -> Option<Vec<StrideOutputs<'a>>> {
    if let [(_, output)] = outputs {
        let bins = bins_of(output)?;
        let mut rows = output.rows();
        let by_stride = STRIDES.map(|stride| {
            let of_stride = rows.by_ref().take(count_cells(input, &[stride]));
            let (scores, sides) = of_stride.map(|row| row.split_at(row.len() - 4 * bins)).unzip();
            StrideOutputs { stride, scores, sides }
        });
        return Some(by_stride.into());
    }
    let mut by_stride = Vec::new();
    for stride in STRIDES {
        let cells = count_cells(input, &[stride]);
        let of_stride = outputs.iter().map(|(_, tensor)| *tensor);
        let pair: Vec<&Tensor> =
            of_stride.filter(|tensor| tensor.shape().get(1) == Some(&cells)).collect();
        let [a, b] = pair[..] else { return None };
        if has_scores(a) == has_scores(b) {
            return None;
        }
        let [scores, sides] = if has_scores(a) { [a, b] } else { [b, a] };
        let width = sides.shape().last().copied().unwrap_or(0);
        if !NANODET_M_BINS.iter().any(|bins| 4 * bins == width) {
            return None;
        }
        by_stride.push(StrideOutputs {
            stride,
            scores: scores.rows().collect(),
            sides: sides.rows().collect(),
        });
    }
    Some(by_stride)
}

/// Returns true if all numbers are scores.
fn has_scores(tensor: &Tensor) -> bool {
    tensor.values().iter().copied().all(is_score)
}

/// Returns `None` for numbers that are not those of the family.
fn nanodet_m(
    outputs: &[(&str, &Tensor)],
    input: InputSize,
    wanted: Wanted<'_>,
) -> Option<Vec<ScoredBox>> {
    let mut found = Vec::new();
    for StrideOutputs { stride, scores, sides } in scores_and_sides(outputs, input)? {
        for ((scores, sides), [column, line, _]) in
            scores.into_iter().zip(sides).zip(cells(input, &[stride]))
        {
            let score = wanted.best(|class| scores.get(class).copied());
            found.extend(wanted.take(score, || {
                let bins = sides.len() / 4;
                let stride = stride as f64;
                // Distances to the sides start at the middle of a cell, unlike in NanoDet-Plus.
                let [x, y] = [column, line].map(|cell| (cell + 0.5) * stride);
                let [left, top, right, bottom] =
                    [0, 1, 2, 3].map(|k| stride * expectation(&sides[k * bins..][..bins]));
                Rect::new(x - left, y - top, left + right, top + bottom)
            }));
        }
    }
    Some(found)
}

/// Returns the mean index of a distribution with these logits.
fn expectation(logits: &[f32]) -> f64 {
    let highest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let weights = logits.iter().map(|logit| f64::from(logit - highest).exp());
    let [sum, moment] = weights.enumerate().fold([0.0; 2], |[sum, moment], (index, weight)| {
        [sum + weight, moment + weight * index as f64]
    });
    moment / sum
}

fn rt_detr(labels: &Tensor, boxes: &Tensor, scores: &Tensor, wanted: Wanted<'_>) -> Vec<ScoredBox> {
    let each = labels.values().iter().zip(scores.values()).zip(boxes.rows());
    let people = each.filter(|((label, _), _)| wanted.has_label(**label));
    people.filter_map(|((_, score), corners)| wanted.take(*score, || between(corners))).collect()
}

fn rf_detr(
    boxes: &Tensor,
    logits: &Tensor,
    input: InputSize,
    wanted: Wanted<'_>,
) -> Vec<ScoredBox> {
    let size = [input.width as f64, input.height as f64];
    let found = boxes.rows().zip(logits.rows()).filter_map(|(part, logits)| {
        let logit = wanted.best(|class| logits.get(class).copied());
        let [x, y, width, height] = [0, 1, 2, 3].map(|k| f64::from(part[k]) * size[k % 2]);
        wanted.take(1.0 / (1.0 + (-logit).exp()), || around(x, y, width, height))
    });
    found.collect()
}

fn rtmdet(boxes: &Tensor, labels: &Tensor, wanted: Wanted<'_>) -> Vec<ScoredBox> {
    let each = boxes.rows().zip(labels.values());
    let people = each.filter(|(_, label)| wanted.has_label(**label));
    people.filter_map(|(row, _)| wanted.take(row[4], || between(row))).collect()
}

fn movenet(output: &Tensor, input: InputSize, wanted: Wanted<'_>) -> Vec<ScoredBox> {
    let one_person = output.values().len() == 3 * JOINTS;
    let people = output.values().chunks_exact(if one_person { 3 * JOINTS } else { 56 });
    let found = people.filter_map(|person| {
        let joints = &person[..3 * JOINTS];
        let score = match person.get(55) {
            Some(score) => *score,
            None => joints.chunks_exact(3).map(|joint| joint[2]).sum::<f32>() / JOINTS as f32,
        };
        let person = wanted.take(score, || box_of_joints(joints, input))?;
        let size = [input.width as f32, input.height as f32];
        let joints = joints_of(|index| {
            let [row, column, score] = [0, 1, 2].map(|part| joints[3 * index + part]);
            [column * size[0], row * size[1], score]
        });
        Some(ScoredBox { joints: Some(joints), ..person })
    });
    found.collect()
}

/// Returns the box of a standing person with these joints, each as row, column and score.
fn box_of_joints(joints: &[f32], input: InputSize) -> Rect {
    let [[top, bottom], [left, right]] =
        [(0, input.height), (1, input.width)].map(|(part, size)| {
            let values = joints.chunks_exact(3).map(|joint| f64::from(joint[part]) * size as f64);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| {
                [least.min(value), most.max(value)]
            })
        });
    let height = bottom - top;
    let whole = height * (1.0 + ABOVE_EYES + BELOW_ANKLES);
    Rect::new(left, top - ABOVE_EYES * height, right - left, whole)
}

/// Drops the less likely of two boxes that overlap by more than `iou` (non-maximum suppression);
/// the likeliest come first.
pub(crate) fn suppress(mut boxes: Vec<ScoredBox>, iou: f64) -> Vec<ScoredBox> {
    // Boxes with equal scores keep the order of the output.
    boxes.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut kept: Vec<ScoredBox> = Vec::new();
    for candidate in boxes {
        if kept.iter().all(|better| better.rect.iou(&candidate.rect) <= iou) {
            kept.push(candidate);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use tagalong_core::JointName;

    use super::*;

    const INPUT: InputSize = InputSize { width: 64, height: 64, channels_last: false };
    const WIDE: InputSize = InputSize { width: 64, height: 32, channels_last: false };
    const PEOPLE: Wanted<'_> = Wanted { classes: &[0], min_score: 0.5, order: BoxOrder::Xyxy };

    fn tensor(shape: &[usize], values: &[f32]) -> Tensor {
        Tensor::new(shape.to_vec(), values.to_vec()).unwrap()
    }

    fn rects(found: &[ScoredBox]) -> Vec<[f64; 4]> {
        found.iter().map(|found| found.rect).map(|r| [r.x, r.y, r.width, r.height]).collect()
    }

    #[test]
    fn yolox_boxes_are_relative_to_their_cells() {
        // 64 cells of 8 pixels, 16 of 16, 4 of 32.
        let mut values = vec![0.0; 84 * 7];
        // Column 2, row 1 of the second grid.
        let row = &mut values[(64 + 6) * 7..][..7];
        row.copy_from_slice(&[0.5, 0.25, 0.0, 2.0_f32.ln(), 0.9, 0.8, 1.0]);
        let found = yolox(&tensor(&[1, 84, 7], &values), INPUT, None, PEOPLE);
        assert_eq!(found.len(), 1);
        let [x, y, width, height] = rects(&found)[0];
        assert_eq!([x, y, width], [40.0 - 8.0, 20.0 - height / 2.0, 16.0]);
        assert!((height - 32.0).abs() < 1e-5 && (found[0].score - 0.72).abs() < 1e-6);
    }

    #[test]
    fn yolo_v8_has_a_row_for_each_part() {
        let parts = [10.0, 30.0, 20.0, 40.0, 8.0, 4.0, 16.0, 2.0, 0.9, 0.2, 0.1, 0.8];
        let found = yolo_v8(&tensor(&[1, 6, 2], &parts), PEOPLE);
        assert_eq!(rects(&found), [[6.0, 12.0, 8.0, 16.0]]);
        let both = Wanted { classes: &[0, 1, 7], ..PEOPLE };
        assert_eq!(yolo_v8(&tensor(&[1, 6, 2], &parts), both).len(), 2);
    }

    #[test]
    fn final_boxes_are_taken_by_label_and_score() {
        let rows = [
            [1.0, 2.0, 5.0, 10.0, 0.9, 0.0],
            [1.0, 2.0, 5.0, 10.0, 0.9, 1.0],
            [1.0, 2.0, 5.0, 10.0, 0.4, 0.0],
            [5.0, 2.0, 1.0, 10.0, 0.9, 0.0],
            [f32::NAN, 2.0, 1.0, 10.0, 0.9, 0.0],
        ];
        let found = yolo_v10(&tensor(&[1, 5, 6], &rows.concat()), PEOPLE);
        assert_eq!(rects(&found), [[1.0, 2.0, 4.0, 8.0]]);
        let boxes = tensor(&[1, 2, 5], &[1.0, 2.0, 5.0, 10.0, 0.9, 0.0, 0.0, 9.0, 9.0, 0.8]);
        let found = rtmdet(&boxes, &tensor(&[1, 2], &[3.0, 0.0]), PEOPLE);
        assert_eq!(rects(&found), [[0.0, 0.0, 9.0, 9.0]]);
    }

    #[test]
    fn corners_may_have_y_before_x() {
        let list = tensor(&[1, 1, 6], &[2.0, 1.0, 10.0, 5.0, 0.9, 0.0]);
        let exchanged = Wanted { order: BoxOrder::Yxyx, ..PEOPLE };
        assert_eq!(rects(&yolo_v10(&list, exchanged)), [[1.0, 2.0, 4.0, 8.0]]);
        // With the number of the image, and in fractions of an input that is not square.
        let list = tensor(&[1, 1, 7], &[0.0, 0.5, 0.25, 1.0, 0.75, 0.0, 0.9]);
        let outputs = [("output", &list)];
        let found = decode(Family::YoloV10, &outputs, WIDE, Some(BoxUnit::Fractions), exchanged);
        assert_eq!(rects(&found), [[16.0, 16.0, 32.0, 16.0]]);
    }

    #[test]
    fn boxes_in_fractions_of_the_input_become_pixels() {
        let row = [0.25, 0.5, 0.5, 1.0, 0.9, 0.0];
        let list = tensor(&[1, 2, 6], &[row, [0.0; 6]].concat());
        for (unit, rect, why) in [
            (None, [16.0, 16.0, 16.0, 16.0], "its numbers tell"),
            (Some(BoxUnit::Pixels), [0.25, 0.5, 0.25, 0.5], "the setting is obeyed"),
        ] {
            let found = decode(Family::YoloV10, &[("output", &list)], WIDE, unit, PEOPLE);
            assert_eq!(rects(&found), [rect], "{why}");
        }
        let one = tensor(&[1, 5, 1], &[0.5, 0.5, 0.25, 0.5, 0.9]);
        let unit = Some(BoxUnit::Fractions);
        let found = decode(Family::YoloV8, &[("output", &one)], WIDE, unit, PEOPLE);
        assert_eq!(rects(&found), [[24.0, 8.0, 16.0, 16.0]]);
    }

    #[test]
    fn outputs_are_found_by_name_in_any_order() {
        let labels = tensor(&[1, 2], &[0.0, 0.0]);
        let scores = tensor(&[1, 2], &[0.9, 0.1]);
        let boxes = tensor(&[1, 2, 4], &[1.0, 2.0, 5.0, 10.0, 0.0, 0.0, 9.0, 9.0]);
        let outputs = [("scores", &scores), ("labels", &labels), ("boxes", &boxes)];
        let found = decode(Family::RtDetr, &outputs, INPUT, None, PEOPLE);
        assert_eq!(rects(&found), [[1.0, 2.0, 4.0, 8.0]]);
        assert!(decode(Family::RtDetr, &outputs[..2], INPUT, None, PEOPLE).is_empty());
    }

    #[test]
    fn rf_detr_has_fractions_and_logits() {
        let boxes = tensor(&[1, 1, 4], &[0.5, 0.5, 0.25, 0.5]);
        let logits = tensor(&[1, 1, 3], &[-9.0, 3.0_f32.ln(), 9.0]);
        let found = rf_detr(&boxes, &logits, INPUT, Wanted { classes: &[1], ..PEOPLE });
        assert_eq!(rects(&found), [[24.0, 16.0, 16.0, 32.0]]);
        assert!((found[0].score - 0.75).abs() < 1e-6);
        let found = rf_detr(&boxes, &logits, WIDE, Wanted { classes: &[1], ..PEOPLE });
        assert_eq!(rects(&found), [[24.0, 8.0, 16.0, 16.0]], "fractions of each side");
    }

    #[test]
    fn nanodet_has_a_distribution_for_each_side() {
        let width = 1 + 32;
        let cell = 9; // Column 1, row 1 of the first grid.
        let mut values = vec![0.0; 85 * width];
        let row = &mut values[cell * width..][..width];
        row[0] = 0.9;
        for (side, bin) in [1, 0, 2, 3].into_iter().enumerate() {
            row[1 + 8 * side + bin] = 50.0;
        }
        let found = nanodet(&tensor(&[1, 85, width], &values), INPUT, PEOPLE);
        assert_eq!(rects(&found), [[0.0, 8.0, 24.0, 24.0]]);
        assert_eq!(expectation(&[1.0, 1.0, 1.0]), 1.0);
    }

    /// The exponentials of these are no numbers.
    #[test]
    fn large_logits_have_a_mean_index() {
        assert_eq!(expectation(&[900.0, 0.0, 900.0, -900.0]), 1.0);
    }

    #[test]
    fn joints_become_a_person_from_crown_to_sole() {
        let mut joints = [0.5, 0.5, 0.6].repeat(JOINTS);
        joints[..3].copy_from_slice(&[0.25, 0.375, 0.6]);
        joints[48..].copy_from_slice(&[0.75, 0.625, 0.6]);
        let found = movenet(&tensor(&[1, 1, 17, 3], &joints), INPUT, PEOPLE);
        let [x, y, width, height] = rects(&found)[0];
        assert_eq!([x, width], [24.0, 16.0]);
        assert!((y - (16.0 - 2.56)).abs() < 1e-9 && (height - 32.0 * 1.13).abs() < 1e-9);
        let mut six = [joints, vec![0.0; 5]].concat();
        six[55] = 0.7;
        let six = [six, vec![0.0; 5 * 56]].concat();
        let found = movenet(&tensor(&[1, 6, 56], &six), INPUT, PEOPLE);
        assert_eq!((found.len(), found[0].score), (1, 0.7));
        let joints = found[0].joints.as_ref().unwrap();
        let nose = joints.get(JointName::Nose);
        assert_eq!((nose.at, nose.score), (Point2::new(24.0, 16.0), f64::from(0.6_f32)));
        assert_eq!(joints.get(JointName::RightAnkle).at, Point2::new(40.0, 48.0));
    }

    #[test]
    fn yolo_v8_for_poses_has_three_rows_for_each_joint() {
        let mut rows = vec![[10.0, 0.0], [30.0, 0.0], [8.0, 0.0], [16.0, 0.0], [0.9, 0.1]];
        for joint in 0..JOINTS {
            rows.extend([[joint as f32 + 5.0, 0.0], [20.0, 0.0], [0.7, 0.0]]);
        }
        let values: Vec<f32> = rows.concat();
        let found = yolo_v8(&tensor(&[1, POSE_ROWS, 2], &values), PEOPLE);
        assert_eq!(rects(&found), [[6.0, 22.0, 8.0, 16.0]]);
        let wrist = *found[0].joints.as_ref().unwrap().get(JointName::LeftWrist);
        assert_eq!((wrist.at, wrist.score), (Point2::new(14.0, 20.0), f64::from(0.7_f32)));
        // The same shape with scores of 52 classes has none.
        let mut classes = values;
        classes[10..].fill(0.2);
        let found = yolo_v8(&tensor(&[1, POSE_ROWS, 2], &classes), PEOPLE);
        assert_eq!((found.len(), found[0].joints.is_none()), (1, true));
    }

    #[test]
    fn of_two_boxes_that_overlap_the_likelier_stays() {
        let boxes: Vec<ScoredBox> = [(0.0, 0.6), (1.0, 0.9), (20.0, 0.7)]
            .map(|(x, score)| ScoredBox {
                rect: Rect::new(x, 0.0, 10.0, 10.0),
                score,
                joints: None,
            })
            .into();
        assert_eq!(suppress(boxes.clone(), 0.5), boxes[1..]);
        assert_eq!(suppress(boxes, 0.9).len(), 3);
    }
}
