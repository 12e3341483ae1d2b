use std::sync::Arc;

use nalgebra::{Isometry2, Point2};
use tagalong_core::{Frame, Images};
use tagalong_geometry::Camera;
use tagalong_pipeline::FrameReport;

/// Data that a picture of one frame shows.
pub struct OverlayData {
    /// Camera of the frame.
    pub camera: Arc<Camera>,
    /// Images of the frame; shared, not copied.
    pub images: Images,
    /// Points of the laser scan in the robot frame, m.
    pub scan: Vec<Point2<f64>>,
    /// Pose of the robot in the odometry frame.
    pub odom_from_robot: Isometry2<f64>,
    /// Report of the pipeline.
    pub report: FrameReport,
}

impl OverlayData {
    /// Returns the data of a frame.
    pub fn of(frame: &Frame, odom_from_robot: Isometry2<f64>, report: FrameReport) -> Self {
        let points = frame.scan().map_or(&[][..], |scan| &scan.points);
        let scan = points.iter().map(|point| point.xy()).collect();
        let camera = frame.camera.clone();
        let images = frame.images();
        Self { camera, images, scan, odom_from_robot, report }
    }
}
