//! Tracker: [`Tracker::step`] takes one frame through all stages, in the order of the table below,
//! and returns a [`TrackingReport`] with the tracks and, for every candidate that led to none, the
//! test that dropped it.
//!
//! | stage | module | decided by |
//! |---|---|---|
//! | stamps that jump | `clock` | [`ClockSettings`] |
//! | tracks held, once the calibration changed | `frozen` | |
//! | depth and motion completed | `preprocess` | each [`Preprocessor`] |
//! | tracks predicted | | the filter |
//! | tracks searched for, image searched for new people | `search` | detectors, verifiers |
//! | detections of one person merged | `detections` | [`MergeSettings`] |
//! | detections associated with tracks | | the associator |
//! | detections of half-hidden people made less certain | `occlusion` | [`OcclusionSettings`] |
//! | filter updated | | the filter |
//! | tracks started, confirmed, ended | `table` | the track manager |
//! | tracks of one person merged | `duplicates` | [`MergeSettings`] |
//! | people recognised across tracks | `reidentification` | [`ReidentificationSettings`] |
//!
//! The tracker itself decides nothing about people: it calls the plugins in this order, checks
//! their results, and counts the candidates that they drop.
//!
//! # Invariants
//!
//! * Time never runs backwards for a plugin.
//! * The number of a track is never used twice, not even after a reset. A report gives a person who
//!   was recognised the earlier number ([`ReidentificationSettings`]).
//! * Nothing is dropped silently: each loss is counted in the funnel.
//! * No number that is not finite leaves the tracker.
//! * Coasting is no separate mode: a predicted occlusion, a wrong rejection by a verifier and a
//!   miss of a detector look the same to the filter, namely as no evidence.
//! * Timings influence nothing.

mod clock;
mod detections;
mod duplicates;
mod frozen;
mod guarded;
mod half_hidden;
mod memo;
mod occlusion;
mod preprocess;
mod reidentification;
mod report;
mod search;
mod settings;
mod stage;
mod table;
mod tracker;
mod weighing;

pub use guarded::{Guarded, StepError};
pub use memo::Identities;
pub use preprocess::{Preprocessed, Preprocessor};
pub use reidentification::{AppearanceEvidence, ReidentificationSettings};
pub use report::{Candidate, Fate, Outcome, TrackingReport};
pub use search::DetectorSlot;
pub use settings::{
    ClockSettings, DetectorSettings, MergeSettings, OcclusionSettings, Role, TrackerSettings,
};
pub use tracker::{Parts, STAGES, Tracked, Tracker};
pub use weighing::Weighing;
