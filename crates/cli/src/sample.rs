//! The built-in log: two drawn people walk past each other in front of a slowly
//! moving robot. It stands in where the user gives no log.

use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use tagalong_conformance::figure::{Figure, World};
use tagalong_core::{Camera, Distortion, Images, Pinhole, Stamp};
use tagalong_log::msgs::{CameraInfo, Header, Image, Odometry, TFMessage, TransformStamped};
use tagalong_log::write::{MessageLog, WriteError};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const FOCAL_PX: f64 = 265.0;
const FRAMES: u64 = 70;
const PERIOD_S: f64 = 0.1;
/// Odometry comes twice per image.
const ODOMETRY_PER_FRAME: u64 = 2;
const ROBOT_SPEED_MPS: f64 = 0.15;
const WALL_M: f64 = 6.5;
const CAMERA_FRAME: &str = "camera_color_optical_frame";

/// Draws the log and writes it to `path`.
///
/// # Errors
/// [`WriteError`] if the disk says no.
pub fn write(path: &Path) -> Result<(), WriteError> {
    let camera = camera();
    let mut log = MessageLog::create(path)?;
    log.send("/tf_static", stamp(0.0), &mount(&camera))?;
    for step in 0..FRAMES * ODOMETRY_PER_FRAME {
        let t_s = step as f64 * PERIOD_S / ODOMETRY_PER_FRAME as f64;
        log.send("/odom", stamp(t_s), &odometry(t_s))?;
        if step % ODOMETRY_PER_FRAME == 0 {
            send_images(&mut log, t_s, &scene(t_s).draw(&camera))?;
        }
    }
    log.finish()
}

fn camera() -> Camera {
    let (cx, cy) = (0.5 * (WIDTH - 1) as f64, 0.5 * (HEIGHT - 1) as f64);
    let lens = Pinhole { fx: FOCAL_PX, fy: FOCAL_PX, cx, cy, distortion: Distortion::None };
    Camera::mounted(lens, WIDTH, HEIGHT, 1.2, 0.0, 0.0)
}

fn stamp(t_s: f64) -> Stamp {
    Stamp::from_nanos(1_700_000_000_000_000_000).plus_seconds(t_s)
}

/// Two people cross, in robot coordinates: the robot drives towards them.
fn scene(t_s: f64) -> World {
    let driven = ROBOT_SPEED_MPS * t_s;
    let walker = |x: f64, y: f64, vy: f64, height: f64| Figure {
        head: Point3::new(x - driven, y + vy * t_s, height),
        heading_rad: f64::to_radians(90.0) * vy.signum(),
    };
    World {
        people: vec![walker(3.2, 1.4, -0.45, 1.58), walker(4.6, -1.9, 0.55, 1.70)],
        wall_m: Some(WALL_M - driven),
        noise_seed: Some((t_s / PERIOD_S) as u64),
    }
}

fn send_images(log: &mut MessageLog, t_s: f64, images: &Images) -> Result<(), WriteError> {
    let header = Header::new(stamp(t_s), CAMERA_FRAME);
    let colour: Vec<u8> =
        images.colour.iter().flat_map(|i| i.pixels().iter().copied().flatten()).collect();
    let depth: Vec<u8> =
        images.depth.iter().flat_map(|i| i.pixels().iter().flat_map(|z| millimetres(*z))).collect();
    for (topic, encoding, bytes, data) in
        [("color", "rgb8", 3, &colour), ("aligned_depth_to_color", "16UC1", 2, &depth)]
    {
        let image = Image {
            header: header.clone(),
            height: HEIGHT as u32,
            width: WIDTH as u32,
            encoding: encoding.into(),
            is_bigendian: 0,
            step: bytes * WIDTH as u32,
            data,
        };
        log.send(&format!("/camera/{topic}/camera_info"), stamp(t_s), &info(&header))?;
        log.send(&format!("/camera/{topic}/image_raw"), stamp(t_s), &image)?;
    }
    Ok(())
}

/// 0 is "no reading", as in REP 118.
fn millimetres(depth_m: f32) -> [u8; 2] {
    let millimetres = if depth_m.is_finite() { (1000.0 * depth_m).round() as u16 } else { 0 };
    millimetres.to_le_bytes()
}

fn info(header: &Header) -> CameraInfo {
    let (f, cx, cy) = (FOCAL_PX, 0.5 * (WIDTH - 1) as f64, 0.5 * (HEIGHT - 1) as f64);
    CameraInfo {
        header: header.clone(),
        height: HEIGHT as u32,
        width: WIDTH as u32,
        distortion_model: "plumb_bob".into(),
        d: vec![0.0; 5],
        k: [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p: [f, 0.0, cx, 0.0, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        ..CameraInfo::default()
    }
}

fn mount(camera: &Camera) -> TFMessage {
    TFMessage {
        transforms: vec![TransformStamped {
            header: Header::new(stamp(0.0), "base_link"),
            child_frame_id: CAMERA_FRAME.into(),
            transform: (&camera.robot_from_camera).into(),
        }],
    }
}

fn odometry(t_s: f64) -> Odometry {
    let forward = Vector3::new(ROBOT_SPEED_MPS * t_s, 0.0, 0.0);
    let pose = Isometry3::from_parts(Translation3::from(forward), UnitQuaternion::identity());
    let mut odometry = Odometry {
        header: Header::new(stamp(t_s), "odom"),
        child_frame_id: "base_link".into(),
        ..Odometry::default()
    };
    odometry.pose.pose = (&pose).into();
    odometry.twist.twist.linear.x = ROBOT_SPEED_MPS;
    odometry
}
