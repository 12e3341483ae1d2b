use std::ops::Range;
use std::sync::Arc;

use nalgebra::{Isometry2, Point2};
use tagalong_core::{Frame, Images, PointCloud};
use tagalong_geometry::Camera;
use tagalong_pipeline::FrameReport;

/// Heights of the points of a lidar that are shown, m.
const TRUNKS_M: Range<f64> = 0.9..1.1;

/// Data that a picture of one frame shows.
pub struct OverlayData {
    /// Camera of the frame.
    pub camera: Arc<Camera>,
    /// Images of the frame; shared, not copied.
    pub images: Images,
    /// Points of the laser scan in the robot frame, or those of a lidar at the height of trunks, m.
    pub scan: Vec<Point2<f64>>,
    /// True if a lidar detects people on all sides.
    pub is_around: bool,
    /// Pose of the robot in the odometry frame.
    pub odom_from_robot: Isometry2<f64>,
    /// Report of the pipeline.
    pub report: FrameReport,
}

impl OverlayData {
    /// Returns true if boxes and places are those of a frozen image, not of now.
    pub(crate) fn shows_past(&self) -> bool {
        self.report.shows_past()
    }

    /// Returns the data of a frame.
    pub fn of(frame: &Frame, odom_from_robot: Isometry2<f64>, report: FrameReport) -> Self {
        let points = frame.scan().map_or(&[][..], |scan| &scan.points);
        let mut scan: Vec<Point2<f64>> = points.iter().map(|point| point.xy()).collect();
        let cloud = frame.sensor::<PointCloud>().ok();
        if let Some(cloud) = cloud {
            let trunks = cloud.points.iter().filter(|point| TRUNKS_M.contains(&point.z));
            scan.extend(trunks.map(|point| point.xy()));
        }
        let camera = frame.camera.clone();
        let images = frame.images();
        Self { camera, images, scan, is_around: cloud.is_some(), odom_from_robot, report }
    }
}
