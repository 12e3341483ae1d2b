//! Steps of the detector that a program may replace.

use std::sync::Arc;

use tagalong_core::{Frame, Result};

use crate::bank::Template;
use crate::matching::Match;
use crate::weigher::PlacedPerson;

/// Comparison of silhouettes with a frame, in place of [`crate::Matcher`].
pub trait SilhouetteComparison: Send {
    /// Prepares the comparison with the silhouettes of one frame.
    ///
    /// # Errors
    /// A frame without depth.
    fn prepare(&self, frame: &Frame) -> Result<Box<dyn FrameComparison>>;
}

/// A [`SilhouetteComparison`] that is ready for one frame.
pub trait FrameComparison {
    /// Compares a template, with its head centre on a reduced pixel and its face at a depth, with the
    /// frame; `None` where too little of the person has a reading.
    fn fit(&self, template: &Template, pixel: (i64, i64), depth_m: f64) -> Option<Match>;
}

/// Likelihood of imagined scenes, in place of the ratio of [`crate::Weigher`].
pub trait SceneLikelihood: Send + Sync {
    /// Prepares the scenes of one frame.
    ///
    /// # Errors
    /// A frame without depth.
    fn prepare(&self, frame: &Frame) -> Result<Arc<dyn FrameLikelihood>>;
}

/// A [`SceneLikelihood`] that is ready for one frame.
pub trait FrameLikelihood: Send + Sync {
    /// Returns the log-likelihood of people at their places, near to far.
    fn log_likelihood(&self, scene: &[PlacedPerson]) -> f64;
}
