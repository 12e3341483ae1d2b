use std::f64::consts::{FRAC_PI_2, TAU};

use crate::{CommandHistory, coasting_weight, step_s};
use nalgebra::Vector2;
use tagalong_core::{Controller, EgoMotion, Scene, Track, Twist, WheelSpeeds};

use crate::arc_follow::aim::Aim;
use crate::arc_follow::config::{Config, MOST, Path};
use crate::arc_follow::trail::Trail;

/// Bearing from which on the robot turns towards the person, wherever they went, rad.
const IN_VIEW_RAD: f64 = 0.4;

/// Follows a person along the paths of P1, section 3.
#[derive(Clone, Debug)]
pub struct ArcFollow {
    config: Config,
    /// The forward speed of the last command, m/s.
    speed_mps: f64,
    /// Turning on the spot: to the left (1) or to the right (-1).
    turning: Option<f64>,
    history: CommandHistory,
    trail: Trail,
}

impl Controller for ArcFollow {
    fn command(&mut self, scene: &Scene<'_>) -> Twist {
        let dt = step_s(&scene.frame.motion);
        self.history.age(dt);
        let twist = self.steer(scene, dt);
        // A drive with impossible dimensions has no wheel speeds, not even at rest.
        self.history.add(twist.map_or(WheelSpeeds::STOP, |twist| scene.wheels.wheels(twist)));
        twist.unwrap_or_else(|| self.halt())
    }

    fn stand_off_m(&self) -> Option<f64> {
        Some(self.config.stand_off_m)
    }
}

impl ArcFollow {
    /// A controller of a robot at rest.
    ///
    /// # Errors
    /// [`tagalong_core::Error::Settings`] if a number cannot work.
    pub fn new(config: Config) -> tagalong_core::Result<Self> {
        config.check()?;
        let history = CommandHistory::new(config.latency_s);
        Ok(Self { config, speed_mps: 0.0, turning: None, history, trail: Trail::default() })
    }

    fn steer(&mut self, scene: &Scene<'_>, dt: f64) -> Option<Twist> {
        let wheels = &scene.wheels;
        let max = scene.max_speed_mps;
        if !is_sensible(wheels.half_separation_m) || !is_sensible(max) {
            return None;
        }
        let target = scene.target?;
        let to_come = self.history.forecast(wheels);
        let aim = Aim::new(&target.estimate.person, &to_come)?;
        // The trail is followed only towards a person ahead and beyond the stand-off.
        let goes_after = aim.range_m > self.config.stand_off_m && aim.bearing.abs() < IN_VIEW_RAD;
        let way = self.way(scene, target, &to_come).filter(|_| goes_after);
        let trust = coasting_weight(target.unseen_s, self.config.max_unseen_s);
        self.turning = self.turn_in_place(&aim);
        let speed_mps = self.ramped(self.wanted_speed(&aim, max), dt).min(trust * max);
        let (towards, gain) = match way.filter(|_| speed_mps > 0.0) {
            Some(way) => (way, 1.0),
            None => (aim, self.config.gain()),
        };
        // The slower the robot drives, the more it may turn on the spot.
        let facing = trust * (1.0 - speed_mps / max) * self.facing_rate(&towards);
        let turn_rate = speed_mps * self.curvature(&towards, gain) + facing;
        let twist = self.within_limits(Twist::new(speed_mps, turn_rate), scene);
        self.speed_mps = twist.linear_mps;
        twist.angular_rps.is_finite().then_some(twist)
    }

    /// Where the person went, so far ahead as the setting says; `None` if the person is
    /// nearer than that, or straight ahead is the way.
    fn way(&mut self, scene: &Scene<'_>, target: &Track, to_come: &EgoMotion) -> Option<Aim> {
        if self.config.trail_m == 0.0 {
            return None;
        }
        let place = target.estimate.person.position.xy();
        self.trail.go_on(&scene.frame.motion, target.id, place);
        let next = self.trail.ahead(self.config.trail_m)?;
        Aim::at(to_come.apply_to_point(next), Vector2::zeros())
    }

    /// Stands still, and will start anew.
    fn halt(&mut self) -> Twist {
        self.turning = None;
        self.speed_mps = 0.0;
        self.trail = Trail::default();
        Twist::STOP
    }

    /// Whether to turn on the spot, and which way. It goes on the way it began,
    /// so that a target right behind the robot does not make it hesitate.
    fn turn_in_place(&self, aim: &Aim) -> Option<f64> {
        let [off, on] = self.config.turning_bounds();
        let bound = if self.turning.is_some() { off } else { on };
        // The direction of a turn is kept behind the robot, where the bearing jumps by a full turn.
        let way = self.turning.filter(|_| aim.bearing.abs() > FRAC_PI_2);
        (aim.bearing.abs() > bound).then(|| way.unwrap_or(aim.bearing.signum()))
    }

    /// The speed that brings the robot to the stand-off and keeps it there, m/s.
    fn wanted_speed(&self, aim: &Aim, max_mps: f64) -> f64 {
        let config = &self.config;
        let excess = config.range_gain_per_s * (aim.range_m - config.stand_off_m);
        let speed = (excess + aim.receding_mps.max(0.0)).clamp(0.0, max_mps);
        // A robot that faces away turns first.
        let ahead = aim.bearing.cos().max(0.0);
        if self.turning.is_some() { 0.0 } else { speed * ahead * ahead }
    }

    /// A speed on the way from the last one to the wanted one.
    fn ramped(&self, wanted: f64, dt: f64) -> f64 {
        let least = self.speed_mps - self.config.max_deceleration * dt;
        wanted.clamp(least, self.speed_mps + self.config.max_acceleration * dt)
    }

    /// Returns 1 / rho of P1, section 3, times the path's gain, 1/m.
    fn curvature(&self, aim: &Aim, gain: f64) -> f64 {
        let config = &self.config;
        let range = aim.range_m.max(config.min_range_m);
        // Near the robot the curvature is limited, because it grows without bound there.
        let curvature = 2.0 * gain * aim.sine * (aim.range_m / range) / range;
        curvature.clamp(-config.max_curvature, config.max_curvature)
    }

    /// Returns the turn rate of a standing robot towards the target, rad/s.
    fn facing_rate(&self, aim: &Aim) -> f64 {
        let config = &self.config;
        let is_straight = config.path == Path::B && self.turning.is_none();
        if is_straight {
            return 0.0;
        }
        let bearing = match self.turning {
            Some(way) if way * aim.bearing < 0.0 => aim.bearing + way * TAU,
            _ => aim.bearing,
        };
        config.bearing_gain_per_s * bearing * (aim.range_m / config.min_range_m).min(1.0)
    }

    /// Slower where the robot cannot do it, on the same path.
    fn within_limits(&self, twist: Twist, scene: &Scene<'_>) -> Twist {
        let rim = twist.angular_rps.abs() * scene.wheels.half_separation_m;
        let by_speed = scene.max_speed_mps / (twist.linear_mps + rim);
        let by_turn = self.config.max_turn_rate / twist.angular_rps.abs();
        let scale = by_speed.min(by_turn).min(1.0);
        // Both by the same factor, so that the curvature stays.
        twist.scaled(scale)
    }
}

fn is_sensible(number: f64) -> bool {
    number > 0.0 && number <= MOST
}
