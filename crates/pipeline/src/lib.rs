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

//!
//! # The pipeline's own entries in the funnel
//!
//! | entry | what was dropped |
//! |---|---|
//! | `frame: duplicate`, `frame: out of order` | a frame, by its stamp |
//! | `odometry: ...` | a frame that shows too little to correct the wheels by |
//! | `stereo: ...`, `stereo pixels: ...` | a stereo pair, or pixels of it, without depth |
//! | `motion not finite` | a frame's odometry; the robot counts as standing |
//! | `detection not finite`, `verifier not finite` | a candidate with numbers that cannot be |
//! | `gate`, `not the best sighting` | what a follower found for a track |
//! | `same person` | the weaker of two sightings of one person |
//! | `tracked already` | a newcomer where somebody else is seen |
//! | `score`, `verifier` | a candidate that is probably no person, by its detector or by the verifiers |
//! | `doubt` | a newcomer where others were rejected shortly before |
//! | `filter` | a match that the filter did not accept |
//! | `too many detections`, `no track numbers left` | what exceeds a limit |
//! | `support of an unknown track`, `estimate of an unknown track`, `nis not finite` | a filter's mistakes |
//! | `command not finite` | a controller's command; the robot stops |
//! | `track: ...` | a track, by the reason for which it ended |

mod assignment;
mod association;
mod boundary;
mod clock;
mod config;
mod control;
mod doubts;
mod governor;
mod lifecycle;
mod memo;
mod now;
mod occlusion;
mod pipeline;
mod report;
mod settings;
mod sightings;
mod slots;
mod target;
#[cfg(test)]
mod tests;
mod weighing;

pub use assignment::assign;
pub use boundary::StepError;
pub use config::{Options, RunSettings, Tunable, check_tuning, with_values};
pub use governor::{CorridorSettings, GovernorSettings, Orders};
pub use pipeline::Pipeline;
pub use report::{Candidate, Fate, FrameReport, Outcome};
pub use settings::{
    AssociationSettings, ClockSettings, Cost, DetectorSettings, LifecycleSettings,
    OcclusionSettings, Overlap, PipelineSettings, PluginSettings, RobotSettings, Role,
};
pub use tagalong_odometry::OdometrySettings;
pub use tagalong_stereo::StereoSettings;
pub use target::{
    Differences, Likeness, LockReport, LockState, LooksSettings, SearchSettings, TargetSettings,
};
pub use weighing::Weighing;
