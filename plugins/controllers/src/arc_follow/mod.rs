//! `arc-follow`: follows a person on circular paths (P1, section 3; P4, section IV).
//!
//! The circle that starts along the robot's heading and passes through a target at (X, Y) has the
//! radius `rho = (X² + Y²) / (2 Y)`; the wheels run at `v (1 ∓ d / rho)`. Path A drives on this
//! circle, path B turns first and then drives straight, and path C divides the radius by k, so that
//! the robot turns while driving.
//!
//! In polar terms the turn rate is `2 k v sin(bearing) / range`, which is pure pursuit with the
//! target itself as the look-ahead point. For a target at rest `sin(bearing) / range^(2k - 1)` is
//! then constant: with k = 1 the robot stays on the circle, with k = 2 it has almost turned towards
//! the target long before it arrives.
//!
//! The papers do not say how fast to drive, and their law cannot turn a robot at rest, drives away
//! from a person behind it, and divides by zero at the origin. The README lists the remedies, each
//! with its test.

mod aim;
mod config;
mod control;
#[cfg(test)]
mod tests;
mod trail;

pub use config::{Config, Path};
pub use control::ArcFollow;

use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "arc-follow";

/// Registers the controller `arc-follow`.
pub fn register(registry: &mut Registry) {
    registry.controller(
        NAME,
        "follows on circular paths, turning towards the person while driving",
        |config: Config, _| ArcFollow::new(config),
    );
}
