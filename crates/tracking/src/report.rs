use std::sync::Arc;

use tagalong_core::{Detection, EgoMotion, Funnel, Joints, Stamp, Track, TrackId, Visualisation};

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

impl Candidate {
    /// Returns the track that the detection supports, if any.
    pub fn track(&self) -> Option<TrackId> {
        match self.fate {
            Fate::Matched(track) | Fate::Started(track) => Some(track),
            Fate::Dropped(_) => None,
        }
    }
}

/// Returns the joints of the tracks in the image, as far as a detector of this frame found them: those
/// of the detection that supports a track, or of one that another detector made of the same person,
/// with the head and the shoulders in that detection's box.
pub fn joints_of(candidates: &[Candidate]) -> Vec<(TrackId, Arc<Joints>)> {
    let mut found = Vec::new();
    for candidate in candidates {
        let Some(track) = candidate.track() else { continue };
        let own = candidate.detection.joints.as_ref();
        let joints = own.or_else(|| joints_beside(&candidate.detection, candidates));
        if let Some(joints) = joints {
            found.push((track, Arc::clone(joints)));
        }
    }
    found
}

/// Returns the joints of the dropped candidate that shows the person of a detection.
fn joints_beside<'a>(
    detection: &Detection,
    candidates: &'a [Candidate],
) -> Option<&'a Arc<Joints>> {
    let region = detection.rect()?;
    let dropped = candidates.iter().filter(|candidate| candidate.track().is_none());
    let mut poses = dropped.filter_map(|candidate| candidate.detection.joints.as_ref());
    poses.find(|joints| joints.upper_body_middle().is_some_and(|at| region.contains(at)))
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

/// Reported track whose ID may be that of another person: it was close to the tracks of others, and
/// the appearances since then do not yet tell which person is which.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IdentityDoubt {
    /// ID of the track.
    pub track: TrackId,
    /// IDs of the other people in question, rising.
    pub others: Vec<TrackId>,
}

/// Two IDs that were reported the wrong way round for a while. One of them may belong to no
/// person of these frames, if a person was recognised some frames after the start of a track.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdentityCorrection {
    /// Index of the first frame in which they are wrong; the frame of the report is right.
    pub since: u64,
    /// The two IDs.
    pub ids: [TrackId; 2],
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
    /// Tracks whose ID may be that of another person.
    pub doubts: Vec<IdentityDoubt>,
    /// IDs of earlier frames that this frame shows to be wrong, to be applied one after the other.
    pub corrections: Vec<IdentityCorrection>,
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
            doubts: Vec::new(),
            corrections: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point2, Point3};
    use tagalong_core::Joint;
    use tagalong_geometry::{ImageBox, Rect};

    use super::*;

    /// Returns a candidate with a box that begins at a column.
    fn candidate(column: f64, fate: Fate) -> Candidate {
        let region = Rect::new(column, 0.0, 40.0, 40.0);
        let detection =
            Detection::new("test", Point3::new(3.0, 0.0, 1.6), Matrix3::identity(), 1.0)
                .with_image(ImageBox::upper_body(region));
        Candidate { detection, fate }
    }

    /// Returns the candidate with all joints in one column.
    fn with_joints(candidate: Candidate, column: f64) -> Candidate {
        let joints = [Joint { at: Point2::new(column, 20.0), score: 0.9 }; 17];
        let detection = candidate.detection.with_joints(Some(Joints::new(joints)));
        Candidate { detection, ..candidate }
    }

    fn columns(candidates: &[Candidate]) -> Vec<(u32, f64)> {
        fn column(joints: &Joints) -> f64 {
            joints.upper_body_middle().map_or(0.0, |at| at.x)
        }

        let found = joints_of(candidates);
        found.iter().map(|(track, joints)| (track.0, column(joints))).collect()
    }

    #[test]
    fn joints_belong_to_the_track_of_their_detection() {
        let matched = with_joints(candidate(0.0, Fate::Matched(TrackId(4))), 10.0);
        let started = with_joints(candidate(100.0, Fate::Started(TrackId(5))), 110.0);
        let without = candidate(200.0, Fate::Matched(TrackId(6)));
        assert_eq!(columns(&[matched, started, without]), [(4, 10.0), (5, 110.0)]);
    }

    #[test]
    fn joints_of_another_detector_belong_to_the_track_of_the_same_person() {
        let own = candidate(0.0, Fate::Matched(TrackId(4)));
        let beside = with_joints(candidate(3.0, Fate::Dropped("double")), 15.0);
        let elsewhere = with_joints(candidate(100.0, Fate::Dropped("double")), 120.0);
        assert_eq!(columns(&[own.clone(), elsewhere.clone(), beside]), [(4, 15.0)]);
        assert_eq!(columns(&[own, elsewhere]), []);
    }
}
