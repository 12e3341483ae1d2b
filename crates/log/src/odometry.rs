//! Pose of the robot at the time of an image.

use std::collections::VecDeque;

use nalgebra::Isometry2;
use tagalong_core::{MAX_ODOMETRY_GAP_S, MAX_ODOMETRY_STEP_M, MAX_ODOMETRY_STEP_RAD, Stamp};

/// Time for which the motion is extrapolated beyond the last pose, s.
const EXTRAPOLATE_S: f64 = 0.2;
/// Time for which poses are kept, s.
const KEPT_S: f64 = 15.0;
/// Maximum number of poses kept.
const MAX_POSES: usize = 16_384;
/// Step back of the clock beyond which it has jumped, s.
const CLOCK_JUMP_S: f64 = 1.0;
/// Maximum time from a frame to a later reading that still counts as odometry of that frame, s.
pub(crate) const AHEAD_S: f64 = 1.0;

/// Pose with its time.
type TimedPose = (Stamp, Isometry2<f64>);

/// Pose at a requested time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct PoseAt {
    /// `odom_from_robot`.
    pub pose: Isometry2<f64>,
    /// True if no odometry was near in time, so that the pose is a guess.
    pub stale: bool,
}

/// Returns the age of odometry at a given time, s, from the times of the readings before and after
/// it: 0 between readings at most [`MAX_ODOMETRY_GAP_S`] apart, otherwise the time since the
/// reading before. Without one it is the time until the reading after, which may be the first of
/// all. It is infinite without either; a reading more than [`AHEAD_S`] later does not count.
pub(crate) fn age_between(before: Option<Stamp>, after: Option<Stamp>, at: Stamp) -> f64 {
    let after = after.filter(|after| after.seconds_since(at) <= AHEAD_S);
    match (before, after) {
        (_, Some(after)) if after == at => 0.0,
        (Some(before), Some(after)) if after.seconds_since(before) <= MAX_ODOMETRY_GAP_S => 0.0,
        (Some(before), _) => at.seconds_since(before),
        (None, Some(after)) => after.seconds_since(at),
        (None, None) => f64::INFINITY,
    }
}

/// Buffer of the odometry of the last seconds.
#[derive(Clone, Debug, Default)]
pub struct PoseBuffer {
    poses: VecDeque<TimedPose>,
}

impl PoseBuffer {
    /// Adds a pose; returns false if it is not finite. If the clock has jumped, the old poses are
    /// removed.
    pub fn push(&mut self, stamp: Stamp, pose: Isometry2<f64>) -> bool {
        let numbers = [pose.translation.x, pose.translation.y, pose.rotation.angle()];
        if numbers.iter().any(|v| !v.is_finite()) {
            return false;
        }
        let newest = self.poses.back().map_or(stamp, |(at, _)| *at);
        if newest.seconds_since(stamp) > CLOCK_JUMP_S {
            self.poses.clear();
        }
        let place = self.poses.partition_point(|(at, _)| *at < stamp);
        if self.poses.get(place).is_none_or(|(at, _)| *at != stamp) {
            self.poses.insert(place, (stamp, pose));
        }
        self.forget_old();
        true
    }

    /// Removes all poses.
    pub fn clear(&mut self) {
        self.poses.clear();
    }

    fn forget_old(&mut self) {
        let Some((newest, _)) = self.poses.back().copied() else { return };
        while self.poses.len() > MAX_POSES
            || self.poses.front().is_some_and(|(at, _)| newest.seconds_since(*at) > KEPT_S)
        {
            self.poses.pop_front();
        }
    }

    /// Returns the pose at a given time, interpolated; `None` without odometry. Readings that are
    /// more than a second later are not used.
    pub fn at(&self, stamp: Stamp) -> Option<PoseAt> {
        let (before, after) = self.around(stamp);
        let after = after.filter(|(at, _)| at.seconds_since(stamp) <= AHEAD_S);
        match (before, after) {
            (Some(a), Some(b)) => Some(PoseAt {
                pose: blend(a, b, stamp),
                // A pose exactly at the stamp is valid, whatever the gap before it.
                stale: b.0 != stamp && b.0.seconds_since(a.0) > MAX_ODOMETRY_GAP_S,
            }),
            (Some(last), None) => Some(self.beyond(last, stamp)),
            (None, Some((first, pose))) => {
                Some(PoseAt { pose, stale: first.seconds_since(stamp) > MAX_ODOMETRY_GAP_S })
            }
            (None, None) => None,
        }
    }

    /// Returns the age of odometry at a given time, s: 0 if the pose is interpolated, infinite
    /// without odometry.
    pub fn age_s(&self, stamp: Stamp) -> f64 {
        let (before, after) = self.around(stamp);
        age_between(before.map(|(at, _)| at), after.map(|(at, _)| at), stamp)
    }

    /// Returns the time from a frame to the next reading, s, if that is too late to be odometry of
    /// the frame, because it has another clock, or because the recording of odometry begins later.
    pub(crate) fn ahead_s(&self, stamp: Stamp) -> Option<f64> {
        let (_, after) = self.around(stamp);
        after.map(|(at, _)| at.seconds_since(stamp)).filter(|ahead_s| *ahead_s > AHEAD_S)
    }

    /// Returns the last pose before a given time, and the first one at or after it.
    fn around(&self, stamp: Stamp) -> (Option<TimedPose>, Option<TimedPose>) {
        let after = self.poses.partition_point(|(at, _)| *at < stamp);
        let before = after.checked_sub(1).map(|place| self.poses[place]);
        (before, self.poses.get(after).copied())
    }

    /// Extrapolates beyond the last pose: the last motion continues for a short time.
    fn beyond(&self, last: (Stamp, Isometry2<f64>), stamp: Stamp) -> PoseAt {
        let ahead = stamp.seconds_since(last.0);
        // These are not simply the last two poses, because poses of much later times may follow.
        let place = self.poses.partition_point(|(at, _)| *at < last.0);
        let known = place.checked_sub(1).map(|place| self.poses[place]);
        let pose = match known {
            // Two poses far apart in time do not determine the present velocity.
            Some(previous) if last.0.seconds_since(previous.0) <= MAX_ODOMETRY_GAP_S => {
                blend(previous, last, last.0.plus_seconds(ahead.min(EXTRAPOLATE_S)))
            }
            _ => last.1,
        };
        PoseAt { pose, stale: ahead > MAX_ODOMETRY_GAP_S }
    }

    /// Returns true if the poses between two times contain a jump.
    pub fn jumped_between(&self, from: Stamp, to: Stamp) -> bool {
        let pairs = self.poses.iter().zip(self.poses.iter().skip(1));
        pairs.filter(|(a, b)| a.0 < to && from < b.0).any(|(a, b)| {
            let step_m = (b.1.translation.vector - a.1.translation.vector).norm();
            let turned_rad = a.1.rotation.angle_to(&b.1.rotation).abs();
            (step_m > MAX_ODOMETRY_STEP_M || turned_rad > MAX_ODOMETRY_STEP_RAD)
                // A large step over a gap may be real motion.
                && b.0.seconds_since(a.0) <= MAX_ODOMETRY_GAP_S
        })
    }
}

/// Interpolates linearly between two poses, and extrapolates beyond them.
fn blend((t0, a): TimedPose, (t1, b): TimedPose, at: Stamp) -> Isometry2<f64> {
    let span = t1.seconds_since(t0);
    let part = if span > 0.0 { at.seconds_since(t0) / span } else { 0.0 };
    let turn = (a.rotation.inverse() * b.rotation).angle();
    Isometry2::new(
        a.translation.vector.lerp(&b.translation.vector, part),
        a.rotation.angle() + part * turn,
    )
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use proptest::prelude::*;

    use super::*;

    fn at(seconds: f64) -> Stamp {
        Stamp::default().plus_seconds(seconds)
    }

    fn pose(x: f64, turn: f64) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(x, 0.0), turn)
    }

    fn driven(stamps: &[f64]) -> PoseBuffer {
        let mut buffer = PoseBuffer::default();
        stamps.iter().for_each(|t| assert!(buffer.push(at(*t), pose(*t, 0.1 * t))));
        buffer
    }

    #[test]
    fn short_gaps_are_bridged_and_long_ones_are_stale() {
        let buffer = driven(&[10.0, 10.4, 11.4]);
        let inside = buffer.at(at(10.1)).unwrap();
        assert!((inside.pose.translation.x - 10.1).abs() < 1e-6 && !inside.stale);
        assert!(buffer.at(at(11.0)).unwrap().stale);
        assert!(!buffer.at(at(11.4)).unwrap().stale);
        assert!(buffer.at(at(12.0)).unwrap().stale);
        assert!(buffer.at(at(9.4)).unwrap().stale);
        assert!(PoseBuffer::default().at(at(1.0)).is_none());
    }

    #[test]
    fn the_last_motion_goes_on_for_a_fifth_of_a_second() {
        let buffer = driven(&[10.0, 10.1]);
        assert!((buffer.at(at(10.25)).unwrap().pose.translation.x - 10.25).abs() < 1e-6);
        assert!((buffer.at(at(10.5)).unwrap().pose.translation.x - 10.3).abs() < 1e-6);
    }

    #[test]
    fn a_jump_is_seen_where_it_happens() {
        let mut buffer = driven(&[10.0, 10.1]);
        buffer.push(at(10.2), pose(13.0, 0.0));
        assert!(buffer.jumped_between(at(10.05), at(10.25)));
        assert!(!buffer.jumped_between(at(9.0), at(10.1)));
        assert!(!buffer.jumped_between(at(10.2), at(10.9)));
    }

    #[test]
    fn a_heading_that_jumps_is_seen_where_it_happens() {
        for (turned_rad, is_jump) in [(1.6, true), (-3.0, true), (1.5, false), (6.2, false)] {
            let mut buffer = driven(&[10.0, 10.1]);
            let heading_rad = 0.1 * 10.1;
            buffer.push(at(10.2), pose(10.1, heading_rad + turned_rad));
            assert_eq!(buffer.jumped_between(at(10.05), at(10.25)), is_jump, "{turned_rad}");
        }
    }

    #[test]
    fn a_clock_that_jumps_back_starts_anew() {
        let mut buffer = driven(&[100.0, 100.1]);
        buffer.push(at(3.0), pose(7.0, 0.0));
        assert_eq!(buffer.at(at(3.0)).unwrap().pose.translation.x, 7.0);
        assert!(buffer.at(at(100.0)).unwrap().stale);
        assert!(!buffer.push(at(3.1), pose(f64::NAN, 0.0)));
    }

    #[test]
    fn age_is_the_time_since_the_last_reading_and_none_between_readings() {
        let buffer = driven(&[10.0, 10.4, 11.4]);
        // Between readings that are far apart nothing is known of the motion.
        for (seconds, age_s) in [(10.2, 0.0), (11.4, 0.0), (12.0, 0.6), (10.9, 0.5), (9.7, 0.3)] {
            assert!((buffer.age_s(at(seconds)) - age_s).abs() < 5e-4, "{seconds}");
        }
        assert_eq!(PoseBuffer::default().age_s(at(1.0)), f64::INFINITY);
    }

    #[test]
    fn a_reading_far_ahead_is_none_of_this_time() {
        let buffer = driven(&[10.0, 10.1, 12.0]);
        let found = buffer.at(at(10.2)).unwrap();
        assert!((found.pose.translation.x - 10.2).abs() < 1e-6 && !found.stale, "{found:?}");
        assert!((buffer.age_s(at(10.2)) - 0.1).abs() < 1e-6);
        assert!(buffer.at(at(8.9)).is_none() && buffer.age_s(at(8.9)) == f64::INFINITY);
        assert_eq!(buffer.ahead_s(at(10.5)).map(|ahead_s| ahead_s.round()), Some(2.0));
        assert_eq!(buffer.ahead_s(at(11.5)), None);
    }

    proptest! {
        #[test]
        fn order_of_arrival_does_not_matter(t in 0.0..0.9f64, seed in any::<u64>()) {
            let mut stamps: Vec<f64> = (0..10).map(|i| f64::from(i) * 0.1).collect();
            let sorted = driven(&stamps);
            let len = stamps.len();
            (0..len).for_each(|i| stamps.swap(i, (seed >> (4 * i)) as usize % len));
            prop_assert_eq!(driven(&stamps).at(at(t)), sorted.at(at(t)));
        }
    }
}
