use nalgebra::{Point2, Vector2};
use tagalong_core::{EgoMotion, Scene};

/// Positions and speeds beyond this are no measurements, m and m/s.
const MOST: f64 = 1e6;
/// Distance at which a lost person is approached, m.
const SEARCH_M: f64 = 0.2;

/// The followed person where they were seen last, in the axes of the robot of now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quarry {
    /// Place, m.
    pub(super) place: Point2<f64>,
    /// Velocity over ground, m/s.
    velocity: Vector2<f64>,
    /// True if the person is seen in this frame.
    is_seen: bool,
}

impl Quarry {
    /// Returns the person of this frame, or, while their track lives on, where they were seen last, moved
    /// along with the robot. `None` without a target: the search of the config comes then.
    pub(super) fn next(before: Option<Self>, scene: &Scene<'_>) -> Option<Self> {
        fn is_finite(place: &Point2<f64>, velocity: &Vector2<f64>) -> bool {
            place.iter().chain(velocity.iter()).all(|value| value.abs() < MOST)
        }

        let track = scene.target?;
        if track.seen {
            let person = &track.estimate.person;
            let place = person.position.xy();
            if is_finite(&place, &person.velocity) {
                return Some(Self { place, velocity: person.velocity, is_seen: true });
            }
        }
        before.map(|before| before.moved(&scene.frame.motion))
    }

    fn moved(self, motion: &EgoMotion) -> Self {
        let place = motion.apply_to_point(self.place);
        Self { place, velocity: motion.apply_to_velocity(self.velocity), is_seen: false }
    }

    /// Returns the point to drive to for where the person will be in `seconds`: on the line from the
    /// robot of now, `distance_m` before the person. A lost person is expected where they would be at
    /// the end of the horizon, and approached.
    pub(super) fn goal(&self, seconds: f64, horizon_s: f64, distance_m: f64) -> Point2<f64> {
        let (ahead_s, distance_m) =
            if self.is_seen { (seconds, distance_m) } else { (horizon_s, SEARCH_M) };
        let place = self.place + self.velocity * ahead_s;
        let towards = place.coords.try_normalize(1e-6).unwrap_or_else(Vector2::x);
        place - towards * distance_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WALKS: Quarry =
        Quarry { place: Point2::new(3.0, 0.0), velocity: Vector2::new(1.0, 0.0), is_seen: true };

    #[test]
    fn the_goal_lies_before_the_person_who_walks_on() {
        assert_eq!(WALKS.goal(0.0, 2.0, 1.5), Point2::new(1.5, 0.0));
        assert_eq!(WALKS.goal(1.0, 2.0, 1.5), Point2::new(2.5, 0.0));
    }

    #[test]
    fn a_lost_person_is_approached_where_they_are_expected() {
        let lost = WALKS.moved(&EgoMotion { forward: 1.0, ..EgoMotion::at_rest(0.1) });
        let goal = lost.goal(0.0, 2.0, 1.5);
        assert!((goal - Point2::new(2.0 + 2.0 - SEARCH_M, 0.0)).norm() < 1e-12, "{goal}");
    }
}
