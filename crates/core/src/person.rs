use nalgebra::{Point3, SMatrix, Vector2};
use tagalong_geometry::Rect;

/// Standard deviation of a distance, as a share of it, above which the distance is a guess. On recorded logs
/// it was 6 to 25 % of distances by the size of a box, and 2 to 4 % of most that were measured.
const GUESSED: f64 = 0.05;
/// The same in metres, which near people have to exceed as well: labels have one decimal.
const GUESSED_M: f64 = 0.1;

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

    /// Returns true if the distance along the floor is a guess: its standard deviation is more than a
    /// twentieth of it and more than a decimetre, because it comes from the size of a box, or because the person was not seen for
    /// some time.
    ///
    /// ```
    /// use nalgebra::{SMatrix, zero};
    /// use tagalong_core::{Estimate, Person};
    /// use tagalong_geometry::Rect;
    /// let person = Person { position: [4.0, 0.0, 1.6].into(), velocity: zero() };
    /// let measured = Estimate::new(person, SMatrix::identity() * 0.01, Rect::default());
    /// assert_eq!(measured.distance_text(), "4.0 m");
    /// let by_size = measured.with_covariance(SMatrix::identity() * 0.64);
    /// assert!(by_size.is_distance_guessed());
    /// assert_eq!(by_size.distance_text(), "~4.0 m");
    /// ```
    pub fn is_distance_guessed(&self) -> bool {
        let away = self.person.position.xy().coords;
        let along = (away.transpose() * self.covariance.fixed_view::<2, 2>(0, 0) * away)[0];
        let distance_m = away.norm();
        // Both sides times the distance, which may be 0.
        along > (distance_m * f64::max(GUESSED * distance_m, GUESSED_M)).powi(2)
    }

    /// Returns the distance along the floor in words for a label, with `~` before one that is a guess.
    pub fn distance_text(&self) -> String {
        let about = if self.is_distance_guessed() { "~" } else { "" };
        format!("{about}{:.1} m", self.person.position.xy().coords.norm())
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

    /// The person is 5 m away, at 3 and 4 m along the axes: the limit is 0.25 m.
    #[test]
    fn a_distance_is_a_guess_by_its_own_variance_alone() {
        let person = Person { position: Point3::new(3.0, 4.0, 1.6), velocity: Vector2::zeros() };
        let estimate = Estimate::new(person, SMatrix::zeros(), Rect::default());
        let along = Vector2::new(0.6, 0.8);
        let across = Vector2::new(-0.8, 0.6);
        for (axis, sigma_m, is_guessed) in
            [(along, 0.24, false), (along, 0.26, true), (across, 2.0, false)]
        {
            let mut covariance = SMatrix::<f64, 5, 5>::zeros();
            let of_place = axis * axis.transpose() * (sigma_m * sigma_m);
            covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&of_place);
            // Neither height nor speed is part of a distance.
            covariance[(2, 2)] = 9.0;
            covariance[(3, 3)] = 9.0;
            let estimate = estimate.clone().with_covariance(covariance);
            assert_eq!(estimate.is_distance_guessed(), is_guessed, "{axis} {sigma_m}");
            let text = if is_guessed { "~5.0 m" } else { "5.0 m" };
            assert_eq!(estimate.distance_text(), text);
        }
    }

    /// 0.09 m are 9 % of a metre, and less than a label shows.
    #[test]
    fn a_distance_that_is_right_to_the_decimetre_is_no_guess() {
        let person = Person { position: Point3::new(1.0, 0.0, 1.6), velocity: Vector2::zeros() };
        for (sigma_m, is_guessed) in [(0.09, false), (0.11, true)] {
            let covariance = SMatrix::identity() * (sigma_m * sigma_m);
            let estimate = Estimate::new(person, covariance, Rect::default());
            assert_eq!(estimate.is_distance_guessed(), is_guessed, "{sigma_m}");
        }
        let here = Person { position: Point3::new(0.0, 0.0, 1.6), ..person };
        let estimate = Estimate::new(here, SMatrix::identity(), Rect::default());
        assert_eq!(estimate.distance_text(), "0.0 m");
    }

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
