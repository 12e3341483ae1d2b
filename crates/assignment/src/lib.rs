//! Common parts of the associators: the cost of a pair of a track and a detection, its gate, and
//! the global assignment with the least sum of costs.
//!
//! An associator is a plugin; it depends on no other plugin. Code that several of them need belongs
//! here.

mod assign;
mod fusion;
mod observations;
mod pair;
mod similarity;

pub use assign::assign;
pub use fusion::{AppearanceFusion, Fusion};
pub use observations::{ObservationMemory, Observed};
pub use pair::{Cost, Fit, Overlap, PairCost, Pairs, assign_fits};
pub use similarity::{PrioritySettings, Stage, Staged, buffered_iou, probability};
