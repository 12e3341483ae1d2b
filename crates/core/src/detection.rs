use nalgebra::{Matrix3, Point3};

use tagalong_geometry::Rect;

/// One detection of a person: an image region and a position.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// Upper-body square in the image (see [`tagalong_geometry::Camera::upper_body`]).
    pub region: Rect,
    /// Centre of the head in the robot frame, m.
    pub position: Point3<f64>,
    /// Covariance of the position, m². An unknown coordinate has a large variance.
    pub covariance: Matrix3<f64>,
    /// Log-odds that this is a person; 0 is undecided. Comparable between the detectors of a
    /// pipeline, so that their output can be ranked together.
    pub score: f64,
    /// Name of the plugin that made the detection.
    pub source: &'static str,
}

impl Detection {
    /// Returns true if every number is finite and the covariance has no negative variance.
    pub fn is_sane(&self) -> bool {
        self.region.is_sane()
            && self.position.iter().all(|v| v.is_finite())
            && self.covariance.iter().all(|v| v.is_finite())
            && self.covariance.diagonal().iter().all(|v| *v >= 0.0)
            && self.score.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_a_detection_is_looked_at() {
        let fine = Detection {
            region: Rect::new(1.0, 2.0, 3.0, 3.0),
            position: Point3::new(3.0, 0.0, 1.6),
            covariance: Matrix3::zeros(),
            score: 0.5,
            source: "test",
        };
        assert!(fine.is_sane());
        let odd = f64::NAN;
        let mut negative = Matrix3::identity();
        negative[(1, 1)] = -0.1;
        let mut endless = Matrix3::identity();
        endless[(0, 1)] = f64::INFINITY;
        for broken in [
            Detection { region: Rect::new(odd, 0.0, 1.0, 1.0), ..fine.clone() },
            Detection { position: Point3::new(0.0, odd, 0.0), ..fine.clone() },
            Detection { covariance: negative, ..fine.clone() },
            Detection { covariance: endless, ..fine.clone() },
            Detection { score: odd, ..fine.clone() },
        ] {
            assert!(!broken.is_sane(), "{broken:?}");
        }
    }
}
