//! State of the obstacle sensors other than the depth image.

use nalgebra::{Point2, Point3, Vector3};
use tagalong_core::{EgoMotion, LaserScan, RangeReading, RayReading, Track};

use super::binned::BinnedHazards;
use super::coverage::{Coverage, FREE_M, Look, passes_way};
use super::space::SpaceGrid;
use super::sweep::{Hazard, HazardKind};
use super::watchdog::{ScanReference, Watch};
use super::{CollisionMonitorSettings, People};

/// Distance up to which the arc of a range sensor counts, m: farther away its cone is wider than the
/// robot, and shows walls beside the way.
const RANGE_M: f64 = 2.0;
/// Distances beyond the nearest one that is measured at which something too near is placed, too, m.
const BEFORE_FOOTPRINT_M: [f64; 3] = [0.1, 0.2, 0.3];
/// Places on the arc of a range sensor.
const ON_ARC: usize = 9;
/// Height by which a reflection may be below a level scanner, m: no mount is quite level.
const LEVEL_M: f64 = 0.03;

/// Laser scanner: between two scans the last one holds.
#[derive(Default)]
pub(super) struct ScanState {
    /// Reflections at heights that matter, robot frame, m.
    points: Vec<Point2<f64>>,
    coverage: Option<Coverage>,
    space: SpaceGrid,
    watch: Watch<ScanReference>,
}

impl ScanState {
    /// Forgets all places, but not that the scanner was frozen.
    pub(super) fn clear(&mut self) {
        self.points.clear();
        self.coverage = None;
        self.space = SpaceGrid::default();
        self.watch.clear();
    }

    /// Forgets that the scanner was frozen.
    pub(super) fn arm(&mut self) {
        self.watch = Watch::default();
    }

    /// Returns true if the scanner repeats itself, or contradicted the odometry.
    pub(super) fn is_frozen(&self, identical_readings: u32) -> bool {
        self.watch.is_frozen(identical_readings)
    }

    /// Takes in a new scan, if there is one, `motion` after the frame before.
    pub(super) fn update(
        &mut self,
        settings: &CollisionMonitorSettings,
        scan: Option<&LaserScan>,
        motion: &EgoMotion,
        tracks: &[Track],
    ) {
        self.space.advance(motion);
        self.watch.advance(motion);
        let Some(scan) = scan else {
            for at in &mut self.points {
                *at = motion.apply_to_point(*at);
            }
            if let Some(coverage) = &mut self.coverage {
                coverage.advance(motion);
            }
            return;
        };
        let heights = least_height_m(settings, scan)..settings.top_m;
        self.points.clear();
        let low = scan.points.iter().filter(|point| heights.contains(&point.z));
        self.points.extend(low.map(Point3::xy));
        for unread in scan.unread.iter() {
            if let RayReading::TooNear(range_m) = unread.reading {
                self.points.push(scan.place(unread.ray, range_m).xy());
            }
        }
        let eye: Point2<f64> = scan.robot_from_scanner.translation.vector.xy().into();
        let silent = scan.unread.iter().filter(|unread| {
            unread.reading == RayReading::NoReturn && passes_way(settings, scan, unread.ray)
        });
        let passed = silent.map(|unread| scan.place(unread.ray, FREE_M).xy());
        let ends = self.points.iter().copied().chain(passed);
        self.space.add(eye, self.points.iter().copied(), ends);
        self.watch.add_scan(scan, tracks);
        self.coverage = Some(Coverage::of_scan(settings, scan, settings.min_share));
    }

    /// Adds what the scan met.
    pub(super) fn add_to(
        &self,
        settings: &CollisionMonitorSettings,
        people: &People<'_>,
        hazards: &mut BinnedHazards,
    ) {
        let first = hazards.len();
        for at in &self.points {
            hazards.add(*at, settings.ray_points(), false);
        }
        hazards.judge_since(first, |at| people.kind(at, self.space.presence(at)));
    }

    /// Returns the directions in which the scanner sees something, if it ever delivered.
    pub(super) fn coverage(&self, min_share: f64) -> Option<Coverage> {
        self.coverage.clone().map(|coverage| coverage.with_min_share(min_share))
    }

    /// Returns true for a scanner that sees the way, not one of which all rays run above it.
    pub(super) fn is_eye(&self) -> bool {
        self.coverage.as_ref().is_some_and(Coverage::looks)
    }
}

/// Returns the height from which on a reflection is not one of the floor, m.
fn least_height_m(settings: &CollisionMonitorSettings, scan: &LaserScan) -> f64 {
    let eye_m = scan.robot_from_scanner.translation.vector.z;
    let is_above_floor = eye_m > settings.floor_m;
    // Points whose scanner is not known may be of one of several layers, some of which meet the floor.
    let has_layers =
        scan.increment_rad == 0.0 && scan.points.iter().any(|point| point.z > settings.floor_m);
    if is_above_floor || has_layers {
        return settings.floor_m;
    }
    // The rays of a scanner that is as low as the floor is rough run along the floor, not into it. Where
    // its height is not known, it is that of the robot's origin.
    eye_m - LEVEL_M
}

/// Range sensor: sonar or infrared.
#[derive(Default)]
pub(super) struct RangeState {
    /// Places on the arc at which the surface may be, robot frame, m.
    arc: Vec<Point2<f64>>,
    coverage: Option<Coverage>,
}

impl RangeState {
    /// Takes in a new reading, if there is one, `motion` after the frame before.
    pub(super) fn update(&mut self, reading: Option<&RangeReading>, motion: &EgoMotion) {
        let Some(reading) = reading else {
            for at in &mut self.arc {
                *at = motion.apply_to_point(*at);
            }
            if let Some(coverage) = &mut self.coverage {
                coverage.advance(motion);
            }
            return;
        };
        self.arc.clear();
        let range_m = reading.range_m;
        let is_too_near = range_m < reading.min_m;
        let met_m = if is_too_near { reading.min_m } else { range_m };
        let half_rad = 0.5 * reading.field_of_view_rad;
        if met_m <= reading.max_m.min(RANGE_M) {
            for at in 0..ON_ARC {
                let angle = half_rad * (2.0 * at as f64 / (ON_ARC - 1) as f64 - 1.0);
                self.arc.push(place_along(reading, angle, met_m));
                // A sensor may sit within the footprint, where places do not count: what is nearer than
                // it measures is before the footprint.
                for beyond_m in BEFORE_FOOTPRINT_M.into_iter().filter(|_| is_too_near) {
                    self.arc.push(place_along(reading, angle, met_m + beyond_m));
                }
            }
        }
        // An infinite range is a statement of a sensor that hears nothing; NaN is none.
        let look = if range_m.is_nan() { Look::Unknown } else { Look::Seen };
        let eye: Point2<f64> = reading.robot_from_sensor.translation.vector.xy().into();
        let mut looks = Vec::with_capacity(3);
        for angle in [-half_rad, 0.0, half_rad] {
            let way = place_along(reading, angle, 1.0) - eye;
            looks.push((way.y.atan2(way.x), look));
        }
        self.coverage = Some(Coverage::new(eye, looks, 0.0));
    }

    /// Adds the arc on which something is.
    pub(super) fn add_to(&self, settings: &CollisionMonitorSettings, hazards: &mut BinnedHazards) {
        for at in &self.arc {
            let points = settings.min_points;
            hazards.push(Hazard { at: *at, points, kind: HazardKind::Still }, false);
        }
    }

    /// Returns the directions of its cone, if it ever delivered.
    pub(super) fn coverage(&self, min_share: f64) -> Option<Coverage> {
        self.coverage.clone().map(|coverage| coverage.with_min_share(min_share))
    }
}

/// Returns the place at a distance, m, in a direction in the frame of a range sensor, rad; robot frame,
/// m.
fn place_along(reading: &RangeReading, angle_rad: f64, range_m: f64) -> Point2<f64> {
    let ahead = Vector3::new(angle_rad.cos(), angle_rad.sin(), 0.0) * range_m;
    (reading.robot_from_sensor * Point3::from(ahead)).xy()
}
