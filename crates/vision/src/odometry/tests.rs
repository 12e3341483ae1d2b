//! A robot with wrong wheel odometry drives in front of a textured wall.

use std::sync::Arc;

use nalgebra::{Isometry2, Point2, Vector2};
use tagalong_core::{DepthImage, EgoMotion, Frame, Funnel, GreyImage, Images, Stamp};
use tagalong_geometry::{Camera, Distortion, Lens, Pinhole};

use crate::odometry::{OdometrySettings, VisualOdometry};

const SIZE: (usize, usize) = (192, 144);
/// Distance of the wall, m.
const WALL_M: f64 = 4.0;
/// Half the width of the person, m.
const BODY_M: f64 = 0.4;

/// Simulated scene.
#[derive(Clone, Copy)]
struct World {
    /// Contrast of the wall, 0 to 1.
    contrast: f64,
    /// Position of the person, world frame, m.
    somebody: Option<Point2<f64>>,
    /// Pitch of the camera, rad.
    nod: f64,
}

const WALLPAPER: World = World { contrast: 1.0, somebody: None, nod: 0.0 };

fn lens() -> Pinhole {
    Pinhole { fx: 90.0, fy: 90.0, cx: 95.5, cy: 71.5, distortion: Distortion::None }
}

fn camera(nod: f64) -> Camera {
    Camera::mounted(lens(), SIZE.0, SIZE.1, 1.0, nod, 0.0)
}

/// Returns the brightness of a surface, without edges that a small image would not show.
fn paint(u: f64, v: f64) -> f64 {
    let waves = [(3.1, 1.7, 0.3), (-2.3, 4.1, 1.1), (5.7, 2.9, 2.0), (1.3, -6.1, 0.7)];
    waves.iter().map(|(a, b, c)| (a * u + b * v + c).sin()).sum::<f64>() / 4.0
}

/// Renders the images of the camera.
fn draw(world: World, robot: Isometry2<f64>) -> (GreyImage, DepthImage) {
    let camera = camera(world.nod);
    let grey = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        (128.0 + 100.0 * seen_at([x, y], &camera, world, robot).1) as u8
    });
    let depth =
        DepthImage::from_fn(SIZE.0, SIZE.1, |x, y| seen_at([x, y], &camera, world, robot).0 as f32);
    (grey, depth)
}

/// Returns the depth and the brightness of a pixel.
fn seen_at([x, y]: [usize; 2], camera: &Camera, world: World, robot: Isometry2<f64>) -> (f64, f64) {
    let eye = camera.robot_from_camera.translation.vector;
    let ray = camera.back_project(Point2::new(x as f64, y as f64), 1.0).coords - eye;
    let ahead = robot.rotation * ray.xy();
    let somebody = world.somebody.and_then(|at| {
        let far = (at.x - robot.translation.x) / ahead.x;
        let aside = robot.translation.y + ahead.y * far - at.y;
        (far > 0.0 && aside.abs() < BODY_M).then_some((far, aside))
    });
    let wall = (WALL_M - robot.translation.x) / ahead.x;
    match somebody.filter(|(far, _)| *far < wall) {
        Some((far, aside)) => (far, paint(3.0 * aside, 3.0 * far * ray.z)),
        None => {
            let along = robot.translation.y + ahead.y * wall;
            (wall, world.contrast * paint(along, wall * ray.z))
        }
    }
}

fn frame(index: u64, world: World, robot: Isometry2<f64>) -> Frame {
    let (grey, depth) = draw(world, robot);
    let images =
        Images { grey: Some(Arc::new(grey)), depth: Some(Arc::new(depth)), ..Images::default() };
    let stamp = Stamp::from_nanos(index * 100_000_000);
    Frame::new(index, stamp, Arc::new(camera(0.0)), EgoMotion::at_rest(0.1), images)
}

/// Returns the pose of the robot after `step` steps of a curve.
fn real(step: usize) -> Isometry2<f64> {
    (0..step).fold(Isometry2::identity(), |pose, _| pose * real_step())
}

fn real_step() -> Isometry2<f64> {
    Isometry2::new(Vector2::new(0.05, 0.0), 0.01)
}

/// Returns the same step by wheel odometry with a wrong heading.
fn by_wheels() -> EgoMotion {
    let wrong = real_step() * Isometry2::new(Vector2::zeros(), 0.004);
    EgoMotion::between(&Isometry2::identity(), &wrong, 0.1, 0.02)
}

const STEPS: usize = 20;

/// Returns the final estimated pose and the counts. `known` is true if the odometry is given the
/// positions of the people.
fn drive(world: impl Fn(usize) -> World, known: bool) -> (Isometry2<f64>, Funnel) {
    let mut odometry = VisualOdometry::new(OdometrySettings::default());
    let mut funnel = Funnel::default();
    let mut believed = Isometry2::identity();
    for step in 0..=STEPS {
        let before = real(step.saturating_sub(1)).inverse();
        let people: Vec<Point2<f64>> = world(step.saturating_sub(1))
            .somebody
            .filter(|_| known)
            .map(|place| before * place)
            .into_iter()
            .collect();
        let frame = frame(step as u64, world(step), real(step));
        let motion = (step > 0).then(by_wheels);
        let seen = odometry.see(&frame, motion, &people, &mut funnel);
        believed *= seen.map_or(Isometry2::identity(), |motion| motion.isometry());
    }
    (believed, funnel)
}

/// Returns the errors of the position, m, and of the heading, rad.
fn error(believed: &Isometry2<f64>) -> (f64, f64) {
    let off = real(STEPS).inverse() * believed;
    (off.translation.vector.norm(), off.rotation.angle().abs())
}

fn wheels_alone() -> (f64, f64) {
    error(&(0..STEPS).fold(Isometry2::identity(), |pose, _| pose * by_wheels().isometry()))
}

#[test]
fn what_stands_still_corrects_the_wheels() {
    let (believed, funnel) = drive(|_| WALLPAPER, true);
    let (place, heading) = error(&believed);
    let (_, by_wheels) = wheels_alone();
    assert!(by_wheels > 0.079, "{by_wheels}");
    assert!(place < 0.02 && heading < 0.003, "{place} m, {heading} rad");
    assert_eq!(funnel, Funnel::default());
}

#[test]
fn a_camera_that_nods_is_no_motion() {
    let (place, heading) =
        error(&drive(|step: usize| World { nod: 0.01 * (step as f64).sin(), ..WALLPAPER }, true).0);
    assert!(place < 0.02 && heading < 0.004, "{place} m, {heading} rad");
}

#[test]
fn a_bare_wall_leaves_the_wheels_alone() {
    let (believed, funnel) = drive(|_| World { contrast: 0.0, ..WALLPAPER }, true);
    let (place, heading) = error(&believed);
    let (by_wheels, turned_by_wheels) = wheels_alone();
    assert!((place - by_wheels).abs() < 1e-9 && (heading - turned_by_wheels).abs() < 1e-9);
    let few = funnel.entries().iter().find(|entry| entry.test == "odometry: too few points");
    assert_eq!(few.map(|entry| entry.count), Some(STEPS as u64 + 1));
}

#[test]
fn who_walks_before_a_bare_wall_is_no_landmark() {
    fn walking(step: usize) -> World {
        World {
            contrast: 0.0,
            somebody: Some(Point2::new(2.2, -0.3 + 0.06 * step as f64)),
            ..WALLPAPER
        }
    }

    let (_, by_wheels) = wheels_alone();
    let (_, known) = error(&drive(walking, true).0);
    let (_, unknown) = error(&drive(walking, false).0);
    assert!((known - by_wheels).abs() < 0.005, "{known} rad");
    assert!((unknown - by_wheels).abs() > 0.02, "{unknown} rad: who walks was believed");
}

/// The points of the wall agree with each other, those of the person do not fit.
#[test]
fn an_unknown_person_before_a_textured_wall_is_outvoted() {
    fn walking(step: usize) -> World {
        World { somebody: Some(Point2::new(2.2, -0.3 + 0.06 * step as f64)), ..WALLPAPER }
    }

    let (place, heading) = error(&drive(walking, false).0);
    let (_, by_wheels) = wheels_alone();
    assert!(place < 0.03 && heading < 0.6 * by_wheels, "{place} m, {heading} rad");
}

#[test]
fn without_a_motion_or_depth_nothing_is_compared() {
    let mut odometry = VisualOdometry::new(OdometrySettings::default());
    let mut funnel = Funnel::default();
    assert_eq!(odometry.see(&frame(0, WALLPAPER, real(0)), None, &[], &mut funnel), None);
    assert!(odometry.reference.is_some());
    let blind = Frame::new(
        1,
        Stamp::default(),
        Arc::new(camera(0.0)),
        EgoMotion::at_rest(0.1),
        Images { grey: Some(Arc::new(GreyImage::filled(9, 9, 0))), ..Images::default() },
    );
    assert_eq!(odometry.see(&blind, Some(by_wheels()), &[], &mut funnel), Some(by_wheels()));
    assert!(odometry.reference.is_none(), "what was seen before a gap is of no use");
}

#[test]
fn images_of_any_size_are_taken() {
    let mut odometry = VisualOdometry::new(OdometrySettings::default());
    let mut funnel = Funnel::default();
    for size in [0, 1, 2, 3, 8, 9, 40, 5] {
        let images = Images {
            grey: Some(Arc::new(GreyImage::from_fn(size, size, |x, y| (x * 40 + y * 17) as u8))),
            depth: Some(Arc::new(DepthImage::filled(size, size, 2.0))),
            ..Images::default()
        };
        let lens = Lens::Pinhole(lens());
        let camera = Camera { lens, width: size, height: size, ..camera(0.0) };
        let frame = Frame::new(0, Stamp::default(), Arc::new(camera), by_wheels(), images);
        let motion = odometry.see(&frame, Some(by_wheels()), &[], &mut funnel);
        assert!(motion.is_some_and(|motion| motion.isometry().translation.x.is_finite()));
    }
}

#[test]
fn a_halved_image_has_the_rounded_means_of_four_pixels() {
    let rows = [[1, 2, 9, 9], [2, 2, 9, 8]];
    let image = GreyImage::from_fn(4, 2, |x, y| rows[y][x]);
    let mut half = GreyImage::default();
    super::halve(&image, &mut half);
    assert_eq!(half.row(0), [2, 9], "of 1.75 and 8.75");
}
