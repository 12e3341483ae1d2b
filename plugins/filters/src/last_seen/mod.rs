//! `last-seen`: a person stays where they were last seen.
//!
//! The simplest possible filter, and therefore the baseline for all others: what a tracker gains
//! over it is the value of its motion model. There is no model of walking and no averaging, and, if
//! so configured, the robot's own motion is ignored as well.

mod config;
mod filter;

pub use config::Config;
pub use filter::{LastSeen, State};
use tagalong_config::Registry;
use tagalong_core::PerPerson;

/// Registers the filter `last-seen`.
pub fn register(registry: &mut Registry) {
    registry.filter(
        "last-seen",
        "a person stays where last seen: the baseline that trackers must beat",
        |config: Config, _| Ok(PerPerson::new(LastSeen::new(config)?)),
    );
}
