//! Scenes that benches and examples have in common, and the statistic of their times.

pub mod overlapping;
pub mod square;
pub mod timing;
