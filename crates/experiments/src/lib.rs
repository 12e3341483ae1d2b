//! Experiments: pipelines compared on many random variants of simulated scenes, or on given boxes;
//! rides after a person, and the tables of published systems.

pub mod boxes;
mod contender;
pub mod follow;
pub mod reproduce;
pub mod trials;
