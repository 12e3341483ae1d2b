//! Input of the checks: gathered once, in one pass over the frames.

use std::sync::Arc;

use tagalong_core::DepthImage;
use tagalong_geometry::Camera;
use tagalong_log::{InputSettings, Inputs, Inspection, LogError, LogFrame};
use tagalong_vision::ground::{Ground, GroundSettings, ground_of_depth};
use tagalong_vision::quality::Exposure;
use tagalong_vision::registration::{EdgeOverlap, OverlapSettings};

use super::trial::Trial;

/// Number of measured frames, spread over those that are read.
const SAMPLES: u64 = 24;

/// Number of depth images that are kept for a summary.
const KEPT_DEPTHS: usize = 8;

/// Facts about a config and a log.
pub struct Evidence {
    /// Contents of the log.
    pub inspection: Inspection,
    /// Reason for which the pipeline lacks an input that it requires.
    pub refusal: Option<LogError>,
    /// `[input]` of the config.
    pub input: InputSettings,
    /// Inputs of the pipeline.
    pub inputs: Inputs,
    /// Measurements in frames.
    pub samples: Samples,
    /// Result of the pipeline.
    pub trial: Trial,
}

/// Measurements of frames that are spread over the log.
pub struct Samples {
    every: u64,
    /// Number of measured frames.
    pub count: usize,
    /// Camera of the first one.
    pub camera: Option<Arc<Camera>>,
    /// Exposure of each.
    pub exposures: Vec<Exposure>,
    /// Some of the depth images.
    pub depths: Vec<Arc<DepthImage>>,
    /// Overlap of the edges of depth and colour.
    pub overlap: EdgeOverlap,
    /// Floor in each frame where it was found, with the camera of that frame.
    pub floors: Vec<(Ground, Arc<Camera>)>,
}

impl Samples {
    /// Returns empty samples for about so many frames.
    pub fn of(frames: u64) -> Self {
        Self {
            every: (frames / SAMPLES).max(1),
            count: 0,
            camera: None,
            exposures: Vec::new(),
            depths: Vec::new(),
            overlap: EdgeOverlap::new(OverlapSettings::default()),
            floors: Vec::new(),
        }
    }

    /// Measures the frame if it is its turn.
    pub fn take(&mut self, number: u64, item: &LogFrame) {
        if !number.is_multiple_of(self.every) {
            return;
        }
        let frame = &item.frame;
        self.count += 1;
        self.camera.get_or_insert_with(|| Arc::clone(&frame.camera));
        let grey = frame.grey().ok();
        self.exposures.extend(grey.map(Exposure::of));
        let Some(depth) = &frame.images().depth else { return };
        if self.depths.len() < KEPT_DEPTHS {
            self.depths.push(Arc::clone(depth));
        }
        // Edges and floor are measured in pinhole images only.
        if frame.camera.panorama().is_some() {
            return;
        }
        if let Some(grey) = grey {
            self.overlap.add(grey, depth);
        }
        let floor = ground_of_depth(depth, &frame.camera, &GroundSettings::default());
        self.floors.extend(floor.map(|floor| (floor, Arc::clone(&frame.camera))));
    }
}
