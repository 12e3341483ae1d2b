//! Logs of a camera that looks into a conical mirror, circular and unwrapped.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

mod common;

use std::f64::consts::TAU;

use common::{INFO, LogWriter, at, camera, info_of};
use nalgebra::Point3;
use tagalong_geometry::{ConicalMirror, Panorama};
use tagalong_log::camera_info::{CONICAL_MIRROR, UNWRAPPED, mirror_coefficients};
use tagalong_log::msgs::{CameraInfo, Header, Image};
use tagalong_log::{Input, InputSettings, Inputs, LogFrame};

const INPUTS: Inputs = Inputs::ANY.require(Input::Colour);
const SIDE: u32 = 120;

fn mirror() -> ConicalMirror {
    let d = [67.5_f64.to_radians(), 0.05, 2.0, 57.0];
    ConicalMirror::new(44.0, [60.1, 58.7], d).unwrap()
}

fn raw_info() -> CameraInfo {
    let mirror = mirror();
    let f = mirror.focal_px;
    let c = mirror.centre_px;
    CameraInfo {
        distortion_model: CONICAL_MIRROR.into(),
        d: mirror_coefficients(&mirror).to_vec(),
        k: [f, 0.0, c.x, 0.0, f, c.y, 0.0, 0.0, 1.0],
        ..info_of("colour", &camera(SIDE as usize, SIDE as usize, f))
    }
}

fn unwrapped_info(width: u32, height: u32) -> CameraInfo {
    let mirror = mirror();
    let f = mirror.focal_px;
    let d = [mirror.half_angle_rad, mirror.apex_m, mirror.inner_px / f, mirror.outer_px / f];
    let across = f64::from(width) / TAU;
    CameraInfo {
        distortion_model: UNWRAPPED.into(),
        d: d.to_vec(),
        k: [across, 0.0, 0.5 * f64::from(width), 0.0, across, 9.0, 0.0, 0.0, 1.0],
        ..info_of("colour", &camera(width as usize, height as usize, across))
    }
}

/// Returns the first frame of a log with one image: bright left of the robot, else dark.
fn first(
    info: &CameraInfo,
    width: u32,
    height: u32,
    bright: impl Fn(u32, u32) -> bool,
) -> LogFrame {
    let mut log = LogWriter::plain();
    log.message(INFO, at(0.0), info);
    log.fixed("base_link", "colour", &ConicalMirror::upright(1.5));
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let data: Vec<u8> =
        places.flat_map(|(x, y)| if bright(x, y) { [250; 3] } else { [10; 3] }).collect();
    let header = Header::new(at(0.0), "colour");
    let image = Image::packed(header, "rgb8", width, height, &data);
    log.message("/camera/color/image_raw", at(0.0), &image);
    log.save().open(&InputSettings::default(), INPUTS).unwrap().next_frame().unwrap()
}

fn panorama(found: &LogFrame) -> Panorama {
    *found.frame.camera.panorama().unwrap()
}

/// Returns the brightness at the pixel of a point one metre and a half to the left, or right.
fn at_side(found: &LogFrame, y: f64) -> u8 {
    let pixel = found.frame.camera.project(&Point3::new(0.0, y, 1.0)).unwrap();
    let colour = found.frame.colour().unwrap().get(pixel.x.round() as i64, pixel.y.round() as i64);
    colour.unwrap()[0]
}

#[test]
fn a_circular_image_becomes_a_panorama() {
    // The right side of the image shows the left side of the robot.
    let found = first(&raw_info(), SIDE, SIDE, |x, _| x > 60);
    let image = found.frame.colour().unwrap();
    assert_eq!((image.width(), image.height()), (480, 120));
    assert_eq!((found.frame.camera.width, found.frame.camera.height), (480, 120));
    assert_eq!(panorama(&found).mirror, mirror());
    assert!(at_side(&found, 1.5) > 200 && at_side(&found, -1.5) < 60);
}

#[test]
fn an_unwrapped_image_is_taken_as_it_is() {
    let found = first(&unwrapped_info(240, 60), 240, 60, |x, _| x < 120);
    let seen = panorama(&found);
    let raw = mirror();
    assert_eq!((seen.columns, seen.rows), (240, 60));
    let whole = Panorama { mirror: raw, columns: 240, rows: 60 };
    for row in [0.0, 20.0, 59.0] {
        assert!((seen.elevation(row) - whole.elevation(row)).abs() < 1e-9);
    }
    let point = Point3::new(1.0, -2.0, -1.0);
    assert!((seen.pixel(&point) - whole.pixel(&point)).norm() < 1e-6);
    assert!(at_side(&found, 1.5) > 200 && at_side(&found, -1.5) < 60);
}

#[test]
fn numbers_of_no_mirror_are_refused() {
    for d in [vec![0.3, 0.05, 2.0, 57.0], vec![1.2, 0.05]] {
        let mut log = LogWriter::plain();
        log.message(INFO, at(0.0), &CameraInfo { d, ..raw_info() });
        log.fixed("base_link", "colour", &ConicalMirror::upright(1.5));
        log.colour_of(at(0.0), SIDE, SIDE);
        let error = log.save().open(&InputSettings::default(), INPUTS).err().unwrap();
        assert!(error.to_string().contains("conical_mirror"), "{error}");
    }
}
