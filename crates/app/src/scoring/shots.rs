use std::path::Path;
use std::sync::Arc;

use crate::outcome::Failure;
use nalgebra::Isometry2;
use tagalong_geometry::Camera;
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits, LogFrame};

use super::Rate;

/// Time and pose of a frame of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// Index of the colour image, from 1.
    pub number: u32,
    /// Stamp of the image, ns.
    pub stamp_ns: u64,
    /// The camera, with its pose in the robot frame.
    pub camera: Arc<Camera>,
    /// Pose of the robot in the odometry frame.
    pub odom_from_robot: Isometry2<f64>,
}

impl Shot {
    /// Extracts the time and the poses of a frame.
    pub fn of(item: &LogFrame) -> Self {
        let frame = &item.frame;
        Self {
            number: u32::try_from(frame.index).unwrap_or(u32::MAX),
            stamp_ns: frame.stamp.nanos(),
            camera: Arc::clone(&frame.camera),
            odom_from_robot: item.odom_from_robot,
        }
    }
}

/// Frames that a log delivered, by number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shots {
    shots: Vec<Shot>,
    /// Stamps that never decrease, ns since the first: after a backward jump of the clock the time
    /// continues with one millisecond.
    elapsed_ns: Vec<i64>,
}

impl Shots {
    /// Reads the frames of a log.
    ///
    /// # Errors
    /// A log that cannot be used.
    pub fn read(path: &Path, input: &InputSettings, limits: &Limits) -> Result<Self, Failure> {
        // The right image would only cost time for decoding.
        let inputs = Inputs::ANY.without(Input::Right);
        let mut source = FrameSource::open(path, input, limits, inputs)?;
        let mut shots = Self::default();
        while let Some(item) = source.next_frame() {
            shots.push(Shot::of(&item));
        }
        Ok(shots)
    }

    /// Adds the next frame.
    pub fn push(&mut self, shot: Shot) {
        let elapsed = match (self.shots.last(), self.elapsed_ns.last()) {
            (Some(last), Some(elapsed)) => {
                let step = shot.stamp_ns as i64 - last.stamp_ns as i64;
                elapsed + if step > 0 { step } else { 1_000_000 }
            }
            _ => 0,
        };
        self.elapsed_ns.push(elapsed);
        self.shots.push(shot);
    }

    /// Returns the first frame.
    pub fn first(&self) -> Option<&Shot> {
        self.shots.first()
    }

    /// Returns all frames in order.
    pub fn iter(&self) -> impl Iterator<Item = &Shot> {
        self.shots.iter()
    }

    /// Returns the number of the last frame; 0 without any.
    pub fn last(&self) -> u32 {
        self.shots.last().map_or(0, |shot| shot.number)
    }

    /// Returns the frame with this number, or the nearest one before it, or the first.
    pub fn at(&self, number: u32) -> Option<&Shot> {
        let after = self.shots.partition_point(|shot| shot.number <= number);
        self.shots.get(after.saturating_sub(1))
    }

    /// Returns the frame with the nearest stamp, if the difference is at most `within_ns`.
    pub fn near(&self, stamp_ns: u64, within_ns: u64) -> Option<&Shot> {
        let nearest = self.shots.iter().min_by_key(|shot| shot.stamp_ns.abs_diff(stamp_ns))?;
        (nearest.stamp_ns.abs_diff(stamp_ns) <= within_ns).then_some(nearest)
    }

    /// Returns the time of a frame since the first one, ns. Frames that were not delivered are
    /// interpolated; without a log all frames are spaced by `rate`.
    pub fn stamp_ns(&self, number: u32, rate: Rate) -> i64 {
        let after = self.shots.partition_point(|shot| shot.number < number);
        let before = after.checked_sub(1).and_then(|index| self.number_and_time(index));
        let number = i64::from(number);
        match (before, self.number_and_time(after)) {
            (_, Some((at, elapsed))) if at == number => elapsed,
            (Some((a, from)), Some((b, to))) => from + (to - from) * (number - a) / (b - a),
            (Some((last, elapsed)), None) => elapsed + (number - last) * self.spacing_ns(),
            (None, Some((first, elapsed))) => elapsed - (first - number) * self.spacing_ns(),
            (None, None) => ((number - 1) as f64 / rate.0 * 1e9).round() as i64,
        }
    }

    /// Returns the number of a shot, and its time since the first one.
    fn number_and_time(&self, index: usize) -> Option<(i64, i64)> {
        Some((i64::from(self.shots.get(index)?.number), *self.elapsed_ns.get(index)?))
    }

    /// Returns the mean time between two images, ns.
    fn spacing_ns(&self) -> i64 {
        let first = self.shots.first();
        let last = self.shots.last();
        let steps = last.map_or(0, |l| l.number) - first.map_or(0, |f| f.number);
        let elapsed = self.elapsed_ns.last().copied().unwrap_or(0);
        // A single frame has no spacing, so 10 Hz is assumed.
        if steps > 0 { (elapsed / i64::from(steps)).max(1) } else { 100_000_000 }
    }

    /// Returns the time from the first to the last frame, s.
    pub fn duration_s(&self) -> f64 {
        self.elapsed_ns.last().copied().unwrap_or(0) as f64 * 1e-9
    }

    /// Returns the frames per second.
    pub fn rate_hz(&self) -> f64 {
        1e9 / self.spacing_ns() as f64
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;
    use tagalong_geometry::Lens;

    use super::*;

    fn shots(frames: &[(u32, u64)]) -> Shots {
        let camera = Arc::new(Camera {
            lens: Lens::Blind,
            width: 4,
            height: 3,
            robot_from_camera: Isometry3::identity(),
        });
        let mut shots = Shots::default();
        for &(number, stamp_ns) in frames {
            shots.push(Shot {
                number,
                stamp_ns,
                camera: Arc::clone(&camera),
                odom_from_robot: Isometry2::identity(),
            });
        }
        shots
    }

    #[test]
    fn frames_that_were_not_delivered_lie_between_their_neighbours() {
        let shots = shots(&[(2, 1_000), (3, 2_000), (6, 5_000)]);
        let times: Vec<i64> = (1..=7).map(|n| shots.stamp_ns(n, Rate(1.0))).collect();
        assert_eq!(times, [-1_000, 0, 1_000, 2_000, 3_000, 4_000, 5_000]);
        assert_eq!((shots.at(1).unwrap().number, shots.at(5).unwrap().number), (2, 3));
    }

    #[test]
    fn time_never_runs_backwards() {
        let shots = shots(&[(1, 9_000_000), (2, 10_000_000), (3, 500), (4, 600)]);
        assert_eq!(shots.elapsed_ns, [0, 1_000_000, 2_000_000, 2_000_100]);
    }

    #[test]
    fn without_a_log_frames_are_evenly_spaced() {
        assert_eq!(Shots::default().stamp_ns(3, Rate(10.0)), 200_000_000);
    }
}
