//! The statements of the README about the controller.

use std::sync::Arc;

use nalgebra::{Isometry2, Isometry3, Point2, Point3, Vector2};
use tagalong_conformance::samples::track_at;
use tagalong_core::{
    Controller, DiffDrive, EgoMotion, Frame, Images, LaserScan, Scene, Stamp, Track, WheelSpeeds,
};
use tagalong_geometry::Camera;

use super::{Config, ForeseeFollow, Side};

const WHEELS: DiffDrive = DiffDrive { half_separation_m: 0.167, slip: 0.0 };
const MAX_MPS: f64 = 0.9;
const DT_S: f64 = 0.1;
/// Radius of a person, m.
const BODY_M: f64 = 0.25;

/// World in which people walk by the time.
#[derive(Clone)]
struct World {
    person: fn(f64) -> Point2<f64>,
    others: Vec<fn(f64) -> Point2<f64>>,
    things: Vec<Point2<f64>>,
    start: Isometry2<f64>,
}

/// The robot at one time of a ride.
#[derive(Clone, Copy, Debug)]
struct Moment {
    pose: Isometry2<f64>,
    /// The person in the axes of the robot, m.
    seen: Point2<f64>,
    /// Distances from the outline of the robot, m.
    to_things_m: f64,
    to_others_m: f64,
}

fn empty(person: fn(f64) -> Point2<f64>) -> World {
    World { person, others: Vec::new(), things: Vec::new(), start: Isometry2::identity() }
}

fn config(side: Side, stand_off_m: f64) -> Config {
    Config { side, stand_off_m, latency_s: 0.0, max_acceleration: 0.8, ..Config::default() }
}

fn track(id: u32, pose: &Isometry2<f64>, walk: fn(f64) -> Point2<f64>, now_s: f64) -> Track {
    let at = pose.inverse_transform_point(&walk(now_s));
    let velocity = pose.inverse_transform_vector(&((walk(now_s + 0.01) - walk(now_s)) / 0.01));
    let mut track = track_at(id, at.x, at.y);
    track.estimate.person.velocity = velocity;
    track.estimate.covariance = nalgebra::SMatrix::identity() * 0.01;
    track
}

fn ride(config: &Config, world: &World, seconds: f64) -> Vec<Moment> {
    let camera = Arc::new(Camera::blind(Isometry3::identity()));
    let mut controller = ForeseeFollow::new(config.clone()).unwrap();
    let mut pose = world.start;
    let mut motion = EgoMotion::at_rest(DT_S);
    let mut moments = Vec::new();
    for step in 0..(seconds / DT_S) as u32 {
        let now_s = f64::from(step) * DT_S;
        let mut tracks = vec![track(1, &pose, world.person, now_s)];
        for (number, other) in (2..).zip(&world.others) {
            tracks.push(track(number, &pose, *other, now_s));
        }
        let points: Vec<Point3<f64>> = world
            .things
            .iter()
            .map(|thing| pose.inverse_transform_point(thing))
            .map(|at| Point3::new(at.x, at.y, 0.3))
            .collect();
        let frame = Frame::new(1, Stamp::default(), Arc::clone(&camera), motion, Images::default())
            .with_laser(Some(LaserScan::of_points(points)));
        let scene = Scene::new(&frame, &tracks, WHEELS, MAX_MPS).with_target(Some(&tracks[0]));
        let twist = controller.command(&scene);
        let WheelSpeeds { left, right } = WHEELS.wheels_within(twist, MAX_MPS);
        motion = EgoMotion::from_wheels(left, right, &WHEELS, DT_S);
        let here = Point2::from(pose.translation.vector);
        let others = world.others.iter().map(|other| other(now_s));
        moments.push(Moment {
            pose,
            seen: tracks[0].estimate.person.position.xy(),
            to_things_m: nearest_m(here, world.things.iter().copied()) - config.radius_m,
            to_others_m: nearest_m(here, others) - config.radius_m - BODY_M,
        });
        pose *= motion.isometry();
    }
    moments
}

fn nearest_m(from: Point2<f64>, places: impl Iterator<Item = Point2<f64>>) -> f64 {
    places.map(|at| (at - from).norm()).fold(f64::INFINITY, f64::min)
}

/// Returns the distance of the robot from its place beside a person that walks along X, m.
fn off_m(moment: &Moment, angle_deg: f64, stand_off_m: f64) -> f64 {
    let person = moment.pose * moment.seen;
    let angle = angle_deg.to_radians();
    let place = person + stand_off_m * Vector2::new(angle.cos(), angle.sin());
    (place.coords - moment.pose.translation.vector).norm()
}

fn least(moments: &[Moment], value: fn(&Moment) -> f64) -> f64 {
    moments.iter().map(value).fold(f64::INFINITY, f64::min)
}

fn straight(now_s: f64) -> Point2<f64> {
    Point2::new(2.0 + 0.6 * now_s, 0.0)
}

#[test]
fn it_keeps_the_distance_behind_a_person_and_faces_them() {
    let moments = ride(&config(Side::Behind, 1.4), &empty(straight), 20.0);
    let seen = moments.last().unwrap().seen;
    assert!((seen.coords.norm() - 1.4).abs() < 0.15 && seen.y.abs() < 0.05, "{seen}");
    fn around(now_s: f64) -> Point2<f64> {
        Point2::new(1.4 * (0.4 * now_s).cos(), 1.4 * (0.4 * now_s).sin())
    }
    let seen = ride(&config(Side::Behind, 1.4), &empty(around), 12.0).last().unwrap().seen;
    assert!(seen.y.atan2(seen.x).abs() < 0.2, "{seen}");
}

#[test]
fn it_goes_at_each_side_of_a_person_who_walks() {
    for (side, angle_deg, stand_off_m) in
        [(Side::Left, 90.0, 1.0), (Side::Right, -90.0, 1.0), (Side::Ahead, 0.0, 1.6)]
    {
        let moments = ride(&config(side, stand_off_m), &empty(straight), 30.0);
        let off_m = off_m(moments.last().unwrap(), angle_deg, stand_off_m);
        assert!(off_m < 0.2, "{side:?}: {off_m} m");
        let nearest = least(&moments, |moment| moment.seen.coords.norm());
        assert!(nearest > 0.75, "{side:?}: {nearest} m from the person");
    }
    let angle = Config { angle_deg: Some(135.0), ..config(Side::Behind, 1.2) };
    let off_m = off_m(ride(&angle, &empty(straight), 30.0).last().unwrap(), 135.0, 1.2);
    assert!(off_m < 0.2, "{off_m} m");
}

#[test]
fn the_right_side_is_the_left_side_in_a_mirror() {
    fn drifts(now_s: f64) -> Point2<f64> {
        Point2::new(2.0 + 0.5 * now_s, 0.4 + 0.1 * now_s)
    }

    fn drifts_back(now_s: f64) -> Point2<f64> {
        Point2::new(drifts(now_s).x, -drifts(now_s).y)
    }

    let left = ride(&config(Side::Left, 1.0), &empty(drifts), 8.0);
    let right = ride(&config(Side::Right, 1.0), &empty(drifts_back), 8.0);
    for (left, right) in left.iter().zip(&right) {
        let off = (left.seen.x - right.seen.x).abs() + (left.seen.y + right.seen.y).abs();
        assert!(off < 1e-9, "{left:?} {right:?}");
    }
}

/// Walls along X at both sides of a gap of this width, m, around Y = 0, for X from `from` to `to`.
fn gap(width_m: f64, from: f64, to: f64) -> Vec<Point2<f64>> {
    let mut things = Vec::new();
    let mut x = from;
    while x <= to {
        for side in [-1.0, 1.0] {
            let mut y = 0.5 * width_m;
            while y < 3.0 {
                things.push(Point2::new(x, side * y));
                y += 0.1;
            }
        }
        x += 0.1;
    }
    things
}

#[test]
fn before_a_narrow_door_it_steps_back_in_line() {
    for side in [Side::Left, Side::Right] {
        let world = World { things: gap(1.0, 7.0, 7.2), ..empty(straight) };
        let moments = ride(&config(side, 1.0), &world, 40.0);
        let to_things_m = least(&moments, |moment| moment.to_things_m);
        let to_person_m = least(&moments, |moment| moment.seen.coords.norm());
        assert!(to_things_m > 0.05, "{side:?}: {to_things_m} m");
        assert!(to_person_m > 0.6, "{side:?}: {to_person_m} m");
        let angle_deg = if side == Side::Left { 90.0 } else { -90.0 };
        let off_m = off_m(moments.last().unwrap(), angle_deg, 1.0);
        assert!(off_m < 0.3, "{side:?}: beside the person again, not {off_m} m off");
    }
}

#[test]
fn round_a_corner_it_stays_clear_of_the_wall() {
    fn turns(now_s: f64) -> Point2<f64> {
        let along = 0.6 * now_s;
        if along < 5.0 { Point2::new(2.0 + along, 0.0) } else { Point2::new(7.0, along - 5.0) }
    }

    // The inside of the corner.
    let mut things = Vec::new();
    for i in 0..60 {
        things.push(Point2::new(6.2 - 0.1 * f64::from(i), 0.8));
        things.push(Point2::new(6.2, 0.8 + 0.1 * f64::from(i)));
    }
    for (side, stand_off_m) in [(Side::Behind, 1.4), (Side::Left, 1.0), (Side::Right, 1.0)] {
        let world = World { things: things.clone(), ..empty(turns) };
        let moments = ride(&config(side, stand_off_m), &world, 18.0);
        let to_things_m = least(&moments, |moment| moment.to_things_m);
        let range_m = moments.last().unwrap().seen.coords.norm();
        assert!(to_things_m > 0.05 && range_m < 2.0, "{side:?}: {to_things_m} m, {range_m} m");
    }
}

#[test]
fn it_gives_way_to_people_who_cross() {
    fn crosses(now_s: f64) -> Point2<f64> {
        Point2::new(5.0, -6.0 + 1.0 * now_s)
    }

    let moments =
        ride(&config(Side::Behind, 1.4), &World { others: vec![crosses], ..empty(straight) }, 20.0);
    let to_others_m = least(&moments, |moment| moment.to_others_m);
    assert!(to_others_m > 0.3, "{to_others_m} m");
    let range_m = moments.last().unwrap().seen.coords.norm();
    assert!((range_m - 1.4).abs() < 0.3, "caught up with: {range_m} m");
}

#[test]
fn a_person_who_stops_keeps_the_robot_where_it_is() {
    fn stops(now_s: f64) -> Point2<f64> {
        straight(now_s.min(8.0))
    }

    for side in [Side::Behind, Side::Left, Side::Ahead] {
        let moments = ride(&config(side, 1.4), &empty(stops), 30.0);
        let [before, last] = [moments[moments.len() - 50].pose, moments.last().unwrap().pose];
        let moved = (before.inverse() * last).translation.vector.norm();
        assert!(moved < 0.02, "{side:?}: {moved} m");
        let turned = (before.inverse() * last).rotation.angle().abs();
        assert!(turned < 0.05, "{side:?}: {turned} rad");
    }
}

#[test]
fn the_same_ride_twice_is_the_same() {
    let world = World { things: gap(1.2, 5.0, 5.2), ..empty(straight) };
    let rides = [(); 2].map(|()| ride(&config(Side::Left, 1.0), &world, 10.0));
    assert!(rides[0].iter().zip(&rides[1]).all(|(a, b)| a.pose == b.pose && a.seen == b.seen));
}

#[test]
fn settings_that_cannot_work_are_refused() {
    for (wrong, key) in [
        (Config { heights_m: [1.5, 0.1], ..Config::default() }, "heights_m"),
        (Config { angle_deg: Some(270.0), ..Config::default() }, "angle_deg"),
        (Config { horizon_s: 0.0, ..Config::default() }, "horizon_s"),
        (Config { people_m: f64::NAN, ..Config::default() }, "people_m"),
    ] {
        let error = ForeseeFollow::new(wrong).unwrap_err().to_string();
        assert!(error.contains(key), "{error}");
    }
    assert_eq!(ForeseeFollow::new(Config::default()).unwrap().stand_off_m(), Some(1.4));
}
