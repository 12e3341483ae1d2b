//! Recall by the visible fraction of a person.

use serde::{Deserialize, Serialize};

use crate::clear::Match;
use crate::prepare::Prepared;
use crate::types::{Sequence, Truth};

/// Maximum distance of people in these figures, m: farther away, depth cameras see little.
pub const NEAR_M: f64 = 5.0;
/// Visible fraction from which a person counts as fully visible ...
pub const FREE: f64 = 0.9;
/// ... and from which one counts as partly hidden. People below this are in neither figure.
pub const PARTLY: f64 = 0.6;

/// Matched people, among those that count.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Found {
    /// Number of matched people ...
    pub matched: u64,
    /// ... out of this number.
    pub of: u64,
}

impl Found {
    /// Returns the fraction that was matched; `None` if there are no people to find.
    pub fn recall(&self) -> Option<f64> {
        (self.of > 0).then(|| self.matched as f64 / self.of as f64)
    }
}

/// People within [`NEAR_M`] of the camera, over all frames, if the truth has their distance and
/// visible fraction.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct VisibilityTally {
    /// People with a visible fraction of at least [`FREE`].
    pub free: Found,
    /// People with a visible fraction of at least [`PARTLY`] and less than [`FREE`].
    pub partly_hidden: Found,
}

impl VisibilityTally {
    /// Counts the people of one sequence.
    pub fn measure(sequence: &Sequence, prepared: &Prepared, matches: &[Vec<Match>]) -> Self {
        let mut tally = Self::default();
        for ((of, frame), matches) in sequence.frames.iter().zip(&prepared.frames).zip(matches) {
            for (row, at) in frame.truth_at.iter().enumerate() {
                let is_matched = matches.iter().any(|m| m.row as usize == row);
                tally.add(&of.truths[*at as usize], is_matched);
            }
        }
        tally
    }

    fn add(&mut self, truth: &Truth, is_matched: bool) {
        let Some(view) = truth.view.filter(|view| view.distance_m <= NEAR_M) else { return };
        let found = match view.visible {
            visible if visible >= FREE => &mut self.free,
            visible if visible >= PARTLY => &mut self.partly_hidden,
            _ => return,
        };
        found.matched += u64::from(is_matched);
        found.of += 1;
    }

    /// Combines the tallies of several sequences.
    pub fn combine<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut sum = Self::default();
        for tally in all {
            for (sum, part) in
                [(&mut sum.free, tally.free), (&mut sum.partly_hidden, tally.partly_hidden)]
            {
                sum.matched += part.matched;
                sum.of += part.of;
            }
        }
        sum
    }
}
