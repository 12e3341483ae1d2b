//! Relative poses of frames over time, as in tf2.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Isometry3;
use tagalong_core::Stamp;

use crate::msgs::{Header, Transform, TransformStamped};
use crate::odometry::{AHEAD_S, age_between};

/// Maximum time between a sample of a moving transform and a query, s.
const REACH_S: f64 = 0.5;
/// Time for which samples of moving transforms are stored, s.
const KEPT_S: f64 = 15.0;
/// Maximum number of stored samples of one moving transform.
const MAX_SAMPLES: usize = 8192;
/// Maximum number of frames; a log with more is broken.
const MAX_FRAMES: usize = 4096;
/// Maximum length of a chain from a frame to the root.
const MAX_DEPTH: usize = 64;

/// Pose of a frame in its parent at a given time.
type Sample = (Stamp, Isometry3<f64>);

/// Link from a frame to its parent.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    parent: String,
    moving: VecDeque<Sample>,
    fixed: Option<Isometry3<f64>>,
}

/// All transforms that are known at present. A static transform is valid at all times.
#[derive(Clone, Debug, Default)]
pub struct TfBuffer {
    links: BTreeMap<String, Link>,
}

/// Removes the leading slash that frame names of ROS 1 had.
pub(crate) fn plain(name: &str) -> &str {
    name.trim_start_matches('/')
}

impl TfBuffer {
    /// Adds a transform; returns false if it is invalid (a number that is not finite, a quaternion
    /// that is no rotation, a frame that is its own parent) or if there are too many frames.
    pub fn insert(&mut self, transform: &TransformStamped, is_static: bool) -> bool {
        let child = plain(&transform.child_frame_id);
        let parent = plain(&transform.header.frame_id);
        let Some(pose) = transform.transform.isometry() else { return false };
        let full = self.links.len() >= MAX_FRAMES && !self.links.contains_key(child);
        if child == parent || child.is_empty() || full {
            return false;
        }
        let link = self.links.entry(child.to_owned()).or_insert_with(|| Link {
            parent: parent.to_owned(),
            moving: VecDeque::new(),
            fixed: None,
        });
        // Samples under different parents cannot be interpolated.
        if link.parent != parent {
            link.parent = parent.to_owned();
            link.moving.clear();
        }
        if is_static {
            link.fixed = Some(pose);
        } else {
            link.add(transform.header.stamp(), pose);
        }
        true
    }

    /// Returns the static transform of a frame, with its time left out.
    pub(crate) fn static_transform(&self, child: &str) -> Option<TransformStamped> {
        let link = self.links.get(plain(child))?;
        Some(TransformStamped {
            header: Header { frame_id: link.parent.clone(), ..Header::default() },
            child_frame_id: child.to_owned(),
            transform: Transform::from(&link.fixed?),
        })
    }

    /// Returns a copy of the link from a frame to its parent, for [`TfBuffer::restore`].
    pub(crate) fn saved(&self, child: &str) -> (String, Option<Link>) {
        let child = plain(child);
        (child.to_owned(), self.links.get(child).cloned())
    }

    /// Restores a link that was saved, or removes it if there was none.
    pub(crate) fn restore(&mut self, (child, link): (String, Option<Link>)) {
        match link {
            Some(link) => self.links.insert(child, link),
            None => self.links.remove(&child),
        };
    }

    /// Removes the samples of moving transforms.
    pub fn clear_moving(&mut self) {
        self.links.values_mut().for_each(|link| link.moving.clear());
    }

    /// Returns each frame that has a parent, with its parent.
    pub fn parents(&self) -> BTreeMap<String, String> {
        self.links.iter().map(|(child, link)| (child.clone(), link.parent.clone())).collect()
    }

    /// Returns true if the frame is a child or a parent.
    pub fn knows(&self, frame: &str) -> bool {
        let frame = plain(frame);
        self.links.contains_key(frame) || self.links.values().any(|link| link.parent == frame)
    }

    /// Returns true if the frame has a parent.
    pub(crate) fn knows_child(&self, frame: &str) -> bool {
        self.links.contains_key(plain(frame))
    }

    /// Returns the topmost ancestor of a frame; the frame itself if it has no parent.
    pub(crate) fn root_of<'a>(&'a self, frame: &'a str) -> &'a str {
        self.ancestors(plain(frame)).last().copied().unwrap_or(frame)
    }

    /// Returns true if the two frames are connected at any time.
    pub fn connects(&self, a: &str, b: &str) -> bool {
        let up_a = self.ancestors(plain(a));
        let up_b = self.ancestors(plain(b));
        up_a.iter().any(|frame| up_b.contains(frame))
    }

    /// Returns the pose of frame `source` in frame `target` at a given time: it maps coordinates in
    /// `source` to coordinates in `target`. Moving transforms are interpolated, and held for half a
    /// second before their first and after their last sample. `None` if the frames are not
    /// connected or a transform is not known at that time.
    pub fn lookup(&self, target: &str, source: &str, at: Stamp) -> Option<Isometry3<f64>> {
        let up_t = self.ancestors(plain(target));
        let up_s = self.ancestors(plain(source));
        let common = up_s.iter().find(|frame| up_t.contains(frame))?;
        let target = self.climb(&up_t, common, at)?;
        let source = self.climb(&up_s, common, at)?;
        Some(target.inverse() * source)
    }

    /// Returns the age of the pose of frame `source` in frame `target` at a given time, s: that of
    /// the oldest moving transform between them, by [`age_between`]. It is infinite if the frames
    /// are not connected, or only by static transforms, which are not readings.
    pub(crate) fn age_s(&self, target: &str, source: &str, at: Stamp) -> f64 {
        let ages = self.moving_between(target, source).filter_map(|link| link.age_s(at));
        ages.reduce(f64::max).unwrap_or(f64::INFINITY)
    }

    /// Returns the age of the pose of frame `source` in frame `target` at a given time, s: that of
    /// the oldest transform between them that only moves, by [`age_between`]. It is 0 if all of them
    /// are static, and infinite if the frames are not connected.
    pub(crate) fn pose_age_s(&self, target: &str, source: &str, at: Stamp) -> f64 {
        if !self.connects(target, source) {
            return f64::INFINITY;
        }
        let moving = self.moving_between(target, source).filter(|link| link.fixed.is_none());
        moving.filter_map(|link| link.age_s(at)).fold(0.0, f64::max)
    }

    /// Returns the time until the next sample of a moving transform, s, if that is too late to
    /// belong to the given time.
    pub(crate) fn ahead_s(&self, target: &str, source: &str, at: Stamp) -> Option<f64> {
        let ahead = self.moving_between(target, source).filter_map(|link| link.around(at).1);
        let ahead_s = ahead.map(|sample| sample.0.seconds_since(at)).reduce(f64::max)?;
        (ahead_s > AHEAD_S).then_some(ahead_s)
    }

    /// Returns the frames between two others that move relative to their parent and have no static
    /// transform as well, with the parent.
    pub(crate) fn moving_frames<'a>(
        &'a self,
        target: &'a str,
        source: &'a str,
    ) -> Vec<(&'a str, &'a str)> {
        let mut found = Vec::new();
        for frame in self.frames_between(target, source) {
            if let Some(link) = self.links.get(frame)
                && link.fixed.is_none()
            {
                found.push((frame, link.parent.as_str()));
            }
        }
        found
    }

    /// Yields the links between two frames; none if they are not connected.
    fn moving_between<'a>(
        &'a self,
        target: &'a str,
        source: &'a str,
    ) -> impl Iterator<Item = &'a Link> {
        self.frames_between(target, source).filter_map(|frame| self.links.get(frame))
    }

    /// Yields the frames from two frames up to their common ancestor, without that one.
    fn frames_between<'a>(
        &'a self,
        target: &'a str,
        source: &'a str,
    ) -> impl Iterator<Item = &'a str> {
        let up_t = self.ancestors(plain(target));
        let up_s = self.ancestors(plain(source));
        let common = up_s.iter().find(|frame| up_t.contains(frame)).copied();
        let ways = common.map(|common| [(up_t, common), (up_s, common)]);
        ways.into_iter()
            .flatten()
            .flat_map(|(up, common)| up.into_iter().take_while(move |frame| *frame != common))
    }

    /// Returns the pose of frame `source` in frame `target` from static transforms only, with
    /// moving transforms taken as the identity; `None` if the frames are not connected.
    pub(crate) fn static_pose(&self, target: &str, source: &str) -> Option<Isometry3<f64>> {
        let up_t = self.ancestors(plain(target));
        let up_s = self.ancestors(plain(source));
        let common = up_s.iter().find(|frame| up_t.contains(frame))?;
        let [target, source] = [&up_t, &up_s].map(|up| {
            let below = up.iter().take_while(|frame| *frame != common);
            let fixed = below.filter_map(|frame| self.links.get(*frame)?.fixed);
            fixed.fold(Isometry3::identity(), |pose, link| link * pose)
        });
        Some(target.inverse() * source)
    }

    /// Returns the frame, its parent, and so on; stops at a loop.
    fn ancestors<'a>(&'a self, frame: &'a str) -> Vec<&'a str> {
        let mut out = vec![frame];
        while let Some(link) = out.last().and_then(|last| self.links.get(*last)) {
            // Without this check a loop of parents would never end.
            if out.len() > MAX_DEPTH || out.contains(&link.parent.as_str()) {
                break;
            }
            out.push(&link.parent);
        }
        out
    }

    /// Returns `to_from_frame` along a list of ancestors.
    fn climb(&self, ancestors: &[&str], to: &str, at: Stamp) -> Option<Isometry3<f64>> {
        let mut pose = Isometry3::identity();
        for frame in ancestors.iter().take_while(|frame| **frame != to) {
            pose = self.links.get(*frame)?.at(at)? * pose;
        }
        Some(pose)
    }
}

impl Link {
    fn add(&mut self, stamp: Stamp, pose: Isometry3<f64>) {
        // A clock that steps back by more than a second has jumped.
        if self.moving.back().is_some_and(|(newest, _)| newest.seconds_since(stamp) > 1.0) {
            self.moving.clear();
        }
        let place = self.moving.partition_point(|(at, _)| *at < stamp);
        if self.moving.get(place).is_some_and(|(at, _)| *at == stamp) {
            self.moving[place].1 = pose;
        } else {
            self.moving.insert(place, (stamp, pose));
        }
        let newest = self.moving.back().map_or(stamp, |(at, _)| *at);
        while self.moving.len() > MAX_SAMPLES
            || self.moving.front().is_some_and(|(at, _)| newest.seconds_since(*at) > KEPT_S)
        {
            self.moving.pop_front();
        }
    }

    /// Returns the last sample before a given time, and the first one at or after it.
    fn around(&self, at: Stamp) -> (Option<&Sample>, Option<&Sample>) {
        let after = self.moving.partition_point(|(stamp, _)| *stamp < at);
        let before = after.checked_sub(1).and_then(|place| self.moving.get(place));
        (before, self.moving.get(after))
    }

    /// Returns the age of a moving transform at a given time, s; `None` for a static one.
    fn age_s(&self, at: Stamp) -> Option<f64> {
        if self.moving.is_empty() && self.fixed.is_some() {
            return None;
        }
        let (before, after) = self.around(at);
        Some(age_between(before.map(|sample| sample.0), after.map(|sample| sample.0), at))
    }

    fn at(&self, at: Stamp) -> Option<Isometry3<f64>> {
        let moving = match self.around(at) {
            (Some(a), Some(b)) => Some(interpolate(a, b, at)),
            (Some(one), None) | (None, Some(one)) => {
                (one.0.seconds_since(at).abs() <= REACH_S).then_some(one.1)
            }
            (None, None) => None,
        };
        // A link may be on both topics; the static one is used if there is no sample.
        moving.or(self.fixed)
    }
}

/// Interpolates linearly in position, and with constant angular velocity in rotation.
fn interpolate((t0, a): &Sample, (t1, b): &Sample, at: Stamp) -> Isometry3<f64> {
    let span = t1.seconds_since(*t0);
    let part = if span > 0.0 { at.seconds_since(*t0) / span } else { 0.0 };
    let translation = a.translation.vector.lerp(&b.translation.vector, part);
    // Between nearly equal rotations the norm of the result is not exactly one.
    let mut rotation = a.rotation.try_slerp(&b.rotation, part, 1e-9).unwrap_or(a.rotation);
    rotation.renormalize();
    Isometry3::from_parts(translation.into(), rotation)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion, Vector3};
    use proptest::prelude::*;

    use super::*;

    fn link(parent: &str, child: &str, at_s: f64, pose: Isometry3<f64>) -> TransformStamped {
        TransformStamped {
            header: Header::new(Stamp::default().plus_seconds(at_s), parent),
            child_frame_id: child.into(),
            transform: Transform::from(&pose),
        }
    }

    fn pose(x: f64, yaw: f64) -> Isometry3<f64> {
        Isometry3::new(Vector3::new(x, 0.0, 0.0), Vector3::new(0.0, 0.0, yaw))
    }

    fn at(seconds: f64) -> Stamp {
        Stamp::default().plus_seconds(seconds)
    }

    #[test]
    fn moving_links_are_interpolated_and_held_for_half_a_second() {
        let mut tf = TfBuffer::default();
        tf.insert(&link("base", "camera", 10.0, pose(0.0, 0.0)), false);
        tf.insert(&link("base", "camera", 12.0, pose(4.0, 1.0)), false);
        let middle = tf.lookup("base", "camera", at(10.5)).unwrap();
        assert!((middle.translation.x - 1.0).abs() < 1e-9);
        assert!((middle.rotation.euler_angles().2 - 0.25).abs() < 1e-9);
        assert!((tf.lookup("base", "/camera", at(12.4)).unwrap().translation.x - 4.0).abs() < 1e-9);
        assert!(tf.lookup("base", "camera", at(12.6)).is_none());
        assert!(tf.lookup("base", "camera", at(9.4)).is_none());
    }

    #[test]
    fn chains_go_up_and_down() {
        let mut tf = TfBuffer::default();
        tf.insert(&link("base", "mast", 0.0, pose(1.0, 0.0)), true);
        tf.insert(&link("mast", "colour", 0.0, pose(0.0, 0.5)), true);
        tf.insert(&link("mast", "depth", 0.0, pose(0.1, 0.0)), true);
        let expected = pose(0.0, 0.5).inverse() * pose(0.1, 0.0);
        let found = tf.lookup("colour", "depth", at(99.0)).unwrap();
        assert!((found.to_homogeneous() - expected.to_homogeneous()).norm() < 1e-12);
        assert!(tf.lookup("colour", "elsewhere", at(0.0)).is_none());
        assert!(tf.connects("colour", "base") && !tf.connects("base", "elsewhere"));
        assert_eq!([tf.root_of("/depth"), tf.root_of("base")], ["base", "base"]);
    }

    #[test]
    fn the_age_is_that_of_the_oldest_moving_link() {
        let mut tf = TfBuffer::default();
        tf.insert(&link("odom", "base", 10.0, pose(0.0, 0.0)), false);
        tf.insert(&link("odom", "base", 10.1, pose(0.1, 0.0)), false);
        tf.insert(&link("base", "camera", 0.0, pose(0.2, 0.0)), true);
        assert_eq!(tf.age_s("odom", "base", at(10.05)), 0.0);
        assert_eq!(tf.age_s("odom", "camera", at(10.05)), 0.0);
        assert!((tf.age_s("odom", "camera", at(10.4)) - 0.3).abs() < 1e-6);
        assert_eq!(tf.age_s("odom", "elsewhere", at(10.0)), f64::INFINITY);
        // A transform that never moves is no reading of a motion.
        assert_eq!(tf.age_s("base", "camera", at(10.0)), f64::INFINITY);
        tf.insert(&link("odom", "base", 20.0, pose(9.0, 0.0)), false);
        assert!((tf.age_s("odom", "base", at(10.2)) - 0.1).abs() < 1e-6);
        assert!((tf.ahead_s("odom", "base", at(10.2)).unwrap() - 9.8).abs() < 1e-6);
    }

    #[test]
    fn a_static_pose_does_not_age() {
        let mut tf = TfBuffer::default();
        tf.insert(&link("base", "head", 10.0, pose(1.0, 0.0)), false);
        tf.insert(&link("head", "camera", 3.0, pose(0.1, 0.0)), true);
        tf.insert(&link("base", "lidar", 3.0, pose(0.2, 0.0)), true);
        assert!((tf.pose_age_s("base", "camera", at(12.0)) - 2.0).abs() < 1e-6);
        assert_eq!(tf.pose_age_s("base", "lidar", at(900.0)), 0.0);
        assert_eq!(tf.pose_age_s("base", "elsewhere", at(10.0)), f64::INFINITY);
        tf.clear_moving();
        assert_eq!(tf.pose_age_s("base", "camera", at(10.0)), f64::INFINITY);
    }

    #[test]
    fn static_poses_leave_out_what_moves() {
        fn x(tf: &TfBuffer) -> Option<f64> {
            tf.static_pose("base", "camera").map(|pose| pose.translation.x)
        }

        let mut tf = TfBuffer::default();
        tf.insert(&link("base", "head", 10.0, pose(5.0, 1.0)), false);
        tf.insert(&link("head", "camera", 0.0, pose(0.2, 0.0)), true);
        assert_eq!((x(&tf), tf.static_pose("base", "elsewhere")), (Some(0.2), None));
        let saved = tf.saved("/camera");
        tf.insert(&link("head", "camera", 0.0, pose(0.3, 0.0)), true);
        assert_eq!(x(&tf), Some(0.3));
        tf.restore(saved);
        assert_eq!(x(&tf), Some(0.2));
        let none = tf.saved("lidar");
        tf.insert(&link("head", "lidar", 0.0, pose(0.3, 0.0)), true);
        tf.restore(none);
        assert!(!tf.knows("lidar"));
    }

    #[test]
    fn loops_end() {
        let mut tf = TfBuffer::default();
        tf.insert(&link("a", "b", 0.0, pose(1.0, 0.0)), true);
        tf.insert(&link("b", "a", 0.0, pose(1.0, 0.0)), true);
        assert!(!tf.insert(&link("c", "c", 0.0, pose(1.0, 0.0)), true));
        assert!(tf.lookup("a", "z", at(0.0)).is_none());
        assert!(tf.lookup("a", "b", at(0.0)).is_some());
    }

    #[test]
    fn what_is_no_transform_is_refused() {
        let mut bad = link("a", "b", 0.0, pose(1.0, 0.0));
        bad.transform.rotation.w = f64::NAN;
        assert!(!TfBuffer::default().insert(&bad, false));
    }

    #[test]
    fn memory_is_bounded() {
        let mut tf = TfBuffer::default();
        for i in 0..20_000 {
            tf.insert(&link("a", "b", f64::from(i) * 0.0005, pose(0.0, 0.0)), false);
            tf.insert(&link("a", &format!("f{i}"), 0.0, pose(0.0, 0.0)), true);
        }
        assert!(tf.links["b"].moving.len() <= MAX_SAMPLES && tf.links.len() <= MAX_FRAMES);
    }

    proptest! {
        #[test]
        fn back_and_forth_is_identity(x in -3.0..3.0f64, yaw in -3.0..3.0f64, roll in -1.0..1.0f64, t in 0.0..2.0f64) {
            let mut tf = TfBuffer::default();
            let tilted = Isometry3::from_parts(
                Translation3::new(x, 1.0, 2.0),
                UnitQuaternion::from_euler_angles(roll, 0.3, yaw),
            );
            tf.insert(&link("odom", "base", 0.0, pose(0.0, 0.0)), false);
            tf.insert(&link("odom", "base", 2.0, pose(x, yaw)), false);
            tf.insert(&link("base", "camera", 0.0, tilted), true);
            let there = tf.lookup("odom", "camera", at(t)).unwrap();
            let back = tf.lookup("camera", "odom", at(t)).unwrap();
            prop_assert!(((there * back).to_homogeneous() - nalgebra::Matrix4::identity()).norm() < 1e-9);
        }
    }
}
