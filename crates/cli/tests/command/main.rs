//! The program `tagalong`, as a user runs it: one test program for all commands, so
//! that it is linked once and its tests run beside each other.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may fail")]

mod common;

mod alter;
mod annotate;
mod answers;
mod bad_input;
mod bench;
mod blur;
mod comparison;
#[cfg(unix)]
mod damaged;
mod demo;
mod doctor;
mod eval;
mod field;
mod figures;
mod follow;
mod import;
mod inputs;
mod lacking;
mod live;
mod missing_topics;
mod model;
mod recorded;
mod rooms;
mod runs;
mod seeds;
mod shell;
#[cfg(unix)]
mod signals;
mod simulate;
mod train;
mod view;
