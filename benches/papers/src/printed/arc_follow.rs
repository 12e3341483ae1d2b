//! `arc-follow-as-printed`: the wheel speeds of P1, section 3, and P4, section IV.
//!
//! The wheels run at `v (1 ∓ k d 2 Y / (X² + Y²))`, with nothing else: the curvature has no bound, a
//! robot at rest cannot turn, and a person behind the robot is driven away from.

use nalgebra::Vector2;
use tagalong_config::{Registry, check_settings};
use tagalong_controllers::{CommandHistory, coasting_weight, step_s};
use tagalong_core::{Controller, Result, Scene, Twist, WheelSpeeds, settings};

/// Above this no length or speed on the floor makes sense, whatever the unit.
const MOST: f64 = 1e6;

settings! {
    /// Settings of the controller `arc-follow-as-printed`.
    pub struct Config {
        /// Divisor of the radius of the circle (k); 1 is path A, more is path C.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub path_gain: f64 = 2.0,
        /// Distance kept from the person, m, of which the papers say nothing.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub stand_off_m: f64 = 1.4,
        /// Speed for each metre beyond the stand-off, 1/s, likewise.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub range_gain_per_s: f64 = 0.8,
        /// Largest acceleration, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_acceleration: f64 = 0.5,
        /// Largest deceleration, m/s².
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_deceleration: f64 = 1.0,
        /// Time after which the robot stands still when the person is not seen, s.
        #[schemars(range(min = 1e-6, max = 1e6))]
        pub max_unseen_s: f64 = 1.0,
        /// Time from the capture of an image until the wheels answer to it, s.
        #[schemars(range(min = 0.0, max = 1e6))]
        pub latency_s: f64 = 0.1,
    }
}

/// The printed controller.
pub struct PrintedArcFollow {
    config: Config,
    /// Forward speed of the last command, m/s.
    speed_mps: f64,
    history: CommandHistory,
}

impl PrintedArcFollow {
    /// Creates a controller of a robot at rest.
    ///
    /// # Errors
    /// Settings outside their ranges.
    pub fn new(config: Config) -> Result<Self> {
        check_settings(&config)?;
        let history = CommandHistory::new(config.latency_s);
        Ok(Self { config, speed_mps: 0.0, history })
    }

    /// Returns the command; `None` without a target, and where the equations have no result.
    fn steer(&mut self, scene: &Scene<'_>, dt_s: f64) -> Option<Twist> {
        let max_mps = scene.max_speed_mps;
        if !is_sensible(scene.wheels.half_separation_m) || !is_sensible(max_mps) {
            return None;
        }
        let target = scene.target?;
        let to_come = self.history.forecast(&scene.wheels);
        let person = &target.estimate.person;
        let is_known = person.velocity.iter().all(|speed| speed.is_finite());
        let walks = if is_known { person.velocity } else { Vector2::zeros() };
        let place = to_come.apply_to_point(person.position.xy() + walks * to_come.dt);
        let range_m = place.x.hypot(place.y);
        if !range_m.is_finite() {
            return None;
        }
        let towards = if range_m > 0.0 { place.coords / range_m } else { Vector2::x() };
        let receding_mps = to_come.apply_to_velocity(walks).dot(&towards);
        let speed_mps = self.speed(range_m, receding_mps, max_mps, dt_s);
        let trust = coasting_weight(target.unseen_s, self.config.max_unseen_s);
        let speed_mps = speed_mps.min(trust * max_mps);
        let turn_rate = speed_mps * curvature(self.config.path_gain, towards.y, range_m)?;
        let rim_mps = turn_rate.abs() * scene.wheels.half_separation_m;
        // Wheels that cannot run so fast both run slower by the same factor.
        let scale = (max_mps / (speed_mps + rim_mps)).min(1.0);
        let twist = Twist::new(speed_mps, turn_rate).scaled(scale);
        self.speed_mps = twist.linear_mps;
        twist.angular_rps.is_finite().then_some(twist)
    }

    /// Returns the speed on the way from the last one to the one that keeps the stand-off, m/s.
    fn speed(&self, range_m: f64, receding_mps: f64, max_mps: f64, dt_s: f64) -> f64 {
        let config = &self.config;
        let excess = config.range_gain_per_s * (range_m - config.stand_off_m);
        let wanted = (excess + receding_mps.max(0.0)).clamp(0.0, max_mps);
        let least = self.speed_mps - config.max_deceleration * dt_s;
        wanted.clamp(least, self.speed_mps + config.max_acceleration * dt_s)
    }
}

/// Returns k / rho, 1/m; `None` at the origin.
fn curvature(path_gain: f64, sine: f64, range_m: f64) -> Option<f64> {
    let curvature = 2.0 * path_gain * sine / range_m;
    curvature.is_finite().then_some(curvature)
}

fn is_sensible(number: f64) -> bool {
    number > 0.0 && number <= MOST
}

impl Controller for PrintedArcFollow {
    fn command(&mut self, scene: &Scene<'_>) -> Twist {
        let dt_s = step_s(&scene.frame.motion);
        self.history.age(dt_s);
        let twist = self.steer(scene, dt_s);
        self.history.add(twist.map_or(WheelSpeeds::STOP, |twist| scene.wheels.wheels(twist)));
        twist.unwrap_or_else(|| {
            self.speed_mps = 0.0;
            Twist::STOP
        })
    }

    fn stand_off_m(&self) -> Option<f64> {
        Some(self.config.stand_off_m)
    }
}

/// Registers the controller.
pub fn register(registry: &mut Registry) {
    registry.controller(
        "arc-follow-as-printed",
        "follows by the wheel speeds of P1 and P4 as printed",
        |config: Config, _| PrintedArcFollow::new(config),
    );
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Isometry2, Point2};
    use tagalong_conformance::target;
    use tagalong_controllers::arc_follow::ArcFollow;
    use tagalong_core::{DiffDrive, EgoMotion, Frame, Images, Stamp, Track};
    use tagalong_geometry::{Camera, Distortion, Pinhole};

    use super::*;

    const WHEELS: DiffDrive = DiffDrive { half_separation_m: 0.167, slip: 0.0 };

    fn printed(config: Config) -> PrintedArcFollow {
        PrintedArcFollow::new(config).unwrap()
    }

    fn corrected() -> ArcFollow {
        ArcFollow::new(tagalong_controllers::arc_follow::Config::default()).unwrap()
    }

    fn command(controller: &mut dyn Controller, motion: EgoMotion, person: &Track) -> WheelSpeeds {
        let lens = Pinhole { fx: 1.0, fy: 1.0, cx: 0.5, cy: 0.5, distortion: Distortion::None };
        let camera = Arc::new(Camera::mounted(lens, 1, 1, 1.0, 0.0, 0.0));
        let frame = Frame::new(1, Stamp::default(), camera, motion, Images::default());
        let target = Some(person);
        let tracks = std::slice::from_ref(person);
        let scene = Scene::new(&frame, tracks, WHEELS, 0.9).with_target(target);
        WHEELS.wheels(controller.command(&scene))
    }

    /// Returns the command for a person that has been there for long.
    fn settled(controller: &mut dyn Controller, person: &Track) -> WheelSpeeds {
        let commands = (0..40).map(|_| command(controller, EgoMotion::at_rest(0.1), person));
        commands.last().unwrap()
    }

    /// Drives for so many steps of 0.1 s, and returns the bearings of a person on the way.
    fn drive(
        controller: &mut dyn Controller,
        steps: u32,
        person: impl Fn(u32) -> (Point2<f64>, Vector2<f64>),
    ) -> Vec<[f64; 2]> {
        let mut pose = Isometry2::<f64>::identity();
        let mut motion = EgoMotion::at_rest(0.1);
        let mut polar = Vec::new();
        for step in 0..steps {
            let (place, velocity) = person(step);
            let at = pose.inverse_transform_point(&place);
            let seen = target(at.x, at.y, pose.inverse_transform_vector(&velocity));
            let wheels = command(controller, motion, &seen);
            motion = EgoMotion::from_wheels(wheels.left, wheels.right, &WHEELS, 0.1);
            pose *= motion.isometry();
            let at = pose.inverse_transform_point(&place);
            polar.push([at.x.hypot(at.y), at.y.atan2(at.x)]);
        }
        polar
    }

    #[test]
    fn wheels_are_those_of_the_paper() {
        let x = 2.0;
        let y = -0.7;
        let d = WHEELS.half_separation_m;
        let mut controller = printed(Config { latency_s: 0.0, ..Config::default() });
        let wheels = settled(&mut controller, &target(x, y, Vector2::zeros()));
        let v = 0.8 * (x.hypot(y) - 1.4);
        let bend = 2.0 * 2.0 * d * y / (x * x + y * y);
        assert!((wheels.left - v * (1.0 - bend)).abs() < 1e-12);
        assert!((wheels.right - v * (1.0 + bend)).abs() < 1e-12);
    }

    #[test]
    fn the_curvature_has_no_bound_and_the_corrected_one_has() {
        fn curvature(wheels: WheelSpeeds) -> f64 {
            let turn_rate = (wheels.right - wheels.left) / (2.0 * WHEELS.half_separation_m);
            turn_rate / (0.5 * (wheels.left + wheels.right))
        }

        let near = target(0.25, 0.1, Vector2::new(0.5, 0.0));
        let config = Config { stand_off_m: 0.2, latency_s: 0.0, ..Config::default() };
        let printed = curvature(settled(&mut printed(config), &near));
        assert!((printed - 4.0 * 0.1 / 0.0725).abs() < 1e-9, "{printed}");
        let config = tagalong_controllers::arc_follow::Config {
            bearing_gain_per_s: 0.0,
            max_turn_rate: 10.0,
            latency_s: 0.0,
            stand_off_m: 0.2,
            ..Default::default()
        };
        let corrected = curvature(settled(&mut ArcFollow::new(config).unwrap(), &near));
        assert!((corrected - 4.0 * 0.1 / 0.25).abs() < 1e-9, "{corrected}");
    }

    #[test]
    fn at_the_origin_there_is_no_command() {
        let config = Config { stand_off_m: 0.0, latency_s: 0.0, ..Config::default() };
        let here = target(0.0, 0.0, Vector2::new(0.5, 0.0));
        assert_eq!(settled(&mut printed(config), &here), WheelSpeeds::STOP);
    }

    #[test]
    fn it_drives_away_from_a_person_behind_whom_the_corrected_law_turns_to() {
        let mut printed = printed(Config::default());
        let mut corrected = corrected();
        let controllers: [&mut dyn Controller; 2] = [&mut printed, &mut corrected];
        let [away, [range_m, bearing_rad]] = controllers.map(|controller| {
            *drive(controller, 150, |_| (Point2::new(-2.0, 0.01), Vector2::zeros())).last().unwrap()
        });
        assert!(away[0] > 3.0, "{away:?}");
        assert!((range_m - 1.4).abs() < 0.05 && bearing_rad.abs() < 0.05);
    }

    #[test]
    fn it_loses_a_person_who_walks_around_it_at_the_stand_off() {
        fn around(step: u32) -> (Point2<f64>, Vector2<f64>) {
            let (sin, cos) = (0.03 * f64::from(step)).sin_cos();
            (Point2::new(1.4 * cos, 1.4 * sin), Vector2::new(-sin, cos) * 0.42)
        }

        fn worst_deg(controller: &mut dyn Controller) -> f64 {
            let bearings = drive(controller, 200, around).into_iter().map(|[_, b]| b.abs());
            bearings.fold(0.0, f64::max).to_degrees()
        }

        assert!(worst_deg(&mut printed(Config::default())) > 90.0);
        assert!(worst_deg(&mut corrected()) < 25.0);
    }
}
