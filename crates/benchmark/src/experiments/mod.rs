//! Experiments: pipelines compared on many random variants of simulated scenes, or on given boxes,
//! and rides in which the robot follows a person.

pub mod boxes;
mod contender;
pub mod follow;
pub mod trials;
