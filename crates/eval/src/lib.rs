//! Pure tracking and detection metrics.
//!
//! A [`Sequence`] holds frames, a [`Frame`] holds the people in it ([`Truth`]) and the tracks that
//! were reported ([`Report`]). The metrics compare the two, either in the image (intersection over
//! union) or on the floor (metres). Nothing here reads a file or a clock: the text formats in
//! [`formats`] work on strings.
//!
//! ```
//! use tagalong_eval::{Frame, Region, Report, Scores, Sequence, Similarity, Truth};
//!
//! let region = Some(Region::new(10.0, 20.0, 30.0, 60.0));
//! let frame = Frame {
//!     truths: vec![Truth { id: 1, region, ..Truth::default() }],
//!     reports: vec![Report { id: 7, region, score: 0.9, ..Report::default() }],
//!     ..Frame::default()
//! };
//! let sequence = Sequence { name: "one frame".into(), frames: vec![frame] };
//! let scores = Scores::measure(&sequence, Similarity::Iou)?;
//! assert_eq!((scores.hota, scores.mota, scores.idf1), (Some(1.0), Some(1.0), Some(1.0)));
//! # Ok::<(), tagalong_eval::EvalError>(())
//! ```
//!
//! # Which figure for what
//!
//! * [`Hota`], [`Clear`], [`Identity`]: tracking; the figures agree with those of TrackEval.
//! * [`DetectionTally`]: single detections; the miss-rate curve and its average.
//! * [`SetTally`]: OSPA and GOSPA, one number for errors of position and of count.
//! * [`PositionError`], [`Times`], [`Following`]: figures that matter for a robot.
//! * [`FloorClear`]: CLEAR on the floor with a cutoff in metres, as in benchmarks of leg trackers.
//! * [`events`]: a list of the errors with their times, to look through.
//! * [`repairs`]: HOTA, MOTA and IDF1 if one kind of error were repaired, which shows where work
//!   pays.
//! * [`Consistency`]: whether the covariance of a filter agrees with its errors.
//! * [`draws_interval`], [`mean_interval`], [`wilson`], [`clustered_share`]: the uncertainty of a
//!   figure; [`paired_gain`], [`holm`]: that of a difference.
//!
//! # Why similarities are computed once
//!
//! All metrics use the same pairs. [`Prepared`] removes everything that does not count, numbers the
//! IDs densely and keeps only the pairs with some similarity, a few per person; everything after
//! that works on short lists. Scoring is so fast that it can run inside a jackknife or a parameter
//! search.

mod clear;
mod consistency;
mod error;
mod events;
mod floor;
pub mod formats;
mod hota;
mod identity;
mod missrate;
mod pairs;
mod position;
mod prepare;
mod repairs;
mod scores;
mod sets;
mod times;
mod types;
mod visibility;

pub use clear::{Clear, MATCH_SIMILARITY, Match};
pub use consistency::{Consistency, chi_square_quantile};
pub use error::EvalError;
pub use events::{Event, EventKind, events};
pub use floor::{FloorClear, FloorPoint, FloorScan, FloorTally};
pub use hota::{Hota, HotaLevel, LEVELS, alpha};
pub use identity::Identity;
pub use missrate::{CurvePoint, DetectionTally, REFERENCE_FPPI, Verdict};
pub use pairs::PairTable;
pub use position::{PositionError, position_errors_m};
pub use prepare::{Comparison, Prepared, PreparedFrame};
pub use repairs::{PAIRED_SIMILARITY, Repair, Repaired, repairs};
pub use scores::{Scores, Tally};
pub use sets::{FrameDistance, GospaParts, SetDistance, SetTally};
pub use tagalong_math::matching::{Edge, Matcher};
pub use tagalong_math::{
    CONFIDENCE, Gain, Interval, clustered_share, draws_interval, holm, is_significant,
    mean_interval, paired_gain, percentile, sign_flip, wilson,
};
pub use times::{Following, Times};
pub use types::{Frame, Region, Report, Role, Sequence, Similarity, Truth, View};
pub use visibility::{FREE, Found, NEAR_M, PARTLY, VisibilityTally};

/// Returns a ratio of counts, with a denominator of at least one.
fn ratio(part: f64, whole: f64) -> f64 {
    part / whole.max(1.0)
}
