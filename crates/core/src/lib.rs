//! Common types of Tagalong and the traits of its six kinds of plugin.
//!
//! All types that two crates of the workspace exchange are defined here: a [`Detector`] finds
//! people in a [`Frame`] as [`Detection`]s, a [`Verifier`] judges them, an [`Associator`] assigns
//! them to [`Track`]s, a [`Filter`] (or a [`PersonFilter`], for one person at a time) estimates
//! their states, a [`TrackManager`] starts and ends them, and a [`Controller`] steers after one of
//! them.
//!
//! # Position and box of a detection
//!
//! A detection is a position in the robot frame, with a box in the image if a camera made it.
//! Stereo, RGB-D and panorama cameras and laser scanners therefore share one interface, and a
//! filter may work in pixels or in metres. The [`tagalong_geometry::Camera`] converts between
//! them. An unknown coordinate (the height of a person in a panorama) has a large variance.
//!
//! # Conventions
//!
//! * SI units. Stamps are nanoseconds ([`Stamp`]).
//! * **Robot frame**: X forward, Y left, Z up, origin on the floor midway between the wheels (REP
//!   103). **Camera frame**: x right, y down, z forward.
//! * Depth is the coordinate along the optical axis, in metres; NaN is "no reading". It is never
//!   the Euclidean range.
//! * The position of a person is the **centre of the head** (`HEAD_RADIUS_M` behind the surface
//!   that a depth camera measures).
//! * Plugins use no clocks and no global randomness: time comes from the frame, seeds from
//!   `Context`. The same log, config and seed give the same bytes.

mod associator;
mod control;
mod defaults;
mod detection;
mod detector;
mod error;
mod external;
mod filter;
mod frame;
mod funnel;
mod image;
mod inputs;
mod joints;
mod manager;
mod mixture;
mod motion;
mod obstacles;
mod person;
mod person_filter;
mod points;
mod scan;
mod sensors;
mod time;
mod track;
mod visualisation;

/// Vectors, matrices and poses of the public types: a plugin that takes it from here always has the
/// version of these types.
pub use nalgebra;

pub use associator::{Association, Associations, Associator, Gate};
pub use control::{Command, Controller, Reason, Scene};
pub use detection::Detection;
pub use detector::{Detector, Likelihood, Query, Verifier};
pub use error::{Error, Result};
pub use external::ExternalDetection;
pub use filter::{Evidence, Filter, FilterRequirements, Matched, Update};
pub use frame::{Derived, Frame, Images};
pub use funnel::{Dropped, Funnel, MAX_PLACES, Measured, TRACKER_TESTS};
pub use image::{DepthImage, GreyImage, Image, RgbImage};
pub use inputs::{Capabilities, Input, Inputs, Usage};
pub use joints::{Joint, JointName, Joints};
pub use manager::{
    Initiation, Observation, ObservedTrack, TrackChanges, TrackHealth, TrackManager, Unassociated,
};
pub use mixture::match_moments;
pub use motion::{
    DiffDrive, EgoMotion, MAX_CAMERA_POSE_AGE_S, MAX_ODOMETRY_GAP_S, MAX_ODOMETRY_STEP_M,
    MAX_ODOMETRY_STEP_RAD, Twist, WheelSpeeds, planar_pose, spatial_pose,
};
pub use obstacles::{ObstacleData, ObstacleReading, ObstacleReadings, RangeReading};
pub use person::{Estimate, Person};
pub use person_filter::{PerPerson, PersonFilter};
pub use points::PointCloud;
pub use scan::{FurtherScans, LaserScan, RayReading, SweepMotion, UnreadRay};
pub use sensors::{CameraImage, ExternalDetections, RightImage, Sensor, Sensors};
pub use time::Stamp;
pub use track::{Track, TrackId};
pub use visualisation::Visualisation;
