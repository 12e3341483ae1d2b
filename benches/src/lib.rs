//! Scenes that benches and examples have in common.

pub mod overlapping;
pub mod square;
