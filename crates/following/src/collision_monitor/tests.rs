use std::sync::Arc;

use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use tagalong_conformance::target;
use tagalong_core::{DepthImage, FurtherScans, Inputs, LaserScan, RgbImage};
use tagalong_core::{Images, ObstacleData, ObstacleReading, RangeReading, RayReading, Stamp};
use tagalong_geometry::{Camera, Distortion, Pinhole};

use super::*;

const BRAKING: Braking =
    Braking { reaction_s: 0.5, rise_s: 0.1, decel: 1.0, between_s: 0.0, settle_s: 0.0 };
const TURN: Braking =
    Braking { reaction_s: 0.5, rise_s: 0.05, decel: 4.0, between_s: 0.0, settle_s: 0.0 };
const AHEAD: Path = Path::Arc { curvature: 0.0, backwards: false };

/// A camera 1 m high with a field of view of 90 by 67 degrees.
fn camera() -> Camera {
    let lens = Pinhole { fx: 80.0, fy: 80.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
    Camera::mounted(lens, 160, 120, 1.0, 0.0, 0.0)
}

/// Noise of a few millimetres, another one in each frame.
fn noise(frame: usize, place: usize) -> f32 {
    ((frame * 7919 + place * 104_729) % 997) as f32 * 5e-6
}

/// A room: a wall all around at 4 m from its middle, in which the robot stands at `x`, turned by `turn`.
fn depth_at(frame: usize, x: f64, turn: f64) -> DepthImage {
    let camera = camera();
    DepthImage::from_fn(160, 120, |u, v| {
        let ray = camera.back_project(Point2::new(u as f64, v as f64), 1.0);
        let falls = 1.0 - ray.z;
        let angle = turn + ray.y.atan2(ray.x);
        let length = ray.xy().coords.norm();
        let wall = wall_m(x, angle) / length;
        let floor = if falls > 0.0 { 1.0 / falls } else { f64::INFINITY };
        wall.min(floor) as f32 + noise(frame, 160 * v + u)
    })
}

/// Returns the distance from (x, 0) to a square wall of half side 4 m in a direction.
fn wall_m(x: f64, angle: f64) -> f64 {
    fn along(from: f64, step: f64) -> f64 {
        if step > 0.0 { (4.0 - from) / step } else { (-4.0 - from) / step }
    }

    along(x, angle.cos()).min(along(0.0, angle.sin()))
}

fn frame(
    index: usize,
    motion: EgoMotion,
    depth: Option<DepthImage>,
    scan: Option<LaserScan>,
) -> Frame {
    let images = Images { depth: depth.map(Arc::new), ..Images::default() };
    let stamp = Stamp::default().plus_seconds(index as f64 * 0.1);
    Frame::new(index as u64, stamp, Arc::new(camera()), motion, images).with_laser(scan)
}

/// A scan in the same room, with other ranges where `instead` says so by the angle in degrees.
fn scan_at(frame: usize, x: f64, turn: f64, instead: impl Fn(i32) -> Option<f64>) -> LaserScan {
    let ranges = (-180..180).map(|deg: i32| {
        let angle = f64::from(deg).to_radians();
        let noise = f64::from(noise(frame, (deg + 180) as usize));
        instead(deg).unwrap_or_else(|| wall_m(x, angle + turn) + noise)
    });
    scan_of(Isometry3::translation(0.0, 0.0, 0.2), ranges)
}

/// A scan of these ranges, m, one for each degree from behind the robot on.
fn scan_of(mount: Isometry3<f64>, ranges: impl IntoIterator<Item = f64>) -> LaserScan {
    LaserScan::of_ranges(mount, -std::f64::consts::PI, 1.0_f64.to_radians(), [0.1, 8.0], ranges)
}

fn monitor_of(settings: CollisionMonitorSettings) -> CollisionMonitor {
    CollisionMonitor::new(settings, &RobotSettings::default())
}

fn monitor() -> CollisionMonitor {
    monitor_of(CollisionMonitorSettings::default())
}

/// A monitor that has seen the room for two seconds by depth.
fn settled() -> CollisionMonitor {
    let mut monitor = monitor();
    for index in 0..20 {
        let frame = frame(index, EgoMotion::at_rest(0.1), Some(depth_at(index, 0.0, 0.0)), None);
        monitor.update(&frame, &frame.motion, &[], None);
    }
    monitor
}

fn speed(monitor: &CollisionMonitor) -> f64 {
    monitor.allowance(AHEAD, 0.9, &BRAKING).most
}

#[test]
fn a_room_that_is_seen_is_free() {
    let monitor = settled();
    assert_eq!(monitor.stop_reason(0.5), None);
    assert_eq!(monitor.allowance(AHEAD, 0.9, &BRAKING), Allowance::FREE);
    assert_eq!(monitor.allowance(Path::Turn { left: true }, 1.0, &TURN), Allowance::FREE);
}

#[test]
fn the_same_depth_image_again_is_frozen_and_a_noisy_one_is_not() {
    let mut monitor = settled();
    let same = depth_at(20, 0.0, 0.0);
    let mut reasons = Vec::new();
    for index in 20..28 {
        let frame = frame(index, EgoMotion::at_rest(0.1), Some(same.clone()), None);
        monitor.update(&frame, &frame.motion, &[], None);
        reasons.push(monitor.stop_reason(0.5));
    }
    assert_eq!(reasons[3], None);
    assert!(reasons[4..].iter().all(|reason| *reason == Some(Reason::Frozen)), "{reasons:?}");
    assert_eq!(monitor.frozen_sensor(), Some(("the depth image".into(), false)));
    assert!(monitor.shows_past());
    let frame = frame(29, EgoMotion::at_rest(0.1), Some(depth_at(29, 0.0, 0.0)), None);
    monitor.update(&frame, &frame.motion, &[], None);
    assert_eq!(monitor.stop_reason(0.5), None, "it goes on");
    assert_eq!((monitor.frozen_sensor(), monitor.shows_past()), (None, false));
}

/// The stop of a camera that contradicted the odometry lasts, and its images do not show the past for ever.
#[test]
fn images_that_are_new_again_show_the_present_while_the_stop_lasts() {
    let mut monitor = settled();
    let same = depth_at(20, 0.0, 0.0);
    let moving = EgoMotion { forward: 0.1, ..EgoMotion::at_rest(0.1) };
    for index in 20..30 {
        let frame = frame(index, moving, Some(same.clone()), None);
        monitor.update(&frame, &frame.motion, &[], None);
    }
    let frozen = Some(("the depth image".to_owned(), true));
    assert_eq!((monitor.frozen_sensor(), monitor.shows_past()), (frozen.clone(), true));
    for index in 30..33 {
        let depth = depth_at(index, 1.0, 0.0);
        let frame = frame(index, EgoMotion::at_rest(0.1), Some(depth), None);
        monitor.update(&frame, &frame.motion, &[], None);
        assert_eq!((monitor.frozen_sensor(), monitor.shows_past()), (frozen.clone(), false));
    }
}

#[test]
fn a_sensor_that_needs_a_reset_is_named_before_one_that_repeats_itself() {
    let mut monitor = monitor();
    let mut named = Vec::new();
    for index in 0..30 {
        let steps = index.min(20) as f64;
        let forward = if index <= 20 { 0.05 } else { 0.0 };
        let motion = EgoMotion { forward, ..EgoMotion::at_rest(0.1) };
        // The scan stays the same but for its noise; the depth image repeats itself at the end.
        let depth = depth_at(index.min(20), 0.05 * steps, 0.0);
        let scan = scan_at(index, 0.0, 0.0, |_| None);
        let frame = frame(index, motion, Some(depth), Some(scan));
        monitor.update(&frame, &motion, &[], None);
        named.push(monitor.frozen_sensor());
    }
    let laser = Some(("the laser scanner".to_owned(), true));
    assert_eq!((&named[20], &named[29]), (&laser, &laser));
}

#[test]
fn a_simulator_without_noise_may_say_so() {
    let settings =
        CollisionMonitorSettings { noiseless: true, ..CollisionMonitorSettings::default() };
    let mut monitor = monitor_of(settings);
    for index in 0..20 {
        let frame = frame(index, EgoMotion::at_rest(0.1), Some(depth_at(0, 0.0, 0.0)), None);
        monitor.update(&frame, &frame.motion, &[], None);
    }
    assert_eq!(monitor.stop_reason(0.5), None);
}

/// Pictures with noise that stay the same while the odometry says that the robot drives or turns, and
/// pictures that change as it says.
#[test]
fn a_picture_that_does_not_change_as_the_odometry_says_is_frozen() {
    for (forward, turn) in [(0.05, 0.0), (0.0, 0.06)] {
        for is_frozen in [true, false] {
            for by_laser in [true, false] {
                let mut monitor = monitor();
                let mut last = None;
                for index in 0..20 {
                    let steps = index as f64;
                    let motion = EgoMotion { forward, turn, ..EgoMotion::at_rest(0.1) };
                    let part = if is_frozen { 0.0 } else { steps };
                    let x = forward * part;
                    let angle = turn * part;
                    let frame = if by_laser {
                        frame(index, motion, None, Some(scan_at(index, x, angle, |_| None)))
                    } else {
                        frame(index, motion, Some(depth_at(index, x, angle)), None)
                    };
                    monitor.update(&frame, &motion, &[], None);
                    last = monitor.stop_reason(0.5);
                }
                let expected = is_frozen.then_some(Reason::Frozen);
                assert_eq!(last, expected, "{forward} {turn} laser {by_laser}");
                let name = if by_laser { "the laser scanner" } else { "the depth image" };
                let sensor = is_frozen.then(|| (name.to_owned(), true));
                assert_eq!(monitor.frozen_sensor(), sensor, "{forward} {turn}");
            }
        }
    }
}

/// Along a straight wall, with nothing else in range, a picture does not change: no contradiction.
#[test]
fn a_floor_and_the_followed_person_do_not_change_and_are_no_contradiction() {
    let mut monitor = monitor();
    let camera = camera();
    for index in 0..20 {
        let depth = DepthImage::from_fn(160, 120, |u, v| {
            let ray = camera.back_project(Point2::new(u as f64, v as f64), 1.0);
            let floor = if ray.z < 1.0 { 1.0 / (1.0 - ray.z) } else { f64::INFINITY };
            // A person at 2 m.
            let person = if (ray.y * 2.0).abs() < 0.25 { 2.0 } else { 7.0 };
            if floor.min(person) >= 7.0 {
                f32::NAN
            } else {
                floor.min(person) as f32 + noise(index, 160 * v + u)
            }
        });
        let motion = EgoMotion { forward: 0.05, ..EgoMotion::at_rest(0.1) };
        let frame = frame(index, motion, Some(depth), None);
        let track = target(2.0, 0.0, Vector2::new(0.5, 0.0));
        monitor.update(&frame, &motion, std::slice::from_ref(&track), Some(track.id));
    }
    assert_eq!(monitor.stop_reason(0.5), None);
}

#[test]
fn depth_in_few_columns_stops_and_in_half_of_them_slows() {
    fn share(is_lit: fn(usize) -> bool) -> (Allowance, f64) {
        let mut monitor = settled();
        let seen = depth_at(20, 0.0, 0.0);
        let depth =
            DepthImage::from_fn(160, 120, |u, v| if is_lit(u) { seen.row(v)[u] } else { f32::NAN });
        let frame = frame(20, EgoMotion::at_rest(0.1), Some(depth), None);
        monitor.update(&frame, &frame.motion, &[], None);
        // By the share alone: an object that hides columns would stop the robot, too.
        (monitor.by_coverage(AHEAD, 0.9, &BRAKING), speed(&monitor))
    }

    let (few, speed_mps) = share(|u| u % 8 == 0);
    assert_eq!((few.most, few.stops, speed_mps), (0.0, Reason::Unknown, 0.0));
    let (half, _) = share(|u| u % 2 == 0);
    assert!(half.most > 0.1 && half.most < 0.8, "{half:?}");
    assert_eq!(half.slower, Reason::Unclear);
    assert_eq!(share(|_| true), (Allowance::FREE, f64::INFINITY));
}

#[test]
fn columns_that_were_dark_from_the_start_are_unknown_but_for_the_border() {
    fn share(dark: fn(usize) -> bool) -> f64 {
        let mut monitor = monitor();
        for index in 0..20 {
            let seen = depth_at(index, 0.0, 0.0);
            let depth =
                DepthImage::from_fn(
                    160,
                    120,
                    |u, v| if dark(u) { f32::NAN } else { seen.row(v)[u] },
                );
            let frame = frame(index, EgoMotion::at_rest(0.1), Some(depth), None);
            monitor.update(&frame, &frame.motion, &[], None);
        }
        speed(&monitor)
    }

    assert_eq!(share(|u| u % 8 != 0), 0.0);
    assert_eq!(share(|u| !(15..145).contains(&u)), f64::INFINITY, "an empty border");
}

#[test]
fn without_any_reading_nothing_moves_not_even_in_place() {
    for nothing in [f32::NAN, 0.0, 65.535] {
        let mut monitor = settled();
        let depth = DepthImage::from_fn(160, 120, |_, _| nothing);
        let frame = frame(20, EgoMotion::at_rest(0.1), Some(depth), None);
        monitor.update(&frame, &frame.motion, &[], None);
        assert_eq!(monitor.stop_reason(0.5), Some(Reason::Blind), "{nothing}");
    }
}

#[test]
fn rays_that_say_nothing_ahead_stop_the_robot() {
    for instead in [0.0, f64::NAN, f64::INFINITY] {
        let mut monitor = monitor();
        for index in 0..20 {
            let frame = frame(
                index,
                EgoMotion::at_rest(0.1),
                None,
                Some(scan_at(index, 0.0, 0.0, |deg| (deg.abs() < 30).then_some(instead))),
            );
            monitor.update(&frame, &frame.motion, &[], None);
        }
        let allowed = monitor.allowance(AHEAD, 0.9, &BRAKING);
        assert_eq!((allowed.most, allowed.stops), (0.0, Reason::Unknown), "{instead}");
    }
}

/// Returns the largest speed ahead after two seconds of such scans, each moved by a trifle as noise
/// does, without another sensor.
fn speed_by(scan: &LaserScan) -> f64 {
    let mut monitor = monitor();
    for index in 0..20 {
        let off = Vector3::new(1e-4 * (index % 3) as f64, 0.0, 0.0);
        let points: Vec<Point3<f64>> = scan.points.iter().map(|at| at + off).collect();
        let scan = LaserScan::of_points(points).with_scanner(scan.robot_from_scanner).with_rays(
            scan.first_rad,
            scan.increment_rad,
            scan.rays.to_vec(),
        );
        let frame = frame(index, EgoMotion::at_rest(0.1), None, Some(scan));
        monitor.update(&frame, &frame.motion, &[], None);
    }
    assert_eq!(monitor.stop_reason(0.5), None);
    speed(&monitor)
}

/// Its rays run along the floor and not into it: also at the origin of the robot, as points of two
/// coordinates are and a scanner that is not in tf.
#[test]
fn a_scanner_that_is_as_low_as_the_floor_is_rough_sees_obstacles() {
    fn scan_at_height(height_m: f64, nods_rad: f64) -> LaserScan {
        let ranges = (-180..180).map(|deg: i32| if deg.abs() < 20 { 0.5 } else { 3.0 });
        scan_of(nodding(height_m, nods_rad), ranges)
    }

    for height_m in [-0.1, 0.0, 0.04, 0.08, 0.2] {
        for nods_rad in [0.0, 0.02] {
            let speed_mps = speed_by(&scan_at_height(height_m, nods_rad));
            assert_eq!(speed_mps, 0.0, "{height_m} m above the floor, {nods_rad} rad");
        }
    }
    let flat = scan_at_height(0.0, 0.0).points.to_vec();
    assert_eq!(speed_by(&LaserScan::of_points(flat)), 0.0);
}

/// The mount of a scanner above the middle of the robot that looks down by an angle.
fn nodding(height_m: f64, nods_rad: f64) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(0.0, 0.0, height_m), Vector3::new(0.0, nods_rad, 0.0))
}

#[test]
fn a_scanner_that_looks_down_and_one_of_several_layers_meet_the_floor() {
    let ranges = (-180..180).map(|deg: i32| {
        let ahead = f64::from(deg).to_radians().cos();
        if deg.abs() < 70 { 0.4 / (0.35_f64.sin() * ahead) } else { 3.0 }
    });
    assert_eq!(speed_by(&scan_of(nodding(0.4, 0.35), ranges)), Allowance::FREE.most);
    let mut points = Vec::new();
    for deg in -180..180 {
        let angle = f64::from(deg).to_radians();
        points.push(Point3::new(0.6 * angle.cos(), 0.6 * angle.sin(), 0.01));
        points.push(Point3::new(3.0 * angle.cos(), 3.0 * angle.sin(), 0.4));
    }
    assert_eq!(speed_by(&LaserScan::of_points(points)), Allowance::FREE.most);
}

/// A program that leaves out the rays without a reflection gives a scan without any.
#[test]
fn a_scan_without_any_ray_is_no_free_way() {
    fn allowed(no_return: NoReturn, has_depth: bool) -> Allowance {
        let default = CollisionMonitorSettings::default();
        let mut monitor = monitor_of(CollisionMonitorSettings { no_return, ..default });
        for index in 0..20 {
            let depth = has_depth.then(|| depth_at(index, 0.0, 0.0));
            let nothing = LaserScan::of_points(Vec::new());
            let frame = frame(index, EgoMotion::at_rest(0.1), depth, Some(nothing));
            monitor.update(&frame, &frame.motion, &[], None);
        }
        monitor.allowance(AHEAD, 0.9, &BRAKING)
    }

    let alone = allowed(NoReturn::Unknown, false);
    assert_eq!((alone.most, alone.stops), (0.0, Reason::Unknown));
    assert_eq!(allowed(NoReturn::Unknown, true), Allowance::FREE, "a camera sees there");
    assert_eq!(allowed(NoReturn::Free, false), Allowance::FREE, "in those words");
}

/// Between two scans the robot moves towards what the last one met; one ray may be dust, and what is
/// high above is passed below.
#[test]
fn what_a_scan_met_holds_until_the_next_one() {
    fn legs(deg: i32) -> Option<f64> {
        (deg.abs() <= 2).then_some(1.6)
    }

    fn dust(deg: i32) -> Option<f64> {
        (deg == 0).then_some(1.0)
    }

    let mut monitor = monitor();
    for index in 0..20 {
        let frame =
            frame(index, EgoMotion::at_rest(0.1), None, Some(scan_at(index, 0.0, 0.0, legs)));
        monitor.update(&frame, &frame.motion, &[], None);
    }
    let far = speed(&monitor);
    let on = EgoMotion { forward: 0.5, ..EgoMotion::at_rest(0.1) };
    let empty = frame(20, on, None, None);
    monitor.update(&empty, &on, &[], None);
    let near = speed(&monitor);
    assert!(near < 0.7 && far > 0.9, "{far} {near}");
    let mut dusty = self::monitor();
    for index in 0..20 {
        let frame =
            frame(index, EgoMotion::at_rest(0.1), None, Some(scan_at(index, 0.0, 0.0, dust)));
        dusty.update(&frame, &frame.motion, &[], None);
    }
    assert_eq!(speed(&dusty), f64::INFINITY);
}

#[test]
fn what_is_nearer_than_a_scanner_measures_is_there() {
    fn scan(index: usize) -> LaserScan {
        let LaserScan { points, rays, .. } = scan_at(index, 0.0, 0.0, |_| None);
        let ahead = scan_at(index, 0.0, 0.0, |deg: i32| (deg.abs() < 20).then_some(0.35));
        let unread = ahead.rays.iter().filter(|ray| (160..200).contains(*ray));
        let unread = unread
            .map(|ray| tagalong_core::UnreadRay { ray: *ray, reading: RayReading::TooNear(0.35) });
        let others: Vec<usize> =
            (0..rays.len()).filter(|at| !(160..200).contains(&rays[*at])).collect();
        let unread: Vec<_> = unread.collect();
        let points: Vec<_> = others.iter().map(|at| points[*at]).collect();
        let rays: Vec<_> = others.iter().map(|at| rays[*at]).collect();
        LaserScan::of_points(points)
            .with_scanner(ahead.robot_from_scanner)
            .with_rays(ahead.first_rad, ahead.increment_rad, rays)
            .with_unread(unread)
    }

    let mut monitor = monitor();
    for index in 0..20 {
        let frame = frame(index, EgoMotion::at_rest(0.1), None, Some(scan(index)));
        monitor.update(&frame, &frame.motion, &[], None);
    }
    assert_eq!(speed(&monitor), 0.0);
}

/// A thing a metre and a half beside the robot stands there since long, came a while ago, or has just
/// appeared.
#[test]
fn what_appears_in_a_free_place_needs_more_room_than_what_stands() {
    fn since(first: usize) -> Allowance {
        let mut monitor = monitor();
        for index in 0..24 {
            let scan = scan_at(index, 0.0, 0.0, |deg| {
                (index >= first && (80..100).contains(&deg)).then_some(1.2)
            });
            let frame = frame(index, EgoMotion::at_rest(0.1), None, Some(scan));
            monitor.update(&frame, &frame.motion, &[], None);
        }
        monitor.allowance(AHEAD, 0.9, &BRAKING)
    }

    assert_eq!(since(0), Allowance::FREE);
    let appeared = since(22);
    assert!(appeared.most < 0.3 && appeared.slower == Reason::Near, "{appeared:?}");
    // A person who came and stands may walk on.
    let parked = since(8);
    assert!(parked.most > appeared.most && parked.most < 0.9, "{parked:?}");
    assert_eq!(parked.slower, Reason::Near);
}

#[test]
fn a_person_is_kept_away_from_and_with_the_separation_off_is_a_thing() {
    fn near(separation: bool, closing: f64) -> f64 {
        let settings =
            CollisionMonitorSettings { separation, ..CollisionMonitorSettings::default() };
        let mut monitor = monitor_of(settings);
        let track = target(1.6, 0.9, Vector2::new(-closing, 0.0));
        for index in 0..20 {
            let frame =
                frame(index, EgoMotion::at_rest(0.1), Some(depth_at(index, 0.0, 0.0)), None);
            monitor.update(&frame, &frame.motion, std::slice::from_ref(&track), None);
        }
        speed(&monitor)
    }

    assert!(near(true, 1.2) < near(true, 0.0) && near(true, 0.0) < 0.9);
    assert_eq!(near(false, 1.2), f64::INFINITY);
}

/// The followed person is an obstacle at the last moment, also where they are only predicted.
#[test]
fn the_followed_person_is_not_run_over() {
    fn before(x: f64, unseen_s: f64) -> f64 {
        let mut monitor = monitor();
        let track = target(x, 0.0, Vector2::zeros()).with_unseen_s(unseen_s).with_seen(false);
        for index in 0..20 {
            let frame =
                frame(index, EgoMotion::at_rest(0.1), Some(depth_at(index, 0.0, 0.0)), None);
            monitor.update(&frame, &frame.motion, std::slice::from_ref(&track), Some(track.id));
        }
        speed(&monitor)
    }

    assert_eq!(before(2.4, 0.0), f64::INFINITY);
    for unseen_s in [0.0, 0.8, 2.5] {
        assert_eq!(before(0.7, unseen_s), 0.0, "{unseen_s}");
        let braking = before(1.2, unseen_s);
        assert!(braking > 0.0 && braking < 0.7, "{braking}");
    }
}

fn with_source(kind: SourceKind) -> CollisionMonitorSettings {
    let source = SourceSettings { name: "eye".into(), kind, ..SourceSettings::default() };
    CollisionMonitorSettings { sources: vec![source], ..CollisionMonitorSettings::default() }
}

/// Returns a reading of the source `eye` with a stamp.
fn reading(stamp: Stamp, data: ObstacleData) -> ObstacleReading {
    ObstacleReading::new("eye", stamp, 0.02, data)
}

/// Returns a monitor after two seconds with depth, and a source that delivers until frame `until`.
fn with_readings(
    kind: SourceKind,
    until: usize,
    data: impl Fn(usize) -> ObstacleData,
) -> CollisionMonitor {
    let mut monitor = monitor_of(with_source(kind));
    for index in 0..20 {
        let frame = frame(index, EgoMotion::at_rest(0.1), Some(depth_at(index, 0.0, 0.0)), None);
        let frame = if index < until {
            let reading = reading(frame.stamp, data(index));
            frame.with_sensor(ObstacleReadings(Arc::new([reading])))
        } else {
            frame
        };
        monitor.update(&frame, &frame.motion, &[], None);
    }
    monitor
}

fn sonar(range_m: f64) -> ObstacleData {
    ObstacleData::Range(RangeReading {
        robot_from_sensor: Isometry3::translation(0.2, 0.0, 0.3),
        field_of_view_rad: 0.5,
        min_m: 0.05,
        max_m: 3.0,
        range_m,
    })
}

#[test]
fn a_sonar_sees_what_depth_does_not() {
    fn most(range_m: f64) -> f64 {
        speed(&with_readings(SourceKind::Range, 20, |_| sonar(range_m)))
    }

    assert_eq!(most(f64::INFINITY), f64::INFINITY);
    assert!(most(0.9) < 0.7, "{}", most(0.9));
    assert_eq!(most(0.3), 0.0);
    assert_eq!(most(f64::NEG_INFINITY), 0.0, "nearer than it measures");
    assert_eq!(most(f64::NAN), 0.0, "no statement");
}

#[test]
fn a_bumper_stops_while_it_is_pressed() {
    fn reason(pressed: bool) -> Option<Reason> {
        with_readings(SourceKind::Bumper, 20, |_| ObstacleData::Bumper(pressed)).stop_reason(0.5)
    }

    assert_eq!((reason(true), reason(false)), (Some(Reason::Contact), None));
}

#[test]
fn a_second_scanner_and_a_second_camera_see_obstacles() {
    let scanned = with_readings(SourceKind::Scan, 20, |index| {
        ObstacleData::Scan(scan_at(index, 0.0, 0.0, |deg: i32| (deg.abs() < 6).then_some(0.9)))
    });
    assert!(speed(&scanned) < 0.5, "{}", speed(&scanned));
    let lens = Pinhole { fx: 80.0, fy: 80.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
    let low = Arc::new(Camera::mounted(lens, 160, 120, 0.3, 0.0, 0.0));
    let seen = with_readings(SourceKind::Depth, 20, |index| {
        let image = DepthImage::from_fn(160, 120, |u, v| 0.9 + noise(index, 160 * v + u));
        ObstacleData::Depth { image: Arc::new(image), camera: Arc::clone(&low) }
    });
    assert!(speed(&seen) < 0.5, "{}", speed(&seen));
}

#[test]
fn a_source_that_never_delivered_or_falls_silent_stops_the_robot() {
    for until in [0, 14] {
        let silent = with_readings(SourceKind::Range, until, |_| sonar(f64::INFINITY));
        assert_eq!(silent.stop_reason(0.5), Some(Reason::Silent), "{until}");
    }
    let late = with_readings(SourceKind::Range, 16, |_| sonar(f64::INFINITY));
    assert_eq!(late.stop_reason(0.5), None, "within its timeout");
}

#[test]
fn a_sensor_that_falls_silent_and_the_lack_of_all_sensors_are_no_eyes() {
    let mut monitor = monitor();
    let mut index = 0;
    for (has_depth, has_laser, frames, sees, why) in [
        (false, false, 1, false, "no sensor at all"),
        (true, false, 20, true, "there never was a laser"),
        (false, false, 1, false, "not even a frame without depth"),
        (true, true, 1, true, "both"),
        (true, false, 4, true, "a scan is late"),
        (true, false, 1, false, "the laser is silent"),
        (true, true, 1, true, "both again"),
        (false, true, 4, true, "an image is late"),
        (false, true, 1, false, "the camera is silent"),
    ] {
        for _ in 0..frames {
            index += 1;
            let depth = has_depth.then(|| depth_at(index, 0.0, 0.0));
            let scan = has_laser.then(|| scan_at(index, 0.0, 0.0, |_| None));
            let frame = frame(index, EgoMotion::at_rest(0.1), depth, scan);
            monitor.update(&frame, &frame.motion, &[], None);
        }
        assert_eq!(monitor.stop_reason(0.45).is_none(), sees, "{why}");
    }
    let without = CollisionMonitorSettings {
        obstacles: ObstacleSource::None,
        ..CollisionMonitorSettings::default()
    };
    assert_eq!(monitor_of(without).stop_reason(0.5), None, "in those words");
}

#[test]
fn a_jump_of_the_clock_does_not_forget_which_sensors_there_were() {
    let mut monitor = monitor();
    let first = frame(0, EgoMotion::at_rest(0.3), None, Some(scan_at(0, 0.0, 0.0, |_| None)));
    monitor.update(&first, &first.motion, &[], None);
    monitor.clear();
    for index in 1..3 {
        let frame = frame(index, EgoMotion::at_rest(0.3), Some(depth_at(index, 0.0, 0.0)), None);
        monitor.update(&frame, &frame.motion, &[], None);
    }
    assert_eq!(monitor.stop_reason(0.5), Some(Reason::Silent));
}

#[test]
fn after_a_jump_of_the_clock_no_place_is_known() {
    let mut monitor = monitor();
    for index in 0..20 {
        let scan = scan_at(index, 0.0, 0.0, |deg: i32| (deg.abs() < 10).then_some(0.8));
        let frame = frame(index, EgoMotion::at_rest(0.1), None, Some(scan));
        monitor.update(&frame, &frame.motion, &[], None);
    }
    assert!(speed(&monitor) < 0.5, "{}", speed(&monitor));
    monitor.clear();
    assert_eq!(speed(&monitor), Allowance::FREE.most);
    assert_eq!(monitor.stop_reason(0.5), Some(Reason::Silent), "until a new scan");
}

/// A wall is 4 m away; a scan meets something at 0.9 m.
#[test]
fn something_in_a_polygon_stops_or_slows_the_robot() {
    fn square(side_m: f64) -> Vec<[f64; 2]> {
        vec![[side_m, side_m], [side_m, -side_m], [-side_m, -side_m], [-side_m, side_m]]
    }

    let settings = CollisionMonitorSettings {
        stop: square(0.5),
        slowdown: square(1.0),
        ..CollisionMonitorSettings::default()
    };
    for (met_m, stop, slowdown) in [
        (None, None, None),
        (Some(0.9), None, Some((0.5, Reason::Obstacle))),
        (Some(0.4), Some(Reason::Blocked), Some((0.5, Reason::Obstacle))),
    ] {
        let mut monitor = monitor_of(settings.clone());
        for index in 0..20 {
            // Beside the robot.
            let scan =
                scan_at(index, 0.0, 0.0, |deg: i32| met_m.filter(|_| (86..95).contains(&deg)));
            let frame = frame(index, EgoMotion::at_rest(0.1), None, Some(scan));
            monitor.update(&frame, &frame.motion, &[], None);
        }
        assert_eq!(monitor.stop_reason(0.5), stop, "{met_m:?}");
        assert_eq!(monitor.slowdown(), slowdown, "{met_m:?}");
    }
}

mod slow_sensors;
