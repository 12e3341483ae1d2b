//! Finds people in depth images by the silhouette of head and shoulders (P1 section 2.2, P4 section
//! II).
//!
//! The tests of a pixel, in order: its height and depth allow a head
//! ([`DepthTemplateConfig::min_head_height_m`]); the scene left, right and above of it is farther
//! away (P4's boundary points); the object that it belongs to is as wide as a head; there is a body
//! below; and the silhouette of one of three body directions fits ([`Matcher`]). The remaining
//! pixels are grouped into people.
//!
//! The printed squared difference of depths from one background value is not used, because with it
//! a wall two metres behind a person costs more than the person gains, and because a fixed
//! threshold has a different meaning at every range. The README lists the differences, each with
//! its test.

mod bank;
mod body;
mod candidates;
mod config;
mod detector;
mod drops;
mod extension;
mod matching;
mod people;
mod scores;
mod view;
mod weigher;

pub use bank::{Bank, Direction, Pose, Template, TemplateRow};
pub use body::{Part, Relief, body_parts, render};
pub use config::{Cost, DepthTemplateConfig};
pub use detector::{DepthTemplate, background};
pub use extension::{FrameComparison, FrameLikelihood, SceneLikelihood, SilhouetteComparison};
pub use matching::{Match, Matcher};
pub use view::Working;
pub use weigher::{PlacedPerson, Span, Weigher, outside};

use tagalong_config::{Registry, Remedy, TrialValues};

/// The name of this plugin in configs.
pub const NAME: &str = "depth-template";

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[
    Remedy {
        test: "detection volume",
        settings: &["min_depth_m", "max_depth_m", "min_head_height_m", "max_head_height_m"],
        look: "is the camera's height and tilt right? Seated people and children are below 1.2 m",
    },
    Remedy {
        test: "boundary points",
        settings: &["boundary_margin_m", "boundary_distance_m"],
        look: "people closer than this to a wall or to each other",
    },
    Remedy {
        test: "head width",
        settings: &["min_head_width_m", "max_head_width_m"],
        look: "hats, helmets; is the depth scaled right?",
    },
    Remedy {
        test: "body below",
        settings: &["min_body"],
        look: "people behind desks and counters",
    },
    Remedy {
        test: "search window",
        settings: &["follow_radius_m"],
        look: "places too far from where a person was expected",
    },
    Remedy {
        test: "not refined",
        settings: &["refine_cost", "discover_cost"],
        look: "silhouettes that cost too much at the first look; larger finds more people and more furniture",
    },
    Remedy {
        test: "component size",
        settings: &["min_cells"],
        look: "single cells; smaller finds people far away, and noise",
    },
    Remedy {
        test: "template cost",
        settings: &["discover_cost", "follow_cost"],
        look: "larger finds more people and more furniture",
    },
];

/// Values of settings that are worth a trial on any log.
const TRIAL_VALUES: &[TrialValues] = &[
    TrialValues { setting: "min_head_height_m", values: &[1.0] },
    TrialValues { setting: "boundary_margin_m", values: &[0.15, 0.25] },
    TrialValues { setting: "discover_cost", values: &[0.13, 0.2, 0.3] },
];

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.trial_values(NAME, TRIAL_VALUES);
    registry.detector(
        NAME,
        "head-and-shoulder silhouettes in depth images",
        |config: DepthTemplateConfig, _| DepthTemplate::new(config),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_keeps_the_promises_of_its_kinds() {
        let mut registry = Registry::default();
        register(&mut registry);
        let suite = tagalong_conformance::Suite::new(&registry);
        let failures = suite.must_discover(NAME).must_follow(NAME).check_all();
        assert!(failures.is_empty(), "{failures:#?}");
    }
}
