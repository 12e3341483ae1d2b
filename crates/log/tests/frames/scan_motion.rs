//! Scans that are taken while the robot moves.

use std::f64::consts::TAU;

use nalgebra::{Isometry2, Isometry3, Point2, Vector2};
use tagalong_core::{LaserScan as Seen, Stamp, planar_pose};
use tagalong_log::msgs::{Header, LaserScan};
use tagalong_log::{Input, Inputs};

use super::common::{LogWriter, at, started};
use super::{count, frames, open};

/// Rays of a turn of the scanner, and the time that they take, s.
const RAYS: usize = 180;
const TURN_S: f64 = 0.1;
/// The robot drives at this speed, m/s, and turns at this rate, rad/s.
const SPEED: f64 = 0.8;
const TURN_RATE: f64 = 1.2;
/// Straight wall, m from the start.
const WALL_M: f64 = 4.0;
const SCANS: u32 = 10;

/// Returns the turned angle at a time.
fn heading(seconds: f64) -> f64 {
    TURN_RATE * seconds - 0.6
}

/// Returns the pose of the robot, which drives along the axis of x in the odometry frame while it
/// turns.
fn pose(seconds: f64) -> Isometry2<f64> {
    Isometry2::new(Vector2::new(SPEED * seconds, 0.0), heading(seconds))
}

fn laser() -> Isometry3<f64> {
    Isometry3::translation(0.2, 0.0, 0.15)
}

/// Returns a scan of the wall that begins at a time; each ray is measured where the robot is then.
fn scan(seconds: f64, time_increment: f64) -> LaserScan {
    let step = TAU / RAYS as f64;
    let mut ranges = Vec::new();
    for ray in 0..RAYS {
        let later_s = TURN_S * ray as f64 / (RAYS - 1) as f64;
        let laser = pose(seconds + later_s) * planar_pose(&laser());
        let direction = step * ray as f64 - TAU / 2.0;
        let ahead = laser.rotation * Vector2::new(direction.cos(), direction.sin());
        let range = (WALL_M - laser.translation.x) / ahead.x;
        ranges.push(if range > 0.0 { range as f32 } else { f32::INFINITY });
    }
    LaserScan {
        header: Header::new(at(seconds), "laser"),
        angle_min: (-TAU / 2.0) as f32,
        angle_max: (TAU / 2.0 - step) as f32,
        angle_increment: step as f32,
        time_increment: time_increment as f32,
        range_min: 0.1,
        range_max: 12.0,
        ranges,
        ..LaserScan::default()
    }
}

/// Writes scans, each when it is over, and odometry fifty times a second.
fn with_scans(log: &mut LogWriter, time_increment: f64) {
    log.fixed("base_link", "laser", &laser());
    for number in 0..SCANS {
        let seconds = f64::from(number) * TURN_S;
        for step in 0..5 {
            let seconds = seconds + 0.02 * f64::from(step);
            log.odometry(at(seconds), pose(seconds).translation.x, heading(seconds));
        }
        log.message("/scan", at(seconds + TURN_S), &scan(seconds, time_increment));
    }
}

/// Returns the largest distance of a point from the wall, m.
fn off_wall_m(seen: &Seen, frame: Stamp) -> f64 {
    let robot = pose(frame.seconds_since(at(0.0)));
    let mut most_m = 0.0_f64;
    for point in seen.points.iter() {
        let place = robot * Point2::new(point.x, point.y);
        most_m = most_m.max((place.x - WALL_M).abs());
    }
    most_m
}

/// Time from one ray to the next, s.
fn increment_s() -> f64 {
    TURN_S / (RAYS - 1) as f64
}

#[test]
fn laser_scans_alone_are_straightened_by_the_odometry() {
    for (time_increment, is_straight) in [(increment_s(), true), (0.0, false)] {
        let mut log = LogWriter::plain();
        with_scans(&mut log, time_increment);
        let (mut source, _saved) = open(log, Inputs::NONE.require(Input::Laser));
        let found = frames(&mut source);
        assert_eq!(found.len(), SCANS as usize);
        for found in &found {
            let seen = found.frame.laser().expect("each frame is a scan");
            let off_m = off_wall_m(seen, found.frame.stamp);
            assert_eq!(off_m < 0.02, is_straight, "{off_m} m off at {}", found.frame.stamp);
        }
        assert_eq!(count(&source, "laser_scans_with_impossible_times"), 0);
    }
}

#[test]
fn laser_scans_beside_images_are_straightened_by_the_odometry() {
    let mut log = started();
    with_scans(&mut log, increment_s());
    for image in 1..8 {
        log.colour(at(f64::from(image) * TURN_S + 0.03));
    }
    let (mut source, _saved) = open(log, Inputs::ANY);
    let found = frames(&mut source);
    assert_eq!(found.len(), 7);
    for found in &found {
        let seen = found.frame.laser().expect("a scan is near each image");
        let off_m = off_wall_m(seen, found.frame.stamp);
        assert!(off_m < 0.02, "{off_m} m off at {}", found.frame.stamp);
    }
}

#[test]
fn times_of_laser_rays_that_cannot_be_are_told() {
    let mut log = LogWriter::plain();
    with_scans(&mut log, TURN_S);
    let (mut source, _saved) = open(log, Inputs::NONE.require(Input::Laser));
    assert_eq!(frames(&mut source).len(), SCANS as usize);
    assert_eq!(count(&source, "laser_scans_with_impossible_times"), u64::from(SCANS));
    assert!(source.notes().iter().any(|note| note.contains("time_increment")));
}
