use tagalong_config::{OrAuto, check_settings};
use tagalong_core::{Error, Result, settings};
use tagalong_network::{
    BoxOrder, BoxUnit, Choices, Colours, Family, Fit, LimitSettings, Preparation,
};
use tagalong_vision::BoxSettings;

/// Number that leaves a setting to the family of the network.
const BY_FAMILY: f64 = -1.0;
/// Default of `track_score`, as a part of `discover_score`.
const TRACK_PART: f64 = 0.4;

/// Probabilities from which a box is a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Thresholds {
    /// A new one.
    pub discover: f64,
    /// The one of a confirmed track.
    pub track: f64,
}

settings! {
    /// Settings of `onnx`.
    pub struct Config {
        /// ONNX file, relative to the config, or the name of an installed network
        /// (`tagalong model --install`). Empty: no person is found, and the funnel says so.
        pub model: String,
        /// Family of the network: `auto` (by the file), `yolox`, `yolov8`, `yolov10`, `rt-detr`,
        /// `rf-detr`, `nanodet`, `nanodet-m`, `rtmdet` or `movenet`.
        pub family: OrAuto<Family> = OrAuto::Auto,
        /// Columns and rows of the input if the file leaves them open, for example `[640, 640]`,
        /// which is also the meaning of an empty list (256 x 256 for `movenet`).
        pub size: Vec<usize>,
        /// Classes of people; empty: those that the file calls person, pedestrian or people, or, if
        /// it has no names, those of the family (0, and 1 for `rf-detr`).
        pub classes: Vec<usize>,
        /// Unit of the boxes: `auto` (by the outputs), `pixels` of the input or `fractions` of its
        /// sides; for `yolox`, `yolov8`, `yolov10`, `rt-detr` and `rtmdet`.
        pub box_unit: OrAuto<BoxUnit> = OrAuto::Auto,
        /// Order of the corners in a list of boxes, for `yolov10`: `xyxy`, `yxyx` or `auto`
        /// (`xyxy`, which is refused if nearly all boxes of people are wide).
        pub box_order: OrAuto<BoxOrder> = OrAuto::Auto,
        /// Probability from which a box is a new person; -1: that of the family. If it is below a
        /// half, scores are log-odds relative to it, so that it is also the meaning of
        /// `start_score = 0.0` of a track manager.
        #[schemars(range(min = -1.0, max = 1.0))]
        pub discover_score: f64 = BY_FAMILY,
        /// Probability from which a box near a confirmed track belongs to it; -1: 0.4 times
        /// `discover_score`.
        #[schemars(range(min = -1.0, max = 1.0))]
        pub track_score: f64 = BY_FAMILY,
        /// Overlap (IoU) of two boxes above which the less likely one is dropped; only for families
        /// that do not do this themselves (`yolox`, `yolov8`, `nanodet`, `nanodet-m`).
        #[schemars(range(min = 0.0, max = 1.0))]
        pub suppress_iou: f64 = 0.6,
        /// Order of the channels: `auto` (that of the family), `rgb` or `bgr`.
        pub colours: OrAuto<Colours> = OrAuto::Auto,
        /// Placement of the image in the input: `auto` (that of the family), `stretch`, `centre` or
        /// `top-left`, the latter two with the aspect ratio of the image.
        pub fit: OrAuto<Fit> = OrAuto::Auto,
        /// Value of padded pixels, 0 to 255; -1: that of the family.
        #[schemars(range(min = -1.0, max = 255.0))]
        pub padding: f64 = -1.0,
        /// Three means in the order of the channels, 0 to 255, which are subtracted from the
        /// pixels; empty: those of the family.
        pub mean: Vec<f32>,
        /// Three standard deviations in the order of the channels, by which the pixels are divided;
        /// empty: those of the family.
        pub deviation: Vec<f32>,
        /// Conversion of boxes to detections with a position.
        #[serde(flatten)]
        pub boxes: BoxSettings,
        /// Limits of the network.
        #[serde(flatten)]
        pub limits: LimitSettings,
    }
}

impl Config {
    /// Refuses numbers that cannot work.
    pub(crate) fn check(&self) -> Result<()> {
        check_settings(self)?;
        if !matches!(self.size.len(), 0 | 2) || self.size.contains(&0) {
            return Err(Error::setting("size", "must be `[columns, rows]`, each above zero"));
        }
        triple("mean", &self.mean)?;
        let deviation = triple("deviation", &self.deviation)?;
        if deviation.is_some_and(|parts| parts.iter().any(|part| *part <= 0.0)) {
            Err(Error::setting("deviation", "must be above zero"))
        } else {
            Ok(())
        }
    }

    pub(crate) fn choices(&self) -> Choices {
        let size = <[usize; 2]>::try_from(&self.size[..]).ok();
        Choices {
            family: self.family.chosen(),
            size,
            classes: self.classes.clone(),
            unit: self.box_unit.chosen(),
            order: self.box_order.chosen(),
        }
    }

    /// Returns the thresholds: those of the family, but for those that are set.
    pub(crate) fn thresholds(&self, family: Family) -> Thresholds {
        let discover =
            if self.discover_score < 0.0 { family.usual_score() } else { self.discover_score };
        let track = if self.track_score < 0.0 { TRACK_PART * discover } else { self.track_score };
        Thresholds { discover, track }
    }

    /// Returns the preparation of images: that of the family, but for what is set.
    pub(crate) fn preparation(&self, family: Family) -> Result<Preparation> {
        let mut preparation = family.preparation();
        if let Some(colours) = self.colours.chosen()
            && colours != preparation.colours
        {
            preparation.colours = colours;
            preparation.mean.reverse();
            preparation.deviation.reverse();
        }
        if let Some(fit) = self.fit.chosen() {
            preparation.fit = fit;
        }
        if self.padding >= 0.0 {
            preparation.padding = self.padding as f32;
        }
        preparation.mean = triple("mean", &self.mean)?.unwrap_or(preparation.mean);
        preparation.deviation =
            triple("deviation", &self.deviation)?.unwrap_or(preparation.deviation);
        Ok(preparation)
    }
}

/// Returns three numbers, one for each channel, or `None` for an empty list.
fn triple(key: &str, values: &[f32]) -> Result<Option<[f32; 3]>> {
    if values.is_empty() {
        return Ok(None);
    }
    let triple = <[f32; 3]>::try_from(values);
    triple.map(Some).map_err(|_| Error::setting(key, "must have a number for each of 3 channels"))
}
