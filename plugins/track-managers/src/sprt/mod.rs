//! `manage-sprt`: decides about a track by sequential evidence (Wald's sequential probability ratio
//! test; for track scores Sittler 1964, Blackman and Popoli 1999, section 6.2).
//!
//! The log-odds that a track is a person are summed over its detections and misses until they pass
//! one bound or the other. Two rules keep furniture from accumulating evidence:
//!
//! * Observations of a static object by a camera at rest are repetitions of one observation, and
//!   count little more than their mean. An observation counts fully when the track is at a new
//!   position, or the robot sees it from a new one.
//! * People move. Each second in which a track is seen and has not moved is evidence against it, up
//!   to a bound that only confident verifiers outweigh. A track that has moved farther than its
//!   uncertainty explains gains evidence once, and may be at rest from then on. One that never
//!   moved and was not confirmed ends, and its positions are remembered as clutter, in the world
//!   frame. Detections that are more likely an object do not count as motion.
//!
//! A detection near a track that was not assigned to it starts a track of its own only if it would
//! be confirmed at once.

mod clutter;
mod config;
mod evidence;
mod looks;
mod manage;
#[cfg(test)]
mod tests;

pub use config::Config;
pub use manage::Sprt;
use tagalong_config::{Registry, Remedy};

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[
    Remedy {
        test: "clutter",
        settings: &["clutter_s", "clutter_m", "max_clutter"],
        look: "a thing at the same place was disproved before",
    },
    Remedy {
        test: "track: not confirmed",
        settings: &["tentative_misses", "confirm_log_odds"],
        look: "people seen in too few frames, or doubtful to the detectors and verifiers",
    },
    Remedy {
        test: "track: never moved",
        settings: &[
            "undecided_s",
            "still_log_odds",
            "max_still",
            "moved_m",
            "confirm_log_odds",
            "doubted_s",
        ],
        look: "things; people who stand still and are doubtful to all verifiers",
    },
    Remedy {
        test: "track: evidence",
        settings: &["end_log_odds", "miss_log_odds", "max_look"],
        look: "misses and doubtful detections lower the score of the track",
    },
];

/// Registers the track manager `manage-sprt`.
pub fn register(registry: &mut Registry) {
    registry.remedies("manage-sprt", REMEDIES);
    registry.alternative("manage-sprt");
    registry.manager(
        "manage-sprt",
        "believes a track by sequential evidence; things that never move are clutter",
        |config: Config, _| Sprt::new(config),
    );
}
