//! `manage-m-of-n`: a track is confirmed by M detections in N frames, and ended by its misses.
//!
//! The rule is the usual one of radar tracking (Blackman and Popoli, *Design and Analysis of Modern
//! Tracking Systems*, 1999, section 6). In addition, a smoothed score of log-odds keeps a track of
//! doubtful detections from being confirmed and ends it in time, and a map stores positions at
//! which candidates were rejected.

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
