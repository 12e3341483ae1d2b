//! Simulated worlds: rooms with people, seen by the sensors of a moving robot, with ground truth.
//!
//! Real logs with exact truth are rare. A simulated log can replace them only if it is difficult in
//! the same ways: people have realistic sizes, gaits and habits, furniture has the silhouettes of
//! people, depth has steps, holes and shadows, odometry drifts, and the camera is not exactly where
//! the log says.
//!
//! A [`Scene`] is read from TOML; a [`Simulation`] returns [`Event`]s in the order in which a robot
//! would have recorded them. The caller may steer the robot between two events: images are rendered
//! from the robot's true pose. The same scene gives the same events with any number of threads.
//!
//! ```
//! use tagalong_sim::{Event, Scene, Simulation};
//! let scene = Scene::parse("duration_s = 0.2\n[camera]\nwidth = 32\nheight = 24\n").unwrap();
//! let mut simulation = Simulation::new(&scene, 2);
//! let mut images = 0;
//! while let Some(event) = simulation.next_event() {
//!     images += usize::from(matches!(event, Event::Shot(_)));
//! }
//! assert_eq!(images, 2);
//! ```
//!
//! One file describes any number of scenes: its table `[vary]` lists the settings that differ from
//! seed to seed, a [`Variant`] selects one, and a [`Split`] separates the seeds, people and rooms
//! for training, validation and test.
//!
//! ```
//! use tagalong_sim::{Scene, Split, Variant};
//! let text = "crowd = 1\n[vary]\nlight.lux = { between = [50.0, 1000.0] }\n";
//! let variant = Variant::of_split(Split::Test, 7).with("crowd", 3);
//! let scene = Scene::parse_with(text, &variant).unwrap();
//! assert_eq!((scene.crowd, scene.seed), (3, 2_000_000_007));
//! assert!((50.0..=1000.0).contains(&scene.light.lux));
//! ```
//!
//! World coordinates have X along the room, Y across it and Z up, in metres.

// Loops over lanes use an index, because each step reads and writes several arrays at the same
// lane; iterators zipped over all of them would hide the arithmetic.
#![allow(clippy::needless_range_loop)]

mod approach;
mod behaviour;
mod bench_setting;
mod body;
mod camera_settings;
mod crowd;
mod daylight;
mod faults;
mod figures;
mod follow_bench;
mod footprint;
mod furniture;
mod gait;
mod hits;
mod lanes;
mod laser;
mod lidar;
mod material;
mod mirror;
mod obstacle;
mod obstacle_sensors;
mod parallel;
mod path_variation;
mod person;
mod posture;
mod ramp;
mod random;
mod render;
mod robot;
mod room;
mod room_settings;
mod scene;
mod seen;
mod sensor;
mod shadow;
mod shape;
mod sight;
mod simulation;
mod slice;
mod split;
mod tile;
mod variation;
mod varied_paths;
mod webcam;
mod world;

pub use approach::{ApproachBy, ApproachInView, ApproachSettings, ApproachState};
pub use bench_setting::{BenchSetting, FollowBench};
pub use camera_settings::{CameraKind, CameraSettings};
pub use crowd::{Block, CrowdSettings, Walk};
pub use daylight::Daylight;
pub use faults::{FaultKind, InjectedFault, ScheduledFault};
pub use figures::FIGURES_VERSION;
pub use footprint::ROBOT_RADIUS_M;
pub use furniture::{Furniture, FurnitureKind};
pub use laser::LaserSettings;
pub use lidar::{BeamPattern, LidarSettings};
pub use mirror::MirrorSettings;
pub use obstacle_sensors::{
    BumperSettings, RangeKind, RangeSettings, ScannerSettings, SensorData, SensorReading,
};
pub use path_variation::PathVariation;
pub use person::Extra;
pub use posture::Posture;
pub use ramp::Ramp;
pub use robot::Encoder;
pub use room_settings::{Floor, RoomSettings};
pub use scene::{AtEnd, FaultSettings, LightSettings, PersonSettings, RobotSettings, Scene, Trick};
pub use simulation::{
    Clearance, CrowdView, Event, Joint, OdometryReading, Shot, Simulation, Truth, WebcamShot,
};
pub use split::{Seeds, Split};
pub use variation::Variant;
pub use webcam::WebcamSettings;
