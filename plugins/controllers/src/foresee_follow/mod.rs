//! `foresee-follow`: accompanies a person at a distance and on a side, with a plan of the next four
//! seconds.
//!
//! The plan is one of some hundred candidate paths. Each begins with a change of the control law
//! (another turn rate, a lower speed, a pause, a position nearer to the person's track) and then
//! returns to the law, which responds to where the person will be. Each path is driven to its end
//! among the forecasts of all people, and the cheapest one is taken: the robot waits until others
//! have passed, or moves back in line before a door, without a rule for it.
//!
//! Adap-RPF (Situ et al., arXiv 2510.11308) samples positions around the person and then
//! velocities. Here both are one: a law with a changed beginning is a smooth path that a robot can
//! drive, and some hundred of them replace thousands of random ones.

mod config;
mod control;
mod cost;
mod law;
mod plan;
mod scenery;
#[cfg(test)]
mod tests;

pub use config::{Config, Side};
pub use control::ForeseeFollow;

use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "foresee-follow";

/// Registers the controller `foresee-follow`.
pub fn register(registry: &mut Registry) {
    registry.controller(
        NAME,
        "goes behind, beside or ahead of the person, by a forecast of all people",
        |config: Config, _| ForeseeFollow::new(config),
    );
}
