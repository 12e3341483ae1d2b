//! Tracks, detections and pairs for the tests of plugins; a test only states the field that it is
//! about:
//!
//! ```
//! # use tagalong_core::Detection;
//! use tagalong_conformance::samples::{detection_at, track_at};
//! let weak = detection_at(3.0, 0.2).with_score(0.1);
//! let track = track_at(1, 3.0, 0.0);
//! assert!((track.estimate.person.position - weak.position).norm() < 0.21);
//! ```

use nalgebra::{Matrix3, Point3};
use tagalong_core::{Associations, Detection, Gate, Track};
use tagalong_geometry::{ImageBox, Rect};

use crate::scenes::{DT_S, level, track};

/// Gate between two frames that are 0.1 s apart, without an appearance memory.
pub const GATE: Gate<'static> = Gate::new(DT_S, 0.0);

/// Height of the heads, m.
const HEAD_M: f64 = 1.6;
/// Standard deviation of the positions, m.
const SIGMA_M: f64 = 0.1;

/// Returns a detection of a person at a position on the floor in the robot frame, m, with a
/// standard deviation of 0.1 m.
pub fn detection_at(x: f64, y: f64) -> Detection {
    let position = Point3::new(x, y, HEAD_M);
    Detection::new("sample", position, Matrix3::identity() * (SIGMA_M * SIGMA_M), 2.0)
        .with_image(ImageBox::upper_body(level().upper_body(&position)))
}

/// Returns a detection 3 m ahead with this box of the whole body, for plugins that compare boxes.
pub fn detection_in(region: Rect) -> Detection {
    detection_at(3.0, 0.0).with_image(ImageBox::full_body(region))
}

/// Returns a confirmed track at rest at a position on the floor in the robot frame, m, with a
/// standard deviation of 0.1 m.
pub fn track_at(id: u32, x: f64, y: f64) -> Track {
    track(id, Point3::new(x, y, HEAD_M), SIGMA_M, &level())
}

/// Returns a confirmed track 3 m ahead with this expected region.
pub fn track_in(id: u32, region: Rect) -> Track {
    let mut track = track_at(id, 3.0, 0.0);
    track.estimate.region = region;
    track
}

/// Returns the track with this variance of each coordinate of the position, m².
pub fn with_variance(mut track: Track, variance_m2: f64) -> Track {
    let mut place = track.estimate.covariance.fixed_view_mut::<3, 3>(0, 0);
    place.copy_from(&(Matrix3::identity() * variance_m2));
    track
}

/// Returns the pairs of an associator as indices of track and detection.
pub fn pairs(associations: &Associations) -> Vec<(usize, usize)> {
    associations.pairs.iter().map(|pair| (pair.track, pair.detection)).collect()
}
