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
#[derive(Clone, Debug)]
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

/// A track reads as its person: `track.position`, `track.velocity`.
impl Deref for Track {
    type Target = Person;

    fn deref(&self) -> &Person {
        &self.estimate.person
    }
}
