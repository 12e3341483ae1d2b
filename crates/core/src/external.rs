use nalgebra::Point3;

use tagalong_geometry::Rect;

/// A detection by a detector outside of Tagalong, as recorded in the log.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct ExternalDetection {
    /// Box in the image, pixels; absent for 3-D detections.
    pub region: Option<Rect>,
    /// Centre of the head in the robot frame, m; absent for boxes.
    pub head: Option<Point3<f64>>,
    /// Confidence on the detector's own scale.
    pub score: f64,
}
