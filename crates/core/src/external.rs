use nalgebra::Point3;

use tagalong_geometry::Rect;

/// A detection by a detector outside of Tagalong, as recorded in the log.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
#[non_exhaustive]
pub struct ExternalDetection {
    /// Box in the image, pixels; absent for 3-D detections.
    pub region: Option<Rect>,
    /// Centre of the head in the robot frame, m; absent for boxes.
    pub head: Option<Point3<f64>>,
    /// Confidence on the detector's own scale.
    pub score: f64,
}

impl ExternalDetection {
    /// Creates a detection with a box in the image, pixels, and the confidence of its detector.
    pub fn in_image(region: Rect, score: f64) -> Self {
        Self { region: Some(region), head: None, score }
    }

    /// Creates a detection with the centre of a head in the robot frame, m, and the confidence of its
    /// detector.
    pub fn at(head: Point3<f64>, score: f64) -> Self {
        Self { region: None, head: Some(head), score }
    }
}
