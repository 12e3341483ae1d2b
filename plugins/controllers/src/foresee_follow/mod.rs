//! `foresee-follow`: goes with a person at a distance and a side, by a plan of the next four seconds.
//!
//! The plan is one of some hundred ways to go on. Each begins with a change of the law (another turn, a
//! lower speed, a pause, a place nearer to the person's track) and then returns to the law, which
//! answers to where the person will be. So each way is driven to its end among the forecasts of
//! all people, and the cheapest is taken: a robot that waits until others have passed, or steps back
//! in line before a door, needs no rule for it.
//!
//! Adap-RPF (Situ et al., arXiv 2510.11308) samples places around the person and then velocities. Here
//! both are one: a law with a changed beginning is a smooth way that a robot can drive, and some
//! hundred of them replace thousands of random ones.

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
