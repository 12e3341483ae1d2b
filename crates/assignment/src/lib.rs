//! What associators share: the cost of a pair of a track and a detection, its gate, and the
//! global assignment with the least sum of costs.
//!
//! An associator is a plugin; it depends on no other plugin. What several of them compute in
//! the same way stands here.

mod assign;
mod pair;

pub use assign::assign;
pub use pair::{Cost, Fit, Overlap, PairCost, assign_fits};
