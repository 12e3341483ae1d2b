use std::collections::VecDeque;

use nalgebra::{Point2, distance};
use tagalong_core::{EgoMotion, TrackId};

/// Points of the trail are this far apart, m.
const APART_M: f64 = 0.1;
/// So many of them are kept.
const POINTS: usize = 80;

/// The way on which a person went, robot frame, m, oldest first.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trail {
    whose: Option<TrackId>,
    points: VecDeque<Point2<f64>>,
}

impl Trail {
    /// Moves the trail along with the robot and adds the person's place. The part that the robot
    /// has passed is forgotten, and all of it if it was another person's.
    pub(crate) fn go_on(&mut self, motion: &EgoMotion, whose: TrackId, place: Point2<f64>) {
        if self.whose != Some(whose) {
            *self = Self { whose: Some(whose), points: VecDeque::new() };
        }
        self.points.iter_mut().for_each(|point| *point = motion.apply_to_point(*point));
        // Points closer together would be the noise of a standing person.
        if self.points.back().is_none_or(|last| distance(last, &place) >= APART_M) {
            self.points.push_back(place);
        }
        self.points.retain(|point| point.iter().all(|v| v.is_finite()));
        // The part up to the nearest point is behind the robot.
        self.points.drain(..self.nearest().max(self.points.len().saturating_sub(POINTS)));
    }

    /// The next point of the trail that is at least so far from the robot, m.
    pub(crate) fn ahead(&self, far_m: f64) -> Option<Point2<f64>> {
        self.points.iter().find(|point| point.coords.norm() >= far_m).copied()
    }

    /// The one that is nearest to the robot; the newest of equals.
    fn nearest(&self) -> usize {
        let ranges = self.points.iter().map(|point| point.coords.norm()).enumerate().rev();
        ranges.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(at, _)| at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walked(places: &[(f64, f64)]) -> Trail {
        let mut trail = Trail::default();
        for (x, y) in places {
            trail.go_on(&EgoMotion::at_rest(0.1), TrackId(1), Point2::new(*x, *y));
        }
        trail
    }

    #[test]
    fn the_way_round_a_corner_is_the_way_that_the_person_took() {
        let corner = [(1.0, 0.0), (1.5, 0.0), (2.0, 0.0), (2.0, 0.5), (2.0, 1.0)];
        let mut trail = walked(&corner);
        assert_eq!(trail.ahead(1.2), Some(Point2::new(1.5, 0.0)));
        assert_eq!(trail.ahead(9.0), None);
        let on = EgoMotion { forward: 1.4, ..EgoMotion::at_rest(0.1) };
        trail.go_on(&on, TrackId(1), Point2::new(0.6, 1.2));
        let next = trail.ahead(0.7).unwrap();
        assert!((next - Point2::new(0.6, 0.5)).norm() < 1e-9, "{next}");
    }

    #[test]
    fn who_comes_back_has_no_way_to_be_followed() {
        let back = walked(&[(1.0, 0.0), (1.5, 0.0), (2.0, 0.3), (1.5, 0.4), (0.9, 0.3)]);
        assert_eq!(back.points.len(), 1);
    }

    #[test]
    fn the_trail_of_somebody_else_is_none() {
        let mut trail = walked(&[(1.0, 0.0), (1.5, 0.0)]);
        trail.go_on(&EgoMotion::at_rest(0.1), TrackId(2), Point2::new(3.0, 0.0));
        assert_eq!(trail.ahead(0.5), Some(Point2::new(3.0, 0.0)));
        trail.go_on(&EgoMotion::at_rest(0.1), TrackId(2), Point2::new(f64::NAN, 0.0));
        assert_eq!(trail.points.len(), 1);
    }
}
