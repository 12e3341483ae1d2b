//! Detects people by their legs in a laser scan (K. Arras, O. Mozos, W. Burgard, *Using boosted
//! features for the detection of people in 2D range data*, ICRA 2007).
//!
//! A scan is divided into segments where neighbouring points are farther apart than the spacing of
//! the rays explains. Each segment becomes a vector of lengths and shapes in metres ([`features`]),
//! boosted trees turn it into log-odds ([`Model`]), and legs near each other are paired to form a
//! person.
//!
//! The features contain neither the range nor the number of rays, so one model serves scanners of
//! any resolution, at any height at which legs are visible; the trainer also uses scans with only
//! every second, third or fourth ray.
//!
//! With the feature `train` the crate also fits models (`train`).
//!
//! ```
//! use tagalong_conformance::context;
//! use tagalong_conformance::figure::{Figure, World};
//! use tagalong_core::{Detector, EgoMotion, Frame, Funnel, Query, Sensors, Stamp};
//! use tagalong_geometry::Camera;
//! use tagalong_laser_legs::{Config, LaserLegs};
//!
//! let mut detector = LaserLegs::new(Config::default(), &context())?;
//! let sensors = Sensors::default().with(World::with(&[Figure::at(2.0, 0.3)]).scan());
//! let blind = Camera::blind(nalgebra::one()).into();
//! let frame = Frame::of_sensors(1, Stamp::default(), blind, EgoMotion::at_rest(0.1), sensors);
//! let all = Query::Discover { occupied: &[] };
//! let found = detector.detect(&frame, &all, &mut Funnel::default())?;
//! assert!(found.iter().any(|person| (person.position.x - 2.0).abs() < 0.3));
//! # Ok::<(), tagalong_core::Error>(())
//! ```

mod config;
mod detect;
mod features;
mod model;
mod past;
mod segment;
#[cfg(test)]
mod tests;
#[cfg(feature = "train")]
pub mod train;

pub use config::{Config, Segmentation, Training};
pub use detect::LaserLegs;
pub use features::{COUNT, FEATURES, Features, features};
pub use model::{Model, Node, Tree};
pub use segment::{Beams, Segment};
use tagalong_config::{Registry, Remedy};

/// Name of this plugin in configs.
pub const NAME: &str = "laser-legs";

/// Settings of each test of its funnel.
const REMEDIES: &[Remedy] = &[Remedy {
    test: "no leg",
    settings: &["min_leg_log_odds"],
    look: "nearly all segments of any scan; lower finds more legs and more table legs",
}];

/// Registers the plugin, and its trainer if that is compiled in.
pub fn register(registry: &mut Registry) {
    registry.remedies(NAME, REMEDIES);
    registry.detector(NAME, "legs in a laser scan, by boosted geometric features", LaserLegs::new);
    #[cfg(feature = "train")]
    registry.training(
        NAME,
        tagalong_config::TrainingOffer::new(
            tagalong_config::TrainingData::LaserScans,
            "[training]\ntrees = [10]\nfolds = 2\nevery_ray = []",
        ),
    );
    #[cfg(feature = "train")]
    registry.trainer(NAME, |config: Config, context| train::LegTrainer::new(&config, context.seed));
}
