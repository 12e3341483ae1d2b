use crate::around::{Look, NearestObstacles};
use crate::{CommandHistory, coasting_weight, step_s};
use nalgebra::{Point2, Vector2};
use tagalong_core::{Controller, EgoMotion, Input, Inputs, Scene, Track, Twist, WheelSpeeds};

use crate::clear_follow::config::{Config, MOST};
use crate::clear_follow::plan::{PlanningInput, Walker, plan};

/// Distance within which points belong to a person, m.
const PERSON_M: f64 = 0.45;
/// The person is never nearer than this to the law that turns, m.
const LEAST_RANGE_M: f64 = 0.5;

/// Follows a person and keeps clear of everything else.
#[derive(Clone, Debug)]
pub struct ClearFollow {
    config: Config,
    around: NearestObstacles,
    /// The forward speed of the last command, m/s.
    speed_mps: f64,
    history: CommandHistory,
}

impl Controller for ClearFollow {
    fn inputs(&self) -> Inputs {
        Inputs::NONE.accept(Input::Depth).accept(Input::Laser)
    }

    fn command(&mut self, scene: &Scene<'_>) -> Twist {
        let dt = step_s(&scene.frame.motion);
        self.history.age(dt);
        self.look(scene);
        let twist = self.steer(scene, dt);
        // A drive with impossible dimensions has no wheel speeds, not even at rest.
        self.history.add(twist.map_or(WheelSpeeds::STOP, |twist| {
            scene.wheels.wheels_within(twist, scene.max_speed_mps)
        }));
        twist.unwrap_or_else(|| {
            self.speed_mps = 0.0;
            Twist::STOP
        })
    }

    fn stand_off_m(&self) -> Option<f64> {
        Some(self.config.stand_off_m)
    }
}

impl ClearFollow {
    /// A controller of a robot at rest.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] if a number cannot work.
    pub fn new(config: Config) -> tagalong_core::Result<Self> {
        config.check()?;
        let history = CommandHistory::new(config.latency_s);
        Ok(Self { config, around: NearestObstacles::new(), speed_mps: 0.0, history })
    }

    /// Updates the obstacles; people are kept apart from them, because they walk.
    fn look(&mut self, scene: &Scene<'_>) {
        let people: Vec<Point2<f64>> = scene
            .tracks
            .iter()
            .chain(scene.target)
            .map(|t| t.estimate.person.position.xy())
            .collect();
        self.around.move_along(&scene.frame.motion, self.config.memory_s);
        let mut look = Look::new();
        if let Ok(depth) = scene.frame.depth() {
            look.add_depth(&scene.frame.camera, depth, self.config.heights_m, |at| {
                is_thing(at, &people)
            });
        }
        for scan in scene.frame.scans() {
            look.add_scan(scan, |at| is_thing(at, &people));
        }
        self.around.add_look(&look);
    }

    fn steer(&mut self, scene: &Scene<'_>, dt: f64) -> Option<Twist> {
        fn is_sensible(number: f64) -> bool {
            number > 0.0 && number <= MOST
        }

        let wheels = &scene.wheels;
        let max_mps = scene.max_speed_mps;
        if !is_sensible(wheels.half_separation_m) || !is_sensible(max_mps) {
            return None;
        }
        let target = scene.target?;
        // The command acts only after the latency, so the plan starts where the robot will be then.
        let to_come = self.history.forecast(wheels);
        let person = walker(target, &to_come)?;
        let trust = coasting_weight(target.unseen_s, self.config.max_unseen_s);
        let nominal = self.nominal(&person, trust, max_mps);
        let others = scene.tracks.iter().filter(|track| track.id != target.id);
        let others: Vec<Walker> = others.filter_map(|track| walker(track, &to_come)).collect();
        let things: Vec<_> = self.around.places().map(|at| to_come.apply_to_point(at)).collect();
        let around = PlanningInput { things: &things, others: &others, person, max_mps };
        let planned = plan(&self.config, nominal, &around);
        let twist = self.ramped(nominal, planned, dt);
        self.speed_mps = twist.linear_mps;
        Some(twist)
    }

    /// Returns the command for an empty room: to face the person, and to keep the distance.
    fn nominal(&self, person: &Walker, trust: f64, max_mps: f64) -> Twist {
        let config = &self.config;
        let range_m = person.at.coords.norm();
        let bearing = person.at.y.atan2(person.at.x);
        let towards = person.at.coords.try_normalize(1e-6).unwrap_or_else(Vector2::x);
        // A person that walks across the line of sight turns it; the least range keeps the quotient
        // finite.
        let around = towards.perp(&person.velocity) / range_m.max(LEAST_RANGE_M);
        let turn = config.bearing_gain_per_s * bearing + around;
        let turn_rate = trust * turn.clamp(-config.max_turn_rate, config.max_turn_rate);
        let recedes = person.velocity.dot(&towards).max(0.0);
        let wanted = config.range_gain_per_s * (range_m - config.stand_off_m) + recedes;
        // A robot that faces away turns first.
        let ahead = bearing.cos().max(0.0).powi(2);
        let speed_mps = (wanted.clamp(0.0, max_mps) * ahead).min(trust * max_mps);
        Twist::new(speed_mps, turn_rate)
    }

    /// On the way from the last speed to the planned one. The detour keeps its
    /// curvature meanwhile, so that it stays the detour that was planned.
    fn ramped(&self, nominal: Twist, planned: Twist, dt: f64) -> Twist {
        let least = self.speed_mps - self.config.max_deceleration * dt;
        let most = self.speed_mps + self.config.max_acceleration * dt;
        let speed_mps = planned.linear_mps.clamp(least, most).max(0.0);
        let detour = planned.angular_rps - nominal.angular_rps;
        // At a speed that is not reached yet the whole detour would turn too sharply.
        let share = if planned.linear_mps > 0.0 { speed_mps / planned.linear_mps } else { 1.0 };
        Twist::new(speed_mps, nominal.angular_rps + detour * share.min(1.0))
    }
}

/// Returns a person in the axes of the robot after its motion to come; `None` if the place is not
/// finite.
fn walker(track: &Track, to_come: &EgoMotion) -> Option<Walker> {
    let person = &track.estimate.person;
    let is_known = person.velocity.iter().all(|v| v.abs() < MOST);
    let velocity = if is_known { person.velocity } else { Vector2::zeros() };
    let at = to_come.apply_to_point(person.position.xy() + velocity * to_come.dt);
    let velocity = to_come.apply_to_velocity(velocity);
    at.iter().all(|v| v.abs() < MOST).then_some(Walker { at, velocity })
}

/// Whether a point is not on a person: people walk, and the target would stop the robot.
fn is_thing(at: &Point2<f64>, people: &[Point2<f64>]) -> bool {
    people.iter().all(|person| nalgebra::distance(person, at) > PERSON_M)
}
