//! Bodies of people as points, for viewers that cannot draw cylinders (Rerun): one cloud per person
//! in the frame of that person, which moves with the transforms.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use tagalong_core::Stamp;
use tagalong_geometry::HALF_HEAD_M;

use crate::msgs::{Header, PointCloud2};

/// Radii of trunk and head, m.
const TRUNK_M: f64 = 0.22;
const HEAD_M: f64 = 0.1;

/// Height of the shoulders below the centre of the head, m.
const SHOULDERS_BELOW_M: f64 = 0.2;

/// Number of points of a ring, and distance between two rings, m.
const RING_POINTS: u32 = 16;
const RING_APART_M: f64 = 0.08;

/// Change of the head height from which on the body is written again, m.
const RESIZED_M: f64 = 0.1;

/// Body of one person as it is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Body {
    /// Height of the head above the floor, m; `None` while nothing is shown.
    head_m: Option<f64>,
}

impl Body {
    /// Sets the height of the head above the floor, m, or `None` for a track that has ended.
    /// Returns false if the last cloud that was written is still valid.
    pub(super) fn update(&mut self, head_m: Option<f64>) -> bool {
        let holds = match (self.head_m, head_m) {
            (Some(shown), Some(now)) => (shown - now).abs() < RESIZED_M,
            (shown, now) => shown.is_none() && now.is_none(),
        };
        if !holds {
            self.head_m = head_m;
        }
        !holds
    }

    /// Returns the cloud in the frame of the person; empty for a track that has ended.
    pub(super) fn cloud(&self, at: Stamp, frame: &str) -> PointCloud2<'static> {
        cloud(&self.head_m.map(points).unwrap_or_default(), at, frame)
    }
}

/// Returns rings around trunk and head; the origin is the centre of the head.
fn points(head_m: f64) -> Vec<Vector3<f64>> {
    let mut out = Vec::new();
    let mut z = -head_m;
    while z <= -SHOULDERS_BELOW_M {
        out.extend(ring_points(TRUNK_M, z));
        z += RING_APART_M;
    }
    for part in [-0.9_f64, -0.45, 0.0, 0.45, 0.9] {
        out.extend(ring_points(HEAD_M * (1.0 - part * part).sqrt(), part * HALF_HEAD_M));
    }
    out
}

/// Returns the points of a horizontal circle at this height.
fn ring_points(radius: f64, z: f64) -> impl Iterator<Item = Vector3<f64>> {
    (0..RING_POINTS).map(move |i| {
        let (sin, cos) = (TAU * f64::from(i) / f64::from(RING_POINTS)).sin_cos();
        Vector3::new(radius * cos, radius * sin, z)
    })
}

fn cloud(points: &[Vector3<f64>], at: Stamp, frame: &str) -> PointCloud2<'static> {
    let points: Vec<[f32; 3]> =
        points.iter().map(|point| [point.x as f32, point.y as f32, point.z as f32]).collect();
    PointCloud2::of_points(Header::new(at, frame), &points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_stands_on_the_floor_and_ends_at_the_crown() {
        let heights: Vec<f64> = points(1.6).iter().map(|point| point.z).collect();
        let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        assert!((lowest + 1.6).abs() < 1e-9, "{lowest}");
        assert!((highest - 0.9 * HALF_HEAD_M).abs() < 1e-9, "{highest}");
    }

    #[test]
    fn a_cloud_is_written_when_it_changes_and_emptied_at_the_end() {
        let mut body = Body::default();
        assert!(!body.update(None), "nothing was shown");
        assert!(body.update(Some(1.6)));
        let first = body.cloud(Stamp::from_nanos(1), "person_1");
        assert_eq!(first.data.len(), 12 * first.width as usize);
        assert_eq!(first.header.frame_id, "person_1");
        assert!(!body.update(Some(1.65)), "as before");
        assert!(body.update(Some(1.2)), "sits down");
        assert!(body.update(None));
        assert_eq!(body.cloud(Stamp::from_nanos(2), "person_1").width, 0);
        assert!(!body.update(None), "emptied once");
    }
}
