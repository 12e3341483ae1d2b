use crate::{Detection, EgoMotion, Track, TrackId};

/// A detection without a track.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Unassociated<'a> {
    /// The detection; its log-odds include those of the verifiers.
    pub detection: &'a Detection,
    /// Log-odds of the detector alone.
    pub detector_log_odds: f64,
    /// True if a search of the whole image found it. A search near a track passes tests that are
    /// meant for tracked people, and is no evidence for a new one.
    pub discovered: bool,
}

impl<'a> Unassociated<'a> {
    /// Creates a detection without a track, with the log-odds of the detector alone; `discovered`
    /// if a search of the whole image found it.
    pub fn new(detection: &'a Detection, detector_log_odds: f64, discovered: bool) -> Self {
        Self { detection, detector_log_odds, discovered }
    }
}

/// Confirmation and log-odds of a track.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct TrackHealth {
    /// True once the track counts as a person and is reported.
    pub confirmed: bool,
    /// Log-odds that the track is a person.
    pub log_odds: f64,
}

impl TrackHealth {
    /// Creates the health of a track: whether it counts as a person and is reported, and the
    /// log-odds that it is one.
    pub const fn new(confirmed: bool, log_odds: f64) -> Self {
        Self { confirmed, log_odds }
    }
}

/// Decision about a candidate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Initiation {
    /// The candidate starts a track.
    Start(TrackHealth),
    /// The candidate starts none; the name of the test is counted in the funnel.
    Drop(&'static str),
}

/// Observation of one track in one frame. A manager takes one that it does not know for no evidence.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Observation {
    /// The track started in this frame.
    Started,
    /// The track was updated by a detection with these log-odds.
    Detected {
        /// Log-odds of the detection, verifiers included.
        log_odds: f64,
    },
    /// The track was updated by the image itself, without a detection of its own.
    Updated,
    /// The track is visible, and was searched for without success.
    Missed,
    /// The detector that found the track last did not run on this frame.
    NotSearched,
    /// The track is occluded by a nearer track.
    Occluded,
    /// The track is outside of the image.
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
#[non_exhaustive]
pub struct ObservedTrack<'a> {
    /// The track after the update; its health is that before this frame.
    pub track: &'a Track,
    /// Its observation in this frame.
    pub observation: Observation,
}

impl<'a> ObservedTrack<'a> {
    /// Creates a track with its observation in this frame.
    pub fn new(track: &'a Track, observation: Observation) -> Self {
        Self { track, observation }
    }
}

/// Decisions of a manager about one frame.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct TrackChanges {
    /// Health of each track that continues; that of others is unchanged.
    pub health: Vec<(TrackId, TrackHealth)>,
    /// Tracks that end, each with the name of the test, which is counted in the funnel.
    pub ends: Vec<(TrackId, &'static str)>,
}

impl TrackChanges {
    /// Creates the decisions of a frame: the health of tracks that continue, and the tracks that end,
    /// each with the name of the test.
    pub fn new(health: Vec<(TrackId, TrackHealth)>, ends: Vec<(TrackId, &'static str)>) -> Self {
        Self { health, ends }
    }
}

/// Decides when tracks start, are confirmed and end: an initiator and a deleter in one, because
/// both use the same evidence.
///
/// ```
/// # use tagalong_core::*;
/// /// Believes each discovery at once, and ends each track that is missed.
/// struct Credulous;
///
/// impl TrackManager for Credulous {
///     fn initiate(&mut self, _: TrackId, new: &Unassociated<'_>) -> Initiation {
///         if new.discovered {
///             Initiation::Start(TrackHealth::new(true, 1.0))
///         } else {
///             Initiation::Drop("no track fits")
///         }
///     }
///
///     fn manage(&mut self, tracks: &[ObservedTrack<'_>]) -> TrackChanges {
///         let missed = tracks.iter().filter(|t| t.observation == Observation::Missed);
///         let ends = missed.map(|t| (t.track.id, "track: missed")).collect();
///         TrackChanges::new(Vec::new(), ends)
///     }
/// }
///
/// # use nalgebra::{Matrix3, SMatrix, zero};
/// # let (position, covariance) = ([2.0, 0.0, 1.6].into(), Matrix3::identity());
/// # let detection = Detection::new("example", position, covariance, 1.0);
/// let new = Unassociated::new(&detection, 1.0, true);
/// let Initiation::Start(health) = Credulous.initiate(TrackId(1), &new) else { unreachable!() };
/// assert!(health.confirmed);
///
/// # let (covariance, region) = (SMatrix::identity(), tagalong_geometry::Rect::default());
/// # let estimate = Estimate::new(Person { position, velocity: zero() }, covariance, region);
/// # let track = Track::new(TrackId(1), estimate, health.log_odds).with_seen(false);
/// let missed = ObservedTrack::new(&track, Observation::Missed);
/// assert_eq!(Credulous.manage(&[missed]).ends, [(TrackId(1), "track: missed")]);
/// ```
pub trait TrackManager: Send {
    /// Returns the log-odds below which a detection alone starts no track.
    fn start_log_odds(&self) -> f64 {
        0.0
    }

    /// Advances to the next frame: positions that the manager remembers move into the robot's new
    /// frame, and age.
    fn predict(&mut self, motion: &EgoMotion) {
        let _ = motion;
    }

    /// Decides if a candidate starts the track `id`. A candidate at the position of a track that
    /// was detected there is dropped before.
    fn initiate(&mut self, id: TrackId, candidate: &Unassociated<'_>) -> Initiation;

    /// Judges all tracks of a frame, sorted from near to far. [`crate::Track::age`],
    /// [`crate::Track::unseen_s`] and the estimate are those of this frame.
    fn manage(&mut self, tracks: &[ObservedTrack<'_>]) -> TrackChanges;

    /// Records that two tracks belong to one person, and that `ended` is about to stop. Returns the
    /// health of the track that continues, if it changes.
    fn merge(&mut self, kept: TrackId, ended: TrackId) -> Option<TrackHealth> {
        let _ = (kept, ended);
        None
    }

    /// Discards a track that ended for another reason than a decision of this manager.
    fn stop(&mut self, id: TrackId) {
        let _ = id;
    }

    /// Discards all positions: after a gap or a jump of the clock the robot may be at any place.
    fn reset(&mut self) {}
}
