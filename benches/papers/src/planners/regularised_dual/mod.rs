//! `follow-bench-rda`: the regularised dual alternating direction method of Follow-Bench.
//!
//! Han et al., *RDA: An Accelerated Collision Free Motion Planner for Autonomous Navigation in Cluttered
//! Environments*, IEEE Robotics and Automation Letters 8(3), 2023. A motion of one second is planned by
//! alternating between two convex programs: the motion, with kinematics linear around the last one, for
//! given lines between the robot and the obstacles, and the lines, for each obstacle and each time on its
//! own, for the given motion. Multipliers make both agree.

mod motion;
mod program;
mod separator;

use std::f64::consts::PI;

use nalgebra::{Point2, Vector2};
use tagalong_config::Registry;
use tagalong_core::{Scene, Twist, settings};

use self::motion::{Aim, Limits, Motion, STEP_S, STEPS};
use self::separator::{Body, Face, Multiplier, Pose, Separator, Shape};
use super::obstacles::{Clusters, PERSON_M, Rectangle, readings};
use super::planner::{MOST, Planner, Situation, Steering};

/// Most alternations in a frame, and residuals at which it is over.
const ALTERNATIONS: usize = 4;
const RESIDUAL: f64 = 0.2;
/// Number of the nearest obstacles that count.
const OBSTACLES: usize = 5;
/// Time ahead at which a lost person is expected, s.
const LOST_S: f64 = 2.0;
/// Readings of the laser within this distance of a person are of that person, m.
const OF_PERSON_M: f64 = PERSON_M + 0.2;
/// Length of a direction, at most 1, of a line that separates.
const SEPARATES: f64 = 0.5;
/// Distance at which an obstacle has no influence: no larger distance is kept, m.
const KEPT_M: f64 = 1.0;

settings! {
    /// Settings of the controller `follow-bench-rda`.
    pub struct Config {
        /// Distance kept from the centre of the person, m.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub distance_m: f64 = 1.5,
        /// Length of the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub length_m: f64 = 0.7,
        /// Width of the robot, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub width_m: f64 = 0.55,
        /// Wished speed in largest speeds; one that cannot be reached draws the robot forward.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub wished_speed: f64 = 2.0,
        /// Largest acceleration, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_acceleration: f64 = 2.0,
        /// Largest angular acceleration, rad/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_angular_acceleration: f64 = PI,
        /// Largest turn rate, rad/s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_turn_rate: f64 = PI,
        /// True if other people are expected to walk on over the horizon.
        pub people_walk: bool = true,
        /// Distance within which two readings of the laser are of one thing, m.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub neighbour_m: f64 = 0.5,
        /// Least number of neighbours of a reading within a thing.
        #[schemars(range(min = 1))]
        pub neighbours: usize = 3,
    }
}

/// The last plan, and the multipliers of the obstacles, the nearest first.
#[derive(Debug)]
pub(super) struct Memory {
    speeds: [[f64; 2]; STEPS],
    distances_m: [f64; STEPS],
    multipliers: [[Multiplier; STEPS]; OBSTACLES],
}

impl Default for Memory {
    fn default() -> Self {
        Self {
            speeds: [[0.0; 2]; STEPS],
            distances_m: [KEPT_M; STEPS],
            multipliers: [[Multiplier::default(); STEPS]; OBSTACLES],
        }
    }
}

/// Lines between the robot and all obstacles at each step, which a motion and they are to agree on.
struct Lines<'a> {
    body: &'a Body,
    shapes: Vec<[Shape; STEPS]>,
    /// Those of each obstacle.
    separators: Vec<Vec<Separator>>,
    multipliers: &'a mut [[Multiplier; STEPS]; OBSTACLES],
}

/// An obstacle and its velocity over ground, m/s.
#[derive(Clone, Debug)]
struct Obstacle {
    shape: Shape,
    velocity: Vector2<f64>,
    /// Distance from the centre of the robot, m.
    away_m: f64,
}

impl Steering for Config {
    type Memory = Memory;

    fn steer(&self, now: &Situation<'_>, memory: &mut Memory) -> Twist {
        let limits = self.limits(now);
        let reach_m = now.max_mps * STEP_S * STEPS as f64;
        let goal = now.quarry.goal(0.0, LOST_S, self.distance_m);
        let aim = Aim {
            goal: goal.coords.cap_magnitude(reach_m).into(),
            heading: now.quarry.bearing(0.0, LOST_S),
            speed_mps: self.wished_speed * now.max_mps,
        };
        let obstacles = self.obstacles(now, reach_m);
        let body = Body::new(self.length_m, self.width_m);
        let speeds = memory.plan(&aim, &limits, &body, &obstacles).speeds[0];
        let kept = [0, 1].map(|which| {
            let [least, most] = limits.first[which];
            speeds[which].clamp(least, most)
        });
        Twist::new(kept[0], kept[1])
    }

    fn stand_off_m(&self) -> f64 {
        self.distance_m
    }
}

impl Config {
    fn limits(&self, now: &Situation<'_>) -> Limits {
        let most = [now.max_mps, self.max_turn_rate.min(now.max_rps)];
        let accelerations = [self.max_acceleration, self.max_angular_acceleration];
        let last = [now.last.linear_mps, now.last.angular_rps];
        let first = [0, 1].map(|which| {
            let change = accelerations[which] * now.dt_s;
            [last[which] - change, last[which] + change]
                .map(|speed| speed.clamp(-most[which], most[which]))
        });
        Limits { most, first, change: accelerations.map(|most| most * STEP_S) }
    }

    /// Returns the nearest obstacles, the nearest first, of those that the robot could come near.
    fn obstacles(&self, now: &Situation<'_>, reach_m: f64) -> Vec<Obstacle> {
        let people = self.people(now.scene);
        let mut readings = readings(now.scene, &now.quarry.place);
        readings.retain(|at| people.iter().all(|person| !person.has_at(at)));
        let clusters = Clusters { neighbour_m: self.neighbour_m, least: self.neighbours };
        let mut obstacles = people;
        obstacles.extend(clusters.rectangles(&readings).iter().map(Obstacle::thing));
        let half_m = 0.5 * self.length_m.hypot(self.width_m);
        obstacles.retain(|one| {
            let walked_m = one.velocity.norm() * STEP_S * STEPS as f64;
            one.away_m <= half_m + KEPT_M + reach_m + walked_m
        });
        obstacles.sort_by(|a, b| a.away_m.total_cmp(&b.away_m));
        obstacles.truncate(OBSTACLES);
        obstacles
    }

    fn people(&self, scene: &Scene<'_>) -> Vec<Obstacle> {
        let target = scene.target.map(|track| track.id);
        let mut people = Vec::new();
        for track in scene.tracks.iter().filter(|track| Some(track.id) != target) {
            let person = &track.estimate.person;
            let centre = person.position.xy();
            let velocity = if self.people_walk { person.velocity } else { Vector2::zeros() };
            if centre.iter().chain(velocity.iter()).all(|value| value.abs() < MOST) {
                let away_m = centre.coords.norm() - PERSON_M;
                let shape = Shape::Circle { centre, radius_m: PERSON_M };
                people.push(Obstacle { shape, velocity, away_m });
            }
        }
        people
    }
}

impl Obstacle {
    fn thing(rectangle: &Rectangle) -> Self {
        let Rectangle { centre, along, half_m } = rectangle;
        let across = Vector2::new(-along.y, along.x);
        let mut faces = Vec::new();
        let mut outside_m = Vector2::zeros();
        for (axis, normal) in [*along, across].into_iter().enumerate() {
            let at_m = normal.dot(&centre.coords);
            faces.push(Face { normal, offset_m: at_m + half_m[axis] });
            faces.push(Face { normal: -normal, offset_m: half_m[axis] - at_m });
            outside_m[axis] = (at_m.abs() - half_m[axis]).max(0.0);
        }
        let away_m = outside_m.norm();
        Self { shape: Shape::Polygon(faces), velocity: Vector2::zeros(), away_m }
    }

    /// Returns true for a reading that is of this person.
    fn has_at(&self, reading: &Point2<f64>) -> bool {
        match self.shape {
            Shape::Circle { centre, .. } => nalgebra::distance(&centre, reading) <= OF_PERSON_M,
            Shape::Polygon(_) => false,
        }
    }

    /// Returns the shape at the end of each step.
    fn over_time(&self) -> [Shape; STEPS] {
        std::array::from_fn(|step| self.shape.moved(&(self.velocity * STEP_S * (step + 1) as f64)))
    }
}

impl Memory {
    /// Returns a motion from the origin on, and keeps it.
    fn plan(&mut self, aim: &Aim, limits: &Limits, body: &Body, obstacles: &[Obstacle]) -> Motion {
        let mut motion = Motion::driven(self.speeds, self.distances_m);
        let mut lines = Lines {
            body,
            shapes: obstacles.iter().map(Obstacle::over_time).collect(),
            separators: Vec::new(),
            multipliers: &mut self.multipliers,
        };
        // Without a solution the motion stays as far as it has come.
        lines.improve(&mut motion, aim, limits);
        self.speeds = motion.speeds;
        self.distances_m = motion.distances_m;
        motion
    }
}

impl Lines<'_> {
    /// Improves a motion until it agrees with the lines.
    fn improve(&mut self, motion: &mut Motion, aim: &Aim, limits: &Limits) -> Option<()> {
        self.renew(motion)?;
        for _ in 0..ALTERNATIONS {
            *motion = motion.improved(aim, limits, &self.separators, self.multipliers)?;
            let change = self.renew(motion)?;
            let disagreement = self.agree(motion);
            if change < RESIDUAL && disagreement < RESIDUAL {
                break;
            }
        }
        Some(())
    }

    /// Finds the lines for a motion. Returns the mean of the squared changes over obstacles.
    fn renew(&mut self, motion: &Motion) -> Option<f64> {
        let mut renewed = Vec::new();
        for (shapes, multipliers) in self.shapes.iter().zip(&*self.multipliers) {
            let mut own = Vec::new();
            for (step, shape) in shapes.iter().enumerate() {
                own.push(self.line(shape, motion, step, &multipliers[step])?);
            }
            renewed.push(own);
        }
        let pairs = self.separators.iter().flatten().zip(renewed.iter().flatten());
        let change = pairs.map(|(before, now)| now.change(before)).sum::<f64>();
        self.separators = renewed;
        Some(change / self.shapes.len().max(1) as f64)
    }

    /// Returns the line to an obstacle at a step. Nothing separates bodies that overlap: then it is the
    /// line to the robot where it is now.
    fn line(
        &self,
        shape: &Shape,
        motion: &Motion,
        step: usize,
        multiplier: &Multiplier,
    ) -> Option<Separator> {
        let distance_m = motion.distances_m[step];
        let pose = &motion.poses[step];
        let line = Separator::between(shape, self.body, pose, distance_m, multiplier)?;
        if line.normal.norm() >= SEPARATES {
            return Some(line);
        }
        Separator::between(shape, self.body, &Pose::default(), distance_m, multiplier)
    }

    /// Adds to the multipliers what motion and lines disagree in, and returns the length of all of it.
    fn agree(&mut self, motion: &Motion) -> f64 {
        let mut squares = 0.0;
        for (own, multipliers) in self.separators.iter().zip(&mut *self.multipliers) {
            for (step, separator) in own.iter().enumerate() {
                let pose = &motion.poses[step];
                let spare_m = separator.gap_m(&pose.place) - motion.distances_m[step];
                let mismatch = separator.mismatch(pose.heading);
                let multiplier = &mut multipliers[step];
                // A robot that is held near a person would add to it without end.
                multiplier.gap = (multiplier.gap + spare_m).clamp(-KEPT_M, 0.0);
                multiplier.mismatch += mismatch;
                squares += mismatch.norm_squared() + spare_m.min(0.0).powi(2);
            }
        }
        squares.sqrt()
    }
}

/// Registers the planner.
pub(super) fn register(registry: &mut Registry) {
    registry.controller(
        "follow-bench-rda",
        "follows by the regularised dual alternating direction method of Follow-Bench",
        |config: Config, _| Planner::new(config),
    );
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation2;

    use super::*;

    const MOST: [f64; 2] = [0.9, PI];

    /// Limits of the next step after these speeds.
    fn limits(last: [f64; 2]) -> Limits {
        let change = [2.0, PI].map(|most| most * STEP_S);
        let first = [0, 1].map(|which| {
            [last[which] - change[which], last[which] + change[which]]
                .map(|speed| speed.clamp(-MOST[which], MOST[which]))
        });
        Limits { most: MOST, first, change }
    }

    fn person(x: f64, y: f64) -> Obstacle {
        let centre = Point2::new(x, y);
        let shape = Shape::Circle { centre, radius_m: PERSON_M };
        Obstacle { shape, velocity: Vector2::zeros(), away_m: centre.coords.norm() - PERSON_M }
    }

    /// The poses, in the axes of the first, of a robot that drives as planned for some steps to a goal
    /// and around people at rest.
    fn drive(goal: Point2<f64>, people: &[[f64; 2]], steps: usize) -> Vec<Pose> {
        let body = Body::new(0.7, 0.55);
        let mut memory = Memory::default();
        let mut pose = Pose::default();
        let mut last = [0.0; 2];
        let mut way = vec![pose];
        for _ in 0..steps {
            let to_robot = Rotation2::new(-pose.heading);
            let goal = Point2::from(to_robot * (goal.coords - pose.place));
            let obstacles: Vec<Obstacle> = people
                .iter()
                .map(|at| to_robot * (Vector2::from(*at) - pose.place))
                .map(|at| person(at.x, at.y))
                .collect();
            let heading = if goal.coords.norm() > 0.2 { goal.y.atan2(goal.x) } else { 0.0 };
            let within = goal.coords.cap_magnitude(0.9);
            let aim = Aim { goal: within.into(), heading, speed_mps: 0.0 };
            last = memory.plan(&aim, &limits(last), &body, &obstacles).speeds[0];
            let moved = Rotation2::new(pose.heading) * Vector2::x() * last[0] * STEP_S;
            pose = Pose { place: pose.place + moved, heading: pose.heading + last[1] * STEP_S };
            way.push(pose);
        }
        way
    }

    /// The distance of the robot from a person, m.
    fn gap_m(pose: &Pose, person: [f64; 2]) -> f64 {
        let at = Rotation2::new(-pose.heading) * (Vector2::from(person) - pose.place);
        let outside = Vector2::new((at.x.abs() - 0.35).max(0.0), (at.y.abs() - 0.275).max(0.0));
        outside.norm() - PERSON_M
    }

    #[test]
    fn with_nothing_on_the_way_the_robot_ends_at_the_goal() {
        for goal in [Point2::new(3.0, 0.0), Point2::new(2.0, 1.5)] {
            let way = drive(goal, &[], 80);
            let end = way[80].place;
            assert!((end - goal.coords).norm() < 0.1, "{goal}: {end}");
            // A straight way is no longer than it has to be.
            let driven: f64 = way.windows(2).map(|two| (two[1].place - two[0].place).norm()).sum();
            assert!(driven < 1.15 * goal.coords.norm(), "{driven}");
        }
    }

    /// The least distance, 0.1 m, less the centimetres that an alternation may be short of.
    const KEPT_NEARLY_M: f64 = 0.04;

    #[test]
    fn a_person_on_the_way_is_passed_at_the_least_distance_or_more() {
        let person = [2.0, 0.45];
        let way = drive(Point2::new(4.5, 0.0), &[person], 150);
        let least_m = way.iter().map(|pose| gap_m(pose, person)).fold(f64::INFINITY, f64::min);
        assert!(least_m > KEPT_NEARLY_M, "{least_m}");
        let end = way[150].place;
        assert!((end - Vector2::new(4.5, 0.0)).norm() < 0.2, "{end}");
    }

    #[test]
    fn before_a_person_straight_ahead_the_robot_stops_at_the_least_distance() {
        let way = drive(Point2::new(2.0, 0.0), &[[2.0, 0.0]], 80);
        let least_m = way.iter().map(|pose| gap_m(pose, [2.0, 0.0])).fold(f64::INFINITY, f64::min);
        assert!(least_m > KEPT_NEARLY_M, "{least_m}");
        let end_m = gap_m(&way[80], [2.0, 0.0]);
        assert!((end_m - 0.1).abs() < 0.01, "{end_m}");
    }

    #[test]
    fn multipliers_sum_up_what_motion_and_lines_disagree_in() {
        let body = Body::new(0.7, 0.55);
        let mut multipliers = Memory::default().multipliers;
        let shapes =
            [person(1.0, 0.4), person(-3.0, 0.0)].iter().map(Obstacle::over_time).collect();
        let mut lines =
            Lines { body: &body, shapes, separators: Vec::new(), multipliers: &mut multipliers };
        let motion = Motion::driven([[0.1, 0.2]; STEPS], [KEPT_M; STEPS]);
        lines.renew(&motion).expect("lines");
        let [near, far] = [0, 1].map(|one| lines.separators[one][STEPS - 1].clone());
        let end = motion.poses[STEPS - 1];
        let all = [0, 1].map(|_| lines.agree(&motion));
        assert!(all[0] > 0.0 && (all[1] - all[0]).abs() < 1e-12, "{all:?}");
        let spare_m = near.gap_m(&end.place) - KEPT_M;
        assert!(spare_m < -0.2, "{spare_m}");
        let summed = multipliers[0][STEPS - 1];
        assert!((summed.gap - (2.0 * spare_m).max(-KEPT_M)).abs() < 1e-12, "{summed:?}");
        assert!((summed.mismatch - 2.0 * near.mismatch(end.heading)).norm() < 1e-12, "{summed:?}");
        assert!(far.gap_m(&end.place) > KEPT_M && multipliers[1][STEPS - 1].gap == 0.0);
    }

    #[test]
    fn a_plan_through_a_person_is_given_up() {
        let mut memory = Memory { speeds: [[0.9, 0.0]; STEPS], ..Memory::default() };
        let aim = Aim { goal: Point2::new(0.9, 0.0), heading: 0.0, speed_mps: 1.8 };
        let body = Body::new(0.7, 0.55);
        let motion = memory.plan(&aim, &limits([0.9, 0.0]), &body, &[person(1.3, 0.0)]);
        let least_m = motion.poses.iter().map(|pose| gap_m(pose, [1.3, 0.0]));
        let least_m = least_m.fold(f64::INFINITY, f64::min);
        assert!(least_m > 0.0, "{motion:?}");
    }

    #[test]
    fn a_robot_that_was_held_near_a_person_drives_on_soon_after_they_left() {
        let mut memory = Memory::default();
        let aim = Aim { goal: Point2::new(0.9, 0.0), heading: 0.0, speed_mps: 1.8 };
        let body = Body::new(0.7, 0.55);
        for _ in 0..150 {
            memory.plan(&aim, &limits([0.0; 2]), &body, &[person(0.68, 0.0)]);
        }
        let mut last = [0.0; 2];
        for _ in 0..5 {
            last = memory.plan(&aim, &limits(last), &body, &[person(1.4, 0.0)]).speeds[0];
        }
        assert!(last[0] > 0.5, "{last:?}");
    }

    #[test]
    fn speeds_and_their_changes_stay_within_the_limits() {
        let body = Body::new(0.7, 0.55);
        let last = [0.5, -1.0];
        for (x, y) in [(5.0, 0.0), (-5.0, 1.0), (0.3, 4.0)] {
            let aim = Aim { goal: Point2::new(x, y), heading: y.atan2(x), speed_mps: 4.0 };
            let obstacles = [person(1.2, 0.1), person(0.0, -1.3)];
            let motion = Memory::default().plan(&aim, &limits(last), &body, &obstacles);
            let mut before = last;
            for speeds in motion.speeds {
                for which in 0..2 {
                    let change = [0.2, PI * STEP_S][which];
                    assert!(speeds[which].abs() <= MOST[which] + 1e-6, "{motion:?}");
                    assert!((speeds[which] - before[which]).abs() <= change + 1e-6, "{motion:?}");
                }
                before = speeds;
            }
            for distance_m in motion.distances_m {
                assert!((0.1 - 1e-6..=1.0 + 1e-6).contains(&distance_m), "{motion:?}");
            }
        }
    }

    #[test]
    fn a_person_who_walks_into_the_way_is_avoided_before_they_are_there() {
        let body = Body::new(0.7, 0.55);
        let aim = Aim { goal: Point2::new(0.9, 0.0), heading: 0.0, speed_mps: 0.0 };
        let fast = limits([0.9, 0.0]);
        let mut stands = person(1.5, -1.4);
        stands.velocity = Vector2::zeros();
        let mut walks = stands.clone();
        walks.velocity = Vector2::new(0.0, 1.5);
        let [free, crossed] =
            [stands, walks].map(|one| Memory::default().plan(&aim, &fast, &body, &[one]).poses);
        let ends = [free, crossed].map(|poses| poses[STEPS - 1].place.x);
        assert!(ends[1] < ends[0] - 0.1, "{ends:?}");
    }

    #[test]
    fn the_same_scene_gives_the_same_bytes() {
        let ways = [(); 2].map(|()| drive(Point2::new(3.0, 0.5), &[[1.5, 0.2], [2.5, -0.8]], 20));
        let bytes = ways.map(|way| {
            let values = way.iter().flat_map(|pose| [pose.place.x, pose.place.y, pose.heading]);
            values.flat_map(f64::to_le_bytes).collect::<Vec<u8>>()
        });
        assert_eq!(bytes[0], bytes[1]);
    }

    #[test]
    fn a_thing_is_as_far_away_as_its_nearest_side() {
        let along = Vector2::new(0.0, 1.0);
        let wall = Rectangle { centre: Point2::new(2.0, 1.0), along, half_m: [3.0, 0.0] };
        assert!((Obstacle::thing(&wall).away_m - 2.0).abs() < 1e-12);
        let post = Rectangle { centre: Point2::new(3.5, 4.5), along, half_m: [0.5, 0.5] };
        assert!((Obstacle::thing(&post).away_m - 5.0).abs() < 1e-12);
    }
}
