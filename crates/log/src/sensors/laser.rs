//! Laser scans: the nearest one to an image in time, or frames of their own.

use std::collections::VecDeque;
use std::ops::RangeInclusive;

use nalgebra::{Isometry2, Isometry3, Point3, UnitQuaternion, Vector3};
use tagalong_core::{Input, LaserScan as Scan, RayReading, Sensors, Stamp, UnreadRay};

use super::{Moment, SensorReader, SensorType};
use crate::msgs::{CdrError, LaserScan, decode};
use crate::tally::Tally;
use crate::walk::Message;

/// Entry of laser scanners.
pub(super) const ENTRY: SensorType = SensorType {
    input: Input::Laser,
    messages: &["sensor_msgs/LaserScan"],
    wanted: "laser scans",
    rank: Some(rank),
    header: |data| decode::<LaserScan>(data).map(|scan| Some(scan.header)),
    reader: |_| Box::<Scans>::default(),
};

fn rank(topic: &str) -> i32 {
    let is_rear = topic.contains("rear") || topic.contains("back");
    2 * i32::from(topic.ends_with("/scan")) - i32::from(is_rear)
}

/// Maximum time between a scan and an image, s.
const NEAR_S: f64 = 0.25;
/// Maximum number of scans kept: those of the frames that wait for their turn.
const KEPT: usize = 64;
/// Maximum number of rays of a scan.
const MAX_RAYS: usize = 65_536;

/// Scans of the last seconds, in the order of arrival.
#[derive(Default)]
struct Scans {
    scans: VecDeque<LaserScan>,
}

impl SensorReader for Scans {
    fn take(&mut self, message: &Message<'_>, tally: &mut Tally) -> Result<(), CdrError> {
        if !self.push(decode(message.data)?) {
            lose_scan(tally);
        }
        Ok(())
    }

    fn add_to(&self, sensors: Sensors, moment: &Moment<'_>, tally: &mut Tally) -> Sensors {
        let Some(scan) = self.near(moment.stamp) else {
            tally.count("frames_without_laser");
            return sensors;
        };
        let then = scan.header.stamp();
        let Some(mount) = moment.tf.lookup(moment.robot_frame, &scan.header.frame_id, then) else {
            tally.count("laser_scans_without_pose");
            tally.note("tf does not connect the laser scanner with the robot: it is not used");
            return sensors;
        };
        sensors.with(seen_from(scan, &mount, &moment.robot_from(then)))
    }
}

/// Counts a scan without angles or ranges as lost.
pub(crate) fn lose_scan(tally: &mut Tally) {
    tally.lose("laser_scans_invalid", || "a laser scan has no angles or ranges".into());
}

impl Scans {
    /// Adds a scan; returns false if its angles or ranges are invalid.
    fn push(&mut self, scan: LaserScan) -> bool {
        if !is_sane(&scan) {
            return false;
        }
        self.scans.push_back(scan);
        if self.scans.len() > KEPT {
            self.scans.pop_front();
        }
        true
    }

    /// Returns the scan nearest to an image in time, if it is near enough.
    fn near(&self, image: Stamp) -> Option<&LaserScan> {
        let off_s = |scan: &&LaserScan| scan.header.stamp().seconds_since(image).abs();
        let nearest = self.scans.iter().min_by(|a, b| off_s(a).total_cmp(&off_s(b)));
        nearest.filter(|scan| off_s(scan) <= NEAR_S)
    }
}

/// Returns a scan in the frame of a robot that has moved by `robot_from_then` since.
pub(crate) fn seen_from(
    scan: &LaserScan,
    robot_from_laser: &Isometry3<f64>,
    robot_from_then: &Isometry2<f64>,
) -> Scan {
    let moved_point = |point: Point3<f64>| {
        let then = robot_from_laser * point;
        // The robot moves on a floor: heights stay.
        let now = robot_from_then * then.xy();
        Point3::new(now.x, now.y, then.z)
    };
    let (rays, points): (Vec<u32>, Vec<Point3<f64>>) =
        points(scan).map(|(ray, point)| (ray, moved_point(point))).unzip();
    Scan {
        stamp: Some(scan.header.stamp()),
        robot_from_scanner: on_floor(robot_from_then) * robot_from_laser,
        first_rad: f64::from(scan.angle_min),
        increment_rad: f64::from(scan.angle_increment),
        points: points.into(),
        rays: rays.into(),
        unread: unread(scan).collect(),
    }
}

/// Returns a motion on the floor as one in space.
pub(crate) fn on_floor(motion: &Isometry2<f64>) -> Isometry3<f64> {
    let (x, y) = (motion.translation.x, motion.translation.y);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), motion.rotation.angle());
    Isometry3::from_parts(Vector3::new(x, y, 0.0).into(), turn)
}

/// Returns false for a scan with invalid angles or ranges.
pub(crate) fn is_sane(scan: &LaserScan) -> bool {
    let angles = [scan.angle_min, scan.angle_increment];
    let is_known = angles.into_iter().all(f32::is_finite) && !limits(scan).is_empty();
    is_known && scan.ranges.len() <= MAX_RAYS
}

/// Returns the valid ranges of the scanner, m.
fn limits(scan: &LaserScan) -> RangeInclusive<f32> {
    scan.range_min.max(0.0)..=scan.range_max
}

/// Yields the reflections in the frame of the scanner, m, with the index of the ray. Ranges beyond
/// the scanner's own limits, infinite and NaN ones are rays without a reflection.
fn points(scan: &LaserScan) -> impl Iterator<Item = (u32, Point3<f64>)> {
    let (first, step) = (f64::from(scan.angle_min), f64::from(scan.angle_increment));
    let limits = limits(scan);
    let rays = scan.ranges.iter().enumerate();
    let met = rays.filter(move |(_, range)| limits.contains(*range));
    let point = move |(ray, range): (usize, &f32)| {
        let (angle, range) = (first + ray as f64 * step, f64::from(*range));
        (ray as u32, Point3::new(range * angle.cos(), range * angle.sin(), 0.0))
    };
    met.map(point).filter(|(_, point)| point.coords.norm().is_finite())
}

/// Yields the rays without a reflection, with what the scanner said instead.
fn unread(scan: &LaserScan) -> impl Iterator<Item = UnreadRay> {
    let limits = limits(scan);
    let (min_m, max_m) = (f64::from(*limits.start()), f64::from(*limits.end()));
    (0..).zip(&scan.ranges).filter_map(move |(ray, range)| {
        match RayReading::of(f64::from(*range), min_m, max_m) {
            RayReading::Reflection(_) => None,
            reading => Some(UnreadRay { ray, reading }),
        }
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::msgs::Header;

    fn scan(seconds: f64, ranges: &[f32]) -> LaserScan {
        LaserScan {
            header: Header::new(Stamp::default().plus_seconds(seconds), "laser"),
            angle_min: -std::f32::consts::FRAC_PI_2,
            angle_max: std::f32::consts::FRAC_PI_2,
            angle_increment: std::f32::consts::FRAC_PI_2,
            range_min: 0.1,
            range_max: 10.0,
            ranges: ranges.to_vec(),
            ..LaserScan::default()
        }
    }

    #[test]
    fn rays_turn_from_right_to_left_and_what_met_nothing_is_left_out() {
        let [(0, right), (2, left)] =
            points(&scan(1.0, &[2.0, f32::INFINITY, 3.0])).collect::<Vec<_>>()[..]
        else {
            panic!("two rays met something");
        };
        assert!((right - Point3::new(0.0, -2.0, 0.0)).norm() < 1e-6);
        assert!((left - Point3::new(0.0, 3.0, 0.0)).norm() < 1e-6);
        assert_eq!(points(&scan(1.0, &[0.05, f32::NAN, 11.0])).count(), 0);
    }

    #[test]
    fn a_scan_without_angles_or_with_turned_limits_is_none() {
        let mut scans = Scans::default();
        assert!(!scans.push(LaserScan { angle_min: f32::NAN, ..scan(1.0, &[1.0]) }));
        assert!(!scans.push(LaserScan { range_max: f32::NAN, ..scan(1.0, &[1.0]) }));
        assert!(!scans.push(LaserScan { range_max: 0.01, ..scan(1.0, &[1.0]) }));
        assert!(!scans.push(scan(1.0, &vec![1.0; MAX_RAYS + 1])));
        assert!(scans.near(Stamp::default().plus_seconds(1.0)).is_none());
    }

    #[test]
    fn the_nearest_scan_counts_and_one_of_long_ago_does_not() {
        let mut scans = Scans::default();
        (0..100).for_each(|i| assert!(scans.push(scan(0.1 * f64::from(i), &[1.0]))));
        let near = |seconds| {
            let found = scans.near(Stamp::default().plus_seconds(seconds));
            found.map(|scan| {
                (scan.header.stamp().seconds_since(Stamp::default()) * 10.0).round() as i64
            })
        };
        assert_eq!((near(7.03), near(9.99)), (Some(70), Some(99)));
        assert_eq!((near(1.0), near(12.0)), (None, None), "dropped, and silent");
    }

    #[test]
    fn points_move_with_the_robot() {
        let mut scans = Scans::default();
        scans.push(scan(1.0, &[f32::NAN, 2.0]));
        let scan = scans.near(Stamp::default().plus_seconds(1.0)).unwrap();
        let mount = Isometry3::new(Vector3::new(0.1, 0.0, 0.2), Vector3::zeros());
        let driven = Isometry2::translation(-0.5, 0.0);
        let scan = seen_from(scan, &mount, &driven);
        assert!((scan.points[0] - Point3::new(1.6, 0.0, 0.2)).norm() < 1e-6, "{scan:?}");
        let origin = scan.robot_from_scanner.translation.vector;
        assert!((origin - Vector3::new(-0.4, 0.0, 0.2)).norm() < 1e-12, "{origin}");
        assert_eq!(scan.rays[..], [1]);
    }
}
