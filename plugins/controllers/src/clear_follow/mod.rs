//! `clear-follow`: faces the person, keeps the distance, and takes the least detour that stays
//! clear of obstacles.
//!
//! A dynamic window (Fox, Burgard and Thrun, 1997) asks which of all commands scores best, and so
//! jumps from one to the next. Here there is one command that would be right in an empty room: it
//! turns the robot towards where the person will be seen, as fast as they walk around it, and keeps
//! the distance. The plan is the smallest change of it that keeps clear of things and people over
//! the next second and a half and does not lose the person behind another one. In an empty room
//! nothing is changed, and the ride is as smooth as the law.
//!
//! Things that a turn has moved out of the image are remembered: the inside of a corner is where a
//! robot that follows a person hits it.

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
