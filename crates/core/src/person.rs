use nalgebra::{Point3, SMatrix, Vector2};
use tagalong_geometry::Rect;

/// State of a person in the robot frame: what the covariance of an [`Estimate`] is about, no more.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Person {
    /// Centre of the head, m.
    pub position: Point3<f64>,
    /// Velocity over ground (not relative to the robot), in robot axes, m/s.
    pub velocity: Vector2<f64>,
}

/// State estimate of one person.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Estimate {
    /// The mean.
    pub person: Person,
    /// Covariance of (x, y, z, vx, vy).
    pub covariance: SMatrix<f64, 5, 5>,
    /// The expected upper-body square in the image.
    pub region: Rect,
}

impl Estimate {
    /// Creates the estimate of a person: the mean, the covariance of (x, y, z, vx, vy), and the
    /// expected upper-body square in the image.
    pub fn new(person: Person, covariance: SMatrix<f64, 5, 5>, region: Rect) -> Self {
        Self { person, covariance, region }
    }

    /// Returns the estimate with another mean.
    pub fn with_person(self, person: Person) -> Self {
        Self { person, ..self }
    }

    /// Returns the estimate with another covariance of (x, y, z, vx, vy).
    pub fn with_covariance(self, covariance: SMatrix<f64, 5, 5>) -> Self {
        Self { covariance, ..self }
    }

    /// Returns the estimate with another upper-body square in the image.
    pub fn with_region(self, region: Rect) -> Self {
        Self { region, ..self }
    }

    /// Returns true if every number is finite and no variance is negative.
    pub fn is_sane(&self) -> bool {
        self.person.position.iter().all(|v| v.is_finite())
            && self.person.velocity.iter().all(|v| v.is_finite())
            && self.covariance.iter().all(|v| v.is_finite())
            && self.covariance.diagonal().iter().all(|v| *v >= 0.0)
            && self.region.is_sane()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_of_an_estimate_is_looked_at() {
        let person = Person { position: Point3::new(3.0, 0.0, 1.6), velocity: Vector2::zeros() };
        let covariance = SMatrix::<f64, 5, 5>::zeros();
        let fine = Estimate { person, covariance, region: Rect::new(0.0, 0.0, 1.0, 1.0) };
        assert!(fine.is_sane());
        let mut endless = covariance;
        endless[(4, 0)] = f64::INFINITY;
        let mut negative = covariance;
        negative[(3, 3)] = -1e-9;
        let position = Point3::new(f64::NAN, 0.0, 0.0);
        let velocity = Vector2::new(0.0, f64::NAN);
        for broken in [
            Estimate { person: Person { position, ..person }, ..fine.clone() },
            Estimate { person: Person { velocity, ..person }, ..fine.clone() },
            Estimate { covariance: endless, ..fine.clone() },
            Estimate { covariance: negative, ..fine.clone() },
            Estimate { region: Rect::new(0.0, 0.0, -1.0, 1.0), ..fine.clone() },
        ] {
            assert!(!broken.is_sane(), "{broken:?}");
        }
    }
}
