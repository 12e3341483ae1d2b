//! `follow-bench-dwa`: the improved dynamic window approach of Follow-Bench.
//!
//! All pairs of speeds that the accelerations allow are driven for two seconds in thought. Four costs,
//! each scaled to 0 to 1 over all pairs, are weighted: heading towards the goals at the beginning and at
//! the end, distance from the first goal, inverse distance to obstacles, and slowness.

use std::f64::consts::PI;

use nalgebra::{Point2, Vector2};
use tagalong_config::Registry;
use tagalong_core::{Twist, settings};

use super::obstacles::{PERSON_M, others, readings};
use super::planner::{Planner, Situation, Steering};

/// Time step of the drives in thought, s, and their number.
const STEP_S: f64 = 0.1;
const STEPS: usize = 20;
/// Distance between two speeds, as a part of the largest.
const RESOLUTION: f64 = 0.02;
/// Weights of heading, distance, obstacles and slowness.
const WEIGHTS: [f64; 4] = [3.0, 2.0, 1.0, 0.5];
/// Weight of the heading at the beginning; that at the end has the rest.
const SHORT_TERM: f64 = 0.4;
/// Weights of the first and the last step for the distance to obstacles.
const OBSTACLE_WEIGHTS: [f64; 2] = [0.5, 1.0];
/// Speed below which the robot is stuck, m/s.
const STUCK_MPS: f64 = 0.01;
/// Distance to an obstacle that is no less, m.
const LEAST_M: f64 = 1e-6;
/// Cost of a drive that begins in a collision.
const COLLISION: f64 = 1e6;

settings! {
    /// Settings of the controller `follow-bench-dwa`.
    pub struct Config {
        /// Distance kept from the surface of the person, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub distance_m: f64 = 1.5,
        /// Radius of the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        // Half of the diagonal of 0.7 by 0.55 m.
        pub radius_m: f64 = 0.445,
        /// Largest acceleration, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_acceleration: f64 = 2.0,
        /// Largest angular acceleration, rad/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_angular_acceleration: f64 = PI,
        /// Largest turn rate, rad/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_turn_rate: f64 = PI,
    }
}

/// A drive in thought: its speeds, and the positions and headings after each step.
struct Drive {
    twist: Twist,
    poses: [(Point2<f64>, f64); STEPS],
}

impl Drive {
    fn new(twist: Twist) -> Self {
        let mut place = Point2::origin();
        let mut heading = 0.0;
        let poses = std::array::from_fn(|_| {
            place += Vector2::new(f64::cos(heading), f64::sin(heading)) * twist.linear_mps * STEP_S;
            heading += twist.angular_rps * STEP_S;
            (place, heading)
        });
        Self { twist, poses }
    }

    /// Returns the angle from the heading after a step to a goal, 0 to pi.
    fn off_heading(&self, step: usize, goal: &Point2<f64>) -> f64 {
        let (place, heading) = self.poses[step];
        let way = goal - place;
        let off = way.y.atan2(way.x) - heading;
        off.sin().atan2(off.cos()).abs()
    }

    fn heading_cost(&self, first: &Point2<f64>, last: &Point2<f64>) -> f64 {
        SHORT_TERM * self.off_heading(0, first)
            + (1.0 - SHORT_TERM) * self.off_heading(STEPS - 1, last)
    }

    /// Returns the weighted mean of the inverse distances to the nearest obstacle.
    fn obstacle_cost(&self, obstacles: &[Point2<f64>], collision_m: f64) -> f64 {
        if obstacles.iter().any(|at| at.coords.norm() <= collision_m) {
            return COLLISION;
        }
        let [from, to] = OBSTACLE_WEIGHTS;
        let mut sum = 0.0;
        let mut weights = 0.0;
        for (step, (place, _)) in self.poses.iter().enumerate() {
            let distances = obstacles.iter().map(|at| nalgebra::distance(at, place));
            let least = (distances.fold(f64::INFINITY, f64::min) - collision_m).max(LEAST_M);
            let weight = from + (to - from) * step as f64 / (STEPS - 1) as f64;
            sum += weight / least;
            weights += weight;
        }
        sum / weights
    }
}

impl Config {
    /// Returns the speeds that the accelerations allow within a step, m/s and rad/s.
    fn window(&self, now: &Situation<'_>, max_rps: f64) -> Vec<Twist> {
        let [linear, angular] = [
            (now.last.linear_mps, self.max_acceleration * now.dt_s, now.max_mps),
            (now.last.angular_rps, self.max_angular_acceleration * now.dt_s, max_rps),
        ]
        .map(|(last, change, most)| speeds(last - change, last + change, most));
        linear.iter().flat_map(|v| angular.iter().map(|w| Twist::new(*v, *w))).collect()
    }
}

impl Steering for Config {
    type Memory = ();

    fn steer(&self, now: &Situation<'_>, (): &mut ()) -> Twist {
        let max_rps = self.max_turn_rate.min(now.max_rps);
        let horizon_s = STEP_S * STEPS as f64;
        let stand_off_m = self.stand_off_m();
        let [first, last] = [0.0, horizon_s].map(|s| now.quarry.goal(s, horizon_s, stand_off_m));
        let mut obstacles = readings(now.scene, &now.quarry.place);
        obstacles.extend(others(now.scene));
        let collision_m = self.radius_m + PERSON_M;
        let drives: Vec<Drive> = self.window(now, max_rps).into_iter().map(Drive::new).collect();
        let costs = [
            scaled(drives.iter().map(|drive| drive.heading_cost(&first, &last))),
            scaled(drives.iter().map(|drive| nalgebra::distance(&drive.poses[0].0, &first))),
            scaled(drives.iter().map(|drive| drive.obstacle_cost(&obstacles, collision_m))),
            scaled(drives.iter().map(|drive| now.max_mps - drive.twist.linear_mps)),
        ];
        let totals = drives.iter().enumerate().map(|(at, drive)| {
            let costs = costs.iter().zip(WEIGHTS).map(|(cost, weight)| weight * cost[at]);
            (drive.twist, costs.sum::<f64>())
        });
        let best = totals.min_by(|(_, a), (_, b)| a.total_cmp(b));
        let Some((twist, _)) = best else { return Twist::STOP };
        let is_stuck = [twist, now.last].iter().all(|twist| twist.linear_mps.abs() < STUCK_MPS);
        if is_stuck { Twist::new(twist.linear_mps, -max_rps) } else { twist }
    }

    fn stand_off_m(&self) -> f64 {
        self.distance_m + PERSON_M
    }
}

/// Returns speeds from `from` to `to` within the limit, evenly.
fn speeds(from: f64, to: f64, most: f64) -> Vec<f64> {
    let [from, to] = [from, to].map(|speed| speed.clamp(-most, most));
    let count = ((to - from) / (RESOLUTION * most)) as usize + 1;
    let step = (to - from) / (count - 1).max(1) as f64;
    (0..count).map(|at| from + step * at as f64).collect()
}

/// Returns costs scaled to 0 to 1; 0 if they are all the same.
fn scaled(costs: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut costs: Vec<f64> = costs.collect();
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let range = costs.iter().copied().fold(f64::NEG_INFINITY, f64::max) - least;
    for cost in &mut costs {
        *cost = if range > 0.0 { (*cost - least) / range } else { 0.0 };
    }
    costs
}

/// Registers the planner.
pub(super) fn register(registry: &mut Registry) {
    registry.controller(
        "follow-bench-dwa",
        "follows by the improved dynamic window approach of Follow-Bench",
        |config: Config, _| Planner::new(config),
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_has_the_speeds_that_can_be_reached() {
        let linear = speeds(-0.2, 0.2, 2.0);
        assert_eq!(linear.len(), 11);
        assert!((linear[0] + 0.2).abs() < 1e-12 && (linear[10] - 0.2).abs() < 1e-12);
        assert_eq!(speeds(1.9, 2.3, 2.0).last(), Some(&2.0));
        assert_eq!(speeds(2.5, 3.0, 2.0), [2.0]);
    }

    #[test]
    fn costs_are_scaled_over_all_drives() {
        assert_eq!(scaled([3.0, 1.0, 2.0].into_iter()), [1.0, 0.0, 0.5]);
        assert_eq!(scaled([3.0, 3.0].into_iter()), [0.0, 0.0]);
    }

    #[test]
    fn a_drive_past_an_obstacle_costs_less_the_farther_it_is() {
        let drive = Drive::new(Twist::new(1.0, 0.0));
        let costs = [0.8, 1.5, 4.0].map(|y| drive.obstacle_cost(&[Point2::new(1.0, y)], 0.745));
        assert!(costs[0] > costs[1] && costs[1] > costs[2], "{costs:?}");
        assert_eq!(drive.obstacle_cost(&[Point2::new(0.5, 0.0)], 0.745), COLLISION);
        assert_eq!(drive.obstacle_cost(&[], 0.745), 0.0);
    }

    #[test]
    fn headings_count_at_the_beginning_and_at_the_end() {
        let ahead = Drive::new(Twist::new(1.0, 0.0));
        let goal = Point2::new(5.0, 0.0);
        assert_eq!(ahead.heading_cost(&goal, &goal), 0.0);
        let aside = ahead.heading_cost(&Point2::new(0.1, 1.0), &goal);
        assert!((aside - SHORT_TERM * 0.5 * PI).abs() < 1e-9, "{aside}");
        let turns = Drive::new(Twist::new(0.0, 0.5));
        assert!((turns.heading_cost(&goal, &goal) - (0.4 * 0.05 + 0.6)).abs() < 1e-9);
    }
}
