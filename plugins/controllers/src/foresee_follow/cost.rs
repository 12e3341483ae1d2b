//! Cost of a path, step by step.

use nalgebra::{Isometry2, Point2};

use super::config::Config;
use super::law::Goal;
use super::scenery::{Expected, STEPS, Scenery};

/// Radius of a person, m.
const PERSON_M: f64 = 0.25;
/// Distance from the line of sight within which another person hides the followed one, m; and a thing.
const SIGHT_M: f64 = 0.35;
const SIGHT_OF_THING_M: f64 = 0.12;
/// Distance from the wanted place beyond which it is no worse, m.
const FARTHEST_M: f64 = 6.0;
/// Part of the distance from the person at which it becomes tight.
const LEAST_PART: f64 = 0.6;
/// Bearing up to which a camera sees the person, rad.
pub(super) const VIEW_RAD: f64 = 0.5;
/// Cost of a radian beyond it.
const OUT_OF_VIEW: f64 = 0.5;
/// Time up to which the forecast of the place of another person is one of a body, s.
const BODY_S: f64 = 1.5;
/// Weight of a tight place at the end of the plan: the law may have changed by then.
const LAST_WEIGHT: f64 = 0.25;
/// Room that it wants however near a thing is, m.
const LEAST_ROOM_M: f64 = 0.05;
/// Every so many steps the line of sight is looked along.
const SIGHT_EVERY: usize = 5;

/// Sum of the costs up to a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Tally {
    sum: f64,
    tight: f64,
    /// Room that the robot wants around itself, m.
    wanted_m: f64,
}

impl Tally {
    /// Creates the tally of a way that begins with a change of this cost, for a robot that wants so much
    /// room, m.
    pub(super) fn new(change: f64, wanted_m: f64) -> Self {
        Self { sum: change, tight: 0.0, wanted_m }
    }

    /// Returns the cost so far; it never falls.
    pub(super) fn cost(&self, config: &Config) -> f64 {
        self.sum + config.room_weight * self.tight
    }

    /// Adds the pose at the end of a step, at which the robot drives at a speed.
    pub(super) fn add(
        &mut self,
        config: &Config,
        scenery: &Scenery,
        goal: Goal,
        step: usize,
        (pose, speed_mps): (&Isometry2<f64>, f64),
    ) {
        let at = Point2::from(pose.translation.vector);
        let person = &scenery.person[step + 1];
        self.sum += off_goal(config, scenery, goal, pose, person) / STEPS as f64;
        let nearness: f64 = scenery.others.iter().map(|other| other[step].nearness(&at)).sum();
        self.sum += config.people_weight * nearness * scenery.step_s;
        let seconds = (step + 1) as f64 * scenery.step_s;
        // A robot that stands comes nearer to nothing.
        if speed_mps > 0.0 {
            let room_m = room_m(config, scenery, step, seconds, &at, person);
            // Bounded, so that all ways through a tight place stay comparable.
            let tight = (1.0 - room_m / self.wanted_m).clamp(0.0, 2.0);
            self.tight = self.tight.max(weight(seconds, scenery) * tight * tight);
        }
        if (step + 1).is_multiple_of(SIGHT_EVERY) {
            let looks = (STEPS / SIGHT_EVERY) as f64;
            self.sum += config.sight_weight * hidden(scenery, step, &at, person) / looks;
        }
    }
}

/// Returns the room that a robot wants, m: no more than it has at the beginning, so that one that is near
/// a thing already may leave.
pub(super) fn wanted_m(config: &Config, scenery: &Scenery) -> f64 {
    let has_m = nearest_m(scenery, &Point2::origin()) - config.radius_m;
    has_m.clamp(LEAST_ROOM_M, LEAST_ROOM_M.max(config.room_m))
}

/// Returns the distance of the nearest thing, m.
fn nearest_m(scenery: &Scenery, from: &Point2<f64>) -> f64 {
    let mut nearest = f64::INFINITY;
    for thing in &scenery.things {
        nearest = nearest.min((thing - from).norm_squared());
    }
    nearest.sqrt()
}

/// Returns the weight of a tight place after some seconds.
fn weight(seconds: f64, scenery: &Scenery) -> f64 {
    let rest_s = STEPS as f64 * scenery.step_s - BODY_S;
    if seconds <= BODY_S || rest_s <= 0.0 {
        return 1.0;
    }
    1.0 - (1.0 - LAST_WEIGHT) * ((seconds - BODY_S) / rest_s).min(1.0)
}

/// Returns how far the robot is from where it should be, m, and how far the person is out of view.
fn off_goal(
    config: &Config,
    scenery: &Scenery,
    goal: Goal,
    pose: &Isometry2<f64>,
    person: &Expected,
) -> f64 {
    if let Some(place) = goal.place(config, scenery, person) {
        return (place.coords - pose.translation.vector).norm().min(FARTHEST_M);
    }
    let seen = pose.inverse_transform_point(&person.at);
    let off_m = (seen.coords.norm() - config.stand_off_m).abs().min(FARTHEST_M);
    let beyond = (seen.y.atan2(seen.x).abs() - VIEW_RAD).max(0.0);
    off_m + OUT_OF_VIEW * beyond
}

/// Returns the room around the robot at a step, m: to things, to the person, and to others as long as
/// their places are known well enough.
fn room_m(
    config: &Config,
    scenery: &Scenery,
    step: usize,
    seconds: f64,
    at: &Point2<f64>,
    person: &Expected,
) -> f64 {
    let range_m = (person.at - at).norm();
    let mut room_m = nearest_m(scenery, at).min(range_m - PERSON_M);
    if seconds <= BODY_S {
        for other in &scenery.others {
            room_m = room_m.min((other[step].place() - at).norm() - PERSON_M);
        }
    }
    // The followed person wants more room than anything else: the robot is to keep a distance.
    let spare_m = range_m - LEAST_PART * config.stand_off_m + config.room_m;
    (room_m - config.radius_m).min(spare_m)
}

/// Returns the degree to which something is before the person, 0 to 1.
fn hidden(scenery: &Scenery, step: usize, from: &Point2<f64>, person: &Expected) -> f64 {
    let mut most = 0.0_f64;
    for other in &scenery.others {
        most = most.max(hidden_by(&other[step].place(), SIGHT_M, from, person));
    }
    for thing in &scenery.things {
        most = most.max(hidden_by(thing, SIGHT_OF_THING_M, from, person));
    }
    most
}

/// Returns the degree to which something at a place, of this half width, m, is before the person.
fn hidden_by(place: &Point2<f64>, half_width_m: f64, from: &Point2<f64>, person: &Expected) -> f64 {
    let way = person.at - from;
    let Some(sight) = way.try_normalize(1e-6) else { return 0.0 };
    let along = (place - from).dot(&sight);
    // Things behind the person, or behind the robot, hide nothing.
    if along <= 0.0 || along >= way.norm() - PERSON_M {
        return 0.0;
    }
    (1.0 - (place - from).perp(&sight).abs() / half_width_m).max(0.0)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, Vector2};

    use super::*;
    use crate::{Forecast, ForecastSettings};

    const STEP: usize = 4;

    /// A standing person 3 m ahead.
    fn scenery() -> Scenery {
        let mut scenery = Scenery::new(4.0);
        scenery.set_person(&stands(3.0, 0.0));
        scenery
    }

    fn stands(x: f64, y: f64) -> Forecast {
        let still = ForecastSettings { damping_per_s: 0.0, unrest: 0.0, ..Default::default() };
        let settings = ForecastSettings { unrest_by_speed: 0.0, ..still };
        Forecast::new(&settings, Point2::new(x, y), Vector2::zeros(), Matrix4::zeros()).unwrap()
    }

    fn added(scenery: &Scenery, goal: Goal, pose: [f64; 3], speed_mps: f64) -> f64 {
        let config = Config::default();
        let pose = Isometry2::new(Vector2::new(pose[0], pose[1]), pose[2]);
        let mut tally = Tally::new(0.0, config.room_m);
        tally.add(&config, scenery, goal, STEP, (&pose, speed_mps));
        tally.cost(&config)
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-9, "{found}, not {expected}");
    }

    #[test]
    fn a_metre_off_costs_one_over_the_whole_way() {
        let free = scenery();
        near(added(&free, Goal::Facing, [1.6, 0.0, 0.0], 0.5), 0.0);
        near(added(&free, Goal::Facing, [0.6, 0.0, 0.0], 0.5), 1.0 / 20.0);
        near(added(&free, Goal::Facing, [1.6, 0.0, 1.5], 0.5), 0.5 / 20.0);
        let walks = Scenery { heading: Some(Vector2::y()), ..scenery() };
        // Its place is 1.4 m to the left of the person, and the person looks to the left of the robot.
        let left = Goal::Beside(90_f64.to_radians());
        near(added(&walks, left, [1.6, 0.0, 0.3], 0.5), 0.0);
        near(added(&walks, left, [1.6, 2.0, 0.3], 0.5), 2.0 / 20.0);
        near(added(&walks, left, [-9.0, 2.0, 0.3], 0.5), 6.0 / 20.0);
    }

    #[test]
    fn room_counts_for_a_robot_that_drives() {
        let mut tight = scenery();
        tight.things.push(Point2::new(1.6, 0.35));
        near(added(&tight, Goal::Facing, [1.6, 0.0, 0.0], 0.5), 2.0 * 0.25);
        near(added(&tight, Goal::Facing, [1.6, 0.0, 0.0], 0.0), 0.0);
        tight.things.push(Point2::new(1.6, 0.0));
        near(added(&tight, Goal::Facing, [1.6, 0.0, 0.0], 0.5), 2.0 * 4.0);
        // 0.74 m from a person, where 0.84 m are wanted.
        let person = added(&scenery(), Goal::Facing, [2.26, 0.0, 0.0], 0.5);
        near(person, 0.66 / 20.0 + 2.0 * 0.25);
        near(weight(1.5, &tight), 1.0);
        near(weight(2.75, &tight), 0.625);
        near(weight(4.0, &tight), 0.25);
    }

    #[test]
    fn a_robot_near_a_thing_wants_no_more_room_than_it_has() {
        let config = Config::default();
        let mut tight = scenery();
        near(wanted_m(&config, &tight), 0.2);
        for (at_m, wanted) in [(0.6, 0.2), (0.35, 0.1), (0.2, 0.05)] {
            tight.things = vec![Point2::new(0.0, at_m)];
            near(wanted_m(&config, &tight), wanted);
        }
    }

    #[test]
    fn other_people_count_by_their_forecast_and_before_the_person() {
        let mut others = scenery();
        others.add_other(&stands(1.6, 0.9), 0.6);
        let nearness = (-0.5 * 0.81 / 0.36_f64).exp();
        let found = added(&others, Goal::Facing, [1.6, 0.0, 0.0], 0.0);
        assert!((found - 0.2 * nearness).abs() < 1e-5, "{found}");
        let mut between = scenery();
        between.add_other(&stands(2.3, 0.07), 0.6);
        let seen = hidden(&between, STEP, &Point2::new(1.6, 0.0), &between.person[5]);
        near(seen, 0.8);
        let behind = hidden(&between, STEP, &Point2::new(2.5, 0.0), &between.person[5]);
        near(behind, 0.0);
    }
}
