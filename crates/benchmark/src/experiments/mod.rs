//! Experiments: pipelines compared on many random variants of simulated scenes, or on given boxes;
//! rides after a person.

pub mod boxes;
mod contender;
pub mod follow;
pub mod trials;
