//! Random numbers, statistics and exact assignment, in one place for the whole workspace.
//!
//! * [`SplitMix64`], [`ChaCha`], [`XorShift64`]: seeded generators with the same numbers on every
//!   machine; [`RandomSource`] has the distributions. [`mix`] and [`number_at`] turn keys into
//!   random numbers without a state, for threads that work in any order; [`fingerprint`] hashes
//!   bytes.
//! * [`mean`], [`mean_and_deviation`], [`median`], [`percentile`]: summaries of values.
//! * [`mean_interval`], [`draws_interval`], [`wilson`], [`clustered_share`], [`exact_upper_bound`]:
//!   confidence intervals; [`paired_gain`], [`sign_flip`], [`holm`], [`draws_needed`]: significance
//!   of differences.
//! * [`matching`]: the assignment of rows to columns with the greatest weight, for metrics and for
//!   associators.
//! * [`exp2_of_negative`]: a fast exponential function for loops over many numbers.
//! * [`counted`]: a number with its noun, for printed text.
//!
//! There is no clock and no global generator, so the same seed gives the same bytes.

mod counted;
mod intervals;
pub mod matching;
mod power;
mod random;
mod significance;
mod summary;

pub use counted::counted;
pub use intervals::{
    CONFIDENCE, Interval, clustered_share, draws_interval, exact_upper_bound, mean_interval, wilson,
};
pub use power::exp2_of_negative;
pub use random::{ChaCha, RandomSource, SplitMix64, XorShift64, fingerprint, mix, number_at};
pub use significance::{Gain, draws_needed, holm, is_significant, paired_gain, sign_flip};
pub use summary::{mean, mean_and_deviation, median, percentile};
