use nalgebra::Matrix3;
use tagalong_config::Context;
use tagalong_core::{
    Capabilities, Detection, Detector, ExternalDetection, Frame, Funnel, Input, Inputs, Query,
    Result,
};
use tagalong_geometry::ImageBox;
use tagalong_vision::is_shown;

use crate::NAME;
use crate::boxes::{Boxes, read};
use crate::config::Config;

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
        let score = self.config.score_of(recorded.score);
        let Some(head) = recorded.head else {
            return self.config.boxes.detection(frame, &recorded.region?, score, NAME);
        };
        let region = recorded.region.unwrap_or_else(|| frame.camera.upper_body(&head));
        let detection = Detection::new(
            NAME,
            head,
            Matrix3::identity() * self.config.sigma_position_m.powi(2),
            score,
        )
        .with_image(ImageBox::upper_body(region));
        if is_shown(&frame.camera, &detection) {
            return Some(detection);
        }
        let seen_elsewhere = detection.with_image(None);
        (self.config.outside_image && seen_elsewhere.is_sane()).then_some(seen_elsewhere)
    }
}

impl Detector for RecordedDetections {
    fn capabilities(&self) -> Capabilities {
        let depth = Inputs::NONE.accept(Input::Depth);
        let inputs = if self.boxes.is_some() { depth } else { depth.require(Input::Detections) };
        Capabilities::new(inputs).discovering().tracking()
    }

    fn detect(
        &mut self,
        frame: &Frame,
        query: &Query<'_>,
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
        Ok(match query {
            Query::Track(track) => self.config.boxes.near(track, found),
            Query::Discover { .. } => found,
        })
    }
}
