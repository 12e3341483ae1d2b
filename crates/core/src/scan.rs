use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use crate::Stamp;

/// One sweep of a laser scanner, in the robot frame at the time of its frame.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LaserScan {
    /// Time of the measurement, by the clock of the frames; `None` for a scan of its frame's own time.
    /// Frames that come more often than scans carry the same scan, with the same stamp, again.
    pub stamp: Option<Stamp>,
    /// Pose of the scanner in the robot frame: x forward, y left, z up.
    pub robot_from_scanner: Isometry3<f64>,
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

    /// Returns the place in the robot frame at a distance, m, along a ray.
    pub fn place(&self, ray: u32, range_m: f64) -> Point3<f64> {
        let angle = self.first_rad + f64::from(ray) * self.increment_rad;
        self.robot_from_scanner * Point3::new(range_m * angle.cos(), range_m * angle.sin(), 0.0)
    }
}
