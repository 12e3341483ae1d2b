//! Observation-centric re-update: a track that is observed again after a gap is filtered anew over
//! the gap, as if it had been observed along the straight line between the two observations (ORU of
//! OC-SORT: Cao et al., CVPR 2023).
//!
//! Otherwise the velocity errors that grew in the gap would remain after it.

use tagalong_core::{Detection, EgoMotion};
use tagalong_geometry::{Camera, ImageBox, Rect};

use crate::image_kalman::{Config, State};

/// Longest gap that is bridged, frames; a longer one says nothing about the way.
const MAX_FRAMES: usize = 256;

/// The state at the last observation, and the motions of the robot since then.
#[derive(Clone, Debug)]
pub(crate) struct Gap {
    state: State,
    seen: Detection,
    /// Motion from each frame to the next, and the camera of that.
    steps: Vec<(EgoMotion, Camera)>,
}

impl Gap {
    /// Begins after an observation.
    pub(crate) fn new(state: &State, seen: &Detection) -> Self {
        Self { state: state.clone(), seen: seen.clone(), steps: Vec::new() }
    }

    /// Adds the motion of the robot from one frame to the next, with the camera of that.
    pub(crate) fn add(&mut self, motion: &EgoMotion, camera: &Camera) {
        if self.steps.len() <= MAX_FRAMES {
            self.steps.push((*motion, camera.clone()));
        }
    }

    /// Returns the state after the gap, which ends with a detection; `None` if there was no frame
    /// between, or too many.
    pub(crate) fn bridged(
        &self,
        config: &Config,
        seen: &Detection,
        camera: &Camera,
    ) -> Option<State> {
        let frames = self.steps.len();
        if !(2..=MAX_FRAMES).contains(&frames) || self.state.is_behind() {
            return None;
        }
        let whole_s: f64 = self.steps.iter().map(|(motion, _)| motion.dt).sum();
        let mut state = self.state.clone();
        let mut passed_s = 0.0;
        for (at, (motion, then)) in self.steps.iter().enumerate() {
            passed_s += motion.dt;
            state.predict(config, motion, then);
            if at + 1 < frames {
                let part = if whole_s > 0.0 { passed_s / whole_s } else { 1.0 };
                state.correct(config, &between(&self.seen, seen, part, camera), then);
            }
        }
        state.correct(config, seen, camera);
        Some(state)
    }
}

/// Returns the detection that divides the straight way from one to another.
fn between(from: &Detection, to: &Detection, part: f64, camera: &Camera) -> Detection {
    let a = from.rect_in(camera);
    let b = to.rect_in(camera);
    let sides = [(a.x, b.x), (a.y, b.y), (a.width, b.width), (a.height, b.height)];
    let [x, y, width, height] = sides.map(|(a, b)| a + part * (b - a));
    let rect = Rect::new(x, y, width, height);
    let position = from.position + (to.position - from.position) * part;
    let image = to.image.map(|image| ImageBox { rect, ..image });
    to.clone().with_image(image).with_position(position)
}
