//! IDF1 and its counts: one track for each person over the whole sequence.

use serde::{Deserialize, Serialize};

use crate::clear::MATCH_SIMILARITY;
use crate::pairs::PairTable;
use crate::prepare::Prepared;
use crate::ratio;
use tagalong_math::matching::Matcher;

/// The identity counts (Ristani et al., ECCV 2016 workshops): each truth is assigned one track for
/// the whole sequence so that as many frames as possible agree.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Identity {
    /// Frames in which a truth was matched by its own track.
    pub tp: u64,
    /// Frames in which it was not.
    #[serde(rename = "fn")]
    pub fn_: u64,
    /// Reports of a track away from its own truth.
    pub fp: u64,
}

impl Identity {
    /// Scores one sequence.
    pub fn measure(prepared: &Prepared, table: &PairTable) -> Self {
        // Identity is decided over the whole sequence: an assignment of tracks to people, not of
        // frames.
        let together = table.count(prepared, |pair| pair.weight >= MATCH_SIMILARITY);
        let edges = table.edges(|pair| together[pair] as f64);
        let mut matched = Vec::new();
        let rows = prepared.truth_ids.len();
        let cols = prepared.track_ids.len();
        Matcher::new().best(rows, cols, &edges, &mut matched);
        let tp = matched.iter().map(|&e| edges[e as usize].weight as u64).sum();
        Self { tp, fn_: prepared.truth_count() - tp, fp: prepared.report_count() - tp }
    }

    /// Combines the counts of several sequences.
    pub fn combine<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        all.into_iter().fold(Self::default(), |a, b| Self {
            tp: a.tp + b.tp,
            fn_: a.fn_ + b.fn_,
            fp: a.fp + b.fp,
        })
    }

    /// Returns the harmonic mean of identity precision and recall.
    pub fn idf1(&self) -> f64 {
        ratio(self.tp as f64, self.tp as f64 + 0.5 * (self.fp + self.fn_) as f64)
    }

    /// Returns the identity precision.
    pub fn idp(&self) -> f64 {
        ratio(self.tp as f64, (self.tp + self.fp) as f64)
    }

    /// Returns the identity recall.
    pub fn idr(&self) -> f64 {
        ratio(self.tp as f64, (self.tp + self.fn_) as f64)
    }
}
