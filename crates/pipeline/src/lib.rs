//! Pipeline of a person-following robot, built from a TOML config.
//!
//! [`Pipeline::builder`] builds the plugins that a config names; [`Pipeline::step`] takes one
//! frame through them and returns a [`FrameReport`] with the tracks and, for every rejected
//! candidate, the test that dropped it.
//!
//! A pipeline with a detector of the caller; the registry holds the plugins that the caller
//! registers, and the feature `plugins` registers all of Tagalong's:
//!
//! ```
//! use tagalong_config::{NoSettings, Registry};
//! use tagalong_core::*;
//! use tagalong_pipeline::Pipeline;
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
//! let mut registry = Registry::default();
//! tagalong_associators::hungarian::register(&mut registry);
//! tagalong_filters::ekf::register(&mut registry);
//! tagalong_track_managers::m_of_n::register(&mut registry);
//! registry.detector("nearest", "the nearest laser point", |_: NoSettings, _| Ok(Nearest));
//! let config = "filter.plugin = 'ekf'\n[[detectors]]\nplugin = 'nearest'\n";
//! let mut pipeline = Pipeline::builder(&registry).from_toml(config)?;
//!
//! let camera = std::sync::Arc::new(tagalong_geometry::Camera::blind(nalgebra::one()));
//! let mut tracks = Vec::new();
//! for index in 1..=10 {
//!     let scan = LaserScan::of_points([[2.0, 0.5, 0.3].into()]);
//!     let stamp = Stamp::default().plus_seconds(0.1 * index as f64);
//!     let sensors = Sensors::default().with(scan);
//!     let motion = EgoMotion::at_rest(0.1);
//!     let frame = Frame::of_sensors(index, stamp, camera.clone(), motion, sensors);
//!     tracks = pipeline.step(&frame)?.tracks;
//! }
//! assert!(tracks[0].confirmed && (tracks[0].position.x - 2.0).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Invariants
//!
//! * Those of the tracker: see `tagalong_tracking`.
//! * No number that is not finite leaves [`Pipeline::step`].
//! * Timings are in [`FrameReport::timings`] and influence no result.
//!
//! # The pipeline's own entries in the funnel
//!
//! | entry | dropped |
//! |---|---|
//! | `frame: duplicate`, `frame: out of order` | a frame, by its stamp |
//! | `frame: wrong pixels` | single wrong pixels of the frame's images, before people are looked for; the controller sees the images as they came |
//! | `frame: calibration changed` | a frame of another calibration, and each after it; tracks stay where they were |
//! | `odometry: ...` | a frame that shows too little to correct the wheel odometry |
//! | `stereo: ...`, `stereo pixels: ...` | a stereo pair, or pixels of it, without depth |
//! | `motion not finite` | a frame's odometry; the robot counts as at rest |
//! | `detection not finite`, `verifier not finite` | a candidate with numbers that are not finite |
//! | `gate`, `not the best detection` | a detection found near a track |
//! | `same person` | the weaker of two detections of one person |
//! | `association not possible`, `associator` | an impossible pair; a detection already used up |
//! | `rather a new person` | a pair with a track that was lost; the detection may start a track |
//! | `tracked already` | a detection at a track that is seen or certain to be there |
//! | `score`, `verifier` | a candidate that its detector or the verifiers reject as no person |
//! | `doubt`, `clutter`, `no track fits` | a candidate that the track manager refuses |
//! | `filter` | a match that the filter did not accept |
//! | `too many detections`, `no track numbers left` | what exceeds a limit |
//! | `support of an unknown track`, `estimate of an unknown track` | an unknown track of a filter |
//! | `nis not finite` | an innovation of a filter that is not finite |
//! | `appearance: no vector` | a person without an embedding of `[appearance]` in time |
//! | `command not finite` | a controller's command; the robot stops |
//! | `track: ...` | a track, with the reason for its end |

mod appearance;
mod builder;
mod cautions;
mod config;
mod pipeline;
mod preprocessors;
mod report;
mod settings;
mod sources;
#[cfg(test)]
mod tests;

pub use appearance::AppearanceSettings;
pub use builder::PipelineBuilder;
#[cfg(feature = "plugins")]
pub use builder::{builtin_registry, register_plugins};
pub use config::{
    BuildError, ConfigSource, Document, ResolvedConfig, Suits, Tunable, flattened, with_values,
};
pub use pipeline::Pipeline;
pub use report::FrameReport;
pub use settings::{PipelineSettings, PluginSettings};
pub use sources::{MissingSource, Sources};
pub use tagalong_following::{
    Base, BlindZone, Cause, Choice, ChoiceRule, CollisionMonitorSettings, CommandLimiterSettings,
    Differences, Enable, EnableSwitch, Enrollment, EnrollmentError, FollowSettings, FollowStatus,
    Likeness, LockReport, LockState, LooksSettings, ObstaclePoint, ObstacleSource, OdometrySource,
    Orders, Permission, PlaceCause, RobotSettings, SafetyDistances, SearchSettings, SourceKind,
    SourceSettings, TargetSettings,
};
pub use tagalong_stereo::StereoSettings;
pub use tagalong_tracking::StepError;
pub use tagalong_tracking::{
    BirthSettings, Candidate, ClockSettings, DetectorSettings, Fate, IdentityCorrection,
    IdentityDoubt, MergeSettings, OcclusionSettings, Outcome, Role, SilhouetteSettings, Weighing,
};
pub use tagalong_vision::odometry::{MotionSource, OdometrySettings};
