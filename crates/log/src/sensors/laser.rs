//! Laser scans: the one nearest in time to an image, or frames of their own.

use std::ops::RangeInclusive;

use nalgebra::{Isometry2, Isometry3, Point3};
use tagalong_core::{
    FurtherScans, Input, LaserScan as Scan, RayReading, Sensors, Stamp, UnreadRay, spatial_pose,
};
use tagalong_math::counted;

use super::recent::{NEAR_S, Recent};
pub(crate) use super::scan_faults::scan_fault;
use super::sweep::{note_impossible_times, sweep_motion};
use super::{Moment, SensorReader, SensorType};
use crate::msgs::{CdrError, LaserScan, decode};
use crate::tally::{Tally, is_unusual};
use crate::walk::Message;

/// Entry of laser scanners.
pub(super) const ENTRY: SensorType = SensorType {
    input: Input::Laser,
    messages: &["sensor_msgs/LaserScan"],
    wanted: "laser scans",
    rank: Some(rank),
    header: |message| decode::<LaserScan>(message.data).map(|scan| Some(scan.header)),
    fault: |data| scan_fault(&decode(data).ok()?),
    reader: |_, _| Box::<Scans>::default(),
};

fn rank(topic: &str) -> i32 {
    let is_rear = topic.contains("rear") || topic.contains("back");
    2 * i32::from(topic.ends_with("/scan")) - i32::from(is_rear)
}

/// Maximum number of stored scans: those of the frames that wait for their turn.
const KEPT: usize = 64;

/// Scans of the last seconds.
#[derive(Default)]
pub(crate) struct Scans {
    recent: Recent<LaserScan, KEPT>,
    /// True for an additional scanner of the robot.
    is_further: bool,
    /// Number of scans, and of those without one range between their limits.
    scans: u64,
    blind: u64,
    /// Number of frames, and of those with a scan near in time.
    frames: u64,
    near: u64,
}

impl SensorReader for Scans {
    fn take(&mut self, message: &Message<'_>, tally: &mut Tally) -> Result<(), CdrError> {
        let scan = decode(message.data)?;
        match scan_fault(&scan) {
            Some(why) => lose_scan(&message.channel.topic, &why, tally),
            None => {
                self.scans += 1;
                self.blind += u64::from(points(&scan).next().is_none());
                self.recent.push(scan);
            }
        }
        Ok(())
    }

    fn pair(&mut self, stamp: Stamp, _: Option<Stamp>, _: f64) {
        self.frames += 1;
        self.near += u64::from(self.recent.near(stamp).is_some());
    }

    fn set_aside(&mut self, _: Stamp) {
        self.recent.set_aside();
    }

    fn restore(&mut self) {
        self.recent.restore();
    }

    fn add_to(&self, sensors: Sensors, moment: &Moment<'_>, tally: &mut Tally) -> Sensors {
        let seen = self.seen(moment, tally);
        if self.is_further {
            let known = sensors.get::<FurtherScans>().map_or(&[][..], |further| &further.0);
            // Each scanner keeps its index, even while it is silent.
            let all: Vec<Option<Scan>> = known.iter().cloned().chain([seen]).collect();
            return sensors.with(FurtherScans(all.into()));
        }
        match seen {
            Some(seen) => sensors.with(seen),
            None => sensors,
        }
    }

    fn close(&mut self, topic: &str, tally: &mut Tally) {
        let Self { scans, blind, frames, near, .. } = *self;
        if scans > 0 && blind == scans {
            tally.note(format!(
                "{topic}: none of its {} has a range between range_min and range_max",
                counted(scans, "scan")
            ));
        }
        if near > 0 && is_unusual(frames - near, frames) {
            tally.note(format!("{topic} has scans within {NEAR_S} s of {near} of {frames} frames"));
        }
    }
}

/// Counts a scan with an impossible header as lost.
pub(crate) fn lose_scan(topic: &str, why: &str, tally: &mut Tally) {
    tally.lose("laser_scans_invalid", || format!("{topic}: a laser scan cannot be used: {why}"));
}

impl Scans {
    /// Creates the reader of an additional scanner.
    pub(crate) fn further() -> Self {
        Self { is_further: true, ..Self::default() }
    }

    /// Returns the scan at a moment in the robot frame; `None` without one, which is counted.
    fn seen(&self, moment: &Moment<'_>, tally: &mut Tally) -> Option<Scan> {
        let Some(scan) = self.recent.near(moment.stamp) else {
            tally.count("frames_without_laser");
            return None;
        };
        let then = scan.header.stamp();
        let Some(mount) = moment.tf.lookup(moment.robot_frame, &scan.header.frame_id, then) else {
            tally.count("laser_scans_without_pose");
            let topic = moment.topic;
            tally.note(format!(
                "tf does not connect the laser scanner of {topic} with the robot: it is not used"
            ));
            return None;
        };
        note_impossible_times(scan, moment.topic, tally);
        Some(seen_from(scan, &mount, |then| moment.robot_from(then)))
    }
}

/// Returns a scan in the robot frame; `robot_from` returns the robot's poses at other times. Each
/// point is moved by the motion of the robot since the time of its own ray.
pub(crate) fn seen_from(
    scan: &LaserScan,
    robot_from_laser: &Isometry3<f64>,
    robot_from: impl Fn(Stamp) -> Isometry2<f64>,
) -> Scan {
    let first = robot_from(scan.header.stamp());
    let motion = sweep_motion(scan, first, robot_from);
    let (rays, points): (Vec<u32>, Vec<Point3<f64>>) = points(scan)
        .map(|(ray, point)| {
            let then = robot_from_laser * point;
            // The robot moves on a floor, so heights do not change.
            let robot = motion.map_or(first, |motion| motion.robot_at(ray));
            let now = robot * then.xy();
            (ray, Point3::new(now.x, now.y, then.z))
        })
        .unzip();
    Scan::of_points(points)
        .with_stamp(scan.header.stamp())
        .with_scanner(spatial_pose(&first) * robot_from_laser)
        .with_motion(motion)
        .with_rays(f64::from(scan.angle_min), f64::from(scan.angle_increment), rays)
        .with_unread(unread(scan).collect::<Vec<_>>())
}

/// Returns the range limits of the scanner, m.
pub(super) fn limits(scan: &LaserScan) -> RangeInclusive<f32> {
    scan.range_min.max(0.0)..=scan.range_max
}

/// Yields the reflections in the frame of the scanner, m, with the index of the ray. Infinite and
/// NaN ranges, and those beyond the scanner's own limits, are rays without a reflection.
fn points(scan: &LaserScan) -> impl Iterator<Item = (u32, Point3<f64>)> {
    let first = f64::from(scan.angle_min);
    let step = f64::from(scan.angle_increment);
    let limits = limits(scan);
    let rays = scan.ranges.iter().enumerate();
    let met = rays.filter(move |(_, range)| limits.contains(*range));
    let points = met.map(move |(ray, range)| {
        let angle = first + ray as f64 * step;
        let range = f64::from(*range);
        (ray as u32, Point3::new(range * angle.cos(), range * angle.sin(), 0.0))
    });
    points.filter(|(_, point)| point.coords.norm().is_finite())
}

/// Yields the rays without a reflection, with the reason given by the scanner.
fn unread(scan: &LaserScan) -> impl Iterator<Item = UnreadRay> {
    let limits = limits(scan);
    let min_m = f64::from(*limits.start());
    let max_m = f64::from(*limits.end());
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
    fn points_move_with_the_robot() {
        let scan = scan(1.0, &[f32::NAN, 2.0]);
        let mount = Isometry3::new(Vector3::new(0.1, 0.0, 0.2), Vector3::zeros());
        let scan = seen_from(&scan, &mount, |_| Isometry2::translation(-0.5, 0.0));
        assert!((scan.points[0] - Point3::new(1.6, 0.0, 0.2)).norm() < 1e-6, "{scan:?}");
        let origin = scan.robot_from_scanner.translation.vector;
        assert!((origin - Vector3::new(-0.4, 0.0, 0.2)).norm() < 1e-12, "{origin}");
        assert_eq!(scan.rays[..], [1]);
    }
}
