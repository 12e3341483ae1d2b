use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

/// One sweep of a laser scanner, in the robot frame at the time of its frame.
#[derive(Clone, Debug, PartialEq)]
pub struct LaserScan {
    /// Pose of the scanner in the robot frame: x forward, y left, z up.
    pub robot_from_scanner: Isometry3<f64>,
    /// Angle from one ray to the next, rad; positive from right to left.
    pub increment_rad: f64,
    /// Points at which rays were reflected, robot frame, m, in the order of the rays.
    pub points: Arc<[Point3<f64>]>,
    /// Ray number of each point: neighbours differ by one.
    pub rays: Arc<[u32]>,
}

impl LaserScan {
    /// Returns a scan of points without known rays: consecutive points count as neighbours.
    pub fn of_points(points: impl Into<Arc<[Point3<f64>]>>) -> Self {
        let points = points.into();
        let rays = (0..points.len() as u32).collect();
        Self { robot_from_scanner: Isometry3::identity(), increment_rad: 0.0, points, rays }
    }
}
