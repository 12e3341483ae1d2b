use std::fmt;
use std::ops::Deref;

use serde::{Deserialize, Serialize};

use crate::{Estimate, Person};

/// Number of a track, unique within a run and never reused.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
pub struct TrackId(pub u32);

impl fmt::Display for TrackId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// State of a tracked person in this frame.
///
/// ```
/// # use nalgebra::{SMatrix, zero};
/// # use tagalong_core::{Estimate, Person, Track, TrackId};
/// # use tagalong_geometry::Rect;
/// let person = Person { position: [2.0, 0.0, 1.6].into(), velocity: zero() };
/// let estimate = Estimate::new(person, SMatrix::identity(), Rect::default());
/// let hidden = Track::new(TrackId(1), estimate, 2.5).with_seen(false).with_occluded(true);
/// assert!(hidden.confirmed && !hidden.seen);
/// assert_eq!(hidden.position.x, 2.0);
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Track {
    /// Number of the track.
    pub id: TrackId,
    /// State estimate of the person.
    pub estimate: Estimate,
    /// True if evidence of this frame supports the track; otherwise it is predicted only.
    pub seen: bool,
    /// True if a nearer tracked person hides the track in this frame.
    pub occluded: bool,
    /// True once the track is reported.
    pub confirmed: bool,
    /// Frames since the track started.
    pub age: u32,
    /// Seconds since the track was last supported by evidence.
    pub unseen_s: f64,
    /// Log-odds that this is a person, smoothed over the track.
    pub score: f64,
}

impl Track {
    /// Creates a confirmed track in its first frame, supported by evidence: its number, the state of
    /// its person, and the log-odds that this is a person.
    pub fn new(id: TrackId, estimate: Estimate, score: f64) -> Self {
        Self {
            id,
            estimate,
            seen: true,
            occluded: false,
            confirmed: true,
            age: 0,
            unseen_s: 0.0,
            score,
        }
    }

    /// Returns the track with another number.
    pub fn with_id(self, id: TrackId) -> Self {
        Self { id, ..self }
    }

    /// Returns the track with another state of its person.
    pub fn with_estimate(self, estimate: Estimate) -> Self {
        Self { estimate, ..self }
    }

    /// Returns the track with [`Track::seen`] as given.
    pub fn with_seen(self, seen: bool) -> Self {
        Self { seen, ..self }
    }

    /// Returns the track with [`Track::occluded`] as given.
    pub fn with_occluded(self, occluded: bool) -> Self {
        Self { occluded, ..self }
    }

    /// Returns the track with [`Track::confirmed`] as given.
    pub fn with_confirmed(self, confirmed: bool) -> Self {
        Self { confirmed, ..self }
    }

    /// Returns the track as it is some frames after its start.
    pub fn with_age(self, age: u32) -> Self {
        Self { age, ..self }
    }

    /// Returns the track as it is some seconds after its last evidence.
    pub fn with_unseen_s(self, unseen_s: f64) -> Self {
        Self { unseen_s, ..self }
    }

    /// Returns the track with other log-odds that this is a person.
    pub fn with_score(self, score: f64) -> Self {
        Self { score, ..self }
    }
}

/// A track reads as its person: `track.position`, `track.velocity`.
impl Deref for Track {
    type Target = Person;

    fn deref(&self) -> &Person {
        &self.estimate.person
    }
}
