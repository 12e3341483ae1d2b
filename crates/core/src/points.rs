use std::sync::Arc;

use nalgebra::Point3;

use crate::{Input, Sensor};

/// Points of a 3-D lidar at the moment of a frame, in the robot frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PointCloud {
    /// Place of the lidar, m.
    pub scanner: Point3<f64>,
    /// Points at which its beams were reflected, m.
    pub points: Arc<[Point3<f64>]>,
}

impl PointCloud {
    /// Creates the points of a lidar at a place in the robot frame, m.
    pub fn new(scanner: Point3<f64>, points: impl Into<Arc<[Point3<f64>]>>) -> Self {
        Self { scanner, points: points.into() }
    }
}

impl Sensor for PointCloud {
    const INPUT: Input = Input::POINTS;
}
