//! `compressive`: finds a known person by their appearance (P2, section III-C; K. Zhang, L. Zhang
//! and M.-H. Yang, *Fast compressive tracking*, TPAMI 36(10), 2014).
//!
//! A box is described by some dozens of numbers, each a few signed rectangles of an integral image:
//! a sparse random projection of all rectangles there are, drawn once and never built as a matrix
//! ([`Features`]). For each person two normal distributions a number are kept, one of boxes on the
//! person and one of boxes beside them ([`Appearance`]); the best box is where the ratio of the two
//! is largest, searched first coarsely and then finely around the expected one.
//!
//! Depth does what colour cannot: boxes that do not show something at the person's distance are not
//! looked at, which both saves time and tells a hidden person from one whose appearance has
//! changed; and it gives the scale.
//!
//! Such a tracker follows any object that it has learned, so most of the care goes into not
//! learning: not from hidden people, not when unsure, and its score is too low to keep a track
//! alive alone.

mod appearance;
mod candidates;
mod config;
mod detect;
mod features;
mod learning;
#[cfg(test)]
mod tests;

pub use appearance::Appearance;
pub use config::Config;
pub use detect::Compressive;
pub use features::{Features, Rectangle, Scaled};
pub use learning::{Learning, LearningRule};
use tagalong_config::{Registry, Remedy};

/// The name of this plugin in configs.
pub const NAME: &str = "compressive";

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[
    Remedy {
        test: "box: *",
        settings: &["search_radius", "depth_tolerance_m"],
        look: "boxes that are not looked at: outside, or at another distance than the person",
    },
    Remedy {
        test: "appearance: *",
        settings: &["min_confidence", "min_lead", "learn_confidence"],
        look: "why a known person is not followed: see the README of `compressive`",
    },
];

/// Registers the plugin.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.detector(
        NAME,
        "follows known people by signed rectangles and naive Bayes, with depth",
        |config: Config, context| Compressive::new(config, context.seed),
    );
}
