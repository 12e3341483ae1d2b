//! Simulated depth of a room with a pillar, and of upright boards that move.

use std::sync::Arc;

use nalgebra::{Isometry2, Point2, Point3, Vector2, Vector3};
use tagalong_core::{DepthImage, EgoMotion, Frame, Images, Stamp};
use tagalong_geometry::{Camera, Pinhole};
use tagalong_log::LogFrame;

use super::Views;

/// Position of the pillar, odometry frame, m.
pub const PILLAR: Point2<f64> = Point2::new(3.5, 1.2);

/// Distance of the wall, m.
const WALL_M: f64 = 5.5;

/// Upright board that faces the robot and moves along the wall.
#[derive(Clone, Copy, Debug)]
pub struct Thing {
    /// Position at the start, m.
    pub start: Point2<f64>,
    /// Speed to the right, m/s.
    pub speed_mps: f64,
    /// Width, m.
    pub width_m: f64,
    /// Height of its upper edge, m.
    pub top_m: f64,
}

impl Thing {
    /// Returns a board of the size of a person that walks from left to right, 3 m away.
    pub fn walking() -> Self {
        Self { start: Point2::new(3.0, 0.9), speed_mps: 0.5, width_m: 0.45, top_m: 1.7 }
    }

    /// Returns the position of its middle at a time, m.
    pub fn place(&self, seconds: f64) -> Point2<f64> {
        self.start - Vector2::new(0.0, self.speed_mps * seconds)
    }
}

/// Room with a wall, a floor, a pillar and other objects.
pub struct Room {
    /// The objects, including the pillar.
    pub things: Vec<Thing>,
    /// True if frames contain the pose of the robot.
    pub odometry: bool,
}

impl Default for Room {
    fn default() -> Self {
        let pillar = Thing { start: PILLAR, speed_mps: 0.0, width_m: 0.4, top_m: 1.75 };
        Self { things: vec![pillar], odometry: true }
    }
}

impl Room {
    /// Adds an object.
    pub fn with(mut self, thing: Thing) -> Self {
        self.things.push(thing);
        self
    }

    /// Returns a number of views of it, ten per second, from a robot that drives ahead at a speed,
    /// m/s.
    pub fn seen(&self, frames: u64, speed_mps: f64) -> Views {
        let mut views = Views::of(frames);
        (0..frames).for_each(|number| views.take(number, &self.frame(number, speed_mps)));
        views
    }

    /// Returns a frame of the room.
    pub fn frame(&self, number: u64, speed_mps: f64) -> LogFrame {
        let seconds = 0.1 * number as f64;
        let travel = speed_mps * seconds;
        let camera = Camera::mounted(Pinhole::centred(130.0, 160, 120), 160, 120, 1.2, 0.0, 0.0);
        let depth = DepthImage::from_fn(160, 120, |x, y| {
            self.depth(&camera, Point2::new(x as f64, y as f64), travel, seconds) as f32
        });
        let images = Images { depth: Some(Arc::new(depth)), ..Images::default() };
        let stamp = Stamp::default().plus_seconds(seconds);
        let told = if self.odometry { travel } else { 0.0 };
        let motion = EgoMotion::at_rest(0.1);
        LogFrame {
            frame: Frame::new(number + 1, stamp, Arc::new(camera), motion, images),
            odom_from_robot: Isometry2::new(Vector2::new(told, 0.0), 0.0),
            odom_stale: false,
        }
    }

    /// Returns the depth at a pixel, m: that of the nearest board, the wall or the floor.
    fn depth(&self, camera: &Camera, pixel: Point2<f64>, travel: f64, seconds: f64) -> f64 {
        let ray: Vector3<f64> = camera.robot_from_camera.rotation * camera.ray(pixel);
        let eye = Point3::new(travel, 0.0, camera.height_m());
        let on_floor = Some(-eye.z / ray.z).filter(|depth| *depth > 0.0);
        let on_boards = self.things.iter().filter_map(|thing| {
            let place = thing.place(seconds);
            let depth = (place.x - eye.x) / ray.x;
            let hit = eye + ray * depth;
            let is_hit = (hit.y - place.y).abs() <= 0.5 * thing.width_m
                && (0.0..=thing.top_m).contains(&hit.z);
            is_hit.then_some(depth)
        });
        let on_wall = (WALL_M - eye.x) / ray.x;
        on_boards.chain(on_floor).fold(on_wall, f64::min)
    }
}
