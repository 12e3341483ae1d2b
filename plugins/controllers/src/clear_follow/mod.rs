//! `clear-follow`: faces the person, keeps the distance, and takes the smallest detour that stays
//! clear of obstacles.
//!
//! A dynamic window (Fox, Burgard and Thrun, 1997) scores all commands and takes the best, and so
//! jumps from one to the next. This controller starts from the one command that would be right in
//! an empty room: it turns the robot towards where the person will be seen, as fast as they walk
//! around it, and keeps the distance. The plan is the smallest change of that command that stays
//! clear of obstacles and people over the next second and a half and does not lose the person
//! behind another one. In an empty room nothing is changed, and the ride is as smooth as the
//! control law.
//!
//! Obstacles that a turn has moved out of the image are remembered, because a robot that follows a
//! person hits the inside of a corner.

mod config;
mod control;
mod plan;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use control::ClearFollow;

use tagalong_config::Registry;

/// The name of this plugin in configs.
pub const NAME: &str = "clear-follow";

/// Registers the controller `clear-follow`.
pub fn register(registry: &mut Registry) {
    registry.controller(
        NAME,
        "faces the person and goes round what is in the way",
        |config: Config, _| ClearFollow::new(config),
    );
}
