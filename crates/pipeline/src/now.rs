use std::collections::BTreeMap;
use std::time::Instant;

use tagalong_core::{Frame, Support, Track, TrackId};

use crate::FrameReport;
use crate::sightings::Sightings;

/// What is known of the frame that is being processed.
pub(crate) struct Now<'f> {
    pub(crate) frame: &'f Frame,
    /// All tracks, predicted to this frame, near to far.
    pub(crate) expected: Vec<Track>,
    pub(crate) sightings: Sightings,
    /// Detectors that work on this frame.
    pub(crate) due: Vec<usize>,
    pub(crate) supports: BTreeMap<TrackId, Support>,
    pub(crate) report: FrameReport,
    lap: Instant,
}

impl<'f> Now<'f> {
    pub(crate) fn new(frame: &'f Frame) -> Self {
        Self {
            frame,
            expected: Vec::new(),
            sightings: Sightings::default(),
            due: Vec::new(),
            supports: BTreeMap::new(),
            report: FrameReport::new(frame.index, frame.stamp),
            lap: Instant::now(),
        }
    }

    pub(crate) fn lap(&mut self, stage: &'static str) {
        let now = Instant::now();
        let spent_ms = (now - self.lap).as_secs_f64() * 1e3;
        self.report.timings.push((stage, spent_ms));
        self.lap = now;
    }

    pub(crate) fn finish(mut self) -> FrameReport {
        self.report.candidates = self.sightings.into_candidates(&mut self.report.funnel);
        self.report
    }
}
