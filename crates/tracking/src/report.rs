use tagalong_core::{Detection, Funnel, Motion, Sketch, Stamp, Track, TrackId};

use crate::Weighing;

/// What became of a detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It was given to this track.
    Matched(TrackId),
    /// It started this track.
    Started(TrackId),
    /// This test dropped it.
    Dropped(&'static str),
}

/// A detection and what became of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The detection; its score includes the verifiers' margins.
    pub detection: Detection,
    /// What became of it.
    pub fate: Fate,
}

/// What the stamp of a frame led to.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Outcome {
    /// An ordinary frame.
    Tracked,
    /// The same stamp as the frame before: not processed.
    Duplicate,
    /// Slightly older than the frame before: not processed.
    OutOfOrder,
    /// After a gap: processed, but tracks that were not confirmed ended.
    Gap {
        /// Time since the frame before, s.
        by_s: f64,
    },
    /// The clock was set back: all tracks ended, then the frame was processed.
    ResetBackward {
        /// How far, s.
        by_s: f64,
    },
    /// The clock jumped ahead: all tracks ended, then the frame was processed.
    ResetForward {
        /// Time since the frame before, s.
        by_s: f64,
    },
}

impl Outcome {
    /// False for frames that left no trace in the pipeline.
    pub fn is_processed(&self) -> bool {
        !matches!(self, Self::Duplicate | Self::OutOfOrder)
    }
}

/// Everything that one frame led to.
#[derive(Clone, Debug)]
pub struct TrackingReport {
    /// Index of the frame.
    pub index: u64,
    /// Stamp of the frame.
    pub stamp: Stamp,
    /// What its stamp led to.
    pub outcome: Outcome,
    /// The robot's motion since the last processed frame, as the preprocessors estimate it; at
    /// rest where a jump of the clock leaves it unknown.
    pub motion: Motion,
    /// All detections, and what became of each.
    pub candidates: Vec<Candidate>,
    /// Everything that was dropped, and by which test.
    pub funnel: Funnel,
    /// All tracks, confirmed or not, near to far.
    pub tracks: Vec<Track>,
    /// Normalised innovation squared and its degrees of freedom.
    pub nis: Vec<(TrackId, f64, u32)>,
    /// What was asked of the likelihood.
    pub weighing: Weighing,
    /// What the filter shows of its work, where [`crate::Tracker::sketch`] asks for it.
    pub sketch: Sketch,
    /// Milliseconds by stage. With those of `weighing` and of the plugins the only part that
    /// differs between two runs.
    pub timings: Vec<(&'static str, f64)>,
    /// Milliseconds by plugin.
    pub plugin_timings: Vec<(String, f64)>,
    /// Tracks that ended in this frame.
    pub ended: Vec<TrackId>,
}

impl TrackingReport {
    /// Returns the report of a frame that led to nothing yet.
    pub fn new(index: u64, stamp: Stamp) -> Self {
        Self {
            index,
            stamp,
            outcome: Outcome::Tracked,
            motion: Motion::at_rest(0.0),
            candidates: Vec::new(),
            funnel: Funnel::default(),
            tracks: Vec::new(),
            nis: Vec::new(),
            weighing: Weighing::default(),
            sketch: Sketch::default(),
            timings: Vec::new(),
            plugin_timings: Vec::new(),
            ended: Vec::new(),
        }
    }
}
