//! The outline of the robot on the floor.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry2, Point2, Vector2};

/// Radius of a robot without a footprint, m: slightly more than that of the robot in the papers,
/// which is 0.38 m wide and 0.47 m long.
pub const ROBOT_RADIUS_M: f64 = 0.25;
/// Distance from the body within which an object presses the bumper, m, because the bumper stands
/// out.
const BUMPER_M: f64 = 0.02;
/// Maximum number of corners of a footprint.
const MOST_CORNERS: usize = 64;
/// Maximum distance of a corner of a footprint, m.
const FARTHEST_M: f64 = 3.0;

/// Outline of the robot around the point between its wheels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outline<'a> {
    /// Disc of this radius, m.
    Disc(f64),
    /// Corners in the robot frame, m.
    Polygon(&'a [[f64; 2]]),
}

/// Free distance between the outline and an object, m; negative inside of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gap {
    /// Direction from the middle of the robot, robot frame, rad.
    pub bearing_rad: f64,
    /// The distance, m.
    pub distance_m: f64,
}

impl Outline<'_> {
    /// Returns the gap to a round object at this distance and direction in the world; a point has
    /// the radius 0.
    pub fn gap(
        &self,
        world_from_robot: &Isometry2<f64>,
        direction: &Vector2<f64>,
        away_m: f64,
        thing_radius_m: f64,
    ) -> Gap {
        let local = world_from_robot.rotation.inverse() * direction;
        let distance_m = match self {
            Self::Disc(radius_m) => away_m - thing_radius_m - radius_m,
            Self::Polygon(corners) if away_m.is_finite() => {
                signed_distance(corners, &Point2::from(local * away_m)) - thing_radius_m
            }
            Self::Polygon(_) => f64::INFINITY,
        };
        Gap { bearing_rad: local.y.atan2(local.x), distance_m }
    }
}

impl Gap {
    /// Returns true if the object presses a bumper that covers this arc, degrees, from right to
    /// left.
    pub fn presses(&self, arc_deg: [f64; 2]) -> bool {
        let [from, to] = arc_deg.map(f64::to_radians);
        let from_first = (self.bearing_rad - from).rem_euclid(TAU);
        self.distance_m <= BUMPER_M && from_first <= to - from
    }
}

/// Returns the conditions on a footprint, each with the message for a violation.
pub(crate) fn rules(corners: &[[f64; 2]]) -> [(bool, &'static str); 2] {
    let is_near = corners.iter().all(|[x, y]| x.hypot(*y) <= FARTHEST_M);
    let is_polygon = corners.is_empty() || (3..=MOST_CORNERS).contains(&corners.len());
    let holds_wheels =
        corners.is_empty() || is_polygon && signed_distance(corners, &Point2::origin()) < 0.0;
    [
        (
            is_near && is_polygon,
            "robot.footprint must have 3 to 64 corners, each within 3 m of the robot's middle",
        ),
        (holds_wheels, "robot.footprint must surround [0.0, 0.0], the point between the wheels"),
    ]
}

/// Returns the distance from a polygon to a point, m; negative inside of it.
fn signed_distance(corners: &[[f64; 2]], point: &Point2<f64>) -> f64 {
    let mut nearest_m = f64::INFINITY;
    let mut turned_rad = 0.0;
    let ends = corners.iter().cycle().skip(1);
    for (start, end) in corners.iter().zip(ends) {
        let start = Point2::from(*start) - point;
        let end = Point2::from(*end) - point;
        nearest_m = nearest_m.min(distance_to_edge(&start, &end));
        let turn = end.y.atan2(end.x) - start.y.atan2(start.x);
        turned_rad += (turn + PI).rem_euclid(TAU) - PI;
    }
    // Around a point inside, the corners make a whole turn; around one outside, none.
    if turned_rad.abs() > PI { -nearest_m } else { nearest_m }
}

/// Returns the distance from the origin to an edge, m.
fn distance_to_edge(start: &Vector2<f64>, end: &Vector2<f64>) -> f64 {
    let along = end - start;
    let length2 = along.norm_squared();
    let part = if length2 > 0.0 { (-start.dot(&along) / length2).clamp(0.0, 1.0) } else { 0.0 };
    (start + along * part).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half a metre long, of which 0.4 m are ahead of the wheels, and 0.4 m wide.
    const LONG: [[f64; 2]; 4] = [[0.4, 0.2], [-0.1, 0.2], [-0.1, -0.2], [0.4, -0.2]];

    #[test]
    fn distances_are_those_to_the_nearest_edge() {
        fn distance(x: f64, y: f64) -> f64 {
            signed_distance(&LONG, &Point2::new(x, y))
        }

        for (x, y, expected) in [
            (0.9, 0.0, 0.5),
            (-0.3, 0.1, 0.2),
            (0.2, -0.5, 0.3),
            (0.7, 0.6, 0.5),
            (0.0, 0.0, -0.1),
            (0.3, 0.0, -0.1),
        ] {
            assert!((distance(x, y) - expected).abs() < 1e-9, "{x} {y}: {}", distance(x, y));
        }
        let mut clockwise = LONG;
        clockwise.reverse();
        assert!(signed_distance(&clockwise, &Point2::origin()) < 0.0);
    }

    #[test]
    fn gaps_turn_with_the_robot() {
        let robot = Isometry2::new(Vector2::new(2.0, 3.0), 0.5 * PI);
        // Along Y of the world, which is ahead of the robot.
        let gap = Outline::Polygon(&LONG).gap(&robot, &Vector2::y(), 1.0, 0.0);
        assert!((gap.distance_m - 0.6).abs() < 1e-9 && gap.bearing_rad.abs() < 1e-9, "{gap:?}");
        let gap = Outline::Disc(0.25).gap(&robot, &Vector2::x(), 1.0, 0.2);
        assert!(
            (gap.bearing_rad + 0.5 * PI).abs() < 1e-9 && (gap.distance_m - 0.55).abs() < 1e-9,
            "{gap:?}"
        );
        let free = Outline::Polygon(&LONG).gap(&robot, &Vector2::x(), f64::INFINITY, 0.0);
        assert_eq!(free.distance_m, f64::INFINITY);
    }

    #[test]
    fn a_bumper_is_pressed_within_its_arc() {
        fn gap(bearing_deg: f64, distance_m: f64) -> Gap {
            Gap { bearing_rad: f64::to_radians(bearing_deg), distance_m }
        }

        let front = [-60.0, 60.0];
        assert!(gap(0.0, 0.01).presses(front) && gap(-59.0, -0.1).presses(front));
        assert!(!gap(0.0, 0.05).presses(front) && !gap(61.0, 0.0).presses(front));
        let tail = [120.0, 240.0];
        assert!(gap(180.0, 0.0).presses(tail) && gap(-170.0, 0.0).presses(tail));
        assert!(!gap(0.0, 0.0).presses(tail));
    }

    #[test]
    fn a_footprint_surrounds_the_wheels() {
        fn holds(corners: &[[f64; 2]]) -> bool {
            rules(corners).iter().all(|(holds, _)| *holds)
        }
        assert!(holds(&[]) && holds(&LONG));
        assert!(!holds(&LONG[..2]) && !holds(&LONG.map(|[x, y]| [x + 1.0, y])));
        assert!(!holds(&LONG.map(|[x, y]| [f64::NAN * x, y])));
    }
}
