use tagalong_core::{Detection, EgoMotion, Funnel, Stamp, Track, TrackId, Visualisation};

use crate::Weighing;

/// Fate of a detection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It was associated with this track.
    Matched(TrackId),
    /// It started this track.
    Started(TrackId),
    /// This test dropped it.
    Dropped(&'static str),
}

/// A detection and its fate.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The detection; its score includes the log-odds of the verifiers.
    pub detection: Detection,
    /// Its fate.
    pub fate: Fate,
}

/// Outcome of the check of a frame's stamp.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Outcome {
    /// An ordinary frame.
    Tracked,
    /// The same stamp as the frame before: not processed.
    Duplicate,
    /// Slightly older than the frame before: not processed.
    OutOfOrder,
    /// After a gap: processed, but tentative tracks ended.
    Gap {
        /// Time since the frame before, s.
        by_s: f64,
    },
    /// The clock was set back: all tracks ended, then the frame was processed.
    ResetBackward {
        /// Step of the clock, s.
        by_s: f64,
    },
    /// The clock jumped ahead: all tracks ended, then the frame was processed.
    ResetForward {
        /// Time since the frame before, s.
        by_s: f64,
    },
}

impl Outcome {
    /// Returns false for frames that left no trace in the pipeline.
    pub fn is_processed(&self) -> bool {
        !matches!(self, Self::Duplicate | Self::OutOfOrder)
    }
}

/// Results of one frame.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct TrackingReport {
    /// Index of the frame.
    pub index: u64,
    /// Stamp of the frame.
    pub stamp: Stamp,
    /// Outcome of the check of its stamp.
    pub outcome: Outcome,
    /// The robot's motion since the last processed frame, as the preprocessors estimate it; at rest
    /// if a jump of the clock leaves it unknown.
    pub motion: EgoMotion,
    /// All detections with their fates.
    pub candidates: Vec<Candidate>,
    /// Number of dropped candidates, by test.
    pub funnel: Funnel,
    /// All tracks, confirmed or not, from near to far.
    pub tracks: Vec<Track>,
    /// Normalised innovation squared and its degrees of freedom.
    pub nis: Vec<(TrackId, f64, u32)>,
    /// Cost of the scene likelihood.
    pub weighing: Weighing,
    /// Visualisation of the filter, if [`crate::Tracker::visualise`] requests it.
    pub visualisation: Option<Visualisation>,
    /// Milliseconds by stage. With those of `weighing` and of the plugins the only part that
    /// differs between two runs.
    pub timings: Vec<(&'static str, f64)>,
    /// Milliseconds by plugin.
    pub plugin_timings: Vec<(String, f64)>,
    /// Tracks that ended in this frame.
    pub ended: Vec<TrackId>,
}

impl TrackingReport {
    /// Returns the report of a frame without results.
    pub fn new(index: u64, stamp: Stamp) -> Self {
        Self {
            index,
            stamp,
            outcome: Outcome::Tracked,
            motion: EgoMotion::at_rest(0.0),
            candidates: Vec::new(),
            funnel: Funnel::default(),
            tracks: Vec::new(),
            nis: Vec::new(),
            weighing: Weighing::default(),
            visualisation: None,
            timings: Vec::new(),
            plugin_timings: Vec::new(),
            ended: Vec::new(),
        }
    }
}
