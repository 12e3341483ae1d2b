//! What the checks look at: gathered once, in one pass over the frames.

use std::sync::Arc;

use tagalong_core::{Camera, DepthImage};
use tagalong_log::{InputSettings, Inputs, Inspection, LogError, LogFrame};
use tagalong_vision::ground::{Ground, GroundSettings, ground_of_depth};
use tagalong_vision::quality::Exposure;
use tagalong_vision::registration::{EdgeOverlap, OverlapSettings};

use super::trial::Trial;

/// Frames that are measured, spread over those that are read.
const SAMPLES: u64 = 24;

/// Depth images that are kept to be summed up.
const KEPT_DEPTHS: usize = 8;

/// Everything that is known of a config and a log.
pub struct Evidence {
    /// What the log holds.
    pub inspection: Inspection,
    /// Why the pipeline cannot have what it requires.
    pub refusal: Option<LogError>,
    /// `[input]` of the config.
    pub input: InputSettings,
    /// The inputs of the pipeline.
    pub inputs: Inputs,
    /// What was measured in frames.
    pub samples: Samples,
    /// What the pipeline made of them.
    pub trial: Trial,
}

/// Measurements of frames that are spread over the log.
pub struct Samples {
    every: u64,
    /// Frames that were measured.
    pub count: usize,
    /// The camera of the first one.
    pub camera: Option<Arc<Camera>>,
    /// The light of each.
    pub exposures: Vec<Exposure>,
    /// Some of the depth images.
    pub depths: Vec<Arc<DepthImage>>,
    /// How depth lies on colour.
    pub overlap: EdgeOverlap,
    /// The floor in each where it was found, with the camera of that frame.
    pub floors: Vec<(Ground, Arc<Camera>)>,
}

impl Samples {
    /// Before the first of about so many frames.
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
