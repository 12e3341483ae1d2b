//! `manage-sprt`: a track is believed by sequential evidence (Wald's sequential probability
//! ratio test; for track scores Sittler 1964, Blackman and Popoli 1999, section 6.2).
//!
//! The log-odds that a track is a person add up over its detections and misses until they pass
//! one bound or the other. Two things keep furniture from gathering belief:
//!
//! * Looks at a thing that stands still before a camera that stands still are one look,
//!   repeated: they count for a fraction. A look counts in full again when the track has moved
//!   or the robot sees it from elsewhere.
//! * Persons move. A track that has moved further than its uncertainty explains gains belief
//!   once; one that never moved, and that repeated looks did not prove, ends, and its place is
//!   remembered as clutter, in the frame of the world.

mod clutter;
mod config;
mod evidence;
mod manage;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use manage::Sprt;
use tagalong_config::Registry;

/// Registers the track manager `manage-sprt`.
pub fn register(registry: &mut Registry) {
    registry.manager(
        "manage-sprt",
        "believes a track by sequential evidence; things that never move are clutter",
        |config: Config, _| Sprt::new(config),
    );
}
