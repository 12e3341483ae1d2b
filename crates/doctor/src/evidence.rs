//! Input of the checks, collected in one pass over the frames.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use serde::Serialize;
use tagalong_app::missed::Cause;
use tagalong_core::{DepthImage, Frame, LaserScan, Stamp};
use tagalong_geometry::{Camera, Lens};
use tagalong_log::{InputSettings, Inputs, Inspection, LogError, LogFrame};
use tagalong_pipeline::{MissingSource, Suits};
use tagalong_vision::ground::{Ground, GroundSettings, ground_of_depth};
use tagalong_vision::quality::Exposure;
use tagalong_vision::registration::{EdgeOverlap, OverlapSettings};

use super::coverage::{Alternative, Coverage};
use super::depth_unit::JudgedDepth;
use super::trial::Trial;

/// Largest number of measured frames, spread over the frames that are read.
const SAMPLES: u64 = 24;

/// Largest number of depth images that are kept for a summary.
const KEPT_DEPTHS: usize = 8;

/// Displacement, m, and angle, rad, above which the camera counts as moving on the robot: the noise
/// of a floor that is measured at each frame, or a loose joint, gives less.
const CAMERA_MOVED_M: f64 = 0.05;
const CAMERA_TURNED_RAD: f64 = 0.05;

/// Facts about a config and a log.
pub struct Evidence {
    /// Name of the config.
    pub config: String,
    /// Contents of the log.
    pub inspection: Inspection,
    /// Remarks of the reader on what was lost.
    pub losses: Vec<String>,
    /// Remarks of the reader on images that make no frame although nothing was lost.
    pub frameless: Vec<String>,
    /// Reason why the pipeline lacks an input that it requires.
    pub refusal: Option<LogError>,
    /// Source that the controller lacks.
    pub missing: Option<MissingSource>,
    /// True if the user named the config: otherwise `tagalong run` ignores the controller.
    pub is_named: bool,
    /// `[input]` of the config.
    pub input: InputSettings,
    /// `[suits]` of the config.
    pub suits: Suits,
    /// True if the log has the motion of the robot.
    pub has_odometry: bool,
    /// Inputs of the pipeline.
    pub inputs: Inputs,
    /// Measurements in frames.
    pub samples: Samples,
    /// Assessment of their depth; the first check that needs it makes it.
    pub depth: OnceCell<Option<JudgedDepth>>,
    /// Numbers of frames that could be made, and of those that could not.
    pub reading: Reading,
    /// Motion of the robot.
    pub driven: Driven,
    /// Result of the pipeline.
    pub trial: Trial,
    /// Tracks of the pipeline compared with shapes that come and go.
    pub coverage: Coverage,
    /// Reasons why shapes that come and go have no track, with their numbers, most frequent first.
    pub causes: Vec<(Cause, usize)>,
    /// Share of the points in depth that come and go; `None` where none can be compared.
    pub changed: Option<f64>,
    /// Built-in configs that fit the log, the best first; only searched when they are needed.
    pub fitting: Vec<&'static str>,
    /// Results of other settings, if any were tried.
    pub alternatives: Vec<Alternative>,
    /// Preparations of images for neural networks, if the pipeline has one.
    pub preparations: Vec<Preparations>,
}

impl Evidence {
    /// Returns true if the height and tilt of the camera are only assumed.
    pub fn is_pose_assumed(&self) -> bool {
        self.inspection.facts.camera_source.starts_with("an assumption")
    }

    /// Returns true if the lens of the camera is a mere assumption.
    pub fn is_lens_assumed(&self) -> bool {
        let camera = self.samples.camera.as_ref();
        let is_pinhole = camera.is_some_and(|camera| matches!(camera.lens, Lens::Pinhole(_)));
        is_pinhole && self.inspection.facts.calibration_topic.is_none()
    }
}

/// Result of a preparation.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Prepared {
    /// Settings that differ from the config, as a line; empty for the config itself.
    pub change: String,
    /// Number of frames in which people are found.
    pub found: usize,
    /// Mean over the frames of the probability of the likeliest person, which is 0 in frames
    /// without people.
    pub score: f64,
}

/// Preparations of the images for one network.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Preparations {
    /// Number of frames that were tried.
    pub frames: usize,
    /// Preparation of the config.
    pub now: Prepared,
    /// Best other preparation, with as few settings as possible; none is tried if that of the
    /// config finds people in most frames.
    pub best: Option<Prepared>,
}

/// Numbers of frames of a pass.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reading {
    /// Number of frames that were made.
    pub made: u64,
    /// Number of images (or scans) until then that should have made a frame.
    pub wanted: u64,
    /// Number of all images (or scans) of the log.
    pub in_log: u64,
}

/// Motion of the robot, and of the camera on it, over the examined frames.
#[derive(Clone, Debug, Default)]
pub struct Driven {
    /// Length of the path, m.
    pub metres: f64,
    /// Sum of all turns, rad.
    pub turned_rad: f64,
    /// Largest distance of the camera from its first position on the robot, m.
    pub camera_moved_m: f64,
    /// Largest angle of the camera from its first direction on the robot, rad.
    pub camera_turned_rad: f64,
    first_camera: Option<Arc<Camera>>,
}

impl Driven {
    /// Adds the motion since the previous frame.
    pub fn take(&mut self, frame: &Frame) {
        self.metres += frame.motion.forward.hypot(frame.motion.left);
        self.turned_rad += frame.motion.turn.abs();
        let first = self.first_camera.get_or_insert_with(|| Arc::clone(&frame.camera));
        let moved = first.robot_from_camera.inv_mul(&frame.camera.robot_from_camera);
        self.camera_moved_m = self.camera_moved_m.max(moved.translation.vector.norm());
        self.camera_turned_rad = self.camera_turned_rad.max(moved.rotation.angle());
    }

    /// Returns true if the camera moves on the robot.
    pub fn moves_camera(&self) -> bool {
        self.camera_moved_m > CAMERA_MOVED_M || self.camera_turned_rad > CAMERA_TURNED_RAD
    }
}

/// Measurements of laser scans.
#[derive(Clone, Debug, Default)]
pub struct Scans {
    /// Number of scans.
    pub count: usize,
    /// Number of reflections in all of them.
    pub readings: usize,
    /// Number of rays: the highest index plus one.
    pub rays: u32,
    /// Angle between two rays, rad.
    pub increment_rad: f64,
    /// Distance of the farthest reflection from the scanner, m.
    pub farthest_m: f64,
    /// Height of the scanner above the floor, m.
    pub height_m: f64,
    /// Scan of about a second before.
    pub(super) earlier: Option<TimedRanges>,
    /// Rays with a reflection in two scans a second apart, and those of them that changed.
    pub(super) compared: u64,
    pub(super) changed: u64,
}

/// Ranges of a scan by their rays, m, with its time.
#[derive(Clone, Debug)]
pub(super) struct TimedRanges {
    stamp: Stamp,
    increment_rad: f64,
    ranges: BTreeMap<u32, f64>,
}

/// Time between two scans that are compared, s.
const SCANS_APART_S: RangeInclusive<f64> = 1.0..=1.5;
/// Difference of two ranges of a ray that counts as a change, m.
const RAY_CHANGED_M: f64 = 0.2;

impl Scans {
    fn take(&mut self, scan: &LaserScan, at: Stamp) {
        let eye = scan.robot_from_scanner.translation.vector;
        let ranges = scan.points.iter().map(|point| (point.coords - eye).norm());
        self.compare(TimedRanges {
            stamp: scan.stamp.unwrap_or(at),
            increment_rad: scan.increment_rad,
            ranges: scan.rays.iter().copied().zip(ranges.clone()).collect(),
        });
        self.count += 1;
        self.readings += scan.points.len();
        let reflected = scan.rays.last().copied();
        let unread = scan.unread.last().map(|unread| unread.ray);
        self.rays = self.rays.max(reflected.max(unread).map_or(0, |ray| ray + 1));
        self.increment_rad = scan.increment_rad.abs();
        self.farthest_m = ranges.fold(self.farthest_m, f64::max);
        self.height_m = eye.z;
    }

    /// Compares a scan with the one of a second before.
    fn compare(&mut self, now: TimedRanges) {
        let Some(earlier) = &self.earlier else {
            self.earlier = Some(now);
            return;
        };
        let apart_s = now.stamp.seconds_since(earlier.stamp);
        if (0.0..*SCANS_APART_S.start()).contains(&apart_s) {
            return;
        }
        // After a pause or a jump of the clock, or with other rays, two scans cannot be compared.
        if SCANS_APART_S.contains(&apart_s) && now.increment_rad == earlier.increment_rad {
            for (ray, range_m) in &now.ranges {
                if let Some(earlier_m) = earlier.ranges.get(ray) {
                    self.compared += 1;
                    self.changed += u64::from((range_m - earlier_m).abs() > RAY_CHANGED_M);
                }
            }
        }
        self.earlier = Some(now);
    }

    /// Returns the share of rays whose range changes by more than 0.2 m in a second; `None` if no two
    /// scans could be compared.
    pub fn changed(&self) -> Option<f64> {
        (self.compared > 0).then(|| self.changed as f64 / self.compared as f64)
    }

    /// Returns the share of rays that were reflected.
    pub fn valid(&self) -> f64 {
        self.readings as f64 / (self.count as f64 * f64::from(self.rays)).max(1.0)
    }
}

/// Measurements in frames that are spread over the log.
pub struct Samples {
    every: u64,
    /// Number of measured frames.
    pub count: usize,
    /// Camera of the first measured frame.
    pub camera: Option<Arc<Camera>>,
    /// Exposure of each measured frame.
    pub exposures: Vec<Exposure>,
    /// Some of the depth images.
    pub depths: Vec<Arc<DepthImage>>,
    /// Overlap of edges in depth with edges in colour.
    pub overlap: EdgeOverlap,
    /// Floor in each frame in which it was found, with the camera of that frame.
    pub floors: Vec<(Ground, Arc<Camera>)>,
    /// Laser scans, those of the first scanner first.
    pub scans: Vec<Scans>,
}

impl Samples {
    /// Creates empty samples for an expected number of frames.
    pub fn of(frames: u64) -> Self {
        Self {
            every: (frames / SAMPLES).max(1),
            count: 0,
            camera: None,
            exposures: Vec::new(),
            depths: Vec::new(),
            overlap: EdgeOverlap::new(OverlapSettings::default()),
            floors: Vec::new(),
            scans: Vec::new(),
        }
    }

    /// Measures the frame if it is selected.
    pub fn take(&mut self, number: u64, item: &LogFrame) {
        // Scans are cheap, and the number of rays is that of the longest one.
        self.take_scan(0, item.frame.laser(), item.frame.stamp);
        for (place, scan) in item.frame.further_scans().iter().enumerate() {
            self.take_scan(place + 1, scan.as_ref(), item.frame.stamp);
        }
        if !number.is_multiple_of(self.every) {
            return;
        }
        let frame = &item.frame;
        self.count += 1;
        self.camera.get_or_insert_with(|| Arc::clone(&frame.camera));
        let grey = frame.grey().ok();
        self.exposures.extend(grey.map(Exposure::of));
        let Some(depth) = frame.images().depth else { return };
        if self.depths.len() < KEPT_DEPTHS {
            self.depths.push(Arc::clone(&depth));
        }
        // Edges and floor are measured in pinhole images only.
        if frame.camera.panorama().is_some() {
            return;
        }
        if let Some(grey) = grey {
            self.overlap.add(grey, &depth);
        }
        let floor = ground_of_depth(&depth, &frame.camera, &GroundSettings::default());
        self.floors.extend(floor.map(|floor| (floor, Arc::clone(&frame.camera))));
    }
}

impl Samples {
    /// Measures the scan of a scanner, if it has one.
    fn take_scan(&mut self, scanner: usize, scan: Option<&LaserScan>, at: Stamp) {
        let Some(scan) = scan else { return };
        if self.scans.len() <= scanner {
            self.scans.resize(scanner + 1, Scans::default());
        }
        self.scans[scanner].take(scan, at);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Translation3, UnitQuaternion};
    use tagalong_core::{EgoMotion, Images};
    use tagalong_geometry::Pinhole;

    use super::*;

    /// Returns true if a camera with this pose in its first frame counts as moving.
    fn moves(forward_m: f64, turn_rad: f64) -> bool {
        let lens =
            Pinhole { fx: 100.0, fy: 100.0, cx: 2.0, cy: 2.0, distortion: Default::default() };
        let first = Camera::mounted(lens, 4, 4, 1.2, 0.0, 0.0);
        let moved = Isometry3::from_parts(
            Translation3::new(forward_m, 0.0, 0.0),
            UnitQuaternion::from_euler_angles(0.0, 0.0, turn_rad),
        );
        let later = Camera { robot_from_camera: moved * first.robot_from_camera, ..first.clone() };
        let mut driven = Driven::default();
        for camera in [first.clone(), later, first] {
            let motion = EgoMotion::at_rest(0.1);
            let camera = Arc::new(camera);
            driven.take(&Frame::new(1, Stamp::default(), camera, motion, Images::default()));
        }
        driven.moves_camera()
    }

    #[test]
    fn scans_are_counted_for_each_scanner() {
        let mut samples = Samples::of(3);
        let met = LaserScan::of_points(vec![nalgebra::Point3::new(2.0, 0.0, 0.0)]);
        samples.take_scan(2, Some(&met), Stamp::default());
        samples.take_scan(0, Some(&met), Stamp::default());
        samples.take_scan(0, None, Stamp::default());
        samples.take_scan(0, Some(&LaserScan::of_points(Vec::new())), Stamp::default());
        let counts: Vec<usize> = samples.scans.iter().map(|scans| scans.count).collect();
        let readings: Vec<usize> = samples.scans.iter().map(|scans| scans.readings).collect();
        assert_eq!((counts, readings), (vec![2, 0, 1], vec![1, 0, 1]));
    }

    #[test]
    fn a_camera_moves_that_leaves_its_first_pose_and_comes_back() {
        assert!(!moves(0.0, 0.0));
        assert!(!moves(0.01, 0.01), "a loose joint");
        assert!(moves(0.3, 0.0));
        assert!(moves(0.0, 0.2));
    }

    /// Returns the share of changed rays of a scanner that approaches a wall at a speed.
    fn changed_at(speed_mps: f64) -> Option<f64> {
        let mut scans = Scans::default();
        for index in 0..25 {
            let seconds = 0.1 * f64::from(index);
            let ranges = (0..90).map(|ray| (ray, 6.0 - speed_mps * seconds)).collect();
            let stamp = Stamp::default().plus_seconds(seconds);
            scans.compare(TimedRanges { stamp, increment_rad: 0.02, ranges });
        }
        scans.changed()
    }

    #[test]
    fn the_rays_of_a_scanner_that_drives_change() {
        assert_eq!(changed_at(0.0), Some(0.0));
        assert_eq!(changed_at(0.5), Some(1.0));
        assert_eq!(Scans::default().changed(), None);
    }
}
