//! `compressive-as-printed`: the compressive tracker of P2 learns in every frame.
//!
//! So says the paper, even if the box may show another person; and by the public code the model
//! starts blank and meets its first frame with the same weight as any other.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use tagalong_compressive::{Compressive, Learning, LearningRule};
use tagalong_config::Registry;
use tagalong_core::{Result, Track};
use tagalong_geometry::Rect;

/// Settings of the detector `compressive-as-printed`: those of `compressive`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Settings of `compressive`.
    #[serde(flatten)]
    pub base: tagalong_compressive::Config,
}

/// The printed rule.
#[derive(Clone, Copy, Debug)]
struct EveryFrame;

impl LearningRule for EveryFrame {
    fn memory(
        &self,
        config: &tagalong_compressive::Config,
        track: &Track,
        _: Option<(Rect, f32)>,
        is_new: bool,
    ) -> Option<f64> {
        // A model begins with a person who is in view.
        (!is_new || (track.seen && !track.occluded)).then_some(config.memory)
    }

    fn ignores_depth(&self) -> bool {
        true
    }
}

/// Builds the detector.
///
/// # Errors
/// Settings outside their ranges.
pub fn detector(config: Config, seed: u64) -> Result<Compressive> {
    let learning = Learning::new(EveryFrame);
    Compressive::new(tagalong_compressive::Config { learning, ..config.base }, seed)
}

/// Registers the detector.
pub fn register(registry: &mut Registry) {
    registry.detector(
        "compressive-as-printed",
        "follows known people by signed rectangles, and learns in every frame (P2)",
        |config: Config, context| detector(config, context.seed),
    );
}

#[cfg(test)]
mod tests {
    use tagalong_conformance::samples::track_in;

    use super::*;

    fn track(seen: bool, occluded: bool) -> Track {
        track_in(1, Rect::new(100.0, 80.0, 60.0, 60.0)).with_seen(seen).with_occluded(occluded)
    }

    #[test]
    fn hidden_people_are_learned_and_by_the_corrected_rule_not() {
        let config = tagalong_compressive::Config::default();
        let hidden = track(false, true);
        let memory = config.memory;
        assert_eq!(EveryFrame.memory(&config, &hidden, None, false), Some(memory));
        assert_eq!(EveryFrame.memory(&config, &hidden, None, true), None, "a model begins in view");
        assert_eq!(config.learning.rule().memory(&config, &hidden, None, false), None);
        assert!(EveryFrame.ignores_depth() && !config.learning.rule().ignores_depth());
    }

    #[test]
    fn the_first_frame_counts_as_any_other_and_by_the_corrected_rule_fully() {
        let config = tagalong_compressive::Config::default();
        let seen = track(true, false);
        assert_eq!(EveryFrame.memory(&config, &seen, None, true), Some(config.memory));
        assert_eq!(config.learning.rule().memory(&config, &seen, None, true), Some(0.0));
    }
}
