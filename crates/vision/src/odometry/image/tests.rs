//! A camera that turns, nods and comes nearer before a painted scene.

use std::sync::Arc;

use nalgebra::{Matrix3, Point3, Rotation3, SMatrix};
use tagalong_core::{Images, Person, Stamp};
use tagalong_geometry::{Camera, Distortion, Pinhole};

use super::*;

const SIZE: (usize, usize) = (320, 240);
const DT_S: f64 = 0.1;

/// Camera in the middle of a painted sphere: rotation about its axes, rad, and zoom.
#[derive(Clone, Copy)]
struct Look {
    tilt_pan_roll: [f64; 3],
    zoom: f64,
}

const STRAIGHT: Look = Look { tilt_pan_roll: [0.0; 3], zoom: 1.0 };

fn panned(by: f64) -> Look {
    Look { tilt_pan_roll: [0.0, by, 0.0], ..STRAIGHT }
}

fn tilted(by: f64) -> Look {
    Look { tilt_pan_roll: [by, 0.0, 0.0], ..STRAIGHT }
}

impl Look {
    fn rotation(&self) -> Rotation3<f64> {
        Rotation3::new(self.tilt_pan_roll.into())
    }

    /// Returns the direction in which a pixel of this camera looks.
    fn of(&self, x: f64, y: f64) -> Vector3<f64> {
        self.rotation().inverse() * Vector3::new(x - 159.5, y - 119.5, 300.0 * self.zoom)
    }

    /// Returns the pixel that shows a direction.
    fn pixel(&self, direction: Vector3<f64>) -> Point2<f64> {
        let seen = self.rotation() * direction;
        let focal = 300.0 * self.zoom;
        Point2::new(159.5 + focal * seen.x / seen.z, 119.5 + focal * seen.y / seen.z)
    }
}

fn paint(u: f64, v: f64) -> f64 {
    let waves = [(0.21, 0.09, 0.3), (-0.11, 0.19, 1.1), (0.31, 0.17, 2.0), (0.06, -0.27, 0.7)];
    waves.iter().map(|(a, b, c)| (a * u + b * v + c).sin()).sum::<f64>() / 4.0
}

fn image(look: Look, contrast: f64) -> GreyImage {
    GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        let at = look.of(x as f64, y as f64);
        let u = 300.0 * at.x.atan2(at.z);
        let v = 300.0 * at.y.atan2(at.xz().norm());
        (128.0 + 110.0 * contrast * paint(u, v)).round() as u8
    })
}

/// A room that is bare but for its right end, and a person in a box who carries a pattern along.
fn room(person: Rect) -> GreyImage {
    GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        let x = x as f64;
        let y = y as f64;
        let seen = if holds(&person, &Point2::new(x, y)) {
            paint(x - person.x, y - person.y)
        } else if x > 230.0 {
            paint(x, y)
        } else {
            0.0
        };
        (128.0 + 110.0 * seen).round() as u8
    })
}

fn camera() -> Camera {
    let lens = Pinhole { fx: 300.0, fy: 300.0, cx: 159.5, cy: 119.5, distortion: Distortion::None };
    Camera::mounted(lens, SIZE.0, SIZE.1, 1.2, 0.05, 0.0)
}

fn frame(index: u64, image: GreyImage, motion: EgoMotion) -> Frame {
    let images = Images { grey: Some(Arc::new(image)), ..Images::default() };
    let stamp = Stamp::from_nanos(index * 100_000_000);
    Frame::new(index, stamp, Arc::new(camera()), motion, images)
}

fn settings() -> OdometrySettings {
    OdometrySettings { settle_s: 1e9, ..OdometrySettings::default() }
}

/// Returns the motion between the last two of some images, and the funnel.
fn seen(settings: OdometrySettings, images: &[GreyImage]) -> (CameraMoved, Funnel) {
    let mut stage = CameraMotion::new(settings);
    let mut funnel = Funnel::default();
    let mut moved = None;
    for (index, image) in (1..).zip(images) {
        let frame = frame(index, image.clone(), EgoMotion::at_rest(DT_S));
        moved = Some(stage.see(&frame, Some(frame.motion), &[], &mut funnel));
    }
    (moved.unwrap(), funnel)
}

fn view(image: &GreyImage) -> View {
    let mount = camera().robot_from_camera.rotation;
    View { levels: levels(image), nominal: camera(), mount }
}

/// Each second step zooms in, the others out.
#[test]
fn a_sequence_that_pans_zooms_and_rolls_is_followed_to_half_a_pixel() {
    fn look(step: f64) -> Look {
        Look {
            tilt_pan_roll: [0.01 * step, 0.023 * step, 0.008 * step],
            zoom: if step % 2.0 == 1.0 { 1.02 } else { 1.0 },
        }
    }

    let looks: Vec<Look> = (0..8).map(|step| look(f64::from(step))).collect();
    let views: Vec<View> = looks.iter().map(|look| view(&image(*look, 1.0))).collect();
    for (views, looks) in views.windows(2).zip(looks.windows(2)) {
        let found = views[0].compared(&views[1], &[], &OdometrySettings::default()).unwrap();
        for (x, y) in [(20.0, 20.0), (300.0, 20.0), (159.5, 119.5), (20.0, 220.0), (300.0, 220.0)] {
            let expected = looks[1].pixel(looks[0].of(x, y));
            let ray = camera().ray(Point2::new(x, y)).xy();
            let off = 300.0 * (found.swing.apply(ray) - camera().ray(expected).xy()).norm();
            assert!(off < 0.5, "{off} px at {x} {y}: {found:?}");
        }
        assert!(found.sigma_pan < 3e-4 && found.points > 30, "{found:?}");
    }
}

#[test]
fn an_image_that_goes_to_the_right_is_a_turn_to_the_left() {
    let images = [STRAIGHT, panned(0.03)].map(|look| image(look, 1.0));
    let (moved, funnel) = seen(settings(), &images);
    let motion = moved.motion.unwrap();
    assert!((motion.turn - 0.03).abs() < 1e-3, "{motion:?}");
    assert!(motion.forward.abs() < 0.02 && motion.left == 0.0 && motion.dt == DT_S, "{motion:?}");
    assert!(motion.covariance[(2, 2)].sqrt() < 3e-3 && motion.covariance[(2, 2)] > 0.0);
    assert!(funnel.entries().is_empty(), "{funnel:?}");
    // A point of the scene is where the image shows it.
    let now = moved.camera.unwrap_or_else(camera);
    let place = camera().back_project(Point2::new(100.0, 119.5), 5.0);
    let floor = motion.isometry().inverse_transform_point(&place.xy());
    let pixel = now.project(&Point3::new(floor.x, floor.y, place.z)).unwrap();
    let shown = panned(0.03).pixel(STRAIGHT.of(100.0, 119.5));
    assert!((pixel - shown).norm() < 1.0, "{pixel} {shown}");
}

#[test]
fn an_image_that_goes_down_is_a_camera_that_nods_up_and_returns() {
    fn pitch(moved: &CameraMoved) -> f64 {
        moved.camera.as_ref().map_or(0.05, Camera::pitch_down_rad)
    }

    let nod = tilted(-0.02);
    let images = [image(STRAIGHT, 1.0), image(nod, 1.0)];
    let moved = seen(settings(), &images).0;
    let expected = 0.03;
    assert!((pitch(&moved) - expected).abs() < 1e-3, "{}", pitch(&moved));
    assert!(moved.motion.unwrap().turn.abs() < 1e-3, "{moved:?}");
    for frames in [1, 4] {
        let settings = OdometrySettings { settle_s: 0.2, ..settings() };
        let held = std::iter::repeat_n(image(nod, 1.0), frames);
        let held = [vec![image(STRAIGHT, 1.0)], held.collect()].concat();
        let pitch = pitch(&seen(settings, &held).0);
        // 0.1 s after the nod it has gone back by 1 - exp(-1/2), and so on.
        let left = (expected - 0.05) * (-0.5 * frames as f64).exp();
        assert!((pitch - 0.05 - left).abs() < 1e-3, "{pitch}");
    }
}

#[test]
fn an_image_that_grows_is_a_way_ahead() {
    let near = Look { zoom: 1.025, ..STRAIGHT };
    let moved = seen(settings(), &[image(STRAIGHT, 1.0), image(near, 1.0)]).0;
    let motion = moved.motion.unwrap();
    assert!((motion.forward - 8.0 * (1.0 - 1.0 / 1.025)).abs() < 0.02, "{motion:?}");
    assert!(motion.covariance[(0, 0)].sqrt() > 0.4 * motion.forward, "the depth is a guess");
}

/// More of the image shows the person, walking to the right, than anything else.
#[test]
fn a_person_who_is_known_is_left_out() {
    fn at(x: f64) -> Rect {
        Rect::new(x, 0.0, 150.0, 240.0)
    }

    let views = [at(30.0), at(36.0)].map(|person| view(&room(person)));
    let position = Point3::new(2.0, 0.0, 1.6);
    let person = Person { position, velocity: Vector2::zeros() };
    let covariance = SMatrix::identity();
    let known = Estimate::new(person, covariance, at(30.0));
    let settings = OdometrySettings { cell_px: 16, ..OdometrySettings::default() };
    let [without, with] = [vec![known], vec![]].map(|people| {
        let found = views[0].compared(&views[1], &people, &settings).unwrap();
        300.0 * found.swing.apply(Vector2::zeros()).x
    });
    assert!(without.abs() < 0.2, "{without}");
    assert!(with > 5.0, "the person would be taken for the room: {with}");
}

#[test]
fn the_outline_of_an_upper_body_reaches_to_the_feet() {
    let upper = Rect::new(100.0, 40.0, 60.0, 85.0);
    assert_eq!(outline(&upper), upper.standing_of_upper_body(TALL_M).inflated(LIMBS));
    assert!(outline(&upper).height > 2.0 * upper.height);
    let whole = Rect { height: 95.0, ..upper };
    assert_eq!(outline(&whole), whole.inflated(LIMBS));
}

#[test]
fn a_camera_at_rest_stays_at_rest() {
    let images = [STRAIGHT, panned(0.0005)].map(|look| image(look, 1.0));
    let moved = seen(settings(), &images).0;
    assert_eq!(moved.motion, Some(EgoMotion::at_rest(DT_S)));
    assert!(moved.camera.is_none());
    let images = [STRAIGHT, panned(0.002)].map(|look| image(look, 1.0));
    let turn = seen(settings(), &images).0.motion.unwrap().turn;
    assert!((turn - 0.002).abs() < 2e-4, "{turn}");
}

#[test]
fn a_bare_wall_tells_nothing() {
    let images = [STRAIGHT, panned(0.03)].map(|look| image(look, 0.0));
    let (moved, funnel) = seen(settings(), &images);
    assert_eq!(moved.motion, Some(EgoMotion::at_rest(DT_S)));
    assert!(moved.camera.is_none());
    let entries = funnel.entries();
    assert!(format!("{entries:?}").contains("too few corners agree"), "{entries:?}");
}

#[test]
fn the_motion_of_the_log_is_believed() {
    let mut stage = CameraMotion::new(settings());
    let mut funnel = Funnel::default();
    let covariance = Matrix3::identity() * 1e-6;
    let by_wheels = EgoMotion { turn: 0.02, covariance, ..EgoMotion::at_rest(DT_S) };
    let mut moved = None;
    for (index, shift) in [(1, 0.0), (2, 0.02)] {
        let look = Look { tilt_pan_roll: [-shift, shift, 0.0], ..STRAIGHT };
        let frame = frame(index, image(look, 1.0), by_wheels);
        moved = Some(stage.see(&frame, Some(by_wheels), &[], &mut funnel));
    }
    let moved = moved.unwrap();
    assert_eq!(moved.motion, Some(by_wheels));
    let nod = 0.05 - moved.camera.unwrap().pitch_down_rad();
    assert!((nod - 0.02).abs() < 1e-3, "but its camera nods: {nod}");
}

#[test]
fn an_image_is_halved_while_its_shorter_side_stays_long_enough() {
    const LEAST: usize = LEAST_SIDE_PX;
    for (width, height, count) in [
        (9 * LEAST, 2 * LEAST - 1, 1),
        (2 * LEAST, 9 * LEAST, 2),
        (4 * LEAST - 1, 4 * LEAST, 2),
        (4 * LEAST, 4 * LEAST, 3),
        (17 * LEAST, 16 * LEAST, LEVELS),
    ] {
        let sizes: Vec<[usize; 2]> = levels(&GreyImage::filled(width, height, 9))
            .iter()
            .map(|level| [level.width(), level.height()])
            .collect();
        let expected: Vec<[usize; 2]> =
            (0..count).map(|level| [width >> level, height >> level]).collect();
        assert_eq!(sizes, expected);
    }
}

#[test]
fn after_a_jump_of_the_clock_nothing_is_compared() {
    let mut stage = CameraMotion::new(settings());
    let mut funnel = Funnel::default();
    for (index, shift, motion) in [(1, 0.0, Some(EgoMotion::at_rest(DT_S))), (2, 0.03, None)] {
        let frame = frame(index, image(panned(shift), 1.0), EgoMotion::at_rest(DT_S));
        let moved = stage.see(&frame, motion, &[], &mut funnel);
        assert_eq!((moved.motion, moved.camera.is_some()), (motion, false));
    }
    assert!(funnel.entries().is_empty());
}
