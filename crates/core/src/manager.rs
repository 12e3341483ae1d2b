use crate::{Detection, Motion, Track, TrackId};

/// A detection that belongs to no track.
#[derive(Clone, Copy, Debug)]
pub struct Unassociated<'a> {
    /// The detection; its log-odds include the verifiers'.
    pub detection: &'a Detection,
    /// Log-odds by the detector alone.
    pub detector_log_odds: f64,
    /// True if a search of the whole image found it. A search near a track passes tests that
    /// are meant for known people, and proves nothing about a new one.
    pub discovered: bool,
}

/// Belief that a track is a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackHealth {
    /// True once the track counts as a person and is reported.
    pub confirmed: bool,
    /// Log-odds that the track is a person.
    pub log_odds: f64,
}

/// What becomes of a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Initiation {
    /// It starts a track.
    Start(TrackHealth),
    /// It starts none; the name of the test counts in the funnel.
    Drop(&'static str),
}

/// What one frame says of one track.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Observation {
    /// It started in this frame.
    Started,
    /// It was updated by a detection with these log-odds.
    Detected {
        /// Log-odds of the detection, verifiers included.
        log_odds: f64,
    },
    /// It was updated by the image itself, without a detection of its own.
    Updated,
    /// It is visible, and was searched for in vain.
    Missed,
    /// The detector that saw it last did not work on this frame.
    NotSearched,
    /// It is hidden behind a nearer track.
    Occluded,
    /// It is outside of the image.
    OutOfView,
}

impl Observation {
    /// Returns true if evidence of this frame supports the track.
    pub fn is_supported(self) -> bool {
        matches!(self, Self::Started | Self::Detected { .. } | Self::Updated)
    }
}

/// A track with the observation of one frame.
#[derive(Clone, Copy, Debug)]
pub struct ObservedTrack<'a> {
    /// The track after the update; its health is that before this frame.
    pub track: &'a Track,
    /// What the frame says of it.
    pub observation: Observation,
}

/// What a manager decided about one frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TrackChanges {
    /// The health of each track that goes on; that of others stays as it was.
    pub health: Vec<(TrackId, TrackHealth)>,
    /// Tracks that end, and the name of the test, which counts in the funnel.
    pub ends: Vec<(TrackId, &'static str)>,
}

/// Decides when tracks start, count as persons, and end: an initiator and a deleter in one,
/// because both draw on the same evidence.
///
/// ```
/// # use tagalong_core::*;
/// /// Believes each discovery at once, and ends each track that is missed.
/// struct Credulous;
///
/// impl TrackManager for Credulous {
///     fn initiate(&mut self, _: TrackId, new: &Unassociated<'_>) -> Initiation {
///         match new.discovered {
///             true => Initiation::Start(TrackHealth { confirmed: true, log_odds: 1.0 }),
///             false => Initiation::Drop("no track fits"),
///         }
///     }
///
///     fn manage(&mut self, tracks: &[ObservedTrack<'_>]) -> TrackChanges {
///         let missed = tracks.iter().filter(|t| t.observation == Observation::Missed);
///         let ends = missed.map(|t| (t.track.id, "track: missed")).collect();
///         TrackChanges { ends, ..TrackChanges::default() }
///     }
/// }
/// ```
pub trait TrackManager: Send {
    /// Returns the log-odds below which a detection alone starts no track.
    fn start_log_odds(&self) -> f64 {
        0.0
    }

    /// Advances to the next frame: places that the manager remembers move into the robot's
    /// new frame, and grow older.
    fn predict(&mut self, motion: &Motion) {
        let _ = motion;
    }

    /// Decides whether a candidate starts the track `id`. One at the place of a track that is
    /// seen there does not come so far.
    fn initiate(&mut self, id: TrackId, candidate: &Unassociated<'_>) -> Initiation;

    /// Judges all tracks of a frame, near to far. [`crate::Track::age`],
    /// [`crate::Track::unseen_s`] and the estimate are those of this frame.
    fn manage(&mut self, tracks: &[ObservedTrack<'_>]) -> TrackChanges;

    /// Takes note that two tracks are of one person, and `ended` is about to stop. Returns the
    /// health of the one that goes on, if it changes.
    fn merge(&mut self, kept: TrackId, ended: TrackId) -> Option<TrackHealth> {
        let _ = (kept, ended);
        None
    }

    /// Forgets a track that ended for another reason than the manager's own.
    fn stop(&mut self, id: TrackId) {
        let _ = id;
    }

    /// Forgets all places: after a gap or a jump of the clock the robot may be anywhere.
    fn reset(&mut self) {}
}
