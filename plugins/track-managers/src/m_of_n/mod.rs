//! `manage-m-of-n`: a track is confirmed by M detections in N frames, and ends by its misses.
//!
//! The rule is the common one of radar tracking (Blackman and Popoli, *Design and Analysis of
//! Modern Tracking Systems*, 1999, section 6). Beside it stands a smoothed score of log-odds,
//! so that a track of doubtful detections is not confirmed and ends in time, and a map of
//! places at which candidates were rejected.

mod clutter;
mod config;
mod manage;
#[cfg(test)]
mod tests;
mod track;

pub use config::Config;
pub use manage::MOfN;
use tagalong_config::{Kind, Registry};

/// Name of this plugin in configs.
const NAME: &str = "manage-m-of-n";

/// Registers the track manager `manage-m-of-n`, which is that of a config that names none.
pub fn register(registry: &mut Registry) {
    registry.manager(
        NAME,
        "confirms a track by M detections in N frames, ends it by its misses",
        |config: Config, _| MOfN::new(config),
    );
    registry.default_plugin(Kind::Manager, NAME);
}
