use nalgebra::Point3;

use crate::Rect;

/// Somebody whom a detector outside of Tagalong saw, as its log tells it.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Recorded {
    /// The box in the image, pixels; absent for detections in space.
    pub region: Option<Rect>,
    /// Centre of the head in the robot frame, m; absent for boxes.
    pub head: Option<Point3<f64>>,
    /// How sure the detector was, on its own scale.
    pub score: f64,
}
