//! `compressive`: finds a known person by their appearance (P2, section III-C; K. Zhang, L. Zhang
//! and M.-H. Yang, *Fast compressive tracking*, TPAMI 36(10), 2014).
//!
//! A box is described by some dozens of features, each the sum of a few signed rectangles of an
//! integral image: a sparse random projection of all possible rectangles, drawn once and never
//! built as a matrix ([`Features`]). For each person and feature two normal distributions are kept,
//! one of boxes on the person and one of boxes beside them ([`Appearance`]). The best box is the
//! one with the largest ratio of the two; the search around the expected box is first coarse and
//! then fine.
//!
//! Depth does what colour cannot. Boxes whose depth does not match the person's distance are not
//! compared, which saves time and distinguishes a hidden person from one whose appearance has
//! changed. Depth also gives the scale.
//!
//! Such a tracker follows any object that it has learned, so most of its rules prevent learning: it
//! does not learn from hidden people or when it is uncertain, and its score is too low to keep a
//! track alive alone.
//!
//! ```
//! use tagalong_compressive::{Compressive, Config};
//! use tagalong_conformance::figure::{Figure, World};
//! use tagalong_conformance::samples::track_at;
//! use tagalong_core::{Detector, EgoMotion, Frame, Funnel, Query, Stamp};
//! use tagalong_geometry::{Camera, Pinhole};
//!
//! # fn frame(people: &[Figure]) -> Frame {
//! #     let lens = Pinhole::centred(262.0, 320, 240);
//! #     let camera = Camera::mounted(lens, 320, 240, 1.2, 0.0, 0.0);
//! #     let images = World::with(people).draw(&camera);
//! #     Frame::new(1, Stamp::default(), camera.into(), EgoMotion::at_rest(0.1), images)
//! # }
//! let mut detector = Compressive::new(Config::default(), 1)?;
//! let shown = frame(&[Figure::at(2.5, 0.0)]);
//! let mut track = track_at(1, 2.5, 0.0);
//! track.estimate.region = shown.camera.upper_body(&track.estimate.person.position);
//! detector.learn(&shown, &[track.clone()])?;
//! let found = detector.detect(&shown, &Query::Track(&track), &mut Funnel::default())?;
//! assert_eq!(found.len(), 1);
//! // People that it has not learned are not found.
//! let all = Query::Discover { occupied: &[] };
//! assert!(detector.detect(&shown, &all, &mut Funnel::default())?.is_empty());
//! # Ok::<(), tagalong_core::Error>(())
//! ```

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
