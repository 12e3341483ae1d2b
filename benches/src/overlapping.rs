//! Two people that overlap, and scenes of two people around them.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Point2, Point3, Vector2};
use tagalong_core::{DepthImage, EgoMotion, Frame, Images, Person, Stamp};
use tagalong_depth_template::render;
use tagalong_geometry::{Camera, Pinhole};

const HEADS: [Point3<f64>; 2] = [Point3::new(2.5, 0.1, 1.6), Point3::new(3.4, -0.15, 1.65)];

/// Returns the frame of a depth image.
pub fn frame(index: u64, depth: &Arc<DepthImage>, camera: &Arc<Camera>) -> Frame {
    let images = Images { depth: Some(Arc::clone(depth)), ..Images::default() };
    let stamp = Stamp::from_nanos(index * 100_000_000);
    Frame::new(index, stamp, Arc::clone(camera), EgoMotion::at_rest(0.1), images)
}

/// Returns the camera of P3, 512x384.
pub fn camera() -> Arc<Camera> {
    Arc::new(Camera::mounted(Pinhole::centred(366.0, 512, 384), 512, 384, 1.2, 0.0, 0.0))
}

/// Returns the depth of two people that overlap, in front of a wall, m.
pub fn depth(camera: &Camera) -> DepthImage {
    let body = render(PI, 0.0);
    DepthImage::from_fn(512, 384, |u, v| {
        let ray = camera.ray(Point2::new(u as f64, v as f64));
        let people = HEADS.iter().map(|head| {
            let down = ray.y * head.x - (1.2 - head.z);
            head.x + body.at(ray.x * head.x + head.y, down.min(0.45))
        });
        people.fold(5.5, f64::min) as f32
    })
}

/// A number in -1..1 that looks random.
fn noise(i: usize) -> f64 {
    ((i as f64 * 12.9898).sin() * 43_758.547).fract()
}

/// Returns scenes of two people around the truth; depth and height vary unless they are held.
pub fn scenes(count: usize, held: bool) -> Vec<Person> {
    let mut people = Vec::with_capacity(2 * count);
    for i in 0..2 * count {
        let mut position = HEADS[i % 2];
        position.y += 0.2 * noise(3 * i);
        if !held {
            position.x += 0.1 * noise(3 * i + 1);
            position.z += 0.04 * noise(3 * i + 2);
        }
        people.push(Person { position, velocity: Vector2::zeros() });
    }
    people
}
