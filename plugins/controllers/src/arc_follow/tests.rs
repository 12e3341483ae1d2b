//! The statements of the README about the controller.

mod laws;
mod states;

use std::sync::Arc;

use nalgebra::{Isometry2, Point2, Vector2};
use tagalong_conformance::target;
use tagalong_core::{
    Controller, DiffDrive, EgoMotion, Frame, Images, Scene, Stamp, Track, Twist, WheelSpeeds,
};
use tagalong_geometry::{Camera, Distortion, Pinhole};

use crate::arc_follow::{ArcFollow, Config, Path};

const WHEELS: DiffDrive = DiffDrive { half_separation_m: 0.167, slip: 0.0 };
const MAX_MPS: f64 = 0.9;

fn frame(motion: EgoMotion) -> Frame {
    let lens = Pinhole { fx: 1.0, fy: 1.0, cx: 0.5, cy: 0.5, distortion: Distortion::None };
    let camera = Arc::new(Camera::mounted(lens, 1, 1, 1.0, 0.0, 0.0));
    Frame::new(1, Stamp::default(), camera, motion, Images::default())
}

fn command(controller: &mut ArcFollow, motion: EgoMotion, target: Option<&Track>) -> WheelSpeeds {
    let tracks = target.map_or(&[][..], std::slice::from_ref);
    let frame = frame(motion);
    let max_speed_mps = MAX_MPS;
    let scene = Scene::new(&frame, tracks, WHEELS, max_speed_mps).with_target(target);
    WHEELS.wheels(controller.command(&scene))
}

fn speed(wheels: WheelSpeeds) -> f64 {
    0.5 * (wheels.left + wheels.right)
}

fn turn_rate(wheels: WheelSpeeds) -> f64 {
    (wheels.right - wheels.left) / (2.0 * WHEELS.half_separation_m)
}

/// Returns the command of a controller for a person that has been there for so long that the
/// acceleration does not limit the speed any longer.
fn settled(config: Config, person: &Track) -> WheelSpeeds {
    let mut controller = ArcFollow::new(config).unwrap();
    let steps = (0..40).map(|_| command(&mut controller, EgoMotion::at_rest(0.1), Some(person)));
    steps.last().unwrap()
}

/// A robot that executes commands at once, or `delay` steps later.
struct Drive {
    controller: ArcFollow,
    pose: Isometry2<f64>,
    motion: EgoMotion,
    pending: Vec<WheelSpeeds>,
    dt: f64,
}

impl Drive {
    fn new(config: Config, dt: f64, delay: usize) -> Self {
        Self {
            controller: ArcFollow::new(config).unwrap(),
            pose: Isometry2::identity(),
            motion: EgoMotion::at_rest(dt),
            pending: vec![WheelSpeeds::STOP; delay],
            dt,
        }
    }

    /// Returns the person at a place in the world, in robot axes.
    fn seen(&self, place: Point2<f64>, velocity: Vector2<f64>) -> Track {
        let at = self.pose.inverse_transform_point(&place);
        target(at.x, at.y, self.pose.inverse_transform_vector(&velocity))
    }

    /// Range, m, and bearing, rad.
    fn polar(&self, place: Point2<f64>) -> (f64, f64) {
        let at = self.pose.inverse_transform_point(&place);
        (at.x.hypot(at.y), at.y.atan2(at.x))
    }

    /// Executes one step; returns its command.
    fn step(&mut self, place: Point2<f64>, velocity: Vector2<f64>) -> WheelSpeeds {
        let seen = self.seen(place, velocity);
        let wheels = command(&mut self.controller, self.motion, Some(&seen));
        self.pending.push(wheels);
        let now = self.pending.remove(0);
        self.motion = EgoMotion::from_wheels(now.left, now.right, &WHEELS, self.dt);
        self.pose *= self.motion.isometry();
        wheels
    }
}

#[test]
fn settings_that_cannot_work_are_refused() {
    fn refused(config: Config) -> String {
        ArcFollow::new(config).unwrap_err().to_string()
    }

    let unfit = refused(Config { max_deceleration: f64::NAN, ..Config::default() });
    assert!(unfit.contains("`max_deceleration` must be positive"), "{unfit}");
    let angles = refused(Config { turn_in_place_deg: [60.0, 30.0], ..Config::default() });
    assert!(angles.contains("`turn_in_place_deg`"), "{angles}");
    for bounds in [[0.0, 12.0], [3.0, 180.0]] {
        let angles = refused(Config { align_deg: bounds, ..Config::default() });
        assert!(angles.contains("`align_deg`"), "{angles}");
    }
}

#[test]
fn a_drive_that_cannot_be_is_not_steered() {
    let person = target(3.0, 1.0, Vector2::zeros());
    let frame = frame(EgoMotion::at_rest(0.1));
    let mut controller = ArcFollow::new(Config::default()).unwrap();
    let odd = [0.0, -0.1, f64::NAN, f64::INFINITY, f64::MAX];
    let odd = odd.into_iter().flat_map(|odd| [(odd, 0.9, false), (0.167, odd, false)]);
    for (half_separation_m, max_speed_mps, drives) in [(0.167, 0.9, true)].into_iter().chain(odd) {
        let wheels = DiffDrive { half_separation_m, slip: 0.0 };
        let scene = Scene::new(&frame, &[], wheels, max_speed_mps).with_target(Some(&person));
        let twist = controller.command(&scene);
        assert_eq!(twist != Twist::STOP, drives, "{half_separation_m} {max_speed_mps}");
    }
}
