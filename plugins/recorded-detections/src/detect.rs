use nalgebra::Matrix3;
use tagalong_config::Context;
use tagalong_core::{
    Capabilities, Detection, Detector, ExternalDetection, Frame, Funnel, Input, Inputs, Query,
    Result, Track,
};
use tagalong_geometry::{FaceDepth, ImageBox, PointEstimate, Rect, UPPER_BODY_SIDE_M};

use crate::NAME;
use crate::boxes::{Boxes, read};
use crate::config::{Body, Config, ScoreScale};

/// Distance of probabilities from 0 and 1 at least.
const SURE: f64 = 1e-3;

/// Detector that returns recorded detections, with a position for each box.
pub struct RecordedDetections {
    config: Config,
    /// Boxes of the file; `None`: those of the log.
    boxes: Option<Boxes>,
}

impl RecordedDetections {
    /// Creates a detector, and reads its file if the settings name one.
    ///
    /// # Errors
    /// Settings outside their ranges, or a file that cannot be read.
    pub fn new(config: Config, context: &Context) -> Result<Self> {
        config.check()?;
        let boxes = match config.path.as_str() {
            "" => None,
            path => Some(read(&context.base_dir.join(path))?),
        };
        Ok(Self { config, boxes })
    }

    /// Returns the recorded detections of a frame.
    fn recorded<'a>(&'a self, frame: &'a Frame, funnel: &mut Funnel) -> &'a [ExternalDetection] {
        let found = match &self.boxes {
            Some(boxes) => Some(boxes.get(&frame.index).map_or(&[][..], Vec::as_slice)),
            None => frame.recorded(),
        };
        if found.is_none() {
            funnel.drop_many("nothing recorded", 1);
        }
        found.unwrap_or_default()
    }

    fn detection(&self, frame: &Frame, recorded: &ExternalDetection) -> Option<Detection> {
        let camera = &*frame.camera;
        let (image, position, covariance) = match (recorded.head, recorded.region) {
            (Some(head), region) => {
                let variance = self.config.sigma_position_m.powi(2);
                let region = region.unwrap_or_else(|| camera.upper_body(&head));
                (ImageBox::upper_body(region), head, Matrix3::identity() * variance)
            }
            (None, Some(region)) => {
                let upper_body = self.upper_body(&region);
                let PointEstimate { position, covariance } = self.located(frame, &upper_body)?;
                let image = match self.config.body {
                    Body::FullBox => ImageBox::full_body(region),
                    Body::Full | Body::Upper => ImageBox::upper_body(upper_body),
                };
                (image, position, covariance)
            }
            (None, None) => return None,
        };
        let inside = image.rect.clipped(camera.width, camera.height).area() > 0.0;
        let score = self.log_odds(recorded.score);
        let detection = Detection { image: Some(image), position, covariance, score, source: NAME };
        (inside && detection.is_sane()).then_some(detection)
    }

    fn upper_body(&self, region: &Rect) -> Rect {
        match self.config.body {
            Body::Upper => *region,
            Body::Full | Body::FullBox => region.upper_body_of_standing(self.config.height_m),
        }
    }

    /// Returns the head position for an upper-body square, with its covariance: from the depth
    /// image where that shows the face, otherwise from the size of the square.
    fn located(&self, frame: &Frame, region: &Rect) -> Option<PointEstimate> {
        let (camera, config) = (&*frame.camera, &self.config);
        let measured = frame.depth().ok().and_then(|depth| depth.face_m(region));
        let face =
            FaceDepth::by_size(camera, UPPER_BODY_SIDE_M, region.width, config.sigma_distance)
                .or_measured(measured, config.sigma_depth_m);
        let sane = face.depth_m.is_finite() && face.depth_m > 0.05;
        sane.then(|| camera.locate_head(region, face, config.sigma_px))
    }

    fn log_odds(&self, score: f64) -> f64 {
        match self.config.score {
            ScoreScale::LogOdds => score,
            ScoreScale::Probability => {
                // The log-odds of 0 and 1 are infinite.
                let sure = score.clamp(SURE, 1.0 - SURE);
                (sure / (1.0 - sure)).ln()
            }
        }
    }

    /// Returns a score of the fit of a detection to a track; `None` if it is not near.
    fn fit(&self, track: &Track, detection: &Detection) -> Option<f64> {
        let overlap = detection.rect().map_or(0.0, |seen| track.estimate.region.iou(&seen));
        let away_m = (track.estimate.person.position.xy() - detection.position.xy()).norm();
        // The distance by size alone may be far off on the floor, so overlap is enough for such a
        // box.
        let guessed = detection.covariance.diagonal().xy().max() > 0.25 * self.config.near_m;
        let near = away_m <= self.config.near_m || guessed && overlap >= self.config.near_overlap;
        near.then_some(overlap - away_m)
    }
}

impl Detector for RecordedDetections {
    fn capabilities(&self) -> Capabilities {
        let depth = Inputs::NONE.accept(Input::Depth);
        Capabilities {
            inputs: if self.boxes.is_some() { depth } else { depth.require(Input::Detections) },
            discovers: true,
            tracks: true,
            weighs: false,
        }
    }

    fn detect(
        &mut self,
        frame: &Frame,
        search: &Query<'_>,
        funnel: &mut Funnel,
    ) -> Result<Vec<Detection>> {
        let mut found = Vec::new();
        for recorded in self.recorded(frame, funnel) {
            if recorded.score < self.config.min_score {
                funnel.drop_at("recorded score", recorded.region.unwrap_or_default());
                continue;
            }
            match self.detection(frame, recorded) {
                Some(detection) => found.push(detection),
                None => funnel.drop_at("outside", recorded.region.unwrap_or_default()),
            }
        }
        // The best fit comes first, because the search is for one person.
        if let Query::Track(track) = search {
            let mut near: Vec<(f64, Detection)> =
                found.into_iter().filter_map(|d| Some((self.fit(track, &d)?, d))).collect();
            near.sort_by(|a, b| b.0.total_cmp(&a.0));
            found = near.into_iter().map(|(_, detection)| detection).collect();
        }
        Ok(found)
    }
}
