//! `last-seen`: a person stays where they were last seen.
//!
//! The least that can be called a filter, and therefore the measure of all others: the gain of a
//! tracker over it is the value of its model. There is no model of walking, nothing is averaged,
//! and, if so configured, the robot's own motion is left out of account as well.

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
