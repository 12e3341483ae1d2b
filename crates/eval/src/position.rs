//! Errors of positions in metres.

use serde::{Deserialize, Serialize};
use tagalong_math::{mean, percentile};

use crate::clear::Match;
use crate::prepare::Prepared;
use crate::types::{Sequence, distance_m};

/// Errors of the reported positions of matched people, in metres on the floor.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PositionError {
    /// Mean.
    pub mean_m: f64,
    /// Root of the mean square.
    pub rms_m: f64,
    /// 95th percentile, interpolated.
    pub p95_m: f64,
    /// The worst.
    pub max_m: f64,
    /// Number of matches.
    pub count: u64,
}

impl PositionError {
    /// Summarises single errors; `None` if there are none.
    ///
    /// ```
    /// use tagalong_eval::PositionError;
    /// let error = PositionError::of(&[0.3, 0.4]).unwrap();
    /// assert_eq!(error.mean_m, 0.35);
    /// assert_eq!(error.max_m, 0.4);
    /// ```
    pub fn of(errors_m: &[f64]) -> Option<Self> {
        let count = errors_m.len() as f64;
        Some(Self {
            p95_m: percentile(errors_m, 0.95)?,
            mean_m: mean(errors_m)?,
            rms_m: (errors_m.iter().map(|e| e * e).sum::<f64>() / count).sqrt(),
            max_m: errors_m.iter().copied().fold(0.0, f64::max),
            count: errors_m.len() as u64,
        })
    }
}

/// Returns the distance of each match, in metres, without the matches in which a position is
/// missing.
pub fn position_errors_m(
    sequence: &Sequence,
    prepared: &Prepared,
    matches: &[Vec<Match>],
) -> Vec<f64> {
    let mut errors = Vec::new();
    for ((of, frame), matches) in sequence.frames.iter().zip(&prepared.frames).zip(matches) {
        for m in matches {
            let truth = &of.truths[frame.truth_at[m.row as usize] as usize];
            let report = &of.reports[frame.track_at[m.col as usize] as usize];
            if let (Some(a), Some(b)) = (truth.floor_m, report.floor_m) {
                errors.push(distance_m(a, b));
            }
        }
    }
    errors
}
