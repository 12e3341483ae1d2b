//! `follow-bench-sfm`: the social force model of Follow-Bench.
//!
//! The goal attracts; people and the centres of the rectangles around readings of the laser repel. The
//! velocity that results is turned into a turn towards it and a speed along the heading.

use nalgebra::{Point2, Vector2};
use tagalong_config::Registry;
use tagalong_core::{Twist, settings};

use super::obstacles::{Clusters, others, readings};
use super::planner::{Planner, Situation, Steering};

/// Time ahead at which a lost person is expected, s.
const HORIZON_S: f64 = 2.0;
/// Largest wanted speed, m/s, and gain of the way towards it, 1/s.
const SPEED_MPS: f64 = 3.0;
const GAIN: f64 = 1.3;
/// Strength, m/s², and decay, m, of the forces of things and of people.
const THINGS: [f64; 2] = [10.0, 0.5];
const PEOPLE: [f64; 2] = [7.0, 0.5];
/// Which readings of the laser are a thing.
const CLUSTERS: Clusters = Clusters { neighbour_m: 0.5, least: 3 };
/// Distance of things that have no force any more, m, and the distance that is safe, m.
const REACH_M: f64 = 5.0;
const SAFE_M: f64 = 0.3;
/// Largest turn rate, rad/s, time in which the heading is reached, s, and the angle that is no turn.
const TURN_RATE: f64 = 2.0;
const TURN_S: f64 = 0.2;
const STRAIGHT_RAD: f64 = 0.1;
/// Speed below which the robot stands, m/s.
const STANDS_MPS: f64 = 0.02;

settings! {
    /// Settings of the controller `follow-bench-sfm`.
    pub struct Config {
        /// Distance kept from the centre of the person, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub distance_m: f64 = 1.5,
        /// Radius of the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub radius_m: f64 = 0.445,
    }
}

impl Steering for Config {
    type Memory = ();

    fn steer(&self, now: &Situation<'_>, (): &mut ()) -> Twist {
        let goal = now.quarry.goal(0.0, HORIZON_S, self.distance_m);
        let things = CLUSTERS.rectangles(&readings(now.scene, &now.quarry.place));
        let things: Vec<_> = things.iter().map(|thing| thing.centre).collect();
        let velocity = Vector2::new(now.last.linear_mps, 0.0);
        let pull = attraction(&goal, 2.0 * self.radius_m);
        let push = of_people(&others(now.scene)) + of_things(&things);
        let wanted = velocity + ((pull - velocity) * GAIN + push) * now.dt_s;
        let twist = towards(&wanted.cap_magnitude(SPEED_MPS));
        Twist::new(
            twist.linear_mps.min(now.max_mps),
            twist.angular_rps.clamp(-now.max_rps, now.max_rps),
        )
    }

    fn stand_off_m(&self) -> f64 {
        self.distance_m
    }
}

/// Returns the wanted velocity; none within `reached_m` of the goal.
fn attraction(goal: &Point2<f64>, reached_m: f64) -> Vector2<f64> {
    let way_m = goal.coords.norm();
    if way_m > reached_m { goal.coords * (SPEED_MPS / way_m) } else { Vector2::zeros() }
}

fn force(strength: [f64; 2], distance_m: f64) -> f64 {
    strength[0] * ((SAFE_M - distance_m) / strength[1]).exp()
}

fn of_people(people: &[Point2<f64>]) -> Vector2<f64> {
    let mut sum = Vector2::zeros();
    for at in people {
        let away = at.coords.norm();
        if away > 0.0 {
            sum -= at.coords / away * force(PEOPLE, away);
        }
    }
    sum
}

/// Returns the force of things. The way from each is divided by the root of the sum of the squares of
/// all ways, as the benchmark runs it, and not by its own length.
fn of_things(things: &[Point2<f64>]) -> Vector2<f64> {
    let ways = things.iter().map(|at| -at.coords).filter(|way| way.norm() < REACH_M);
    let ways: Vec<Vector2<f64>> = ways.collect();
    let all_m = ways.iter().map(|way| way.norm_squared()).sum::<f64>().sqrt();
    if all_m <= 0.0 {
        return Vector2::zeros();
    }
    ways.iter().map(|way| way / all_m * force(THINGS, way.norm())).sum()
}

/// Returns the speeds of a robot that turns towards a velocity.
fn towards(velocity: &Vector2<f64>) -> Twist {
    let speed_mps = velocity.norm();
    if speed_mps <= STANDS_MPS {
        return Twist::STOP;
    }
    let angle_rad = velocity.y.atan2(velocity.x);
    let is_straight = angle_rad.abs() < STRAIGHT_RAD;
    let turn = if is_straight { 0.0 } else { (angle_rad / TURN_S).clamp(-TURN_RATE, TURN_RATE) };
    Twist::new((speed_mps * angle_rad.cos()).max(0.0), turn)
}

/// Registers the planner.
pub(super) fn register(registry: &mut Registry) {
    registry.controller(
        "follow-bench-sfm",
        "follows by the social force model of Follow-Bench",
        |config: Config, _| Planner::new(config),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_goal_attracts_until_it_is_reached() {
        assert_eq!(attraction(&Point2::new(2.0, 0.0), 0.89), Vector2::new(SPEED_MPS, 0.0));
        assert_eq!(attraction(&Point2::new(0.5, 0.0), 0.89), Vector2::zeros());
    }

    #[test]
    fn people_and_things_repel_the_more_the_nearer_they_are() {
        let near = of_people(&[Point2::new(0.3, 0.0)]);
        assert!((near - Vector2::new(-PEOPLE[0], 0.0)).norm() < 1e-12, "{near}");
        assert!(of_people(&[Point2::new(1.0, 0.0)]).x > near.x);
        let thing = of_things(&[Point2::new(0.0, 0.3)]);
        assert!((thing - Vector2::new(0.0, -THINGS[0])).norm() < 1e-12, "{thing}");
        assert_eq!(of_things(&[Point2::new(6.0, 0.0)]), Vector2::zeros());
        // A second thing far away weakens the force of the first.
        let both = of_things(&[Point2::new(0.0, 0.3), Point2::new(4.0, 0.0)]);
        assert!(both.y > 0.2 * thing.y, "{both}");
    }

    #[test]
    fn the_robot_turns_towards_a_velocity_and_drives_along_its_heading() {
        assert_eq!(towards(&Vector2::new(0.01, 0.0)), Twist::STOP);
        assert_eq!(towards(&Vector2::new(1.0, 0.05)).angular_rps, 0.0);
        let aside = towards(&Vector2::new(0.0, 1.0));
        assert!(aside.linear_mps.abs() < 1e-12 && aside.angular_rps == TURN_RATE, "{aside:?}");
        let behind = towards(&Vector2::new(-1.0, -0.1));
        assert!(behind.linear_mps == 0.0 && behind.angular_rps == -TURN_RATE, "{behind:?}");
    }
}
