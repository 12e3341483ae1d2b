//! Casts a ray through every pixel. The image is divided into tiles; a tile
//! looks only at the solids whose surrounding ball it can see. Tiles do not
//! depend on each other, so that any number of threads draws the same image.

use std::sync::{Mutex, PoisonError};
use std::thread;

use nalgebra::{Isometry3, Point2, Point3, Vector3};
use tagalong_core::{Camera, Image};

use crate::shape::Shape;
use crate::world::{Hit, World};

/// Side of a tile, pixels.
const TILE: usize = 16;

/// What a camera sees of the world without any noise: for each pixel what its
/// ray meets, where `t` is the depth along the optical axis in metres.
pub fn draw(
    world: &World,
    camera: &Camera,
    world_from_robot: &Isometry3<f64>,
    threads: usize,
) -> Image<Hit> {
    let view = View { world, camera, pose: world_from_robot * camera.robot_from_camera };
    let mut image = Image::filled(camera.width, camera.height, Hit::default());
    let strips = image.pixels_mut().chunks_mut(TILE * camera.width).enumerate();
    let strips = Mutex::new(strips);
    thread::scope(|scope| {
        for _ in 0..threads.max(1) {
            scope.spawn(|| {
                while let Some((number, pixels)) = next(&strips) {
                    view.strip(number * TILE, pixels);
                }
            });
        }
    });
    image
}

/// The next piece of work; the lock is held no longer than that.
fn next<T>(work: &Mutex<impl Iterator<Item = T>>) -> Option<T> {
    work.lock().unwrap_or_else(PoisonError::into_inner).next()
}

struct View<'a> {
    world: &'a World,
    camera: &'a Camera,
    pose: Isometry3<f64>,
}

impl View<'_> {
    fn ray(&self, column: usize, row: usize) -> Vector3<f64> {
        self.pose.rotation * self.camera.ray(Point2::new(column as f64, row as f64))
    }

    fn eye(&self) -> Point3<f64> {
        Point3::from(self.pose.translation.vector)
    }

    fn strip(&self, top: usize, pixels: &mut [Hit]) {
        let width = self.camera.width;
        let rows = pixels.len() / width;
        for left in (0..width).step_by(TILE) {
            let columns = TILE.min(width - left);
            let seen = self.visible(left, top, columns, rows);
            for row in 0..rows {
                for column in left..left + columns {
                    let ray = self.ray(column, top + row);
                    let hit = self.world.first(seen.iter().copied(), &self.eye(), &ray);
                    pixels[row * width + column] = hit;
                }
            }
        }
    }

    /// The solids whose surrounding ball reaches into the cone around a tile.
    fn visible(
        &self,
        left: usize,
        top: usize,
        columns: usize,
        rows: usize,
    ) -> Vec<(usize, &Shape)> {
        let corners = [(0, 0), (columns - 1, 0), (0, rows - 1), (columns - 1, rows - 1)]
            .map(|(x, y)| self.ray(left + x, top + y).normalize());
        let axis = corners.iter().sum::<Vector3<f64>>().normalize();
        let opening = corners.iter().map(|c| axis.angle(c)).fold(0.0, f64::max) + 1e-6;
        let eye = self.eye();
        let reaches = |shape: &Shape| {
            let (centre, radius) = shape.bound();
            let way = centre - eye;
            let distance = way.norm();
            distance <= radius || axis.angle(&way) <= opening + (radius / distance).asin()
        };
        self.world.solids().filter(|(_, shape)| reaches(shape)).collect()
    }
}

/// How much of some solids of a person is seen in an image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Visibility {
    /// Seen fraction of what would be seen if nothing else were there; 0 where
    /// nothing would be.
    pub fraction: f64,
    /// Left, upper, right and lower edge of what is seen, pixels.
    pub bounds_px: Option<[f64; 4]>,
    /// The person that hides most of the rest.
    pub occluder: Option<u16>,
}

/// Compares what is seen of some solids of `person` within an area (left, top,
/// right, bottom, pixels, clipped to the image by the caller) with what would be
/// seen of them alone. At most some 40 x 40 rays are cast.
pub fn visibility(
    image: &Image<Hit>,
    camera: &Camera,
    world_from_robot: &Isometry3<f64>,
    (person, shapes): (u16, &[Shape]),
    area: [usize; 4],
) -> Visibility {
    let pose = world_from_robot * camera.robot_from_camera;
    let eye = Point3::from(pose.translation.vector);
    let [left, top, right, bottom] = area;
    let step = ((right - left).max(bottom - top) / 40).max(1);
    let (mut whole, mut seen) = (0u32, 0u32);
    let mut bounds: Option<[f64; 4]> = None;
    let mut hiders = std::collections::BTreeMap::<u16, u32>::new();
    for row in (top..bottom).step_by(step) {
        for column in (left..right).step_by(step) {
            let ray = pose.rotation * camera.ray(Point2::new(column as f64, row as f64));
            if !shapes.iter().any(|shape| shape.meet(&eye, &ray).is_some()) {
                continue;
            }
            whole += 1;
            let there = image.pixels()[row * image.width() + column].person;
            if there == Some(person) {
                seen += 1;
                let (x, y, s) = (column as f64, row as f64, step as f64);
                bounds = Some(bounds.map_or([x, y, x + s, y + s], |b| {
                    [b[0].min(x), b[1].min(y), b[2].max(x + s), b[3].max(y + s)]
                }));
            } else if let Some(other) = there {
                *hiders.entry(other).or_default() += 1;
            }
        }
    }
    let occluder = hiders.into_iter().max_by_key(|(_, count)| *count).map(|(id, _)| id);
    let fraction = if whole == 0 { 0.0 } else { f64::from(seen) / f64::from(whole) };
    Visibility { fraction, bounds_px: bounds, occluder }
}
