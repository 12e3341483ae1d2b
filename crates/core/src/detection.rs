use std::sync::Arc;

use nalgebra::{Matrix3, Point3};
use tagalong_geometry::{Camera, ImageBox, Rect};

use crate::Joints;

/// One detection of a person: a position, and a box in the image if a camera made it.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Detection {
    /// Box in the image; none from a detector that sees no image, like that of a laser scan.
    pub image: Option<ImageBox>,
    /// Centre of the head in the robot frame, m.
    pub position: Point3<f64>,
    /// Covariance of the position, m². An unknown coordinate has a large variance.
    pub covariance: Matrix3<f64>,
    /// Log-odds that this is a person; 0 is undecided. Comparable between the detectors of a
    /// pipeline, so that their output can be ranked together.
    pub score: f64,
    /// Name of the plugin that made the detection.
    pub source: &'static str,
    /// Joints in the image, from a detector that finds them.
    pub joints: Option<Arc<Joints>>,
}

impl Detection {
    /// Creates the detection of a plugin without a box in the image: the centre of a head in the robot
    /// frame, m, its covariance, m², and the log-odds that this is a person.
    pub fn new(
        source: &'static str,
        position: Point3<f64>,
        covariance: Matrix3<f64>,
        score: f64,
    ) -> Self {
        Self { image: None, position, covariance, score, source, joints: None }
    }

    /// Returns the detection with its box in the image, or with `None` without one.
    pub fn with_image(self, image: impl Into<Option<ImageBox>>) -> Self {
        Self { image: image.into(), ..self }
    }

    /// Returns the detection at another centre of the head, robot frame, m.
    pub fn with_position(self, position: Point3<f64>) -> Self {
        Self { position, ..self }
    }

    /// Returns the detection with another covariance of the position, m².
    pub fn with_covariance(self, covariance: Matrix3<f64>) -> Self {
        Self { covariance, ..self }
    }

    /// Returns the detection with other log-odds that this is a person.
    pub fn with_score(self, score: f64) -> Self {
        Self { score, ..self }
    }

    /// Returns the detection with these joints, if any.
    pub fn with_joints(self, joints: Option<Joints>) -> Self {
        Self { joints: joints.map(Arc::new), ..self }
    }

    /// Returns the rectangle of the box in the image, if there is one.
    pub fn rect(&self) -> Option<Rect> {
        self.image.map(|image| image.rect)
    }

    /// Returns the rectangle of the box in the image; without a box, the upper-body square at the
    /// projection of the position.
    pub fn rect_in(&self, camera: &Camera) -> Rect {
        self.rect().unwrap_or_else(|| camera.upper_body(&self.position))
    }

    /// Returns true if every number is finite and the covariance has no negative variance.
    pub fn is_sane(&self) -> bool {
        self.image.is_none_or(|image| image.rect.is_sane())
            && self.position.iter().all(|v| v.is_finite())
            && self.covariance.iter().all(|v| v.is_finite())
            && self.covariance.diagonal().iter().all(|v| *v >= 0.0)
            && self.score.is_finite()
            && self.joints.as_ref().is_none_or(|joints| joints.is_sane())
    }
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    #[test]
    fn without_a_box_the_position_is_projected() {
        let lens = Pinhole { fx: 50.0, fy: 50.0, cx: 32.0, cy: 24.0, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 64, 48, 1.2, 0.0, 0.0);
        let rect = Rect::new(1.0, 2.0, 3.0, 3.0);
        let boxed = Detection::new("test", Point3::new(3.0, 0.0, 1.6), Matrix3::zeros(), 0.5)
            .with_image(ImageBox::full_body(rect));
        assert_eq!((boxed.rect(), boxed.rect_in(&camera)), (Some(rect), rect));
        let scanned = Detection { image: None, ..boxed };
        assert!(scanned.is_sane());
        assert_eq!(scanned.rect(), None);
        assert_eq!(scanned.rect_in(&camera), camera.upper_body(&scanned.position));
    }

    #[test]
    fn every_number_of_a_detection_is_looked_at() {
        let fine = Detection::new("test", Point3::new(3.0, 0.0, 1.6), Matrix3::zeros(), 0.5)
            .with_image(ImageBox::upper_body(Rect::new(1.0, 2.0, 3.0, 3.0)));
        assert!(fine.is_sane());
        let odd = f64::NAN;
        let mut negative = Matrix3::identity();
        negative[(1, 1)] = -0.1;
        let mut endless = Matrix3::identity();
        endless[(0, 1)] = f64::INFINITY;
        for broken in [
            Detection {
                image: Some(ImageBox::upper_body(Rect::new(odd, 0.0, 1.0, 1.0))),
                ..fine.clone()
            },
            Detection { position: Point3::new(0.0, odd, 0.0), ..fine.clone() },
            Detection { covariance: negative, ..fine.clone() },
            Detection { covariance: endless, ..fine.clone() },
            Detection { score: odd, ..fine.clone() },
        ] {
            assert!(!broken.is_sane(), "{broken:?}");
        }
    }
}
