//! Drives along a simulated room, and prints the processor time of `Steering::steer` for a frame, ms: the
//! median and the longest of three hundred. That is the collision monitor with its watchdogs, the target lock
//! without appearance, and the limiter of the commands.
//!
//! `cargo run --release -p tagalong-following --example time_steering`

#![allow(clippy::print_stdout, reason = "its output is what it is for")]

use cpu_time::ThreadTime;
use std::error::Error;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::{Isometry3, Point2, SMatrix, Vector3};
use tagalong_core::{
    Controller, DepthImage, EgoMotion, Estimate, Frame, Images, LaserScan, Person, Scene, Stamp,
    Track, TrackId, Twist,
};
use tagalong_following::{FollowSettings, Steering};
use tagalong_geometry::{Camera, Distortion, Pinhole, Rect};
use tagalong_vision::Describer;

/// Frames that are timed.
const FRAMES: usize = 300;
/// Time between them, s.
const PERIOD_S: f64 = 1.0 / 30.0;
/// Distance of each wall from the middle of the room, m.
const WALL_M: f64 = 4.0;
/// Distance within which the robot drives to and fro about the middle, m.
const TO_AND_FRO_M: f64 = 1.0;

/// Controller that wishes to drive along an arc.
struct Onwards;

impl Controller for Onwards {
    fn command(&mut self, _: &Scene<'_>) -> Twist {
        Twist::new(0.4, 0.1)
    }
}

/// Noise of a few millimetres, another one in each frame.
fn noise_m(frame: usize, place: usize) -> f64 {
    ((frame * 7919 + place * 104_729) % 997) as f64 * 5e-6
}

/// Returns the distance from (x, 0) to the square wall in a direction, m.
fn wall_m(x: f64, angle: f64) -> f64 {
    let along_x = if angle.cos() > 0.0 { WALL_M - x } else { -WALL_M - x } / angle.cos();
    let along_y = if angle.sin() > 0.0 { WALL_M } else { -WALL_M } / angle.sin();
    along_x.min(along_y)
}

fn camera(width: usize, height: usize) -> Camera {
    let focal = 0.5 * width as f64;
    let lens = Pinhole {
        fx: focal,
        fy: focal,
        cx: 0.5 * (width as f64 - 1.0),
        cy: 0.5 * (height as f64 - 1.0),
        distortion: Distortion::None,
    };
    Camera::mounted(lens, width, height, 1.0, 0.0, 0.0)
}

fn depth_at(camera: &Camera, frame: usize, x: f64) -> DepthImage {
    DepthImage::from_fn(camera.width, camera.height, |u, v| {
        let ray = camera.back_project(Point2::new(u as f64, v as f64), 1.0);
        let wall = wall_m(x, ray.y.atan2(ray.x)) / ray.xy().coords.norm();
        let floor = if ray.z < 1.0 { 1.0 / (1.0 - ray.z) } else { f64::INFINITY };
        (wall.min(floor) + noise_m(frame, camera.width * v + u)) as f32
    })
}

fn scan_at(frame: usize, x: f64, rays: usize) -> LaserScan {
    let step_rad = TAU / rays as f64;
    let ranges = (0..rays).map(|ray| {
        let angle = -PI + ray as f64 * step_rad;
        wall_m(x, angle) + noise_m(frame, ray)
    });
    let mount = Isometry3::translation(0.0, 0.0, 0.2);
    LaserScan::of_ranges(mount, -PI, step_rad, [0.1, 12.0], ranges)
}

/// Returns a person standing beside the way.
fn person() -> Track {
    let person = Person { position: [2.5, 1.0, 1.6].into(), velocity: Vector3::zeros().xy() };
    let estimate = Estimate::new(person, SMatrix::identity() * 0.01, Rect::default());
    Track::new(TrackId(1), estimate, 1.0).with_age(99)
}

/// Returns the median and the longest time of a frame, ms.
fn time_ms(camera: Camera, rays: Option<usize>) -> Result<[f64; 2], Box<dyn Error>> {
    let camera = Arc::new(camera);
    let settings = FollowSettings::default();
    let mut steering =
        Steering::new("onwards".into(), Box::new(Onwards), settings, Describer::default());
    let mut times_ms = Vec::with_capacity(FRAMES);
    let mut before_m = 0.0;
    for index in 0..FRAMES {
        let x = TO_AND_FRO_M * (0.4 * index as f64 * PERIOD_S).sin();
        let motion = EgoMotion { forward: x - before_m, ..EgoMotion::at_rest(PERIOD_S) };
        before_m = x;
        let depth = Some(Arc::new(depth_at(&camera, index, x)));
        let images = Images { depth, ..Images::default() };
        let stamp = Stamp::default().plus_seconds(index as f64 * PERIOD_S);
        let frame = Frame::new(index as u64, stamp, Arc::clone(&camera), motion, images)
            .with_laser(rays.map(|rays| scan_at(index, x, rays)));
        let track = person();
        let start = ThreadTime::now();
        steering.steer(&frame, &motion, std::slice::from_ref(&track), &[])?;
        times_ms.push(start.elapsed().as_secs_f64() * 1e3);
    }
    times_ms.sort_by(f64::total_cmp);
    Ok([times_ms[FRAMES / 2], times_ms[FRAMES - 1]])
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("| sensors | median ms | longest ms |");
    println!("| --- | --- | --- |");
    for (name, width, height, rays) in [
        ("depth 640x480", 640, 480, None),
        ("depth 160x120, laser with 720 rays", 160, 120, Some(720)),
        ("depth 640x480, laser with 720 rays", 640, 480, Some(720)),
    ] {
        let [median_ms, longest_ms] = time_ms(camera(width, height), rays)?;
        println!("| {name} | {median_ms:.3} | {longest_ms:.3} |");
    }
    Ok(())
}
