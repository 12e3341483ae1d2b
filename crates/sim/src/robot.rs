//! A differential drive that responds with delay and lag, on a path or under external control, and
//! the odometry computed from its encoders.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use nalgebra::{Isometry2, Point2, Vector2};
use tagalong_core::{DiffDrive, EgoMotion, WheelSpeeds};

use crate::random::Random;
use crate::scene::RobotSettings;

/// A point of the path is reached at this distance, m.
const REACHED_M: f64 = 0.2;
/// Pitch per m/s² of braking, rad.
const NOD_RAD: f64 = 0.008;
/// Time constant of the pitch, s.
const NOD_S: f64 = 0.15;

/// Reading of a wheel's encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Encoder {
    /// Angle since the start, in whole ticks, rad.
    pub angle_rad: f64,
    /// Speed, rad/s.
    pub rate_rad_s: f64,
}

/// State of wheels that may fail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelFaults {
    /// The wheels do not move, whatever is commanded.
    pub stuck: bool,
    /// The wheels continue with the previous command.
    pub runaway: bool,
    /// Fraction of their travel that reaches the ground.
    pub grip: f64,
    /// Time from a command to its effect, s, instead of that of the settings.
    pub latency_s: Option<f64>,
}

impl Default for WheelFaults {
    fn default() -> Self {
        Self { stuck: false, runaway: false, grip: 1.0, latency_s: None }
    }
}

/// The robot on its way.
#[derive(Clone, Debug)]
pub struct Robot {
    settings: RobotSettings,
    /// True pose in the world.
    pub pose: Isometry2<f64>,
    /// Pose according to the odometry, in a frame that starts at zero.
    pub odometry: Isometry2<f64>,
    /// Speeds of the rims of the wheels, m/s.
    wheels: [f64; 2],
    /// Speeds that the encoders measure, m/s.
    measured: [f64; 2],
    /// Distances that the encoders measure since the start, m.
    travelled: [f64; 2],
    /// Ratios of the true wheel radii to the nominal one.
    radius: [f64; 2],
    half_separation_m: f64,
    commands: VecDeque<(f64, WheelSpeeds)>,
    /// The last command, which may not be in effect yet.
    given: WheelSpeeds,
    command: WheelSpeeds,
    /// The last command that has reached the wheels, which a runaway continues.
    arrived: WheelSpeeds,
    faults: WheelFaults,
    steered: bool,
    ahead: usize,
    nod_rad: f64,
    random: Random,
}

impl Robot {
    /// Creates a robot at rest at its start.
    pub fn new(settings: &RobotSettings, mut random: Random) -> Self {
        let bias = settings.wheel_bias;
        // Wheels never have exactly the nominal size, so the odometry has a bias.
        let [left, right, separation] = [0, 1, 2].map(|_| 1.0 + bias * random.normal());
        let start = Vector2::from(settings.start);
        Self {
            pose: Isometry2::new(start, settings.heading_deg.to_radians()),
            odometry: Isometry2::identity(),
            wheels: [0.0; 2],
            measured: [0.0; 2],
            travelled: [0.0; 2],
            radius: [left, right],
            half_separation_m: settings.half_separation_m * separation,
            commands: VecDeque::new(),
            given: WheelSpeeds::STOP,
            command: WheelSpeeds::STOP,
            arrived: WheelSpeeds::STOP,
            faults: WheelFaults::default(),
            steered: false,
            ahead: 0,
            nod_rad: 0.0,
            random,
            settings: settings.clone(),
        }
    }

    /// Commands wheel speeds from outside; from then on the path is ignored.
    pub fn steer(&mut self, now_s: f64, command: WheelSpeeds) {
        self.steered = true;
        self.give(now_s, command);
    }

    /// Sets the command that leads along the path, or that follows a person at `leader`, unless a
    /// caller steers.
    pub fn decide(&mut self, now_s: f64, leader: Option<Point2<f64>>) {
        if self.steered {
            return;
        }
        let command = match leader.filter(|_| self.settings.behind_m > 0.0) {
            Some(leader) => self.towards(leader, self.settings.behind_m),
            None => self.along_path(),
        };
        self.give(now_s, command);
    }

    fn give(&mut self, now_s: f64, command: WheelSpeeds) {
        self.given = command;
        let latency_s = self.faults.latency_s.unwrap_or(self.settings.latency_s);
        self.commands.push_back((now_s + latency_s, command));
    }

    /// Sets the state of the wheels from now on.
    pub fn set_faults(&mut self, faults: WheelFaults) {
        self.faults = faults;
    }

    /// Moves the robot by a time step.
    pub fn step(&mut self, now_s: f64, dt: f64) {
        while let Some(command) = self.commands.front().filter(|c| c.0 <= now_s).map(|c| c.1) {
            self.arrived = command;
            self.commands.pop_front();
        }
        if !self.faults.runaway {
            self.command = self.arrived;
        }
        self.drive(dt);
    }

    fn drive(&mut self, dt: f64) {
        let before = self.speed_mps();
        // A step shorter than the response time gives a first-order lag; a longer one reaches the
        // target.
        let part = dt / self.settings.response_s.max(dt);
        let targets = [self.command.left, self.command.right];
        let wheels = self.wheels.iter_mut().zip(&mut self.measured);
        for (((wheel, measured), target), radius) in wheels.zip(targets).zip(self.radius) {
            *wheel += (target - *wheel) * part;
            if self.faults.stuck {
                *wheel = 0.0;
            }
            // The wheel slips, but the encoder measures the wheel and not the ground.
            *measured = *wheel / radius * (1.0 + self.settings.slip * self.random.normal());
        }
        for (travelled, measured) in self.travelled.iter_mut().zip(self.measured) {
            *travelled += measured * dt;
        }
        let acceleration = (self.speed_mps() - before) / dt;
        self.nod_rad += (-NOD_RAD * acceleration - self.nod_rad) * (dt / NOD_S).min(1.0);
        self.pose = self.pose_after(dt);
        // With the nominal separation, because the odometry does not know the true one.
        self.odometry *= moved(self.measured, self.settings.half_separation_m, dt);
    }

    /// Returns the pose after a short time, or before it if negative, at the present speed.
    pub fn pose_after(&self, dt: f64) -> Isometry2<f64> {
        self.pose * moved(self.over_ground(), self.half_separation_m, dt)
    }

    /// Returns the speeds that lead to the next point of the path.
    fn along_path(&mut self) -> WheelSpeeds {
        let Some(goal) = self.settings.path.get(self.ahead).copied().map(Point2::from) else {
            return WheelSpeeds::STOP;
        };
        if nalgebra::distance(&goal, &self.pose.translation.vector.into()) < REACHED_M {
            self.ahead += 1;
        }
        let last = self.ahead + 1 >= self.settings.path.len();
        // Between waypoints the robot does not slow down.
        self.towards(goal, if last { 0.0 } else { f64::NEG_INFINITY })
    }

    /// Returns the speeds that lead to a point and stop at this distance from it.
    fn towards(&self, goal: Point2<f64>, away_m: f64) -> WheelSpeeds {
        let way = self.pose.inverse_transform_point(&goal).coords;
        let off = way.y.atan2(way.x);
        let limit = (way.norm() - away_m).max(0.0);
        // A robot that faces away turns first: the cosine reduces its speed to zero.
        let speed = self.settings.speed_mps.min(limit) * off.cos().max(0.0).powi(2);
        let turn = (1.6 * off).clamp(-0.9, 0.9) * self.settings.half_separation_m;
        WheelSpeeds { left: speed - turn, right: speed + turn }
    }

    /// Returns the speeds of the wheels over ground, m/s.
    fn over_ground(&self) -> [f64; 2] {
        self.wheels.map(|wheel| wheel * self.faults.grip)
    }

    /// Returns the forward speed over ground, m/s.
    pub fn speed_mps(&self) -> f64 {
        let [left, right] = self.over_ground();
        0.5 * (left + right)
    }

    /// Returns the turn rate about the vertical, rad/s.
    pub fn turn_rate(&self) -> f64 {
        let [left, right] = self.over_ground();
        (right - left) / (2.0 * self.half_separation_m)
    }

    /// Returns the forward speed, m/s, and the turn rate, rad/s, that the encoders measure.
    pub fn measured(&self) -> (f64, f64) {
        self.planar(self.measured)
    }

    /// Returns the forward speed, m/s, and the turn rate, rad/s, of the last command.
    pub fn commanded(&self) -> (f64, f64) {
        self.planar([self.given.left, self.given.right])
    }

    fn planar(&self, [left, right]: [f64; 2]) -> (f64, f64) {
        (0.5 * (left + right), (right - left) / (2.0 * self.settings.half_separation_m))
    }

    /// Returns the readings of the left and the right encoder.
    pub fn encoders(&self) -> [Encoder; 2] {
        let radius_m = self.settings.wheel_radius_m;
        let tick_rad = TAU / f64::from(self.settings.ticks_per_turn);
        [0, 1].map(|side| Encoder {
            // Encoders count whole ticks.
            angle_rad: (self.travelled[side] / radius_m / tick_rad).floor() * tick_rad,
            rate_rad_s: self.measured[side] / radius_m,
        })
    }

    /// Returns the pitch, rad, positive with the nose down.
    pub fn nod_rad(&self) -> f64 {
        self.nod_rad
    }
}

/// Returns the motion of wheels at these speeds.
fn moved([left, right]: [f64; 2], half_separation_m: f64, dt: f64) -> Isometry2<f64> {
    EgoMotion::from_wheels(left, right, &DiffDrive { half_separation_m, slip: 0.0 }, dt).isometry()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(settings: RobotSettings) -> Robot {
        Robot::new(&settings, Random::new(5, 1))
    }

    fn run(robot: &mut Robot, seconds: f64) {
        for step in 0..(seconds / 0.02) as usize {
            robot.decide(step as f64 * 0.02, None);
            robot.step(step as f64 * 0.02, 0.02);
        }
    }

    #[test]
    fn the_path_is_driven_and_odometry_drifts_a_little() {
        let mut robot =
            robot(RobotSettings { path: vec![[4.0, 3.0], [4.0, 5.0]], ..RobotSettings::default() });
        run(&mut robot, 25.0);
        assert!((robot.pose.translation.vector - Vector2::new(4.0, 5.0)).norm() < 0.3);
        let start = Isometry2::new(Vector2::new(1.0, 3.0), 0.0);
        let believed = start * robot.odometry;
        let error = (believed.translation.vector - robot.pose.translation.vector).norm();
        assert!(error > 1e-3 && error < 0.5, "{error}");
    }

    #[test]
    fn it_comes_after_who_walks_ahead_and_stays_away() {
        fn leader(step: usize) -> Point2<f64> {
            Point2::new(3.0, 3.0 + (0.008 * step as f64).min(4.0))
        }

        let mut robot = robot(RobotSettings { behind_m: 1.5, ..RobotSettings::default() });
        for step in 0..1500 {
            robot.decide(step as f64 * 0.02, Some(leader(step)));
            robot.step(step as f64 * 0.02, 0.02);
        }
        let way = robot.pose.inverse_transform_point(&leader(1500)).coords;
        assert!((way.norm() - 1.5).abs() < 0.05, "{way}");
        assert!(way.y.abs() < 0.1, "it looks at the person: {way}");
    }

    #[test]
    fn ticks_say_how_far_the_odometry_believes_to_be() {
        let settings = RobotSettings { path: vec![[4.0, 3.0]], ..RobotSettings::default() };
        let tick_m = TAU * settings.wheel_radius_m / f64::from(settings.ticks_per_turn);
        let mut robot = robot(settings.clone());
        run(&mut robot, 10.0);
        let [left, right] = robot.encoders().map(|e| e.angle_rad * settings.wheel_radius_m);
        let turn = (right - left) / (2.0 * settings.half_separation_m);
        let off = turn - robot.odometry.rotation.angle();
        assert!(off.abs() <= tick_m / settings.half_separation_m, "{off}");
        assert!((0.5 * (left + right) - robot.odometry.translation.vector.norm()).abs() < 0.02);
        let ticks = left / tick_m;
        assert!((ticks - ticks.round()).abs() < 1e-6 && ticks > 1000.0, "{ticks}");
    }

    #[test]
    fn a_command_works_after_its_latency_and_then_gradually() {
        let mut robot = robot(RobotSettings::default());
        robot.steer(0.0, WheelSpeeds { left: 0.4, right: 0.4 });
        run(&mut robot, 0.09);
        assert_eq!(robot.speed_mps(), 0.0);
        run(&mut robot, 0.30);
        assert!(robot.speed_mps() > 0.1 && robot.speed_mps() < 0.38, "{}", robot.speed_mps());
        run(&mut robot, 2.0);
        assert!((robot.speed_mps() - 0.4).abs() < 1e-3 && robot.turn_rate().abs() < 1e-9);
    }
}
