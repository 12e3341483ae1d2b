//! Watchdog for sensors that repeat their data, or whose data do not change as the odometry
//! predicts.

use std::sync::Arc;

use nalgebra::{Isometry2, Isometry3, Point2, Point3};
use tagalong_core::{DepthImage, EgoMotion, Image, Images, LaserScan, Track, spatial_pose};
use tagalong_geometry::Camera;

/// Pixels of a depth image that are compared, at most, in each direction.
const GRID: usize = 48;
/// Motion since the reference after which the picture must have changed: m and rad.
const MOVED_M: f64 = 0.25;
const TURNED_RAD: f64 = 0.1;
/// Noise of the distances of a depth camera and of a laser scanner: m, and as a fraction.
const DEPTH_NOISE: [f64; 2] = [0.03, 0.02];
const SCAN_NOISE: [f64; 2] = [0.02, 0.01];
/// Comparisons in a row that contradict the odometry, from which on the sensor is frozen.
const IN_A_ROW: u32 = 2;
/// Readings that tell a moved picture from an unchanged one, at least.
const ENOUGH: u32 = 40;
/// Part of them that is unchanged from which on the sensor contradicts the odometry.
const UNCHANGED: f64 = 0.8;
/// Distance from a person within which readings have no say, m: the followed person is where they
/// were, and so is what they pull.
const OF_PERSON_M: f64 = 1.2;
/// Height below which a reading is of the floor, m: a floor looks the same from everywhere.
const FLOOR_M: f64 = 0.15;
/// Distance beyond which depth is not compared, m.
const FAR_M: f64 = 6.0;

/// Watch over one sensor.
pub(super) struct Watch<R> {
    /// Previous readings, bit for bit.
    previous: Vec<u32>,
    /// Number of new readings in a row that were the same.
    repeated: u32,
    /// Readings and pose of an earlier frame, with which the picture is compared.
    reference: Option<(R, Isometry2<f64>)>,
    /// Comparisons in a row that contradicted the odometry.
    contradictions: u32,
    /// True once enough of them did: a robot that stands cannot be contradicted, so this holds until
    /// the watch is set up anew.
    is_contradicted: bool,
    /// True once the readings were new again after that.
    is_new_again: bool,
}

impl<R> Default for Watch<R> {
    fn default() -> Self {
        Self {
            previous: Vec::new(),
            repeated: 0,
            reference: None,
            contradictions: 0,
            is_contradicted: false,
            is_new_again: false,
        }
    }
}

impl<R> Watch<R> {
    /// Returns true if the sensor has repeated itself so many times, or contradicted the odometry.
    pub(super) fn is_frozen(&self, identical_readings: u32) -> bool {
        self.is_contradicted || identical_readings > 0 && self.repeated >= identical_readings
    }

    /// Returns true if a frozen sensor shows an earlier time now: not once it delivers new readings,
    /// though a stop may last.
    pub(super) fn shows_past(&self, identical_readings: u32) -> bool {
        self.is_frozen(identical_readings) && !self.is_new_again
    }

    /// Forgets the pose of the reference, after a jump of the clock, but not what was found.
    pub(super) fn clear(&mut self) {
        self.reference = None;
        self.contradictions = 0;
    }

    /// Moves the reference by the motion since the last frame.
    pub(super) fn advance(&mut self, motion: &EgoMotion) {
        if let Some((_, since)) = &mut self.reference {
            *since *= motion.isometry();
        }
    }

    /// Takes in the result of a comparison, if it had one.
    fn judge(&mut self, contradicts: Option<bool>) {
        self.contradictions = match contradicts {
            Some(true) => self.contradictions.saturating_add(1),
            Some(false) => 0,
            None => self.contradictions,
        };
        if self.contradictions >= IN_A_ROW {
            self.is_contradicted = true;
            self.is_new_again = false;
        }
        self.is_new_again |= contradicts == Some(false);
    }

    /// Takes in readings, bit for bit: real ones have noise.
    fn compare_bits(&mut self, readings: impl Iterator<Item = u32>) {
        let mut is_same = true;
        let mut count = 0;
        for (place, reading) in readings.enumerate() {
            count = place + 1;
            match self.previous.get_mut(place) {
                Some(before) if *before == reading => {}
                Some(before) => {
                    is_same = false;
                    *before = reading;
                }
                None => {
                    is_same = false;
                    self.previous.push(reading);
                }
            }
        }
        if count != self.previous.len() {
            is_same = false;
            self.previous.truncate(count);
        }
        if is_same && count > 0 {
            self.repeated = self.repeated.saturating_add(1);
            self.is_new_again = false;
        } else {
            // Readings that never were the same have noise, and say nothing by being different.
            self.is_new_again |= self.repeated > 0;
            self.repeated = 0;
        }
    }

    /// Returns the motion since the reference, if that is enough to compare.
    fn moved(&self) -> Option<Isometry2<f64>> {
        let (_, since) = self.reference.as_ref()?;
        let is_far =
            since.translation.vector.norm() > MOVED_M || since.rotation.angle().abs() > TURNED_RAD;
        is_far.then_some(*since)
    }
}

/// Reference of a colour image: none, for only repetition is looked for.
pub(super) struct NoReference;

impl Watch<NoReference> {
    /// Takes in the colour or grey image of a frame. One of a single value, as in the dark, has no
    /// noise by which it could be told from the next one, and shows no person either.
    pub(super) fn add_picture(&mut self, images: &Images) {
        let pixels = if let Some(colour) = &images.colour {
            sampled(colour, |[red, green, blue]| u32::from_be_bytes([0, red, green, blue]))
        } else if let Some(grey) = &images.grey {
            sampled(grey, u32::from)
        } else {
            return;
        };
        if pixels.iter().all(|pixel| Some(pixel) == pixels.first()) {
            self.previous.clear();
            self.repeated = 0;
            return;
        }
        self.compare_bits(pixels.into_iter());
    }
}

/// Returns the pixels of an image on a grid.
fn sampled<P: Copy>(image: &Image<P>, bits: impl Fn(P) -> u32 + Copy) -> Vec<u32> {
    let step_x = image.width().div_ceil(GRID).max(1);
    let step_y = image.height().div_ceil(GRID).max(1);
    let rows = (0..image.height()).step_by(step_y).map(|y| image.row(y));
    rows.flat_map(|row| row.iter().step_by(step_x).map(|pixel| bits(*pixel))).collect()
}

/// Depth image of a reference.
pub(super) struct DepthReference {
    depth: Arc<DepthImage>,
    /// Places of the people in it, robot frame, m.
    people: Vec<Point2<f64>>,
}

impl Watch<DepthReference> {
    /// Takes in a new depth image.
    pub(super) fn add_depth(&mut self, camera: &Camera, depth: &Arc<DepthImage>, tracks: &[Track]) {
        let step_x = depth.width().div_ceil(GRID).max(1);
        let step_y = depth.height().div_ceil(GRID).max(1);
        self.compare_bits(sampled(depth, f32::to_bits).into_iter());
        let moved = self.moved();
        if self.reference.is_some() && moved.is_none() {
            return;
        }
        let people = places(tracks);
        if let (Some(moved), Some((then, _))) = (moved, &self.reference) {
            let found = contradicts_depth(camera, then, depth, &people, &moved, [step_x, step_y]);
            self.judge(found);
        }
        let reference = DepthReference { depth: Arc::clone(depth), people };
        self.reference = Some((reference, Isometry2::identity()));
    }
}

fn places(tracks: &[Track]) -> Vec<Point2<f64>> {
    tracks.iter().map(|track| track.estimate.person.position.xy()).collect()
}

fn is_of_person(people: &[Point2<f64>], at: &Point2<f64>) -> bool {
    people.iter().any(|person| (person - at).norm() < OF_PERSON_M)
}

/// Returns true if the picture is unchanged where the motion must have changed it, false if it is
/// not, and `None` if too few readings tell.
fn contradicts_depth(
    camera: &Camera,
    then: &DepthReference,
    now: &DepthImage,
    people: &[Point2<f64>],
    moved: &Isometry2<f64>,
    [step_x, step_y]: [usize; 2],
) -> Option<bool> {
    if (then.depth.width(), then.depth.height()) != (now.width(), now.height()) {
        return None;
    }
    let now_from_then = spatial_pose(moved).inverse();
    let mut counts = Counts::new(DEPTH_NOISE);
    for y in (0..now.height()).step_by(step_y) {
        for x in (0..now.width()).step_by(step_x) {
            let z = f64::from(then.depth.row(y)[x]);
            if !(0.0 < z && z < FAR_M) {
                continue;
            }
            let before = camera.back_project(Point2::new(x as f64, y as f64), z);
            let point = now_from_then * before;
            let is_telling = point.z > FLOOR_M
                && !is_of_person(&then.people, &before.xy())
                && !is_of_person(people, &point.xy());
            let Some(expected) = camera.project(&point).filter(|_| is_telling) else { continue };
            let place = [expected.x.round() as i64, expected.y.round() as i64];
            let (Some(old), Some(new)) = (flat(&then.depth, place), flat(now, place)) else {
                continue;
            };
            let old_at = camera.back_project(Point2::new(place[0] as f64, place[1] as f64), old);
            if old_at.z > FLOOR_M && !is_of_person(&then.people, &old_at.xy()) {
                counts.add(camera.depth_of(&point), old, new);
            }
        }
    }
    counts.contradicts()
}

/// Returns the depth at a pixel whose neighbours are about as far: on a slanted surface and at an edge
/// a part of a pixel makes another depth.
fn flat(depth: &DepthImage, [x, y]: [i64; 2]) -> Option<f64> {
    let middle = f64::from(depth.get(x, y)?);
    for dx in [-2, 2] {
        let beside = f64::from(depth.get(x + dx, y)?);
        let noise_m = DEPTH_NOISE[0] + DEPTH_NOISE[1] * middle;
        // Positive comparison, so that a missing reading is none.
        let is_flat = (beside - middle).abs() < noise_m;
        if !is_flat {
            return None;
        }
    }
    Some(middle)
}

/// Scan of a reference: ranges by the number of the ray.
pub(super) struct ScanReference {
    /// Pose of the scanner in the robot frame of its frame: a scan may be older than that.
    robot_from_scanner: Isometry3<f64>,
    ranges: Vec<f32>,
    left_out: Vec<bool>,
}

impl ScanReference {
    /// Returns true if the neighbours of a ray are about as far: along a slanted wall a part of a ray
    /// makes another range.
    fn is_flat(&self, ray: usize) -> bool {
        let before = ray.checked_sub(1);
        self.is_alike(ray, before) && self.is_alike(ray, Some(ray + 1))
    }

    /// Returns true if another ray is about as far as this one.
    fn is_alike(&self, ray: usize, other: Option<usize>) -> bool {
        let range = f64::from(self.ranges[ray]);
        let noise_m = SCAN_NOISE[0] + SCAN_NOISE[1] * range;
        let beside = other.and_then(|other| self.ranges.get(other));
        beside.is_some_and(|beside| (f64::from(*beside) - range).abs() < noise_m)
    }
}

impl Watch<ScanReference> {
    /// Takes in a new scan.
    pub(super) fn add_scan(&mut self, scan: &LaserScan, tracks: &[Track]) {
        let ranges = measured_ranges(scan);
        // Moving a scan to the time of its frame rounds the ranges: to a fiftieth of a millimetre they
        // are the same.
        self.compare_bits(
            ranges
                .iter()
                .zip(scan.rays.iter())
                .map(|(range, ray)| (range * 2e4).round().to_bits().rotate_left(7) ^ ray),
        );
        let moved = self.moved();
        if self.reference.is_some() && moved.is_none() || scan.increment_rad == 0.0 {
            return;
        }
        let people = places(tracks);
        let mut now = ScanReference {
            robot_from_scanner: scan.robot_from_scanner,
            ranges: Vec::new(),
            left_out: Vec::new(),
        };
        for ((point, ray), range) in scan.points.iter().zip(scan.rays.iter()).zip(&ranges) {
            let ray = *ray as usize;
            if ray >= now.ranges.len() {
                now.ranges.resize(ray + 1, f32::NAN);
                now.left_out.resize(ray + 1, true);
            }
            now.ranges[ray] = *range;
            now.left_out[ray] = is_of_person(&people, &point.xy());
        }
        if let (Some(moved), Some((then, _))) = (moved, &self.reference) {
            let found = contradicts_scan(scan, then, &now, &moved);
            self.judge(found);
        }
        self.reference = Some((now, Isometry2::identity()));
    }
}

/// Returns the ranges of the points of a scan as the scanner measured them, m, whatever the robot did
/// while it turned.
fn measured_ranges(scan: &LaserScan) -> Vec<f32> {
    let mut ranges = Vec::with_capacity(scan.points.len());
    for (ray, point) in scan.rays.iter().zip(scan.points.iter()) {
        let eye = scan.scanner_at(*ray).translation.vector;
        ranges.push((point.coords - eye).norm() as f32);
    }
    ranges
}

fn contradicts_scan(
    scan: &LaserScan,
    then: &ScanReference,
    now: &ScanReference,
    moved: &Isometry2<f64>,
) -> Option<bool> {
    let now_from_then = spatial_pose(moved).inverse();
    let scanner_from_robot = scan.robot_from_scanner.inverse();
    let mut counts = Counts::new(SCAN_NOISE);
    for (ray, range) in then.ranges.iter().enumerate() {
        let range = f64::from(*range);
        if then.left_out[ray] || !(0.0 < range && range < FAR_M) {
            continue;
        }
        let met = scan.place_in_scanner(ray as u32, range);
        let point: Point3<f64> = now_from_then * (then.robot_from_scanner * met);
        let seen = scanner_from_robot * point;
        let turns = std::f64::consts::TAU / scan.increment_rad.abs();
        let place = (seen.y.atan2(seen.x) - scan.first_rad) / scan.increment_rad;
        let there = place.round().rem_euclid(turns.round().max(1.0)) as usize;
        let (Some(old), Some(new)) = (then.ranges.get(there), now.ranges.get(there)) else {
            continue;
        };
        if then.left_out[there] || now.left_out[there] || !then.is_flat(there) {
            continue;
        }
        counts.add(seen.coords.xy().norm(), f64::from(*old), f64::from(*new));
    }
    counts.contradicts()
}

/// Readings that tell a moved picture from an unchanged one.
struct Counts {
    noise: [f64; 2],
    telling: u32,
    unchanged: u32,
}

impl Counts {
    fn new(noise: [f64; 2]) -> Self {
        Self { noise, telling: 0, unchanged: 0 }
    }

    /// Adds a reading: its distance if the odometry is right, that of the reference in this
    /// direction, and that of now.
    fn add(&mut self, expected_m: f64, old_m: f64, new_m: f64) {
        let noise_m = self.noise[0] + self.noise[1] * expected_m;
        // Where both agree the reading tells nothing: a wall along the way, for example.
        let tells = (expected_m - old_m).abs() > 2.0 * noise_m;
        if !(tells && new_m.is_finite() && new_m > 0.0) {
            return;
        }
        self.telling += 1;
        self.unchanged += u32::from((new_m - old_m).abs() < noise_m);
    }

    fn contradicts(&self) -> Option<bool> {
        (self.telling >= ENOUGH)
            .then(|| f64::from(self.unchanged) >= UNCHANGED * f64::from(self.telling))
    }
}

#[cfg(test)]
mod tests {
    use tagalong_core::SweepMotion;

    use super::*;

    const RANGES: [f64; 4] = [1.0, 2.5, 0.7, 4.0];

    /// A scan of the same ranges by a scanner that turns while the robot drives and turns.
    fn laser_scan(driven_m: f64, turned_rad: f64) -> LaserScan {
        let motion = SweepMotion {
            first: Isometry2::identity(),
            last: Isometry2::new(nalgebra::Vector2::new(driven_m, 0.0), turned_rad),
            last_ray: 3,
        };
        let empty = LaserScan::of_points(Vec::new())
            .with_scanner(Isometry3::translation(0.3, 0.1, 0.2))
            .with_rays(-1.0, 0.5, Vec::new())
            .with_motion(Some(motion));
        let mut points = Vec::new();
        for (ray, range_m) in (0..).zip(RANGES) {
            points.push(empty.place(ray, range_m));
        }
        LaserScan::of_points(points)
            .with_scanner(empty.robot_from_scanner)
            .with_rays(empty.first_rad, empty.increment_rad, vec![0, 1, 2, 3])
            .with_motion(Some(motion))
    }

    /// A frozen scanner repeats its ranges, not the points to which the odometry moves them.
    #[test]
    fn frozen_ranges_of_a_laser_are_the_same_however_the_robot_moves() {
        for (driven_m, turned_rad) in [(0.0, 0.0), (0.1, 0.0), (0.05, 0.2)] {
            let ranges = measured_ranges(&laser_scan(driven_m, turned_rad));
            assert_eq!(ranges.len(), RANGES.len());
            for (measured_m, range_m) in ranges.iter().zip(RANGES) {
                assert!((f64::from(*measured_m) - range_m).abs() < 1e-6, "{ranges:?}");
            }
        }
    }
}
