//! Control law of the position of the person: what the robot does in an empty room.

use nalgebra::{Isometry2, Point2, Vector2};
use tagalong_core::Twist;

use super::config::Config;
use super::scenery::{Expected, Scenery};

/// The person is never nearer than this to the law that turns, m.
const LEAST_RANGE_M: f64 = 0.5;
/// A robot that is nearer than this to its place beside the person keeps its direction, m: the direction
/// to so near a place is noise.
const THERE_M: f64 = 0.15;
/// Wanted speed below which the robot stands, m/s.
const STILL_MPS: f64 = 0.05;

/// Place at which a robot wants to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Goal {
    /// So far from the person, with the robot facing them.
    Facing,
    /// At an angle from the direction in which the person walks, rad.
    Beside(f64),
}

impl Goal {
    /// Returns the place at a step of the plan, m; that of the robot itself for a goal without one.
    pub(super) fn place(
        self,
        config: &Config,
        scenery: &Scenery,
        person: &Expected,
    ) -> Option<Point2<f64>> {
        let Self::Beside(angle) = self else { return None };
        let heading = scenery.heading?;
        let aside = nalgebra::Rotation2::new(angle) * heading;
        Some(person.at + config.stand_off_m * aside)
    }
}

/// Returns the velocity by the law at a pose in the axes of the plan, for a robot with a limit of its
/// speed.
pub(super) fn wish(
    config: &Config,
    scenery: &Scenery,
    goal: Goal,
    pose: &Isometry2<f64>,
    person: &Expected,
    max_mps: f64,
) -> Twist {
    match goal.place(config, scenery, person) {
        Some(place) => beside(config, pose, place, person, max_mps),
        None => facing(config, pose, person, max_mps),
    }
}

/// Faces the person and keeps the distance.
fn facing(config: &Config, pose: &Isometry2<f64>, person: &Expected, max_mps: f64) -> Twist {
    let at = pose.inverse_transform_point(&person.at);
    let velocity = pose.inverse_transform_vector(&person.velocity);
    let range_m = at.coords.norm();
    let bearing = at.y.atan2(at.x);
    let towards = at.coords.try_normalize(1e-6).unwrap_or_else(Vector2::x);
    // A person that walks across the line of sight turns it; the least range keeps the quotient
    // finite.
    let around = towards.perp(&velocity) / range_m.max(LEAST_RANGE_M);
    let turn = config.bearing_gain_per_s * bearing + around;
    let recedes = velocity.dot(&towards).max(0.0);
    let wanted = config.range_gain_per_s * (range_m - config.stand_off_m) + recedes;
    // A robot that faces away turns first.
    let ahead = bearing.cos().max(0.0).powi(2);
    bounded(config, wanted.clamp(0.0, max_mps) * ahead, turn)
}

/// Drives to a place that moves with the person, and on with it.
fn beside(
    config: &Config,
    pose: &Isometry2<f64>,
    place: Point2<f64>,
    person: &Expected,
    max_mps: f64,
) -> Twist {
    let off = pose.inverse_transform_point(&place).coords;
    let goes = pose.inverse_transform_vector(&person.velocity);
    let wanted = goes + config.range_gain_per_s * off;
    let speed = wanted.norm();
    if speed < STILL_MPS {
        return Twist::STOP;
    }
    let bearing = wanted.y.atan2(wanted.x);
    // Near the place only the way of the person counts, not the noise of the place.
    let sure =
        if goes.norm() > STILL_MPS { 1.0 } else { (off.norm() / THERE_M - 1.0).clamp(0.0, 1.0) };
    let ahead = bearing.cos().max(0.0).powi(2);
    let turn = 2.0 * config.bearing_gain_per_s * bearing;
    bounded(config, sure * speed.min(max_mps) * ahead, sure * turn)
}

fn bounded(config: &Config, speed_mps: f64, turn: f64) -> Twist {
    Twist::new(speed_mps, turn.clamp(-config.max_turn_rate, config.max_turn_rate))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenery(heading: Option<Vector2<f64>>) -> Scenery {
        Scenery { heading, ..Scenery::new(4.0) }
    }

    fn person(x: f64, y: f64, velocity: [f64; 2]) -> Expected {
        Expected { at: Point2::new(x, y), velocity: velocity.into() }
    }

    fn asked(goal: Goal, heading: Option<Vector2<f64>>, person: Expected) -> Twist {
        wish(&Config::default(), &scenery(heading), goal, &Isometry2::identity(), &person, 0.9)
    }

    #[test]
    fn behind_a_person_it_faces_them_and_keeps_the_distance() {
        let there = asked(Goal::Facing, None, person(1.4, 0.0, [0.0, 0.0]));
        assert_eq!(there, Twist::STOP);
        let walks = asked(Goal::Facing, None, person(1.4, 0.0, [0.6, 0.0]));
        assert!((walks.linear_mps - 0.6).abs() < 1e-9 && walks.angular_rps == 0.0, "{walks:?}");
        let around = asked(Goal::Facing, None, person(2.0, 0.0, [0.0, 0.8]));
        assert!((around.angular_rps - 0.4).abs() < 1e-9, "{around:?}");
        let behind = asked(Goal::Facing, None, person(-2.0, 0.1, [0.0, 0.0]));
        assert!(behind.linear_mps == 0.0 && behind.angular_rps == 1.2, "{behind:?}");
    }

    #[test]
    fn beside_a_person_it_goes_with_them_and_to_its_place() {
        let ahead = Some(Vector2::x());
        let left = Goal::Beside(90_f64.to_radians());
        let with = asked(left, ahead, person(0.0, -1.4, [0.7, 0.0]));
        assert!((with.linear_mps - 0.7).abs() < 1e-9 && with.angular_rps.abs() < 1e-9, "{with:?}");
        let right_of_it = asked(left, ahead, person(0.0, -0.4, [0.7, 0.0]));
        assert!(right_of_it.angular_rps > 0.5, "{right_of_it:?}");
        let stands = asked(left, ahead, person(0.05, -1.4, [0.0, 0.0]));
        assert_eq!(stands, Twist::STOP);
        let unknown = asked(left, None, person(1.4, 0.0, [0.0, 0.0]));
        assert_eq!(unknown, Twist::STOP, "as behind, as long as the person has no direction");
    }

    #[test]
    fn a_person_who_stands_does_not_make_it_turn_to_and_fro() {
        let ahead = Some(Vector2::x());
        let goal = Goal::Beside(0.0);
        for off in [-0.1, 0.1] {
            let twist = asked(goal, ahead, person(-1.4 + off, off, [0.0, 0.0]));
            assert_eq!(twist.angular_rps, 0.0, "{off}: {twist:?}");
        }
        assert!(asked(goal, ahead, person(-1.0, 0.4, [0.0, 0.0])).angular_rps != 0.0);
    }
}
