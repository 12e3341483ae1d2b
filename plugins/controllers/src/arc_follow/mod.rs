//! `arc-follow`: follows a person on circular paths (P1, section 3; P4, section IV).
//!
//! The circle that leaves along the robot's heading and meets a target at (X, Y) has the radius
//! `rho = (X² + Y²) / (2 Y)`; the wheels run at `v (1 ∓ d / rho)`. Path A drives on it, path B
//! turns first and then drives straight, path C divides the radius by k and so turns while driving.
//!
//! In polar terms the turn rate is `2 k v sin(bearing) / range`, which is pure pursuit with the
//! target itself as the look-ahead point. A target at rest then keeps `sin(bearing) / range^(2k -
//! 1)` constant: k = 1 stays on the circle, k = 2 has almost turned towards the target long before
//! it is there.
//!
//! The papers leave open how fast to drive, and their law cannot turn a robot at rest, drives away
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
