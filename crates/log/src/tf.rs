//! Relative poses of frames over time.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::Isometry3;
use tagalong_core::Stamp;

use crate::msgs::TransformStamped;

/// Maximum time between a sample of a moving transform and a query, s.
const REACH_S: f64 = 0.5;
/// Time for which moving transforms are kept, s.
const KEPT_S: f64 = 15.0;
/// Maximum number of samples kept of one moving transform.
const MAX_SAMPLES: usize = 8192;
/// Maximum number of frames; a log with more is broken.
const MAX_FRAMES: usize = 4096;
/// Maximum length of a chain from a frame to the root.
const MAX_DEPTH: usize = 64;

/// Link from a frame to its parent.
#[derive(Clone, Debug)]
struct Link {
    parent: String,
    moving: VecDeque<(Stamp, Isometry3<f64>)>,
    fixed: Option<Isometry3<f64>>,
}

/// All transforms known at present. A static transform holds at all times.
#[derive(Clone, Debug, Default)]
pub struct TfBuffer {
    links: BTreeMap<String, Link>,
}

/// Removes the leading slash that frame names of ROS 1 had.
fn plain(name: &str) -> &str {
    name.trim_start_matches('/')
}

impl TfBuffer {
    /// Adds a transform; returns false if it is invalid (a number that is not finite, a quaternion
    /// that is no rotation, a frame that is its own parent) or there are too many frames.
    pub fn insert(&mut self, transform: &TransformStamped, is_static: bool) -> bool {
        let (child, parent) = (plain(&transform.child_frame_id), plain(&transform.header.frame_id));
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

    /// Returns true if the two frames are connected, at any time.
    pub fn connects(&self, a: &str, b: &str) -> bool {
        let (up_a, up_b) = (self.ancestors(plain(a)), self.ancestors(plain(b)));
        up_a.iter().any(|frame| up_b.contains(frame))
    }

    /// Returns the pose of frame `source` in frame `target` at a given time: it maps coordinates in
    /// `source` to coordinates in `target`. Moving transforms are interpolated, and held for half a
    /// second before their first and behind their last sample. `None` if the frames are not
    /// connected or a transform is not known at that time.
    pub fn lookup(&self, target: &str, source: &str, at: Stamp) -> Option<Isometry3<f64>> {
        let (up_t, up_s) = (self.ancestors(plain(target)), self.ancestors(plain(source)));
        let common = up_s.iter().find(|frame| up_t.contains(frame))?;
        let target = self.climb(&up_t, common, at)?;
        let source = self.climb(&up_s, common, at)?;
        Some(target.inverse() * source)
    }

    /// Returns the frame, its parent, and so on; ends at a loop.
    fn ancestors<'a>(&'a self, frame: &'a str) -> Vec<&'a str> {
        let mut out = vec![frame];
        while let Some(link) = out.last().and_then(|last| self.links.get(*last)) {
            // A loop of parents would never end.
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

    fn at(&self, at: Stamp) -> Option<Isometry3<f64>> {
        let after = self.moving.partition_point(|(stamp, _)| *stamp < at);
        let near = |sample: &(Stamp, Isometry3<f64>)| {
            (sample.0.seconds_since(at).abs() <= REACH_S).then_some(sample.1)
        };
        let before = after.checked_sub(1).and_then(|i| self.moving.get(i));
        let moving = match (before, self.moving.get(after)) {
            (Some(a), Some(b)) => Some(interpolate(a, b, at)),
            (Some(one), None) | (None, Some(one)) => near(one),
            (None, None) => None,
        };
        // A link may be on both topics; the static one serves without a sample.
        moving.or(self.fixed)
    }
}

/// Interpolates linearly in position and at constant speed in rotation.
fn interpolate(
    (t0, a): &(Stamp, Isometry3<f64>),
    (t1, b): &(Stamp, Isometry3<f64>),
    at: Stamp,
) -> Isometry3<f64> {
    let span = t1.seconds_since(*t0);
    let part = if span > 0.0 { at.seconds_since(*t0) / span } else { 0.0 };
    let translation = a.translation.vector.lerp(&b.translation.vector, part);
    // Between nearly equal rotations the length of the result is not exactly one.
    let mut rotation = a.rotation.try_slerp(&b.rotation, part, 1e-9).unwrap_or(a.rotation);
    rotation.renormalize();
    Isometry3::from_parts(translation.into(), rotation)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion, Vector3};
    use proptest::prelude::*;

    use super::*;
    use crate::msgs::{Header, Transform};

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
