//! Families of detectors: conventions of their inputs, and shapes of their outputs.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Colours, Fit, InputSize, Preparation, Tensor};

/// Mean and deviation of ImageNet in red, green, blue, 0 to 255.
pub const IMAGENET: [[f32; 3]; 2] = [[123.675, 116.28, 103.53], [58.395, 57.12, 57.375]];

/// Values of a distribution for one side of a box of NanoDet.
pub(crate) const NANODET_BINS: usize = 8;

/// Name and shape of an output.
#[derive(Clone, Debug, PartialEq, Eq)]
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
pub enum Family {
    /// YOLOX: offsets in grid cells, objectness and classes.
    Yolox,
    /// YOLOv8, 9, 11 and 12: boxes in pixels, a row for each coordinate and class.
    #[serde(rename = "yolov8")]
    YoloV8,
    /// YOLOv10 and 26: final boxes in pixels.
    #[serde(rename = "yolov10")]
    YoloV10,
    /// RT-DETR, D-FINE and DEIM: final boxes by name, and a second input for the size.
    RtDetr,
    /// RF-DETR: boxes as fractions of the image, logits of classes from 1.
    RfDetr,
    /// NanoDet-Plus: a distribution for each side of a box.
    #[serde(rename = "nanodet")]
    NanoDet,
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

/// Outputs, to be matched by name or, where there is only one, by its shape.
struct Outputs<'a>(&'a [OutputShape]);

impl<'a> Outputs<'a> {
    fn named(&self, name: &str) -> Option<&'a [usize]> {
        self.0.iter().find(|output| output.name == name).map(|output| &output.shape[..])
    }

    fn only(&self) -> Option<&'a [usize]> {
        let [output] = self.0 else { return None };
        Some(&output.shape)
    }
}

impl Family {
    /// All families, in the order in which they are tried on a file.
    pub const ALL: [Self; 8] = [
        Self::MoveNet,
        Self::RtDetr,
        Self::RfDetr,
        Self::RtmDet,
        Self::Yolox,
        Self::YoloV8,
        Self::NanoDet,
        Self::YoloV10,
    ];

    /// Returns its name in settings.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Yolox => "yolox",
            Self::YoloV8 => "yolov8",
            Self::YoloV10 => "yolov10",
            Self::RtDetr => "rt-detr",
            Self::RfDetr => "rf-detr",
            Self::NanoDet => "nanodet",
            Self::RtmDet => "rtmdet",
            Self::MoveNet => "movenet",
        }
    }

    /// Returns the networks with this convention, in words.
    pub const fn networks(self) -> &'static str {
        match self {
            Self::Yolox => "YOLOX",
            Self::YoloV8 => "YOLOv8, v9, 11, 12",
            Self::YoloV10 => "YOLOv10, 26",
            Self::RtDetr => "RT-DETR, D-FINE, DEIM",
            Self::RfDetr => "RF-DETR",
            Self::NanoDet => "NanoDet-Plus",
            Self::RtmDet => "RTMDet",
            Self::MoveNet => "MoveNet",
        }
    }

    /// Returns the outputs that it needs, in words.
    pub const fn outputs(self) -> &'static str {
        match self {
            Self::Yolox => "one output [1, cells of strides 8, 16, 32; 5 + classes]",
            Self::YoloV8 => "one output [1; 4 + classes; cells of strides 8, 16, 32]",
            Self::YoloV10 => "one output [1, boxes, 6]",
            Self::RtDetr => {
                "outputs `labels` [1, n], `boxes` [1, n, 4], `scores` [1, n], and an input \
                 `orig_target_sizes` [1, 2]"
            }
            Self::RfDetr => "outputs `dets` [1, n, 4] and `labels` [1, n, classes]",
            Self::NanoDet => "one output [1, cells of strides 8, 16, 32, 64; classes + 32]",
            Self::RtmDet => "outputs `dets` [1, n, 5] and `labels` [1, n]",
            Self::MoveNet => "one output [1, 1, 17, 3] or [1, 6, 56]",
        }
    }

    /// Returns the preparation of images that its networks are trained with.
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
            Self::NanoDet => reversed,
            Self::RtmDet => Preparation { fit: Fit::TopLeft, ..reversed },
            Self::MoveNet => {
                Preparation { fit: Fit::Centre, padding: 0.0, deviation: [1.0; 3], ..plain }
            }
        }
    }

    /// Returns the class of people in networks trained on COCO.
    pub const fn person_class(self) -> usize {
        match self {
            // Trained on the category numbers of COCO, which start with 1.
            Self::RfDetr => 1,
            _ => 0,
        }
    }

    /// Returns true if several boxes of one person are left to the caller.
    pub const fn needs_suppression(self) -> bool {
        matches!(self, Self::Yolox | Self::YoloV8 | Self::NanoDet)
    }

    /// Returns the number of classes of a network with these outputs; `None` if they are not of
    /// this family. Zero stands for classes that are not known: labels of a list of boxes.
    pub fn classes(self, outputs: &[OutputShape], input: InputSize) -> Option<usize> {
        let outputs = Outputs(outputs);
        let cells = |strides: &[usize]| count_cells(input, strides);
        match (self, outputs.only()) {
            (Self::Yolox, Some(&[1, n, width])) if n == cells(&[8, 16, 32]) => width.checked_sub(5),
            (Self::YoloV8, Some(&[1, height, n])) if n == cells(&[8, 16, 32]) => {
                height.checked_sub(4)
            }
            (Self::NanoDet, Some(&[1, n, width])) if n == cells(&[8, 16, 32, 64]) => {
                width.checked_sub(4 * NANODET_BINS)
            }
            // More boxes than this are cells of a grid.
            (Self::YoloV10, Some(&[1, 0..=1000, 6])) => return Some(0),
            (Self::MoveNet, Some(&[1, 1, 17, 3] | &[1, _, 56])) if input.channels_last => {
                return Some(1);
            }
            (Self::RtDetr, None) => {
                let (boxes, scores) = (outputs.named("boxes")?, outputs.named("scores")?);
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
fn count_cells(input: InputSize, strides: &[usize]) -> usize {
    strides
        .iter()
        .map(|stride| input.width.div_ceil(*stride) * input.height.div_ceil(*stride))
        .sum()
}

/// Meaning of the last of six columns, by the values of a first call.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LastColumn {
    /// Whole numbers behind a score and ordered corners: labels.
    Labels,
    /// Fractions: scores of a class.
    Scores,
    /// The values do not tell.
    #[default]
    Unknown,
}

impl LastColumn {
    /// Returns what the rows of an output tell.
    pub fn of(output: &Tensor) -> Self {
        let [1, _, 6] = *output.shape() else { return Self::Unknown };
        let mut found = Self::Unknown;
        for row in output.rows() {
            let &[left, top, right, bottom, score, last] = row else { return Self::Unknown };
            // An activation is never exactly a whole number, and a label always is.
            if last.fract() != 0.0 {
                return Self::Scores;
            }
            let is_box = right > left && bottom > top;
            if score > 0.0 && score <= 1.0 && last >= 0.0 && is_box {
                found = Self::Labels;
            }
        }
        found
    }

    fn fits(self, family: Family) -> bool {
        match (self, family) {
            (Self::Labels, Family::Yolox) | (Self::Scores, Family::YoloV10) => false,
            (Self::Labels | Self::Scores | Self::Unknown, _) => true,
        }
    }
}

/// Returns the family of a network by its outputs: their shapes, and where these leave a choice the
/// values of a first call.
///
/// # Errors
/// Outputs of no family: a sentence with the families and their outputs. Outputs of several: those
/// that fit.
pub fn recognise(
    outputs: &[OutputShape],
    input: InputSize,
    last: LastColumn,
) -> Result<Family, String> {
    let fits = |family: &Family| family.classes(outputs, input).is_some() && last.fits(*family);
    let fitting: Vec<Family> = Family::ALL.into_iter().filter(fits).collect();
    if let [_, _, ..] = fitting[..] {
        let names: Vec<String> =
            fitting.iter().map(|family| format!("`family = \"{family}\"`")).collect();
        let shown: Vec<String> = outputs.iter().map(OutputShape::to_string).collect();
        return Err(format!(
            "its outputs {} may be those of several families, and their values do not tell: set {}",
            shown.join(", "),
            names.join(" or ")
        ));
    }
    fitting.first().copied().ok_or_else(|| {
        let shown: Vec<String> = outputs.iter().map(OutputShape::to_string).collect();
        let known = Family::ALL.map(|family| format!("\n  {family}: {}", family.outputs()));
        let (width, height) = (input.width, input.height);
        format!(
            "no decoder fits the outputs {} for an input of {width} x {height} pixels; known \
             are{}",
            shown.join(", "),
            known.concat()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const INPUT: InputSize = InputSize { width: 640, height: 640, channels_last: false };

    fn outputs(shapes: &[(&str, &[usize])]) -> Vec<OutputShape> {
        let output = |(name, shape): &(&str, &[usize])| OutputShape {
            name: (*name).to_owned(),
            shape: shape.to_vec(),
        };
        shapes.iter().map(output).collect()
    }

    #[test]
    fn published_networks_are_recognised() {
        let only = |shape: &[usize]| {
            recognise(&outputs(&[("output", shape)]), INPUT, LastColumn::Unknown).unwrap()
        };
        assert_eq!(only(&[1, 8400, 85]), Family::Yolox);
        assert_eq!(only(&[1, 8400, 6]), Family::Yolox, "a single class");
        assert_eq!(only(&[1, 84, 8400]), Family::YoloV8);
        assert_eq!(only(&[1, 5, 8400]), Family::YoloV8, "a single class");
        assert_eq!(only(&[1, 300, 6]), Family::YoloV10);
        assert_eq!(only(&[1, 8500, 112]), Family::NanoDet);
        let detr: [(&str, &[usize]); 3] =
            [("scores", &[1, 300]), ("labels", &[1, 300]), ("boxes", &[1, 300, 4])];
        assert_eq!(recognise(&outputs(&detr), INPUT, LastColumn::Unknown), Ok(Family::RtDetr));
        let rf: [(&str, &[usize]); 2] = [("dets", &[1, 300, 4]), ("labels", &[1, 300, 91])];
        assert_eq!(recognise(&outputs(&rf), INPUT, LastColumn::Unknown), Ok(Family::RfDetr));
        let rtm: [(&str, &[usize]); 2] = [("dets", &[1, 100, 5]), ("labels", &[1, 100])];
        assert_eq!(recognise(&outputs(&rtm), INPUT, LastColumn::Unknown), Ok(Family::RtmDet));
        let last = InputSize { width: 192, height: 192, channels_last: true };
        for shape in [&[1, 1, 17, 3][..], &[1, 6, 56]] {
            assert_eq!(
                recognise(&outputs(&[("output_0", shape)]), last, LastColumn::Unknown),
                Ok(Family::MoveNet)
            );
        }
    }

    /// Returns the output of a network of 128 x 96 pixels with rows of six values.
    fn six(row: [f32; 6]) -> Tensor {
        let values: Vec<f32> = (0..252).flat_map(|_| row).collect();
        Tensor::new(vec![1, 252, 6], values).unwrap()
    }

    #[test]
    fn the_values_tell_where_the_shape_does_not() {
        let input = InputSize { width: 128, height: 96, channels_last: false };
        let shapes = outputs(&[("output", &[1, 252, 6])]);
        for (row, expected) in [
            ([10.0, 10.0, 40.0, 60.0, 0.9, 0.0], Some(Family::YoloV10)),
            ([10.0, 10.0, 40.0, 60.0, 0.02, 17.0], Some(Family::YoloV10)),
            ([0.3, -0.2, 1.1, 0.7, 0.004, 0.21], Some(Family::Yolox)),
            ([0.3, -0.2, 1.1, 0.7, 0.9, 0.999], Some(Family::Yolox)),
            ([0.0; 6], None),
            ([40.0, 60.0, 10.0, 10.0, 0.9, 0.0], None),
        ] {
            let found = recognise(&shapes, input, LastColumn::of(&six(row)));
            assert_eq!(found.clone().ok(), expected, "{row:?}");
            if let Err(why) = found {
                assert!(why.contains("`family = \"yolox\"` or `family = \"yolov10\"`"), "{why}");
            }
        }
    }

    #[test]
    fn other_shapes_are_refused_with_those_that_are_known() {
        let why =
            recognise(&outputs(&[("logits", &[1, 1000])]), INPUT, LastColumn::Unknown).unwrap_err();
        assert!(why.contains("`logits` [1, 1000]") && why.contains("640 x 640"), "{why}");
        assert!(Family::ALL.iter().all(|family| why.contains(family.name())), "{why}");
        let wrong = |shape: &[usize]| {
            recognise(&outputs(&[("output", shape)]), INPUT, LastColumn::Unknown).is_err()
        };
        assert!(wrong(&[1, 8400, 5]) && wrong(&[1, 4, 8400]) && wrong(&[1, 8500, 32]));
        assert!(wrong(&[2, 8400, 85]) && wrong(&[]));
        assert!(wrong(&[1, 6, 56]), "MoveNet has its channels last");
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
