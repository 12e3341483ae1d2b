//! The statements of the README about the controller.

use std::sync::Arc;

use nalgebra::{Isometry2, Point2, Point3, Vector2};
use proptest::prelude::*;
use tagalong_conformance::target;
use tagalong_core::{
    Controller, DepthImage, DiffDrive, EgoMotion, Frame, Images, LaserScan, Scene, Stamp, Track,
    Twist, WheelSpeeds,
};
use tagalong_geometry::{Camera, Pinhole};

use crate::clear_follow::{ClearFollow, Config};

const WHEELS: DiffDrive = DiffDrive { half_separation_m: 0.167, slip: 0.0 };
const MAX_MPS: f64 = 0.9;

fn camera() -> Arc<Camera> {
    Arc::new(Camera::mounted(Pinhole::centred(30.0, 40, 30), 40, 30, 1.0, 0.0, 0.0))
}

fn command(
    controller: &mut ClearFollow,
    motion: EgoMotion,
    depth: Option<DepthImage>,
    target: Option<&Track>,
) -> WheelSpeeds {
    let images = Images { depth: depth.map(Arc::new), ..Images::default() };
    let frame = Frame::new(1, Stamp::default(), camera(), motion, images);
    let tracks = target.map_or(&[][..], std::slice::from_ref);
    let scene = Scene::new(&frame, tracks, WHEELS, MAX_MPS).with_target(target);
    WHEELS.wheels_within(controller.command(&scene), MAX_MPS)
}

/// Follows a person whose place in the world is given for each time, for some seconds; returns
/// range and bearing at the end.
fn ride(config: Config, seconds: f64, person: impl Fn(f64) -> Point2<f64>) -> (f64, f64) {
    let mut controller = ClearFollow::new(config).unwrap();
    let mut pose = Isometry2::identity();
    let mut motion = EgoMotion::at_rest(0.1);
    let dt = 0.1;
    let mut seen = Point2::origin();
    for step in 0..(seconds / dt) as u32 {
        let now = f64::from(step) * dt;
        let velocity = (person(now + dt) - person(now)) / dt;
        seen = pose.inverse_transform_point(&person(now));
        let velocity = pose.inverse_transform_vector(&velocity);
        let WheelSpeeds { left, right } =
            command(&mut controller, motion, None, Some(&target(seen.x, seen.y, velocity)));
        motion = EgoMotion::from_wheels(left, right, &WHEELS, dt);
        pose *= motion.isometry();
    }
    (seen.coords.norm(), seen.y.atan2(seen.x))
}

fn prompt() -> Config {
    Config { latency_s: 0.0, ..Config::default() }
}

#[test]
fn it_keeps_the_distance_to_a_person_who_walks() {
    let (range_m, bearing) = ride(prompt(), 20.0, |t| Point2::new(2.0 + 0.6 * t, 0.0));
    assert!((range_m - 1.4).abs() < 0.15 && bearing.abs() < 0.02, "{range_m} {bearing}");
}

#[test]
fn it_turns_with_a_person_who_walks_around_it() {
    let (_, bearing) =
        ride(prompt(), 12.0, |t: f64| Point2::new(1.4 * (0.4 * t).cos(), 1.4 * (0.4 * t).sin()));
    assert!(bearing.abs() < 0.1, "{bearing}");
    let behind = ride(prompt(), 8.0, |_| Point2::new(-2.0, 0.3));
    assert!(behind.1.abs() < 0.05, "{behind:?}");
}

/// Returns a depth image with a post 1 m ahead, left of the middle, before a wall.
fn post_ahead() -> DepthImage {
    DepthImage::from_fn(40, 30, |x, _| if (17..20).contains(&x) { 1.0 } else { 6.0 })
}

#[test]
fn what_stands_in_the_way_is_gone_round_and_a_wall_stops_it() {
    let person = target(4.0, 0.0, Vector2::zeros());
    let free = DepthImage::filled(40, 30, 6.0);
    let wall = DepthImage::filled(40, 30, 0.45);
    let [free, wall, round] = [free, wall, post_ahead()].map(|depth| {
        let mut controller = ClearFollow::new(prompt()).unwrap();
        let still = EgoMotion::at_rest(0.1);
        let steps =
            (0..30).map(|_| command(&mut controller, still, Some(depth.clone()), Some(&person)));
        steps.last().unwrap()
    });
    assert!(free.left == free.right && free.left > 0.8, "{free:?}");
    assert!(wall.left + wall.right < 0.05, "{wall:?}");
    assert!((round.left - round.right).abs() > 0.05 && round.left + round.right > 0.1, "{round:?}");
}

/// A robot with a laser scanner alone, which sees a post to the left of the middle, and the followed person.
#[test]
fn what_a_laser_scanner_sees_is_gone_round_and_the_person_is_no_thing() {
    let person = target(4.0, 0.0, Vector2::zeros());
    let [free, round] = [[[3.8, 0.05], [3.8, -0.05]], [[1.0, 0.05], [1.0, 0.1]]].map(|points| {
        let mut controller = ClearFollow::new(prompt()).unwrap();
        let points: Vec<_> = points.iter().map(|[x, y]| Point3::new(*x, *y, 0.2)).collect();
        let motion = EgoMotion::at_rest(0.1);
        let frame = Frame::new(1, Stamp::default(), camera(), motion, Images::default())
            .with_laser(Some(LaserScan::of_points(points)));
        let tracks = std::slice::from_ref(&person);
        let scene = Scene::new(&frame, tracks, WHEELS, MAX_MPS).with_target(Some(&person));
        (0..30).map(|_| controller.command(&scene)).last().unwrap()
    });
    assert!(free.angular_rps == 0.0 && free.linear_mps > 0.8, "{free:?}");
    assert!(round.angular_rps < -0.1 && round.linear_mps > 0.1, "{round:?}");
}

#[test]
fn it_speeds_up_and_slows_down_no_faster_than_it_may() {
    let mut controller = ClearFollow::new(prompt()).unwrap();
    let still = EgoMotion::at_rest(0.1);
    // It slows down by 0.6 m/s².
    for (x, expected) in [(4.0, 0.05), (4.0, 0.1), (4.0, 0.15), (1.4, 0.09)] {
        let person = target(x, 0.0, Vector2::zeros());
        let WheelSpeeds { left, right } = command(&mut controller, still, None, Some(&person));
        let speed = 0.5 * (left + right);
        assert!((speed - expected).abs() < 1e-9, "{x}: {speed}");
    }
    assert_eq!(ClearFollow::new(prompt()).unwrap().stand_off_m(), Some(1.4));
}

#[test]
fn it_turns_by_the_bearing_and_as_fast_as_the_person_walks_around_it() {
    fn turn(x: f64, y: f64, velocity: Vector2<f64>) -> f64 {
        let mut controller = ClearFollow::new(prompt()).unwrap();
        let person = target(x, y, velocity);
        let wheels = command(&mut controller, EgoMotion::at_rest(0.0), None, Some(&person));
        (wheels.right - wheels.left) / (2.0 * WHEELS.half_separation_m)
    }

    assert!((turn(2.0, 1.0, Vector2::zeros()) - 0.5_f64.atan()).abs() < 1e-9);
    assert!((turn(2.0, 0.0, Vector2::new(0.0, 0.8)) - 0.4).abs() < 1e-9);
    assert!((turn(2.0, 0.0, Vector2::new(0.8, 0.0))).abs() < 1e-9);
    assert!((turn(0.2, 0.0, Vector2::new(0.0, -0.3)) + 0.6).abs() < 1e-9, "as if at half a metre");
    assert!((turn(-2.0, 0.3, Vector2::zeros()) - 1.2).abs() < 1e-9, "no faster than it may");
}

/// Half a second to come: the person, 0.4 m/s, will be 0.2 m farther away.
#[test]
fn the_person_is_where_the_wheels_will_find_them() {
    let config = Config { latency_s: 0.5, max_acceleration: 1e3, ..Config::default() };
    let mut controller = ClearFollow::new(config).unwrap();
    let person = target(1.5, 0.0, Vector2::new(0.4, 0.0));
    let wheels = command(&mut controller, EgoMotion::at_rest(0.1), None, Some(&person));
    assert!((0.5 * (wheels.left + wheels.right) - 0.7).abs() < 1e-9, "{wheels:?}");
}

/// Returns the speed before a wall, after a number of commands that the wheels have yet to execute.
fn speed_before_a_wall(pending: usize) -> f64 {
    let config = Config {
        latency_s: 0.5,
        max_acceleration: 1e3,
        max_deceleration: 1e3,
        ..Config::default()
    };
    let mut controller = ClearFollow::new(config).unwrap();
    let person = target(4.5, 0.0, Vector2::zeros());
    let still = EgoMotion::at_rest(0.1);
    for _ in 0..pending {
        command(&mut controller, still, None, Some(&person));
    }
    let wall = DepthImage::filled(40, 30, 1.3);
    let wheels = command(&mut controller, still, Some(wall), Some(&person));
    0.5 * (wheels.left + wheels.right)
}

/// Half a second at 0.9 m/s brings the robot 0.45 m nearer before a new command acts.
#[test]
fn obstacles_are_where_the_wheels_will_find_them() {
    let at_rest = speed_before_a_wall(0);
    let driving = speed_before_a_wall(5);
    assert!(driving < at_rest - 0.1, "{driving} {at_rest}");
}

/// 60 degrees to the side, the speed is a quarter.
#[test]
fn it_drives_the_more_slowly_the_more_it_has_to_turn() {
    let config = Config { max_acceleration: 1e3, ..prompt() };
    let mut controller = ClearFollow::new(config).unwrap();
    let bearing = 60_f64.to_radians();
    let person = target(2.0 * bearing.cos(), 2.0 * bearing.sin(), Vector2::zeros());
    let wheels = command(&mut controller, EgoMotion::at_rest(0.1), None, Some(&person));
    assert!((0.5 * (wheels.left + wheels.right) - 0.6 * 0.25).abs() < 1e-9, "{wheels:?}");
}

/// The person is straight ahead, so that all of the turn is the detour around the post.
#[test]
fn a_detour_keeps_its_curvature_while_the_robot_speeds_up() {
    let person = target(4.0, 0.0, Vector2::zeros());
    let [at_once, slowly] = [1e3, 0.5].map(|max_acceleration| {
        let config = Config { max_acceleration, ..prompt() };
        let mut controller = ClearFollow::new(config).unwrap();
        let still = EgoMotion::at_rest(0.1);
        let wheels = command(&mut controller, still, Some(post_ahead()), Some(&person));
        let speed = wheels.left + wheels.right;
        let turn = wheels.right - wheels.left;
        (0.5 * speed, turn / (2.0 * WHEELS.half_separation_m))
    });
    // The post is to the left of the middle.
    assert!(at_once.0 > 0.2 && at_once.1 < -0.2, "{at_once:?}");
    assert!((slowly.0 - 0.05).abs() < 1e-9, "{slowly:?}");
    assert!((slowly.1 / slowly.0 - at_once.1 / at_once.0).abs() < 1e-6, "{slowly:?} {at_once:?}");
}

#[test]
fn somebody_unseen_is_followed_ever_more_slowly_and_then_no_more() {
    fn speed(unseen_s: f64) -> f64 {
        let mut controller = ClearFollow::new(prompt()).unwrap();
        let person = target(4.0, 0.0, Vector2::zeros()).with_seen(false).with_unseen_s(unseen_s);
        let still = EgoMotion::at_rest(0.1);
        let steps = (0..30).map(|_| command(&mut controller, still, None, Some(&person)).left);
        steps.last().unwrap()
    }

    assert!((speed(0.5) - 0.9).abs() < 1e-9 && (speed(0.75) - 0.45).abs() < 1e-9);
    for unseen_s in [1.0, 30.0, f64::NAN] {
        assert_eq!(speed(unseen_s), 0.0);
    }
    let patient = Config { max_unseen_s: 2.0, max_acceleration: 1e3, ..prompt() };
    let mut controller = ClearFollow::new(patient).unwrap();
    let person = target(4.0, 0.0, Vector2::zeros()).with_seen(false).with_unseen_s(1.5);
    let wheels = command(&mut controller, EgoMotion::at_rest(0.1), None, Some(&person));
    assert!((wheels.left - 0.45).abs() < 1e-9, "three quarters of the time");
}

#[test]
fn the_person_is_no_obstacle_and_others_are() {
    let person = target(1.6, 0.0, Vector2::new(0.8, 0.0));
    let mut other = target(0.9, 0.1, Vector2::zeros());
    other.id = tagalong_core::TrackId(2);
    let body = DepthImage::from_fn(40, 30, |x, _| if (17..23).contains(&x) { 1.5 } else { 6.0 });
    let cases = [(None, None), (Some(body), None), (None, Some(other))];
    let [free, with_body, with_other] = cases.map(|(depth, other)| {
        let mut controller = ClearFollow::new(prompt()).unwrap();
        let images = Images { depth: depth.map(Arc::new), ..Images::default() };
        let tracks: Vec<Track> = other.into_iter().chain([person.clone()]).collect();
        let frame = Frame::new(1, Stamp::default(), camera(), EgoMotion::at_rest(0.1), images);
        let scene = Scene::new(&frame, &tracks, WHEELS, MAX_MPS).with_target(Some(&person));
        (0..30).map(|_| controller.command(&scene)).last().unwrap()
    });
    assert_eq!(with_body, free);
    assert_ne!(with_other, free);
}

#[test]
fn what_a_turn_has_moved_out_of_the_image_is_remembered_for_a_while() {
    fn after(seconds: f64) -> bool {
        let mut controller = ClearFollow::new(prompt()).unwrap();
        let person = target(4.0, 0.0, Vector2::zeros());
        let still = EgoMotion::at_rest(0.1);
        command(&mut controller, still, Some(post_ahead()), Some(&person));
        let steps = (0..(seconds / 0.1) as u32)
            .map(|_| command(&mut controller, still, None, Some(&person)));
        let wheels = steps.last().unwrap();
        (wheels.left - wheels.right).abs() > 0.05
    }

    assert!(after(4.0) && !after(8.0));
}

#[test]
fn a_drive_that_cannot_be_is_not_steered() {
    let person = target(3.0, 0.5, Vector2::zeros());
    let frame =
        Frame::new(1, Stamp::default(), camera(), EgoMotion::at_rest(0.1), Images::default());
    let odd = [0.0, -0.1, f64::NAN, f64::INFINITY, f64::MAX];
    let odd = odd.into_iter().flat_map(|odd| [(odd, 0.9, false), (0.167, odd, false)]);
    for (half_separation_m, max_speed_mps, drives) in [(0.167, 0.9, true)].into_iter().chain(odd) {
        let wheels = DiffDrive { half_separation_m, slip: 0.0 };
        let mut controller = ClearFollow::new(prompt()).unwrap();
        let scene = Scene::new(&frame, &[], wheels, max_speed_mps).with_target(Some(&person));
        let twist = controller.command(&scene);
        assert_eq!(twist != Twist::STOP, drives, "{half_separation_m} {max_speed_mps}");
    }
}

#[test]
fn wrong_settings_are_refused_by_name() {
    for (config, key) in [
        (Config { horizon_s: f64::NAN, ..Config::default() }, "horizon_s"),
        (Config { heights_m: [1.0, 0.5], ..Config::default() }, "heights_m"),
        (Config { radius_m: 0.0, ..Config::default() }, "radius_m"),
    ] {
        let error = ClearFollow::new(config).err().unwrap().to_string();
        assert!(error.contains(key), "{error}");
    }
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -5.0..5.0_f64,
        1 => proptest::num::f64::ANY,
        1 => Just(0.0),
        1 => Just(f64::INFINITY),
    ]
}

fn any_target() -> impl Strategy<Value = Track> {
    let velocity = (any_number(), any_number());
    (any_number(), any_number(), velocity, any_number()).prop_map(|(x, y, (vx, vy), unseen_s)| {
        target(x, y, Vector2::new(vx, vy)).with_unseen_s(unseen_s)
    })
}

fn any_motion() -> impl Strategy<Value = EgoMotion> {
    (any_number(), any_number(), any_number(), any_number()).prop_map(
        |(dt, forward, left, turn)| EgoMotion { forward, left, turn, ..EgoMotion::at_rest(dt) },
    )
}

/// A million states in release, fewer where the compiler helps less.
const CASES: u32 = if cfg!(debug_assertions) { 2_000 } else { 50_000 };

proptest! {
    #![proptest_config(ProptestConfig { cases: CASES, ..ProptestConfig::default() })]

    #[test]
    fn commands_are_finite_and_limited_and_zero_without_a_target(
        steps in prop::collection::vec((any_motion(), prop::option::weighted(0.9, any_target())), 20)
    ) {
        let mut controller = ClearFollow::new(Config::default()).unwrap();
        for (motion, target) in steps {
            let WheelSpeeds { left, right } = command(&mut controller, motion, None, target.as_ref());
            prop_assert!(left.abs() <= MAX_MPS + 1e-9 && right.abs() <= MAX_MPS + 1e-9, "{left} {right}");
            if target.is_none() {
                prop_assert_eq!((left, right), (0.0, 0.0));
            }
        }
    }

    #[test]
    fn mirrored_input_gives_mirrored_wheels(
        x in -3.0..4.0f64, y in 0.01..3.0f64, vx in -1.0..1.0f64, vy in -1.0..1.0f64
    ) {
        let mut one = ClearFollow::new(Config::default()).unwrap();
        let mut other = ClearFollow::new(Config::default()).unwrap();
        for _ in 0..5 {
            let still = EgoMotion::at_rest(0.1);
            let a = command(&mut one, still, None, Some(&target(x, y, Vector2::new(vx, vy))));
            let b = command(&mut other, still, None, Some(&target(x, -y, Vector2::new(vx, -vy))));
            prop_assert!((a.left - b.right).abs() < 1e-9 && (a.right - b.left).abs() < 1e-9, "{a:?} {b:?}");
        }
    }
}
