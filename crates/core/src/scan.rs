use std::sync::Arc;

use nalgebra::{Isometry2, Isometry3, Point3};

use crate::{Stamp, spatial_pose};

/// One sweep of a laser scanner, in the robot frame at the time of its frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LaserScan {
    /// Time of the measurement, by the clock of the frames; `None` for a scan of its frame's own time.
    /// Frames that come more often than scans carry the same scan, with the same stamp, again.
    pub stamp: Option<Stamp>,
    /// Pose of the scanner in the robot frame: x forward, y left, z up. That at ray 0, if the robot
    /// moves while the scanner turns.
    pub robot_from_scanner: Isometry3<f64>,
    /// Motion of the robot while the scanner turns; `None` for a scan that is taken at once. The points
    /// are moved by it already.
    pub motion: Option<SweepMotion>,
    /// Direction of ray 0 in the frame of the scanner, rad.
    pub first_rad: f64,
    /// Angle from one ray to the next, rad; positive from right to left.
    pub increment_rad: f64,
    /// Points at which rays were reflected, robot frame, m, in the order of the rays.
    pub points: Arc<[Point3<f64>]>,
    /// Ray number of each point: neighbours differ by one.
    pub rays: Arc<[u32]>,
    /// Rays without a reflection within the range of the scanner, in their order.
    pub unread: Arc<[UnreadRay]>,
}

/// Motion of a robot while a laser scanner turns: each ray is measured a little later than the one
/// before it, and the robot drives and turns evenly meanwhile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SweepMotion {
    /// Pose of the robot at ray 0 in the robot frame of the scan.
    pub first: Isometry2<f64>,
    /// Pose of the robot at the last ray in the same frame.
    pub last: Isometry2<f64>,
    /// Number of the last ray.
    pub last_ray: u32,
}

impl SweepMotion {
    /// Returns the pose of the robot at the time of a ray.
    pub fn robot_at(&self, ray: u32) -> Isometry2<f64> {
        self.first.lerp_slerp(&self.last, f64::from(ray) / f64::from(self.last_ray.max(1)))
    }
}

/// Scans of further laser scanners at the moment of a frame, each in a place of its own; `None` where
/// a scanner is silent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FurtherScans(pub Arc<[Option<LaserScan>]>);

/// Ray of a laser scanner without a usable distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnreadRay {
    /// Ray number.
    pub ray: u32,
    /// Its reading.
    pub reading: RayReading,
}

/// Meaning of one range of a laser scanner (REP 117, and what drivers send in practice).
///
/// ```
/// # use tagalong_core::RayReading;
/// let reading = |range_m| RayReading::of(range_m, 0.1, 8.0);
/// assert_eq!(reading(2.5), RayReading::Reflection(2.5));
/// assert_eq!(reading(f64::INFINITY), RayReading::NoReturn);
/// assert_eq!(reading(0.05), RayReading::TooNear(0.05));
/// assert_eq!(reading(f64::NEG_INFINITY), RayReading::TooNear(0.1));
/// assert_eq!(reading(0.0), RayReading::Invalid);
/// assert_eq!(reading(f64::NAN), RayReading::Invalid);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RayReading {
    /// A surface at this distance, m.
    Reflection(f64),
    /// Nothing came back: nothing is within the range, or a surface that does not reflect.
    NoReturn,
    /// A surface nearer than the scanner measures, at most this far away, m.
    TooNear(f64),
    /// No statement: NaN, zero, or a negative number.
    Invalid,
}

impl RayReading {
    /// Returns the meaning of a range, m, of a scanner that measures from `min_m` to `max_m`.
    pub fn of(range_m: f64, min_m: f64, max_m: f64) -> Self {
        let nearest_m = min_m.max(0.0);
        match range_m {
            range_m if range_m == f64::NEG_INFINITY => Self::TooNear(nearest_m),
            // Positive comparisons only: NaN fails each of them.
            range_m if range_m > max_m => Self::NoReturn,
            range_m if range_m >= nearest_m && range_m > 0.0 => Self::Reflection(range_m),
            range_m if range_m > 0.0 => Self::TooNear(range_m),
            _ => Self::Invalid,
        }
    }
}

impl LaserScan {
    /// Returns a scan of points without known rays: consecutive points count as neighbours, and no
    /// ray is without a reflection.
    pub fn of_points(points: impl Into<Arc<[Point3<f64>]>>) -> Self {
        let points = points.into();
        let rays = (0..points.len() as u32).collect();
        Self {
            stamp: None,
            robot_from_scanner: Isometry3::identity(),
            motion: None,
            first_rad: 0.0,
            increment_rad: 0.0,
            points,
            rays,
            unread: Arc::default(),
        }
    }

    /// Returns the scan of a scanner at a pose in the robot frame, from ranges, m, of which the first
    /// is in direction `first_rad` and each next one `increment_rad` farther to the left. The
    /// scanner measures from `min_m` to `max_m`.
    pub fn of_ranges(
        robot_from_scanner: Isometry3<f64>,
        first_rad: f64,
        increment_rad: f64,
        [min_m, max_m]: [f64; 2],
        ranges: impl IntoIterator<Item = f64>,
    ) -> Self {
        let mut points = Vec::new();
        let mut rays = Vec::new();
        let mut unread = Vec::new();
        for (ray, range_m) in (0..).zip(ranges) {
            match RayReading::of(range_m, min_m, max_m) {
                RayReading::Reflection(range_m) => {
                    let angle = first_rad + f64::from(ray) * increment_rad;
                    let point = Point3::new(range_m * angle.cos(), range_m * angle.sin(), 0.0);
                    points.push(robot_from_scanner * point);
                    rays.push(ray);
                }
                reading => unread.push(UnreadRay { ray, reading }),
            }
        }
        Self {
            stamp: None,
            robot_from_scanner,
            motion: None,
            first_rad,
            increment_rad,
            points: points.into(),
            rays: rays.into(),
            unread: unread.into(),
        }
    }

    /// Returns the scan with the pose of its scanner in the robot frame.
    pub fn with_scanner(self, robot_from_scanner: Isometry3<f64>) -> Self {
        Self { robot_from_scanner, ..self }
    }

    /// Returns the scan with the ray number of each point; `first_rad` is the direction of ray 0, and
    /// each next ray is `increment_rad` farther to the left.
    pub fn with_rays(
        self,
        first_rad: f64,
        increment_rad: f64,
        rays: impl Into<Arc<[u32]>>,
    ) -> Self {
        Self { first_rad, increment_rad, rays: rays.into(), ..self }
    }

    /// Returns the scan with the rays that have no reflection within the range of the scanner.
    pub fn with_unread(self, unread: impl Into<Arc<[UnreadRay]>>) -> Self {
        Self { unread: unread.into(), ..self }
    }

    /// Returns the scan with [`LaserScan::stamp`] as given.
    pub fn with_stamp(self, stamp: Stamp) -> Self {
        Self { stamp: Some(stamp), ..self }
    }

    /// Returns the scan with [`LaserScan::motion`] as given.
    pub fn with_motion(self, motion: Option<SweepMotion>) -> Self {
        Self { motion, ..self }
    }

    /// Returns the pose of the scanner in the robot frame at the time of a ray.
    pub fn scanner_at(&self, ray: u32) -> Isometry3<f64> {
        match &self.motion {
            None => self.robot_from_scanner,
            Some(motion) => {
                let since_first = motion.robot_at(ray) * motion.first.inverse();
                spatial_pose(&since_first) * self.robot_from_scanner
            }
        }
    }

    /// Returns the place at a distance, m, along a ray in the frame that the scanner has at that ray.
    pub fn place_in_scanner(&self, ray: u32, range_m: f64) -> Point3<f64> {
        let angle = self.first_rad + f64::from(ray) * self.increment_rad;
        Point3::new(range_m * angle.cos(), range_m * angle.sin(), 0.0)
    }

    /// Returns the place in the robot frame at a distance, m, along a ray.
    pub fn place(&self, ray: u32, range_m: f64) -> Point3<f64> {
        self.scanner_at(ray) * self.place_in_scanner(ray, range_m)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// A scan of four rays with this motion, of a scanner 0.2 m before the middle of the robot.
    fn laser_scan(motion: Option<SweepMotion>) -> LaserScan {
        let mount = Isometry3::new(Vector3::new(0.2, 0.0, 0.3), Vector3::zeros());
        LaserScan::of_points(Vec::new())
            .with_scanner(mount)
            .with_rays(0.0, 0.5, Vec::new())
            .with_motion(motion)
    }

    #[test]
    fn places_along_a_ray_of_a_laser_move_with_the_robot() {
        let motion = SweepMotion {
            first: Isometry2::translation(1.0, 0.0),
            last: Isometry2::translation(1.6, 0.0),
            last_ray: 3,
        };
        let still = laser_scan(None);
        let moving = laser_scan(Some(motion));
        for (ray, driven_m) in [(0, 0.0), (1, 0.2), (3, 0.6)] {
            let off = moving.place(ray, 2.0) - still.place(ray, 2.0);
            assert!((off - Vector3::new(driven_m, 0.0, 0.0)).norm() < 1e-12, "ray {ray}: {off}");
            let back = moving.scanner_at(ray).inverse() * moving.place(ray, 2.0);
            assert!((back - moving.place_in_scanner(ray, 2.0)).norm() < 1e-12, "ray {ray}: {back}");
        }
    }

    #[test]
    fn the_scanner_of_a_laser_scan_turns_around_the_middle_of_the_robot() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let motion = SweepMotion {
            first: Isometry2::identity(),
            last: Isometry2::rotation(quarter),
            last_ray: 2,
        };
        let scan = laser_scan(Some(motion));
        let end = scan.scanner_at(2).translation.vector;
        assert!((end - Vector3::new(0.0, 0.2, 0.3)).norm() < 1e-12, "{end}");
        assert_eq!(
            scan.scanner_at(0),
            spatial_pose(&Isometry2::identity()) * scan.robot_from_scanner
        );
    }
}
