//! A camera and a track for the tests of the writers.

use nalgebra::{Point3, SMatrix, Vector2};
use tagalong_core::{Estimate, Person, Track, TrackId};
use tagalong_geometry::{Camera, Pinhole};

pub(super) fn camera() -> Camera {
    Camera::mounted(Pinhole::centred(525.0, 640, 480), 640, 480, 1.2, 0.0, 0.0)
}

/// Returns a confirmed person three metres ahead and half a metre to the left.
pub(super) fn track(id: u32) -> Track {
    let person =
        Person { position: Point3::new(3.0, 0.5, 1.6), velocity: Vector2::new(0.5, -0.25) };
    let region = camera().upper_body(&person.position);
    let estimate = Estimate::new(person, SMatrix::<f64, 5, 5>::identity() * 0.01, region);
    Track::new(TrackId(id), estimate, 2.0).with_age(9)
}
