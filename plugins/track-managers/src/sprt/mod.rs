//! `manage-sprt`: a track is believed by sequential evidence (Wald's sequential probability
//! ratio test; for track scores Sittler 1964, Blackman and Popoli 1999, section 6.2).
//!
//! The log-odds that a track is a person add up over its detections and misses until they pass
//! one bound or the other. Two things keep furniture from gathering belief:
//!
//! * Looks at a thing that stands still before a camera that stands still are one look, repeated,
//!   and count little more than their mean. A look counts for itself when the track is at a new place, or
//!   the robot sees it from elsewhere.
//! * Persons move. Each second in which a track is seen and did not move speaks against it, up to a
//!   bound that only sure looks of verifiers outweigh. A track that has moved further than its
//!   uncertainty explains gains belief once, and may stand still from then on. One that never moved
//!   and was not proven ends, and its places are remembered as clutter, in the frame of the world.
//!   Detections that rather show a thing are no motion.
//!
//! A detection near a track that did not take it starts a track of its own only if it would be confirmed
//! at once.

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
