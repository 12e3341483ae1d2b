use std::sync::Arc;

use tagalong_core::{Command, EgoMotion, Funnel, Joints, Stamp, Track, TrackId, Visualisation};
use tagalong_tracking::{
    Candidate, IdentityCorrection, IdentityDoubt, Outcome, TrackingReport, Weighing, joints_of,
};

use crate::{Cause, LockReport, ObstaclePoint};

/// Result of one frame: the [`TrackingReport`] and, where the pipeline has a controller, the target
/// and the command.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FrameReport {
    /// Index of the frame.
    pub index: u64,
    /// Stamp of the frame.
    pub stamp: Stamp,
    /// Decision that its stamp led to.
    pub outcome: Outcome,
    /// Robot motion since the last processed frame, by its odometry, corrected by static structure
    /// in the images where the config asks for that; at rest where a jump of the clock leaves it
    /// unknown.
    pub motion: EgoMotion,
    /// All detections, each with its fate.
    pub candidates: Vec<Candidate>,
    /// Number of dropped items per test.
    pub funnel: Funnel,
    /// All tracks, confirmed or not, near to far.
    pub tracks: Vec<Track>,
    /// Track of the person to follow, where the pipeline has a controller.
    pub target: Option<TrackId>,
    /// State and confidence of the target lock, where the pipeline has a controller.
    pub lock: Option<LockReport>,
    /// Command for the wheels with its reason, where the pipeline has a controller: its wish within
    /// all limits, zero without a target.
    pub command: Option<Command>,
    /// Cause of the command's reason, where a place, a frozen sensor or a fault is one.
    pub cause: Option<Cause>,
    /// Places that the collision monitor counts as obstacles, where the pipeline has a controller;
    /// those of the followed person are left out.
    pub obstacles: Vec<ObstaclePoint>,
    /// Normalised innovation squared and its degrees of freedom.
    pub nis: Vec<(TrackId, f64, u32)>,
    /// Likelihood evaluations of the frame.
    pub weighing: Weighing,
    /// Visualisation of the filter, where [`crate::Pipeline::visualise`] asks for it.
    pub visualisation: Option<Visualisation>,
    /// Milliseconds per stage. With those of `weighing` and of the plugins the only part that
    /// differs between two runs.
    pub timings: Vec<(&'static str, f64)>,
    /// Milliseconds per plugin.
    pub plugin_timings: Vec<(String, f64)>,
    /// Tracks that ended in this frame.
    pub ended: Vec<TrackId>,
    /// Tracks whose ID may be that of another person.
    pub doubts: Vec<IdentityDoubt>,
    /// IDs of earlier frames that this frame shows to be wrong, to be applied one after the other.
    pub corrections: Vec<IdentityCorrection>,
}

impl FrameReport {
    /// Returns the joints in the image, pixels, of each track for which a detector of this frame found
    /// them.
    pub fn joints(&self) -> Vec<(TrackId, Arc<Joints>)> {
        joints_of(&self.candidates)
    }

    /// Returns true if the images show an earlier time, because the camera is frozen: boxes and places
    /// of people are not those of now.
    pub fn shows_past(&self) -> bool {
        matches!(self.cause, Some(Cause::Sensor { shows_past: true, .. }))
    }

    /// Returns an empty report for a frame.
    pub fn new(index: u64, stamp: Stamp) -> Self {
        TrackingReport::new(index, stamp).into()
    }
}

impl From<TrackingReport> for FrameReport {
    fn from(tracking: TrackingReport) -> Self {
        let TrackingReport { index, stamp, outcome, motion, candidates, funnel, tracks, .. } =
            tracking;
        let TrackingReport { nis, weighing, visualisation, timings, plugin_timings, ended, .. } =
            tracking;
        let TrackingReport { doubts, corrections, .. } = tracking;
        Self {
            index,
            stamp,
            outcome,
            motion,
            candidates,
            funnel,
            tracks,
            target: None,
            lock: None,
            command: None,
            cause: None,
            obstacles: Vec::new(),
            nis,
            weighing,
            visualisation,
            timings,
            plugin_timings,
            ended,
            doubts,
            corrections,
        }
    }
}
