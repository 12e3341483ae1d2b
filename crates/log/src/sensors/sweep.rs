//! Motion of the robot while a laser scanner turns: each ray is measured slightly later than the
//! one before it.

use nalgebra::Isometry2;
use tagalong_core::{MAX_ODOMETRY_STEP_M, Stamp, SweepMotion};

use crate::msgs::LaserScan;
use crate::tally::Tally;

/// Maximum time from the first ray to the last, s: that of a scanner that turns twice a second.
const LONGEST_S: f64 = 0.5;
/// Factor by which the duration of a scan may exceed the time to the next one, because drivers
/// round it.
const ROUNDED: f64 = 1.1;

/// Returns the motion during a scan, from the poses of the robot at all times; `None` for a scan
/// that is taken at once, or by a robot at rest. A jump of the odometry does not count as motion.
pub(super) fn sweep_motion(
    scan: &LaserScan,
    first: Isometry2<f64>,
    robot_from: impl Fn(Stamp) -> Isometry2<f64>,
) -> Option<SweepMotion> {
    let last = robot_from(scan.header.stamp().plus_seconds(sweep_s(scan)?));
    let driven_m = (last.translation.vector - first.translation.vector).norm();
    if last == first || driven_m > MAX_ODOMETRY_STEP_M {
        return None;
    }
    Some(SweepMotion { first, last, last_ray: scan.ranges.len() as u32 - 1 })
}

/// Returns the time from the first ray to the last, s; `None` if the scan states none, or an
/// impossible one.
fn sweep_s(scan: &LaserScan) -> Option<f64> {
    let sweep_s = told_s(scan);
    (sweep_s > 0.0 && sweep_s <= longest_s(scan)).then_some(sweep_s)
}

/// Returns the time from the first ray to the last according to the header, s.
fn told_s(scan: &LaserScan) -> f64 {
    f64::from(scan.time_increment) * scan.ranges.len().saturating_sub(1) as f64
}

/// Returns the maximum duration of the scan, s: at most the time to the next one, if that is
/// stated.
fn longest_s(scan: &LaserScan) -> f64 {
    let scan_s = f64::from(scan.scan_time);
    if scan_s > 0.0 { (ROUNDED * scan_s).min(LONGEST_S) } else { LONGEST_S }
}

/// Counts a scan with impossible ray times; it is treated as measured at once.
pub(crate) fn note_impossible_times(scan: &LaserScan, topic: &str, tally: &mut Tally) {
    let sweep_s = told_s(scan);
    if sweep_s != 0.0 && self::sweep_s(scan).is_none() {
        tally.remark("laser_scans_with_impossible_times", || {
            format!(
                "{topic}: time_increment {} s with {} ranges is {sweep_s:.3} s a scan, and scan_time is \
                 {} s: the motion of the robot during a scan is left out",
                scan.time_increment,
                scan.ranges.len(),
                scan.scan_time
            )
        });
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::{Isometry3, Point2, Vector2, Vector3};
    use tagalong_core::LaserScan as Scan;

    use super::*;
    use crate::msgs::Header;
    use crate::sensors::laser::seen_from;

    /// Rays of a turn, and the time that they take.
    const RAYS: usize = 360;
    const TURN_S: f64 = 0.1;
    /// Motion of the robot, m/s and rad/s.
    const SPEED: f64 = 1.0;
    const TURN_RATE: f64 = 1.5;
    /// Straight wall ahead of the robot, m.
    const WALL_M: f64 = 3.0;

    fn start() -> Stamp {
        Stamp::default().plus_seconds(100.0)
    }

    /// Pose of a robot that drives along a circle, in the frame of its start.
    fn pose(stamp: Stamp) -> Isometry2<f64> {
        let angle = TURN_RATE * stamp.seconds_since(start());
        let radius = SPEED / TURN_RATE;
        Isometry2::new(Vector2::new(radius * angle.sin(), radius * (1.0 - angle.cos())), angle)
    }

    fn mount() -> Isometry3<f64> {
        Isometry3::new(Vector3::new(0.2, 0.1, 0.3), Vector3::new(0.0, 0.0, 0.4))
    }

    /// Scan of the wall, each ray of which is measured where the robot is then.
    fn scan_of_wall() -> LaserScan {
        let step = TAU / RAYS as f64;
        let increment_s = TURN_S / (RAYS - 1) as f64;
        let mut ranges = Vec::new();
        for ray in 0..RAYS {
            let robot = pose(start().plus_seconds(increment_s * ray as f64));
            let laser = robot * tagalong_core::planar_pose(&mount());
            let direction = -TAU / 2.0 + step * ray as f64;
            let ahead = laser * Vector2::new(direction.cos(), direction.sin());
            let range = (WALL_M - laser.translation.x) / ahead.x;
            ranges.push(if range > 0.0 { range as f32 } else { f32::INFINITY });
        }
        LaserScan {
            header: Header::new(start(), "laser"),
            angle_min: (-TAU / 2.0) as f32,
            angle_max: (TAU / 2.0 - step) as f32,
            angle_increment: step as f32,
            time_increment: increment_s as f32,
            scan_time: TURN_S as f32,
            range_min: 0.1,
            range_max: 8.0,
            ranges,
            ..LaserScan::default()
        }
    }

    /// Returns the largest distance of a point from the wall, m, as the robot sees it at a time.
    fn off_wall_m(seen: &Scan, now: Stamp) -> f64 {
        let at = pose(now);
        let mut most_m = 0.0_f64;
        for point in seen.points.iter() {
            let place = at * Point2::new(point.x, point.y);
            most_m = most_m.max((place.x - WALL_M).abs());
        }
        most_m
    }

    fn seen_at(scan: &LaserScan, now: Stamp) -> Scan {
        seen_from(scan, &mount(), |then| pose(now).inverse() * pose(then))
    }

    #[test]
    fn a_straight_wall_is_straight_to_a_robot_that_turns() {
        let scan = scan_of_wall();
        let skewed = LaserScan { time_increment: 0.0, ..scan.clone() };
        // At the stamp, and at an image of later.
        for now in [start(), start().plus_seconds(0.2)] {
            let seen = seen_at(&scan, now);
            assert!(seen.points.len() > 100, "{} points", seen.points.len());
            let off_m = off_wall_m(&seen, now);
            assert!(off_m < 0.01, "{off_m} m off");
            let off_m = off_wall_m(&seen_at(&skewed, now), now);
            assert!(off_m > 0.3, "without the times of the rays it is only {off_m} m off");
        }
    }

    #[test]
    fn the_scanner_is_where_it_was_at_each_ray() {
        let scan = scan_of_wall();
        let seen = seen_at(&scan, start());
        let off = seen.robot_from_scanner.translation.vector - mount().translation.vector;
        assert!(off.norm() < 1e-9, "{off}");
        for (ray, point) in seen.rays.iter().zip(seen.points.iter()) {
            let range = f64::from(scan.ranges[*ray as usize]);
            assert!((seen.place(*ray, range) - point).norm() < 1e-6, "ray {ray}");
            let eye = seen.scanner_at(*ray).translation.vector;
            assert!(((point.coords - eye).norm() - range).abs() < 1e-6, "ray {ray}");
        }
    }

    #[test]
    fn a_robot_that_stands_sees_the_same_points_whatever_the_times() {
        let scan = scan_of_wall();
        let at_once = LaserScan { time_increment: 0.0, ..scan.clone() };
        let seen = seen_from(&scan, &mount(), |_| Isometry2::identity());
        let seen_at_once = seen_from(&at_once, &mount(), |_| Isometry2::identity());
        assert_eq!(seen.points, seen_at_once.points);
    }

    #[test]
    fn times_that_cannot_be_are_told_and_not_used() {
        let good = scan_of_wall();
        let seconds_a_ray = LaserScan { time_increment: TURN_S as f32, ..good.clone() };
        let longer_than_a_scan = LaserScan { scan_time: 0.05, ..good.clone() };
        let backwards = LaserScan { time_increment: -good.time_increment, ..good.clone() };
        let no_number = LaserScan { time_increment: f32::NAN, ..good.clone() };
        for scan in [&seconds_a_ray, &longer_than_a_scan, &backwards, &no_number] {
            assert_eq!(sweep_s(scan), None);
            let mut tally = Tally::default();
            note_impossible_times(scan, "/scan", &mut tally);
            assert_eq!(tally.counters.get("laser_scans_with_impossible_times"), Some(&1));
            assert!(!tally.lost && tally.notes[0].contains("time_increment"), "{:?}", tally.notes);
        }
        let unset = LaserScan { time_increment: 0.0, ..good.clone() };
        for scan in [&good, &unset] {
            let mut tally = Tally::default();
            note_impossible_times(scan, "/scan", &mut tally);
            assert!(tally.counters.is_empty(), "{:?}", tally.notes);
        }
        assert!((sweep_s(&good).unwrap_or_default() - TURN_S).abs() < 1e-6);
    }

    #[test]
    fn a_jump_of_the_odometry_is_no_motion() {
        fn jumping(then: Stamp) -> Isometry2<f64> {
            let is_later = then.seconds_since(start()) > 0.05;
            Isometry2::translation(if is_later { 3.0 } else { 0.0 }, 0.0)
        }

        assert_eq!(sweep_motion(&scan_of_wall(), Isometry2::identity(), jumping), None);
    }
}
