//! Experiments on simulated scenes: pipelines compared on many random variants, rides after a person,
//! and the tables of published systems.

mod contender;
pub mod follow;
pub mod reproduce;
pub mod trials;
