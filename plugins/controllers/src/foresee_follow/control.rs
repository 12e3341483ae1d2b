use nalgebra::{Point2, Vector2};
use tagalong_core::{Controller, EgoMotion, Input, Inputs, Scene, Twist, WheelSpeeds};

use super::config::{Config, MOST};
use super::cost::VIEW_RAD;
use super::plan::{Drive, Planner};
use super::scenery::Scenery;
use crate::around::{Look, NearestObstacles};
use crate::{CommandHistory, Forecast, coasting_weight, step_s};

/// Distance within which points belong to a person, m.
const PERSON_M: f64 = 0.45;
/// Speed from which on a person walks, and has a direction, m/s.
const WALKS_MPS: f64 = 0.3;
/// Time in which the direction of a walking person follows the velocity, s.
const HEADING_S: f64 = 0.5;
/// Speed above the measured one that the wheels may have reached meanwhile, m/s.
const AHEAD_MPS: f64 = 0.1;

/// Goes with a person by a plan among forecasts.
#[derive(Clone, Debug)]
pub struct ForeseeFollow {
    config: Config,
    around: NearestObstacles,
    scenery: Scenery,
    planner: Planner,
    /// Direction in which the person walks or last walked, in the axes of the robot; `None` for a
    /// person before the first step.
    heading: Option<Vector2<f64>>,
    /// The forward speed of the last command, m/s.
    speed_mps: f64,
    history: CommandHistory,
}

impl Controller for ForeseeFollow {
    fn inputs(&self) -> Inputs {
        Inputs::NONE.accept(Input::Depth).accept(Input::Laser)
    }

    fn command(&mut self, scene: &Scene<'_>) -> Twist {
        let dt = step_s(&scene.frame.motion);
        self.history.age(dt);
        self.look(scene);
        self.turn_heading(scene, dt);
        let twist = self.steer(scene, dt);
        // A drive with impossible dimensions has no wheel speeds, not even at rest.
        self.history.add(twist.map_or(WheelSpeeds::STOP, |twist| {
            scene.wheels.wheels_within(twist, scene.max_speed_mps)
        }));
        self.speed_mps = twist.map_or(0.0, |twist| twist.linear_mps);
        if twist.is_none() {
            self.planner.clear();
        }
        twist.unwrap_or(Twist::STOP)
    }

    fn stand_off_m(&self) -> Option<f64> {
        Some(self.config.stand_off_m)
    }

    fn leaves_view(&self) -> bool {
        // Behind a person that walks away the angle is 180 degrees.
        let angle = self.config.angle_rad();
        angle.is_some_and(|angle| std::f64::consts::PI - angle.abs() > VIEW_RAD)
    }
}

impl ForeseeFollow {
    /// A controller of a robot at rest.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] if a number cannot work.
    pub fn new(config: Config) -> tagalong_core::Result<Self> {
        config.check()?;
        Ok(Self {
            around: NearestObstacles::new(),
            scenery: Scenery::new(config.horizon_s),
            planner: Planner::new(&config),
            heading: None,
            speed_mps: 0.0,
            history: CommandHistory::new(config.latency_s),
            config,
        })
    }

    /// Updates the obstacles; people are kept apart from them, because they walk.
    fn look(&mut self, scene: &Scene<'_>) {
        self.around.move_along(&scene.frame.motion, self.config.memory_s);
        let mut look = Look::new();
        if let Ok(depth) = scene.frame.depth() {
            let heights = self.config.heights_m;
            look.add_depth(&scene.frame.camera, depth, heights, |at| is_thing(scene, at));
        }
        for scan in scene.frame.scans() {
            look.add_scan(scan, |at| is_thing(scene, at));
        }
        self.around.add_look(&look);
    }

    /// Follows the direction in which the person walks; one who stands keeps it.
    fn turn_heading(&mut self, scene: &Scene<'_>, dt: f64) {
        let heading = self.heading.map(|heading| scene.frame.motion.apply_to_velocity(heading));
        // Odometry that is no number would stay in it for ever.
        self.heading = heading.filter(|heading| heading.iter().all(|part| part.is_finite()));
        let Some(target) = scene.target else {
            self.heading = None;
            return;
        };
        let velocity = target.estimate.person.velocity;
        let speed = velocity.norm();
        if !(WALKS_MPS..MOST).contains(&speed) {
            return;
        }
        let now = velocity / speed;
        let part = (dt / HEADING_S).min(1.0);
        let mixed = self.heading.map_or(now, |before| before + (now - before) * part);
        // Of opposite directions nothing is left: the new one counts.
        self.heading = Some(mixed.try_normalize(1e-3).unwrap_or(now));
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
        let person = Forecast::of_track(&self.config.forecast, target)?.after(&to_come);
        self.scenery.clear();
        self.scenery.set_person(&person);
        self.scenery.heading = self.heading.map(|heading| to_come.apply_to_velocity(heading));
        for other in scene.tracks.iter().filter(|track| track.id != target.id) {
            if let Some(forecast) = Forecast::of_track(&self.config.forecast, other) {
                self.scenery.add_other(&forecast.after(&to_come), self.config.people_m);
            }
        }
        let things = self.around.places().map(|at| to_come.apply_to_point(at));
        self.scenery.things.extend(things);
        let drive = Drive {
            max_mps,
            half_separation_m: wheels.half_separation_m,
            speed_mps: self.speed_by_odometry(&scene.frame.motion),
            trust: coasting_weight(target.unseen_s, self.config.max_unseen_s),
        };
        let planned = self.planner.plan(&self.config, &self.scenery, &drive);
        Some(self.ramped(planned, dt))
    }

    /// Returns the speed that the last command can have led to, m/s: a robot that was stopped on the way
    /// begins anew.
    fn speed_by_odometry(&self, motion: &EgoMotion) -> f64 {
        let measured = if motion.dt > 0.0 { motion.forward.max(0.0) / motion.dt } else { 0.0 };
        let reached = measured + self.config.max_acceleration * self.config.latency_s + AHEAD_MPS;
        if reached < self.speed_mps { reached } else { self.speed_mps }
    }

    /// On the way from the last speed to the planned one.
    fn ramped(&self, planned: Twist, dt: f64) -> Twist {
        let least = self.speed_mps - self.config.max_deceleration * dt;
        let most = self.speed_mps + self.config.max_acceleration * dt;
        Twist::new(planned.linear_mps.clamp(least, most).max(0.0), planned.angular_rps)
    }
}

/// Returns true for a place that belongs to no person.
fn is_thing(scene: &Scene<'_>, at: &Point2<f64>) -> bool {
    let mut people = scene.tracks.iter().chain(scene.target);
    people.all(|track| nalgebra::distance(&track.estimate.person.position.xy(), at) > PERSON_M)
}
