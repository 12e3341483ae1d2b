//! Rule by which appearances are learned; a program may replace it.

use std::fmt::Debug;
use std::sync::Arc;

use tagalong_core::Track;
use tagalong_geometry::Rect;

use crate::Config;

/// A detection that overlaps the track's box by less was not the one that the track was given (IoU).
const SAME_PLACE: f64 = 0.7;

/// Rule by which the model of a person is adapted to a frame.
pub trait LearningRule: Debug + Send + Sync {
    /// Returns the weight of the past against this frame; `None` where nothing is to be learned.
    /// `found` is the box that the detector found, with its confidence; `is_new` is true before the
    /// first frame is learned.
    fn memory(
        &self,
        config: &Config,
        track: &Track,
        found: Option<(Rect, f32)>,
        is_new: bool,
    ) -> Option<f64> {
        careful_memory(config, track, found, is_new)
    }

    /// Returns true if boxes are learned that show another depth than the person's.
    fn ignores_depth(&self) -> bool {
        false
    }
}

/// Learns neither from hidden people nor from unsure boxes.
fn careful_memory(
    config: &Config,
    track: &Track,
    found: Option<(Rect, f32)>,
    is_new: bool,
) -> Option<f64> {
    if !track.seen || track.occluded {
        return None;
    }
    if is_new {
        return Some(0.0);
    }
    match found {
        Some((region, confidence)) if region.iou(&track.estimate.region) >= SAME_PLACE => {
            (f64::from(confidence) >= config.learn_confidence).then_some(config.memory)
        }
        _ => Some(config.anchored_memory),
    }
}

/// The default rule.
#[derive(Clone, Copy, Debug)]
struct Careful;

impl LearningRule for Careful {}

/// Rule of learning, the default one or that of a program.
#[derive(Clone, Debug)]
pub struct Learning(Arc<dyn LearningRule>);

impl Learning {
    /// Returns another rule.
    pub fn new(rule: impl LearningRule + 'static) -> Self {
        Self(Arc::new(rule))
    }

    /// Returns the rule.
    pub fn rule(&self) -> &dyn LearningRule {
        &*self.0
    }
}

impl Default for Learning {
    fn default() -> Self {
        Self::new(Careful)
    }
}

impl PartialEq for Learning {
    fn eq(&self, other: &Self) -> bool {
        // Rules have no equality of their own; their settings are in what they print.
        format!("{self:?}") == format!("{other:?}")
    }
}
