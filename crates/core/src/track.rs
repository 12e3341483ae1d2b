use std::fmt;

use serde::{Deserialize, Serialize};

use crate::Estimate;

/// The number of a track, unique within a run and never used again.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
pub struct TrackId(pub u32);

impl fmt::Display for TrackId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// A person as the pipeline knows them in this frame.
#[derive(Clone, Debug)]
pub struct Track {
    /// Its number.
    pub id: TrackId,
    /// Where the person is believed to be.
    pub estimate: Estimate,
    /// Supported by evidence in this frame; otherwise predicted only.
    pub seen: bool,
    /// Hidden behind a nearer tracked person in this frame.
    pub occluded: bool,
    /// Seen often enough to be reported.
    pub confirmed: bool,
    /// Frames since the track started.
    pub age: u32,
    /// Seconds since it was last seen.
    pub unseen_s: f64,
    /// Log-odds that this is a person, smoothed over the track.
    pub score: f64,
}
