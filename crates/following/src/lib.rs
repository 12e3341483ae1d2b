//! Following one person: from tracks to commands that a robot may execute.
//!
//! [`Steering`] runs four stages for each frame, in this order:
//!
//! | stage | module | settings |
//! |---|---|---|
//! | choice of the target, and its recovery after a loss | `target_lock` | [`TargetSettings`] |
//! | command of the controller, or of the search for a lost target | the controller, `target_lock` | [`SearchSettings`] |
//! | obstacles around the robot | `command_limiter` | [`CollisionMonitorSettings`] |
//! | limits of the command | `command_limiter` | [`CommandLimiterSettings`] |
//!
//! Following is also a skill that a program calls: [`Steering::enroll`] with an [`Enrollment`],
//! [`Steering::status`], [`Steering::clear`].
//!
//! # Invariants
//!
//! * A fault, a gap between frames, or a number that is not finite stops the robot.
//! * A command is valid for a limited time; after that [`Orders`] returns zero.
//! * Without obstacle sensors the robot does not move, unless the settings say so explicitly.
//! * [`EnableSwitch`] decides whether a robot may move at all; a bridge to a robot checks it for
//!   each command.
//! * This is not a safety function in the sense of the standards.

mod cause;
mod collision_monitor;
mod command_limiter;
mod distances;
mod enable;
mod robot;
mod settings;
mod skill;
mod steering;
mod target_lock;

pub use cause::{Cause, PlaceCause};
pub use collision_monitor::{
    CollisionMonitorSettings, NoReturn, ObstaclePoint, ObstacleSource, SourceKind, SourceSettings,
};
pub use command_limiter::{CommandLimiterSettings, Orders};
pub use distances::{BlindZone, SafetyDistances};
pub use enable::{Enable, EnableSwitch, Permission};
pub use robot::{Base, OdometrySource, RobotSettings};
pub use settings::FollowSettings;
pub use skill::{Choice, Enrollment, EnrollmentError, FollowStatus, PersonStatus};
pub use steering::{Steered, Steering};
pub use target_lock::{
    AppearanceMemory, ChoiceRule, Differences, Likeness, LockReport, LockState, LooksSettings,
    SearchSettings, TargetSettings,
};
