//! Families of detectors: the conventions of their inputs, and the shapes of their outputs.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::values::{fits, is_empty};
use crate::{Colours, Fit, InputSize, Preparation, Tensor};

/// Mean and deviation of ImageNet in red, green, blue, 0 to 255.
pub const IMAGENET: [[f32; 3]; 2] = [[123.675, 116.28, 103.53], [58.395, 57.12, 57.375]];

/// Number of values of the distribution for one side of a box in NanoDet-Plus.
pub(crate) const NANODET_BINS: usize = 8;
/// Number of values of the distribution for one side of a box in NanoDet before Plus, for its
/// networks with 320 and with 416 pixels.
pub(crate) const NANODET_M_BINS: [usize; 2] = [8, 11];
/// Strides of the grids of most families.
pub(crate) const STRIDES: [usize; 3] = [8, 16, 32];
/// Strides of NanoDet-Plus.
pub(crate) const NANODET_STRIDES: [usize; 4] = [8, 16, 32, 64];

/// Maximum number of boxes of a list without duplicates: if there are more, they are cells of a
/// grid.
const FINAL_BOXES: usize = 300;

/// Name and shape of an output.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct OutputShape {
    /// Name in the file.
    pub name: String,
    /// Size of each dimension.
    pub shape: Vec<usize>,
}

impl fmt::Display for OutputShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` {:?}", self.name, self.shape)
    }
}

/// Family of detectors with one convention of inputs and outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Family {
    /// YOLOX: offsets in grid cells, or boxes in pixels, objectness and classes.
    Yolox,
    /// YOLOv8, 9, 11 and 12: boxes in pixels and classes, with a row or a column for each box.
    #[serde(rename = "yolov8")]
    YoloV8,
    /// YOLOv10 and 26, exports of others with suppression or for DeepStream, and CenterNet: final
    /// boxes in pixels.
    #[serde(rename = "yolov10")]
    YoloV10,
    /// RT-DETR, D-FINE and DEIM: final boxes in named outputs, and a second input for the size.
    RtDetr,
    /// RF-DETR: boxes as fractions of the image, logits of classes from 1.
    RfDetr,
    /// NanoDet-Plus: a distribution for each side of a box.
    #[serde(rename = "nanodet")]
    NanoDet,
    /// NanoDet before Plus: scores and distributions for each of three strides.
    #[serde(rename = "nanodet-m")]
    NanoDetM,
    /// RTMDet of MMDeploy: final boxes with scores, and labels.
    #[serde(rename = "rtmdet")]
    RtmDet,
    /// MoveNet: joints of one person or of six.
    #[serde(rename = "movenet")]
    MoveNet,
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Outputs of a network, which are matched by name or, if there is only one, by its shape.
struct Outputs<'a>(&'a [OutputShape]);

impl<'a> Outputs<'a> {
    fn named(&self, name: &str) -> Option<&'a [usize]> {
        self.0.iter().find(|output| output.name == name).map(|output| &output.shape[..])
    }

    fn only(&self) -> Option<&'a [usize]> {
        let [output] = self.0 else { return None };
        Some(&output.shape)
    }

    /// Returns the number of classes (zero if it is unknown) for outputs that are scores and
    /// distributions for each stride; `None` for other outputs.
    fn classes_by_stride(&self, input: InputSize) -> Option<usize> {
        let mut widths = None;
        for stride in STRIDES {
            let cells = count_cells(input, &[stride]);
            let of_stride = self.0.iter().filter_map(|output| match output.shape[..] {
                [1, n, width] if n == cells => Some(width),
                _ => None,
            });
            let mut pair: Vec<usize> = of_stride.collect();
            pair.sort_unstable();
            if pair.len() != 2 || *widths.get_or_insert_with(|| pair.clone()) != pair {
                return None;
            }
        }
        let widths = widths.filter(|_| self.0.len() == 2 * STRIDES.len())?;
        let [a, b] = [widths[0], widths[1]];
        if !is_distribution(a) && !is_distribution(b) {
            return None;
        }
        // If both widths fit distributions, the values decide.
        Some(if !is_distribution(a) {
            a
        } else if !is_distribution(b) {
            b
        } else {
            0
        })
    }
}

/// Returns true for the width of the distributions of all four sides in NanoDet before Plus.
fn is_distribution(width: usize) -> bool {
    NANODET_M_BINS.iter().any(|bins| 4 * bins == width)
}

impl Family {
    /// All families, in the order in which they are tried on a file.
    pub const ALL: [Self; 9] = [
        Self::MoveNet,
        Self::RtDetr,
        Self::RfDetr,
        Self::RtmDet,
        Self::Yolox,
        Self::YoloV8,
        Self::NanoDet,
        Self::NanoDetM,
        Self::YoloV10,
    ];

    /// Returns the name of the family in settings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Yolox => "yolox",
            Self::YoloV8 => "yolov8",
            Self::YoloV10 => "yolov10",
            Self::RtDetr => "rt-detr",
            Self::RfDetr => "rf-detr",
            Self::NanoDet => "nanodet",
            Self::NanoDetM => "nanodet-m",
            Self::RtmDet => "rtmdet",
            Self::MoveNet => "movenet",
        }
    }

    /// Returns the networks of the family, in words.
    pub const fn networks(self) -> &'static str {
        match self {
            Self::Yolox => "YOLOX",
            Self::YoloV8 => "YOLOv8, v9, 11, 12",
            Self::YoloV10 => "YOLOv10, 26, DeepStream, CenterNet",
            Self::RtDetr => "RT-DETR, D-FINE, DEIM",
            Self::RfDetr => "RF-DETR",
            Self::NanoDet => "NanoDet-Plus",
            Self::NanoDetM => "NanoDet before Plus",
            Self::RtmDet => "RTMDet",
            Self::MoveNet => "MoveNet",
        }
    }

    /// Returns the outputs that the family needs, in words.
    pub const fn outputs(self) -> &'static str {
        match self {
            Self::Yolox => "one output [1, cells of strides 8, 16, 32; 5 + classes]",
            Self::YoloV8 => {
                "one output [1; 4 + classes; cells of strides 8, 16, 32], or with the last two \
                 changed over"
            }
            Self::YoloV10 => {
                "one output [1, boxes, 6] or [boxes, 6] with corners, score and class, or \
                 [1, boxes, 7] or [boxes, 7] with the number of the image before them"
            }
            Self::RtDetr => {
                "outputs `labels` [1, n], `boxes` [1, n, 4], `scores` [1, n], and an input \
                 `orig_target_sizes` [1, 2]"
            }
            Self::RfDetr => "outputs `dets` [1, n, 4] and `labels` [1, n, classes]",
            Self::NanoDet => "one output [1, cells of strides 8, 16, 32, 64; classes + 32]",
            Self::NanoDetM => {
                "for each of the strides 8, 16, 32 outputs [1, cells, classes] and [1, cells, 32 \
                 or 44], or one output with all of them side by side"
            }
            Self::RtmDet => "outputs `dets` [1, n, 5] and `labels` [1, n]",
            Self::MoveNet => "one output [1, 1, 17, 3] or [1, 6, 56]",
        }
    }

    /// Returns the preparation of images with which the networks of the family are trained.
    pub const fn preparation(self) -> Preparation {
        let [mean, deviation] = IMAGENET;
        let plain = Preparation {
            fit: Fit::Stretch,
            padding: 114.0,
            colours: Colours::Rgb,
            mean: [0.0; 3],
            deviation: [255.0; 3],
        };
        let reversed = Preparation {
            colours: Colours::Bgr,
            mean: [mean[2], mean[1], mean[0]],
            deviation: [deviation[2], deviation[1], deviation[0]],
            ..plain
        };
        match self {
            Self::Yolox => Preparation {
                fit: Fit::TopLeft,
                colours: Colours::Bgr,
                deviation: [1.0; 3],
                ..plain
            },
            Self::YoloV8 | Self::YoloV10 => Preparation { fit: Fit::Centre, ..plain },
            Self::RtDetr => plain,
            Self::RfDetr => Preparation { mean, deviation, ..plain },
            Self::NanoDet | Self::NanoDetM => reversed,
            Self::RtmDet => Preparation { fit: Fit::TopLeft, ..reversed },
            Self::MoveNet => {
                Preparation { fit: Fit::Centre, padding: 0.0, deviation: [1.0; 3], ..plain }
            }
        }
    }

    /// Returns the class of people in networks trained on COCO.
    pub const fn person_class(self) -> usize {
        match self {
            // It is trained with the category numbers of COCO, which start with 1.
            Self::RfDetr => 1,
            _ => 0,
        }
    }

    /// Returns the probability from which a box is usually accepted: one half, or the value in the
    /// authors' examples if networks of the family never reach high scores.
    pub const fn usual_score(self) -> f64 {
        match self {
            Self::MoveNet => 0.2,
            _ => 0.5,
        }
    }

    /// Returns true if exports of the family differ in the unit of their boxes.
    pub(crate) const fn has_unit(self) -> bool {
        matches!(self, Self::Yolox | Self::YoloV8 | Self::YoloV10 | Self::RtDetr | Self::RtmDet)
    }

    /// Returns true if exports of the family differ in the order of the corners of their boxes.
    pub(crate) const fn has_order(self) -> bool {
        matches!(self, Self::YoloV10)
    }

    /// Returns true if removing duplicate boxes of one person is left to the caller. Lists of final
    /// boxes have no duplicates, except for those with a box for each cell of a grid.
    pub fn needs_suppression(self, outputs: &[OutputShape]) -> bool {
        match self {
            Self::Yolox | Self::YoloV8 | Self::NanoDet | Self::NanoDetM => true,
            Self::YoloV10 => {
                matches!(Outputs(outputs).only(), Some(&[1, boxes, _]) if boxes > FINAL_BOXES)
            }
            _ => false,
        }
    }

    /// Returns the number of classes of a network with these outputs; `None` if they do not belong
    /// to this family. Zero means that the number is unknown, because the outputs are labels of a
    /// list of boxes.
    pub fn classes(self, outputs: &[OutputShape], input: InputSize) -> Option<usize> {
        let outputs = Outputs(outputs);
        let cells = count_cells(input, &STRIDES);
        match (self, outputs.only()) {
            (Self::Yolox, Some(&[1, n, width])) if n == cells => width.checked_sub(5),
            (Self::YoloV8, Some(&[1, height, n])) if n == cells => height.checked_sub(4),
            (Self::YoloV8, Some(&[1, n, width])) if n == cells => width.checked_sub(4),
            (Self::NanoDet, Some(&[1, n, width])) if n == count_cells(input, &NANODET_STRIDES) => {
                width.checked_sub(4 * NANODET_BINS)
            }
            (Self::NanoDetM, Some(&[1, n, width])) if n == cells => {
                // The values decide which of the numbers of bins it is.
                return (width > 4 * NANODET_M_BINS[0]).then_some(0);
            }
            (Self::NanoDetM, None) => return outputs.classes_by_stride(input),
            (Self::YoloV10, Some(&[1, _, 6 | 7] | &[_, 6 | 7])) => return Some(0),
            (Self::MoveNet, Some(&[1, 1, 17, 3] | &[1, _, 56])) if input.channels_last => {
                return Some(1);
            }
            (Self::RtDetr, None) => {
                let boxes = outputs.named("boxes")?;
                let scores = outputs.named("scores")?;
                return match (outputs.named("labels")?, boxes, scores) {
                    (&[1, a], &[1, b, 4], &[1, c]) if a == b && b == c => Some(0),
                    _ => None,
                };
            }
            (Self::RfDetr, None) => match (outputs.named("dets")?, outputs.named("labels")?) {
                (&[1, a, 4], &[1, b, classes]) if a == b => Some(classes),
                _ => None,
            },
            (Self::RtmDet, None) => {
                return match (outputs.named("dets")?, outputs.named("labels")?) {
                    (&[1, a, 5], &[1, b]) if a == b => Some(0),
                    _ => None,
                };
            }
            _ => None,
        }
        .filter(|classes| *classes > 0)
    }
}

/// Returns the number of grid cells of an input over all strides.
pub(crate) fn count_cells(input: InputSize, strides: &[usize]) -> usize {
    strides
        .iter()
        .map(|stride| input.width.div_ceil(*stride) * input.height.div_ceil(*stride))
        .sum()
}

/// Returns the shapes of named outputs.
pub(crate) fn shapes_of(outputs: &[(&str, &Tensor)]) -> Vec<OutputShape> {
    outputs
        .iter()
        .map(|(name, tensor)| OutputShape {
            name: (*name).to_owned(),
            shape: tensor.shape().to_vec(),
        })
        .collect()
}

/// Returns the family of a network, recognised from the shapes and the numbers of its outputs.
///
/// # Errors
/// For outputs of no family, a sentence with all families and their outputs; for outputs of several
/// families, a sentence with those.
pub(crate) fn recognise(outputs: &[(&str, &Tensor)], input: InputSize) -> Result<Family, String> {
    let shapes = shapes_of(outputs);
    let shown: Vec<String> = shapes.iter().map(OutputShape::to_string).collect();
    let shown = shown.join(", ");
    let by_shape: Vec<Family> =
        Family::ALL.into_iter().filter(|family| family.classes(&shapes, input).is_some()).collect();
    if by_shape.is_empty() {
        let known = Family::ALL.map(|family| format!("\n  {family}: {}", family.outputs()));
        let InputSize { width, height, .. } = input;
        return Err(format!(
            "no decoder fits the outputs {shown} for an input of {width} x {height} pixels; known \
             are{}",
            known.concat()
        ));
    }
    let by_value: Vec<Family> =
        by_shape.iter().copied().filter(|family| fits(*family, outputs, input)).collect();
    match by_value[..] {
        [family] => Ok(family),
        [] => Err(format!(
            "the outputs {shown} have the shape of {}, but not its numbers: set `family` if you \
             know that it is one of them, or export it as its authors do",
            any_of(&by_shape)
        )),
        _ if outputs.iter().all(|(_, output)| is_empty(output)) => Err(format!(
            "the outputs {shown} are all zero for an image without anything in it, and may be those \
             of {}: set `family` to the one that it is",
            any_of(&by_value)
        )),
        _ => Err(format!(
            "the outputs {shown} may be those of {}: set `family` to the one that it is",
            any_of(&by_value)
        )),
    }
}

/// Returns the names of families as a text: `yolox (YOLOX) or yolov8 (YOLOv8, v9, 11, 12)`.
fn any_of(families: &[Family]) -> String {
    let shown: Vec<String> =
        families.iter().map(|family| format!("`{family}` ({})", family.networks())).collect();
    shown.join(" or ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const INPUT: InputSize = InputSize { width: 640, height: 640, channels_last: false };

    /// Returns the family of outputs of zeros, which every family with their shapes may have.
    fn of_shapes(shapes: &[(&str, &[usize])], input: InputSize) -> Result<Family, String> {
        fn zeros((_, shape): &(&str, &[usize])) -> Tensor {
            Tensor::new(shape.to_vec(), vec![0.0; shape.iter().product()]).unwrap()
        }

        let tensors: Vec<Tensor> = shapes.iter().map(zeros).collect();
        let named: Vec<(&str, &Tensor)> =
            shapes.iter().map(|(name, _)| *name).zip(&tensors).collect();
        recognise(&named, input)
    }

    #[test]
    fn published_networks_are_recognised() {
        fn only(shape: &[usize]) -> Family {
            of_shapes(&[("output", shape)], INPUT).unwrap()
        }

        assert_eq!(only(&[1, 84, 8400]), Family::YoloV8);
        assert_eq!(only(&[1, 5, 8400]), Family::YoloV8, "a single class");
        assert_eq!(only(&[1, 300, 6]), Family::YoloV10);
        assert_eq!(only(&[0, 6]), Family::YoloV10, "nothing found");
        assert_eq!(only(&[0, 7]), Family::YoloV10);
        assert_eq!(only(&[1, 8500, 112]), Family::NanoDet);
        let detr: [(&str, &[usize]); 3] =
            [("scores", &[1, 300]), ("labels", &[1, 300]), ("boxes", &[1, 300, 4])];
        assert_eq!(of_shapes(&detr, INPUT), Ok(Family::RtDetr));
        let rf: [(&str, &[usize]); 2] = [("dets", &[1, 300, 4]), ("labels", &[1, 300, 91])];
        assert_eq!(of_shapes(&rf, INPUT), Ok(Family::RfDetr));
        let rtm: [(&str, &[usize]); 2] = [("dets", &[1, 100, 5]), ("labels", &[1, 100])];
        assert_eq!(of_shapes(&rtm, INPUT), Ok(Family::RtmDet));
        let last = InputSize { width: 192, height: 192, channels_last: true };
        for shape in [&[1, 1, 17, 3][..], &[1, 6, 56]] {
            assert_eq!(of_shapes(&[("output_0", shape)], last), Ok(Family::MoveNet));
        }
    }

    #[test]
    fn other_shapes_are_refused_with_those_that_are_known() {
        fn wrong(shape: &[usize]) -> bool {
            of_shapes(&[("output", shape)], INPUT).is_err()
        }

        let why = of_shapes(&[("logits", &[1, 1000])], INPUT).unwrap_err();
        assert!(why.contains("`logits` [1, 1000]") && why.contains("640 x 640"), "{why}");
        assert!(Family::ALL.iter().all(|family| why.contains(family.name())), "{why}");
        assert!(wrong(&[1, 4, 8400]) && wrong(&[1, 8500, 32]));
        assert!(wrong(&[2, 8400, 85]) && wrong(&[]));
        assert!(wrong(&[1, 6, 56]), "MoveNet has its channels last");
    }

    #[test]
    fn shapes_of_several_families_are_refused_with_their_names_where_numbers_do_not_decide() {
        let why = of_shapes(&[("output", &[1, 8400, 6])], INPUT).unwrap_err();
        assert!(why.contains("`yolox` (YOLOX) or `yolov8`") && why.contains("`yolov10`"), "{why}");
        assert!(why.contains("set `family`") && !why.contains("rf-detr"), "{why}");
    }

    #[test]
    fn names_are_those_of_the_settings() {
        for family in Family::ALL {
            let written = serde_json::to_value(family).unwrap();
            assert_eq!(written.as_str(), Some(family.name()));
        }
    }

    #[test]
    fn channels_of_means_follow_the_colours() {
        let preparation = Family::NanoDet.preparation();
        assert_eq!(preparation.mean, [103.53, 116.28, 123.675]);
        assert_eq!(preparation.deviation, [57.375, 57.12, 58.395]);
        assert_eq!(Family::RfDetr.preparation().mean, [123.675, 116.28, 103.53]);
    }
}
