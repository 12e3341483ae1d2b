//! A patterned square before a patterned wall, and the track of a person there.

use std::sync::Arc;

use nalgebra::{Point3, SMatrix, Vector2};
use tagalong_core::{
    DepthImage, EgoMotion, Estimate, Frame, GreyImage, Images, Person, RgbImage, Stamp, Track,
    TrackId,
};
use tagalong_geometry::{Camera, Pinhole, Rect};

/// Returns the camera, 640x480.
pub fn camera() -> Arc<Camera> {
    Arc::new(Camera::mounted(Pinhole::centred(525.0, 640, 480), 640, 480, 1.3, 0.0, 0.0))
}

/// Returns a patterned square before a patterned wall at 6 m, and its depth, m.
pub fn frame(camera: &Arc<Camera>, of: Rect, index: u64, face_m: f32) -> Frame {
    let grey = GreyImage::from_fn(640, 480, |x, y| {
        let (x, y, kind) = if is_inside(&of, x, y) { (2 * x, y, 90) } else { (x, 3 * y, 20) };
        ((x * x / 64 + y * 7) % 120 + kind) as u8
    });
    let depth =
        DepthImage::from_fn(640, 480, |x, y| if is_inside(&of, x, y) { face_m } else { 6.0 });
    let images =
        Images { grey: Some(Arc::new(grey)), depth: Some(Arc::new(depth)), ..Images::default() };
    let stamp = Stamp::default().plus_seconds(index as f64 * 0.04);
    Frame::new(index, stamp, Arc::clone(camera), EgoMotion::at_rest(0.04), images)
}

/// Says whether a pixel lies in a box.
fn is_inside(of: &Rect, x: usize, y: usize) -> bool {
    of.contains(nalgebra::Point2::new(x as f64, y as f64))
}

/// Returns the colour image of the patterned square before the patterned wall, without depth.
pub fn coloured_frame(camera: &Arc<Camera>, of: Rect, index: u64) -> Frame {
    let colour = RgbImage::from_fn(640, 480, |x, y| {
        let is_inside = of.contains(nalgebra::Point2::new(x as f64, y as f64));
        let along = if is_inside { 2 * x.saturating_sub(of.x as usize) } else { x };
        let down = if is_inside { 7 * y } else { 21 * y };
        let least = if is_inside { 90 } else { 20 };
        [((along * along / 64 + down) % 120 + least) as u8; 3]
    });
    let images = Images { colour: Some(Arc::new(colour)), ..Images::default() };
    let stamp = Stamp::default().plus_seconds(index as f64 * 0.04);
    Frame::new(index, stamp, Arc::clone(camera), EgoMotion::at_rest(0.04), images)
}

/// Returns a track at 3 m with this standard deviation, m.
pub fn track(camera: &Camera, sigma_m: f64) -> Track {
    let head = Point3::new(3.0, 0.0, 1.35);
    let region = camera.upper_body(&head);
    let person = Person { position: head, velocity: Vector2::zeros() };
    let estimate = Estimate::new(person, SMatrix::identity() * sigma_m.powi(2), region);
    Track::new(TrackId(1), estimate, 2.0).with_age(9)
}
