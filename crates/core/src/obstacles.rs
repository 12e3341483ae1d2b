use std::sync::Arc;

use nalgebra::Isometry3;
use tagalong_geometry::Camera;

use crate::{DepthImage, Input, LaserScan, Sensor, Stamp};

/// Newest readings of the further sources of the collision monitor: laser scanners and depth cameras
/// beside those that make the frames, range sensors, and bumpers.
///
/// A source that has never delivered is left out; one that fell silent stays, with its age.
#[derive(Clone, Debug, Default)]
pub struct ObstacleReadings(pub Arc<[ObstacleReading]>);

impl Sensor for ObstacleReadings {
    const INPUT: Input = Input::OBSTACLES;
}

/// Newest reading of one source of obstacles, in the robot frame at the time of the frame.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ObstacleReading {
    /// Name of the source in `[[collision_monitor.sources]]`.
    pub source: Arc<str>,
    /// Time of the measurement, by the clock of the frames. Frames that come more often than readings
    /// carry the same reading, with the same stamp, again.
    pub stamp: Stamp,
    /// Time from the reading to the frame, s; 0 for a reading of after the frame.
    pub age_s: f64,
    /// The reading.
    pub data: ObstacleData,
}

impl ObstacleReading {
    /// Creates a reading: the name of its source, its stamp by the clock of the frames, the time
    /// from then to the frame, s, and its data.
    pub fn new(source: impl Into<Arc<str>>, stamp: Stamp, age_s: f64, data: ObstacleData) -> Self {
        Self { source: source.into(), stamp, age_s, data }
    }
}

/// Data of a source of obstacles.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum ObstacleData {
    /// Sweep of a laser scanner.
    Scan(LaserScan),
    /// Depth image, m, with its camera.
    Depth {
        /// The image.
        image: Arc<DepthImage>,
        /// The camera, mounted on the robot.
        camera: Arc<Camera>,
    },
    /// Distance within a cone: sonar or infrared.
    Range(RangeReading),
    /// True while a bumper is pressed.
    Bumper(bool),
}

/// Reading of a range sensor: the distance to the nearest surface within a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeReading {
    /// Pose of the sensor in the robot frame; it looks along its x axis.
    pub robot_from_sensor: Isometry3<f64>,
    /// Angle of the cone, rad.
    pub field_of_view_rad: f64,
    /// Nearest distance that is measured, m.
    pub min_m: f64,
    /// Farthest distance that is measured, m.
    pub max_m: f64,
    /// The distance, m: infinite where nothing is within the range (REP 117), NaN for no statement.
    pub range_m: f64,
}
