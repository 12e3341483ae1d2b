//! From a TOML file to a running pipeline.
//!
//! [`Pipeline::from_toml`] builds the plugins that a config names;
//! [`Pipeline::step`] takes one frame through them and returns a
//! [`FrameReport`] that says who was tracked and, for every candidate that was
//! not, which test dropped it.
//!
//! # Why association, occlusion and life cycle are no plugins
//!
//! Every tracker gets the same ones, so that a comparison compares trackers. A
//! method that wants its own (soft association, say) is a filter that reads
//! [`tagalong_core::Evidence::unmatched`].
//!
//! # Invariants
//!
//! * Time never runs backwards into a plugin: see [`ClockSettings`].
//! * A track's number is never used twice, not even after a reset.
//! * Nothing is dropped silently: each loss is counted in the report's funnel.
//! * No number that is not finite leaves [`Pipeline::step`].
//! * Coasting is no mode. A predicted occlusion, a verifier's wrong no and a
//!   detector's miss look the same to the filter: no evidence.
//! * Timings are in [`FrameReport::timings`] and influence nothing.

mod assignment;
mod association;
mod boundary;
mod clock;
mod config;
mod control;
mod lifecycle;
mod now;
mod occlusion;
mod pipeline;
mod report;
mod settings;
mod sightings;
#[cfg(test)]
mod tests;

pub use assignment::assign;
pub use boundary::StepError;
pub use config::{Options, RunSettings};
pub use pipeline::Pipeline;
pub use report::{Candidate, Fate, FrameReport, Outcome};
pub use settings::{
    AssociationSettings, ClockSettings, Cost, DetectorSettings, LifecycleSettings,
    OcclusionSettings, Overlap, PipelineSettings, PluginSettings, RobotSettings, Role,
};
