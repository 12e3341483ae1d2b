use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_network::{Colours, Family, Fit};

/// Family of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FamilyChoice {
    /// The one that the outputs of the file have the shapes of.
    Auto,
    /// YOLOX.
    Yolox,
    /// YOLOv8, 9, 11 and 12.
    #[serde(rename = "yolov8")]
    YoloV8,
    /// YOLOv10 and 26.
    #[serde(rename = "yolov10")]
    YoloV10,
    /// RT-DETR, D-FINE and DEIM.
    RtDetr,
    /// RF-DETR.
    RfDetr,
    /// NanoDet-Plus.
    #[serde(rename = "nanodet")]
    NanoDet,
    /// RTMDet.
    #[serde(rename = "rtmdet")]
    RtmDet,
    /// MoveNet.
    #[serde(rename = "movenet")]
    MoveNet,
}

impl FamilyChoice {
    pub(crate) fn family(self) -> Option<Family> {
        match self {
            Self::Auto => None,
            Self::Yolox => Some(Family::Yolox),
            Self::YoloV8 => Some(Family::YoloV8),
            Self::YoloV10 => Some(Family::YoloV10),
            Self::RtDetr => Some(Family::RtDetr),
            Self::RfDetr => Some(Family::RfDetr),
            Self::NanoDet => Some(Family::NanoDet),
            Self::RtmDet => Some(Family::RtmDet),
            Self::MoveNet => Some(Family::MoveNet),
        }
    }
}

/// Order of the colour channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Channels {
    /// That of the family.
    Auto,
    /// Red, green, blue.
    Rgb,
    /// Blue, green, red.
    Bgr,
}

impl Channels {
    pub(crate) fn colours(self) -> Option<Colours> {
        match self {
            Self::Auto => None,
            Self::Rgb => Some(Colours::Rgb),
            Self::Bgr => Some(Colours::Bgr),
        }
    }
}

/// Way in which the image fills the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Placing {
    /// That of the family.
    Auto,
    /// Both sides scaled to the input.
    Stretch,
    /// Scaled with its aspect ratio, with padding on two sides.
    Centre,
    /// Scaled with its aspect ratio, with padding on the right and below.
    TopLeft,
}

impl Placing {
    pub(crate) fn fit(self) -> Option<Fit> {
        match self {
            Self::Auto => None,
            Self::Stretch => Some(Fit::Stretch),
            Self::Centre => Some(Fit::Centre),
            Self::TopLeft => Some(Fit::TopLeft),
        }
    }
}

/// Box that is tracked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Body {
    /// The upper-body square of the person in the box.
    Full,
    /// The box as it is, for data sets with whole bodies in their ground truth.
    FullBox,
}
