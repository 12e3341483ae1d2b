//! Share of valid readings in the region that the robot would sweep.

use std::f64::consts::{PI, TAU};

use nalgebra::{Point2, Vector2};
use tagalong_core::{EgoMotion, LaserScan, RayReading};

use super::CollisionMonitorSettings;
use super::footprint::{Footprint, Path};
use super::settings::NoReturn;

/// Share of rays without a statement up to which those from which nothing came back may be free.
const MOST_UNKNOWN: f64 = 0.1;

/// Length of the way that a ray without a reflection keeps free, m, where that means free.
pub(super) const FREE_M: f64 = 6.0;

/// Directions of a scan without any ray.
const ALL_AROUND: u32 = 360;

/// Statement of a sensor in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    /// It saw something.
    Seen,
    /// Nothing came back: free, if another sensor sees that region.
    Silent,
    /// No statement.
    Unknown,
}

/// Directions in which a sensor looked in this frame, with what it saw there.
#[derive(Clone, Debug, Default)]
pub(super) struct Coverage {
    /// Place of the sensor in the robot frame, m.
    eye: Point2<f64>,
    /// Direction in the robot frame, rad, and statement of each ray or column.
    looks: Vec<(f64, Look)>,
    /// Least share that lets the robot move at all.
    min_share: f64,
}

impl Coverage {
    /// Returns the coverage of directions as given.
    pub(super) fn new(eye: Point2<f64>, looks: Vec<(f64, Look)>, min_share: f64) -> Self {
        Self { eye, looks, min_share }
    }

    /// Returns the coverage of a laser scan. Rays that run above all that could be in the way say
    /// nothing of it.
    pub(super) fn of_scan(
        settings: &CollisionMonitorSettings,
        scan: &LaserScan,
        min_share: f64,
    ) -> Self {
        let eye: Point2<f64> = scan.robot_from_scanner.translation.vector.xy().into();
        let no_return =
            if settings.no_return == NoReturn::Free { Look::Seen } else { Look::Silent };
        let mut looks = Vec::with_capacity(scan.points.len() + scan.unread.len());
        let is_below_top = scan.robot_from_scanner.translation.vector.z < settings.top_m;
        if is_below_top && scan.points.is_empty() && scan.unread.is_empty() {
            // A program that leaves out rays without a reflection has left out all of them here.
            for ray in 0..ALL_AROUND {
                looks.push((TAU * f64::from(ray) / f64::from(ALL_AROUND), no_return));
            }
        }
        for point in scan.points.iter().filter(|point| is_below_top || point.z < settings.top_m) {
            looks.push((direction(&eye, &point.xy()), Look::Seen));
        }
        for unread in scan.unread.iter() {
            if !passes_way(settings, scan, unread.ray) {
                continue;
            }
            let look = match unread.reading {
                RayReading::NoReturn => no_return,
                RayReading::Reflection(_) => Look::Seen,
                // Dirt on the scanner, or a hand on it: what is behind is not seen.
                RayReading::TooNear(_) | RayReading::Invalid => Look::Unknown,
            };
            let eye: Point2<f64> = scan.scanner_at(unread.ray).translation.vector.xy().into();
            looks.push((direction(&eye, &scan.place(unread.ray, 1.0).xy()), look));
        }
        Self { eye, looks, min_share }
    }

    /// Returns true if the sensor looks in any direction along the floor.
    pub(super) fn looks(&self) -> bool {
        !self.looks.is_empty()
    }

    /// Moves the directions of an earlier frame into the robot's new frame.
    pub(super) fn advance(&mut self, motion: &EgoMotion) {
        self.eye = motion.apply_to_point(self.eye);
        for (direction, _) in &mut self.looks {
            *direction -= motion.turn;
        }
    }

    /// Returns the coverage with another least share.
    pub(super) fn with_min_share(self, min_share: f64) -> Self {
        Self { min_share, ..self }
    }

    /// Returns the part of the speed that is allowed on a path of this length: 1 with enough valid
    /// readings in the swept region, and 0 below the least share; `None` of a sensor that does not look
    /// there, which has no say. Where another sensor sees the region, directions from which nothing
    /// came back are free.
    fn allowed_part(
        &self,
        footprint: &Footprint,
        path: Path,
        way: f64,
        others_see: bool,
    ) -> Option<f64> {
        let share = self.share(footprint, path, way, others_see)?;
        if share < self.min_share {
            return Some(0.0);
        }
        // Full speed from twice the least share on.
        let is_limited = self.min_share > 0.0;
        Some(if is_limited { (share / self.min_share - 1.0).clamp(0.2, 1.0) } else { 1.0 })
    }

    /// Returns the share of valid readings among those into the swept region; `None` if there are
    /// none.
    fn share(&self, footprint: &Footprint, path: Path, way: f64, others_see: bool) -> Option<f64> {
        let sector = match path {
            Path::Turn { .. } => Sector { middle: 0.0, half: PI },
            Path::Arc { .. } => Sector::of(&self.eye, footprint, path, way).and(&Sector::of(
                &self.eye,
                footprint,
                path,
                0.6 * way,
            )),
        };
        let mut looks = 0_u32;
        let mut seen = 0_u32;
        let mut silent = 0_u32;
        for (direction, look) in &self.looks {
            if sector.contains(*direction) {
                looks += 1;
                seen += u32::from(*look == Look::Seen);
                silent += u32::from(*look == Look::Silent);
            }
        }
        // A scanner of which many rays say nothing at all is not believed where nothing came back.
        let unknown = looks - seen - silent;
        let is_sound = f64::from(unknown) <= MOST_UNKNOWN * f64::from(looks);
        let valid = if others_see && is_sound { seen + silent } else { seen };
        (looks > 0).then(|| f64::from(valid) / f64::from(looks))
    }
}

/// Returns true for a ray that runs, somewhere within [`FREE_M`], lower than the highest obstacle.
pub(super) fn passes_way(settings: &CollisionMonitorSettings, scan: &LaserScan, ray: u32) -> bool {
    let eye_m = scan.robot_from_scanner.translation.vector.z;
    eye_m < settings.top_m || scan.place(ray, FREE_M).z < settings.top_m
}

/// Returns the part of the speed that all sensors together allow on a path of this length.
pub(super) fn allowed_part(
    coverages: &[Coverage],
    footprint: &Footprint,
    path: Path,
    way: f64,
) -> f64 {
    let alone: Vec<Option<f64>> = coverages
        .iter()
        .map(|coverage| coverage.allowed_part(footprint, path, way, false))
        .collect();
    let mut least = 1.0_f64;
    for (at, coverage) in coverages.iter().enumerate() {
        let Some(mut part) = alone[at] else { continue };
        let others_see =
            alone.iter().enumerate().any(|(other, part)| other != at && *part == Some(1.0));
        if part < 1.0 && others_see {
            part = coverage.allowed_part(footprint, path, way, true).unwrap_or(part);
        }
        least = least.min(part);
    }
    least
}

/// Directions around a middle one, rad.
#[derive(Clone, Copy, Debug)]
struct Sector {
    middle: f64,
    half: f64,
}

impl Sector {
    /// Returns the directions from `eye` to the footprint after a way along the path.
    fn of(eye: &Point2<f64>, footprint: &Footprint, path: Path, way: f64) -> Self {
        let pose = path.pose(way);
        let middle = direction(eye, &Point2::from(pose.translation.vector));
        let mut half = 0.0_f64;
        for corner in footprint.corners() {
            half = half.max(off(direction(eye, &(pose * corner)), middle).abs());
        }
        Self { middle, half }
    }

    /// Returns the smallest sector about the middle of this one that holds both.
    fn and(self, other: &Self) -> Self {
        let half = self.half.max(off(other.middle, self.middle).abs() + other.half);
        Self { half: half.min(PI), ..self }
    }

    fn contains(&self, direction: f64) -> bool {
        off(direction, self.middle).abs() <= self.half
    }
}

fn direction(eye: &Point2<f64>, at: &Point2<f64>) -> f64 {
    let way: Vector2<f64> = at - eye;
    way.y.atan2(way.x)
}

/// Returns the difference of two directions, -π to π.
fn off(a: f64, b: f64) -> f64 {
    let off = a - b;
    // Nearly always: the remainder takes longer than all else that is done with a ray.
    if off.abs() <= PI {
        return off;
    }
    (off + PI).rem_euclid(2.0 * PI) - PI
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;

    const AHEAD: Path = Path::Arc { curvature: 0.0, backwards: false };

    fn footprint() -> Footprint {
        Footprint::new(&crate::RobotSettings::default().footprint)
    }

    /// A scanner of 360 rays that all measure 3 m, but those within `half_deg` ahead.
    fn scan(half_deg: i32, instead: f64) -> LaserScan {
        let ranges = (-180..180).map(|deg: i32| if deg.abs() <= half_deg { instead } else { 3.0 });
        LaserScan::of_ranges(
            Isometry3::translation(0.0, 0.0, 0.2),
            -PI,
            PI / 180.0,
            [0.1, 8.0],
            ranges,
        )
    }

    fn part(scan: &LaserScan, path: Path, no_return: NoReturn) -> f64 {
        let settings =
            CollisionMonitorSettings { no_return, ..CollisionMonitorSettings::default() };
        let coverage = Coverage::of_scan(&settings, scan, 0.3);
        allowed_part(&[coverage], &footprint(), path, 1.3)
    }

    #[test]
    fn rays_that_say_nothing_ahead_stop_the_robot_and_elsewhere_they_do_not() {
        for instead in [0.0, f64::NAN, f64::INFINITY, 99.0] {
            assert_eq!(part(&scan(25, instead), AHEAD, NoReturn::Unknown), 0.0, "{instead}");
            let back = Path::Arc { curvature: 0.0, backwards: true };
            assert_eq!(part(&scan(25, instead), back, NoReturn::Unknown), 1.0, "{instead}");
        }
        assert_eq!(part(&scan(-1, 0.0), AHEAD, NoReturn::Unknown), 1.0);
        assert_eq!(part(&scan(25, 0.05), AHEAD, NoReturn::Unknown), 0.0, "nearer than it measures");
    }

    #[test]
    fn a_scanner_whose_silence_means_free_may_say_so() {
        assert_eq!(part(&scan(25, f64::INFINITY), AHEAD, NoReturn::Free), 1.0);
        assert_eq!(part(&scan(25, f64::NAN), AHEAD, NoReturn::Free), 0.0);
    }

    #[test]
    fn with_few_readings_the_robot_is_slower() {
        let slower = part(&scan(11, 0.0), AHEAD, NoReturn::Unknown);
        assert!(slower > 0.0 && slower < 1.0, "{slower}");
    }

    #[test]
    fn a_sensor_that_does_not_look_there_has_no_say() {
        let back = Path::Arc { curvature: 0.0, backwards: true };
        let blind = [camera(Look::Unknown)];
        assert_eq!(allowed_part(&blind, &footprint(), back, 0.6), 1.0);
        assert_eq!(allowed_part(&blind, &footprint(), AHEAD, 0.6), 0.0);
        assert_eq!(allowed_part(&blind, &footprint(), Path::Turn { left: true }, 0.3), 0.0);
    }

    /// A camera that looks 60 degrees to each side.
    fn camera(look: Look) -> Coverage {
        let looks = (-60..=60).map(|deg| (f64::from(deg).to_radians(), look)).collect();
        Coverage::new(Point2::new(0.1, 0.0), looks, 0.3)
    }

    #[test]
    fn rays_from_which_nothing_came_back_are_free_where_a_camera_sees() {
        let settings = CollisionMonitorSettings::default();
        for (instead, look, part, why) in [
            (f64::INFINITY, Look::Seen, 1.0, "a hall larger than the range"),
            (f64::INFINITY, Look::Unknown, 0.0, "no camera sees there"),
            (f64::NAN, Look::Seen, 0.0, "a scanner that says nothing"),
        ] {
            let scanner = Coverage::of_scan(&settings, &scan(30, instead), 0.3);
            let found = allowed_part(&[camera(look), scanner], &footprint(), AHEAD, 1.3);
            assert_eq!(found, part, "{why}");
        }
    }
}
