//! Cameras with their mounts, the mirror of a panoramic camera, and boxes in images.
//!
//! A [`Camera`] converts between the robot frame (x forward, y left, z up, m) and pixels for any
//! [`Lens`]: pinhole with distortion, fisheye, unwrapped panorama, or none at all for a robot with
//! a laser scanner only.

mod camera;
mod distortion;
mod locate;
mod panorama;
mod rect;

/// Vectors, matrices and poses of the public types.
pub use nalgebra;

pub use camera::{Camera, Lens, Pinhole};
pub use distortion::Distortion;
pub use locate::{FaceDepth, PointEstimate};
pub use panorama::{ConicalMirror, Panorama};
pub use rect::{Extent, ImageBox, Rect};

/// Distance from the visible surface of a head to its centre, in metres.
///
/// Annotations give the surface of the head; states give its centre, because that point stays the
/// same when the robot drives around the person.
pub const HEAD_RADIUS_M: f64 = 0.08;

/// Side of the upper-body square (head and shoulders) at the person, in metres (the upper-body
/// template of Jafari et al., ICRA 2014, spans the same 0.57 m).
pub const UPPER_BODY_SIDE_M: f64 = 0.57;

/// Distance from the centre of a head to its top, in metres.
pub const HALF_HEAD_M: f64 = 0.115;

/// Distance of the head centre below the upper edge of the upper-body square, in metres (2.5 cm of
/// air and half a head).
pub const HEAD_BELOW_TOP_M: f64 = 0.14;
