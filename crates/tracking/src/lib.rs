//! Tracker: [`Tracker::step`] takes one frame through all stages, in the order of the table below,
//! and returns a [`TrackingReport`] with the tracks and, for every candidate that led to no track,
//! the test that dropped it.
//!
//! | stage | module | decided by |
//! |---|---|---|
//! | frames without a required input refused | `needs` | the plugins |
//! | stamps that jump | `clock` | [`ClockSettings`] |
//! | tracks frozen once the calibration has changed | `frozen` | |
//! | depth and motion completed | `preprocess` | each [`Preprocessor`] |
//! | tracks predicted | | the filter |
//! | tracks searched for, image searched for new people | `search` | detectors, verifiers |
//! | detections of one person merged | `detections` | [`MergeSettings`] |
//! | detections associated with tracks | | the associator |
//! | detections of new people separated from lost tracks | `births` | [`BirthSettings`] |
//! | detections of half-hidden people made less certain | `occlusion` | [`OcclusionSettings`] |
//! | filter updated | | the filter |
//! | tracks started, confirmed, ended | `table` | the track manager |
//! | tracks of one person merged | `duplicates` | [`MergeSettings`] |
//! | people recognised across tracks | `reidentification` | [`ReidentificationSettings`] |
//! | reported boxes moved to the trunk | `silhouette` | [`SilhouetteSettings`] |
//!
//! The tracker itself decides nothing about people: it calls the plugins in this order, checks
//! their results, and counts the candidates that they drop.
//!
//! A tracker without a config, with a detector of the caller and three plugins:
//!
//! ```
//! use tagalong_core::*;
//! use tagalong_core::PerPerson;
//! use tagalong_tracking::{
//!     DetectorSettings, DetectorSlot, Guarded, Parts, Tracker, TrackerSettings,
//! };
//! use tagalong_vision::Describer;
//!
//! /// Takes the nearest point of the laser scan for a person.
//! # struct Nearest;
//! # impl Detector for Nearest {
//! #     fn capabilities(&self) -> Capabilities {
//! #         let inputs = Inputs::NONE.require(Input::Laser);
//! #         Capabilities::new(inputs).discovering()
//! #     }
//! #     fn detect(
//! #         &mut self,
//! #         frame: &Frame,
//! #         _: &Query<'_>,
//! #         _: &mut Funnel,
//! #     ) -> Result<Vec<Detection>> {
//! #         let points = frame.scan()?.points.iter();
//! #         let nearest = points.min_by(|a, b| a.coords.norm().total_cmp(&b.coords.norm()));
//! #         let covariance = nalgebra::Matrix3::from_diagonal_element(0.01);
//! #         let found = nearest.map(|at| Detection::new("nearest", *at, covariance, 2.0));
//! #         Ok(found.into_iter().collect())
//! #     }
//! # }
//!
//! let parts = Parts {
//!     preprocessors: Vec::new(),
//!     detectors: vec![DetectorSlot {
//!         settings: DetectorSettings::default(),
//!         plugin: Guarded::new("nearest", Box::new(Nearest)),
//!     }],
//!     verifiers: Vec::new(),
//!     associator: {
//!         let hungarian = tagalong_associators::hungarian::Hungarian::new(Default::default())?;
//!         Guarded::new("associate-hungarian", Box::new(hungarian))
//!     },
//!     filter: {
//!         let ekf = tagalong_filters::ekf::Ekf::new(Default::default())?;
//!         Guarded::new("ekf", Box::new(PerPerson::new(ekf)))
//!     },
//!     manager: {
//!         let counts = tagalong_track_managers::m_of_n::MOfN::new(Default::default())?;
//!         Guarded::new("manage-m-of-n", Box::new(counts))
//!     },
//!     describer: Describer::default(),
//! };
//! let mut tracker = Tracker::new(parts, TrackerSettings::default());
//! let camera = std::sync::Arc::new(tagalong_geometry::Camera::blind(nalgebra::one()));
//! let mut tracks = Vec::new();
//! for index in 1..=10 {
//!     let scan = LaserScan::of_points([[2.0, 0.5, 0.3].into()]);
//!     let stamp = Stamp::default().plus_seconds(0.1 * index as f64);
//!     let sensors = Sensors::default().with(scan);
//!     let motion = EgoMotion::at_rest(0.1);
//!     let frame = Frame::of_sensors(index, stamp, camera.clone(), motion, sensors);
//!     tracks = tracker.step(&frame)?.report.tracks;
//! }
//! assert!(tracks[0].confirmed && (tracks[0].position.x - 2.0).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Invariants
//!
//! * Time never runs backwards for a plugin.
//! * The ID of a track is never used twice, not even after a reset. A report gives a recognised
//!   person the earlier ID ([`ReidentificationSettings`]).
//! * Nothing is dropped silently: each loss is counted in the funnel.
//! * No number that is not finite leaves the tracker.
//! * Coasting is not a separate mode: a predicted occlusion, a wrong rejection by a verifier and a
//!   miss of a detector are the same to the filter, namely no evidence.
//! * Timings influence no result.

mod births;
mod clock;
mod detections;
mod duplicates;
mod frozen;
mod guarded;
mod half_hidden;
mod memo;
mod needs;
mod occlusion;
mod preprocess;
mod reidentification;
mod report;
mod search;
mod settings;
mod silhouette;
mod stage;
mod table;
mod tracker;
mod weighing;

pub use guarded::{Guarded, StepError};
pub use memo::Identities;
pub use preprocess::{Preprocessed, Preprocessor};
pub use reidentification::{AppearanceEvidence, ReidentificationSettings};
pub use report::{
    Candidate, Fate, IdentityCorrection, IdentityDoubt, Outcome, TrackingReport, joints_of,
};
pub use search::DetectorSlot;
pub use settings::{
    BirthSettings, ClockSettings, DetectorSettings, MergeSettings, OcclusionSettings, Role,
    SilhouetteSettings, TrackerSettings,
};
pub use tracker::{Parts, STAGES, Tracked, Tracker};
pub use weighing::Weighing;
