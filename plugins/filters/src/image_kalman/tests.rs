use std::sync::Arc;

use nalgebra::{Matrix2, Matrix3, Point2, Point3, Vector2, Vector3, Vector5};
use proptest::prelude::*;
use tagalong_core::{
    Detection, EgoMotion, Evidence, Filter, Frame, Images, Matched, Stamp, TrackId,
};
use tagalong_geometry::{Camera, Distortion, ImageBox, Pinhole, Rect};

use crate::image_kalman::space::{ImagePoint, RobotPoint, pixel_covariance};
use crate::image_kalman::{Config, ImageKalman, State};

mod camera_motion;

const DT_S: f64 = 1.0 / 23.0;

fn camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 525.0, fy: 520.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, 640, 480, 1.3, 0.15, 0.05))
}

fn person(head: Point3<f64>) -> Detection {
    Detection::new("test", head, Matrix3::identity() * 1e-4, 3.0)
        .with_image(ImageBox::upper_body(camera().upper_body(&head)))
}

/// Filters the detections of one person, each after a motion of the robot.
fn fed(config: Config, sightings: &[Detection], motion: EgoMotion) -> State {
    let camera = camera();
    let mut state = State::start(&config, &sightings[0], &camera);
    for seen in &sightings[1..] {
        state.predict(&config, &motion, &camera);
        state.correct(&config, seen, &camera);
    }
    state
}

/// Detections of a box that moves by 120 pixels a second.
fn sliding(frames: usize) -> Vec<Detection> {
    let start = person(Point3::new(4.0, 1.0, 1.6));
    let region = start.rect().unwrap();
    (0..frames)
        .map(|i| {
            let shifted = Rect { x: region.x + 120.0 * DT_S * i as f64, ..region };
            start.clone().with_image(ImageBox::upper_body(shifted))
        })
        .collect()
}

#[test]
fn the_estimate_of_a_steady_motion_does_not_lag() {
    let sightings = sliding(60);
    let state = fed(Config::default(), &sightings, EgoMotion::at_rest(DT_S));
    let lag_px = sightings[59].rect().unwrap().centre().x - state.image[0];
    assert!(lag_px.abs() < 0.1, "{lag_px}");
}

/// Detections of a standing person from a robot that turns and drives.
fn from_a_moving_robot(motion: &EgoMotion, frames: usize) -> Vec<Detection> {
    let mut place = Point3::new(5.0, -0.5, 1.65);
    let mut seen = vec![person(place)];
    for _ in 1..frames {
        let floor = motion.apply_to_point(place.xy());
        place = Point3::new(floor.x, floor.y, place.z);
        seen.push(person(place));
    }
    seen
}

#[test]
fn a_standing_person_has_no_velocity_while_the_robot_turns() {
    let motion = EgoMotion { forward: 0.02, turn: 0.015, ..EgoMotion::at_rest(DT_S) };
    let sightings = from_a_moving_robot(&motion, 30);
    let estimate = fed(Config::default(), &sightings, motion).estimate(&camera());
    let speed_mps = estimate.person.velocity.norm();
    assert!(speed_mps < 0.1, "{speed_mps}");
}

#[test]
fn the_box_coasts_with_the_picture_while_the_robot_turns() {
    let motion = EgoMotion { turn: 0.02, ..EgoMotion::at_rest(DT_S) };
    let sightings = from_a_moving_robot(&motion, 30);
    let (seen, hidden) = sightings.split_at(20);
    let config = Config::default();
    let camera = camera();
    let mut state = fed(config.clone(), seen, motion);
    hidden.iter().for_each(|_| state.predict(&config, &motion, &camera));
    let iou = state.estimate(&camera).region.iou(&hidden[9].rect().unwrap());
    assert!(iou > 0.85, "{iou}");
}

#[test]
fn whoever_the_robot_turns_its_back_on_is_found_again_where_they_were() {
    let config = Config::default();
    let camera = camera();
    let place = Point3::new(3.0, 0.2, 1.6);
    let mut state = fed(config.clone(), &vec![person(place); 10], EgoMotion::at_rest(DT_S));
    let [gone, back] = [0.15, -0.15].map(|turn| {
        let motion = EgoMotion { turn, ..EgoMotion::at_rest(DT_S) };
        (0..20).for_each(|_| state.predict(&config, &motion, &camera));
        state.estimate(&camera)
    });
    assert!(gone.person.position.x < -2.0 && gone.region.area() == 0.0, "{gone:?}");
    assert!((back.person.position - place).norm() < 0.05, "{back:?}");
    assert!(back.region.iou(&person(place).rect().unwrap()) > 0.9);
}

/// The robot turns by 3 rad within 20 frames, the person walks on to the left at half a metre a
/// second.
#[test]
fn a_person_behind_the_robot_walks_on() {
    fn at(frame: usize) -> Point3<f64> {
        Point3::new(3.0, -0.5 + 0.5 * DT_S * frame as f64, 1.6)
    }

    let config = Config::default();
    let camera = camera();
    let sightings: Vec<Detection> = (0..40).map(|frame| person(at(frame))).collect();
    let mut state = fed(config.clone(), &sightings, EgoMotion::at_rest(DT_S));
    let motion = EgoMotion { turn: 0.15, ..EgoMotion::at_rest(DT_S) };
    (0..20).for_each(|_| state.predict(&config, &motion, &camera));
    let place = state.estimate(&camera).person.position;
    assert!(place.x < 0.0, "{place}");
    let in_old_frame = nalgebra::Rotation2::new(20.0 * 0.15) * place.xy();
    assert!((in_old_frame - at(59).xy()).norm() < 0.1, "{in_old_frame} {}", at(59));
}

/// A change of any of the six numbers, by much more than the step of the derivative.
#[test]
fn the_jacobian_foretells_the_point_in_space() {
    let here = ImagePoint {
        pixel: Point2::new(420.0, 180.0),
        velocity: Vector2::new(60.0, -25.0),
        range: Vector2::new(4.0, 0.3),
    };
    let (camera, jacobian) = (camera(), here.jacobian(&camera()));
    let before = here.in_space(&camera);
    for (column, by) in [0.5, 0.5, 5.0, 5.0, 0.05, 0.05].into_iter().enumerate() {
        let mut there = here;
        match column {
            0 | 1 => there.pixel[column] += by,
            2 | 3 => there.velocity[column - 2] += by,
            _ => there.range[column - 4] += by,
        }
        let after = there.in_space(&camera);
        let place = after.position - before.position;
        let pace = after.velocity - before.velocity;
        let moved = Vector5::new(place.x, place.y, place.z, pace.x, pace.y);
        let foretold = jacobian.column(column) * by;
        assert!((foretold - moved).norm() < 0.01 * moved.norm(), "{column}: {foretold} {moved}");
    }
}

/// Coasting towards the camera ends in front of it.
#[test]
fn a_person_who_came_near_is_not_foreseen_behind_the_camera() {
    let config = Config::default();
    let sightings: Vec<Detection> =
        (0..30).map(|i| person(Point3::new(4.0 - 2.0 * DT_S * i as f64, 0.0, 1.4))).collect();
    let mut state = fed(config.clone(), &sightings, EgoMotion::at_rest(DT_S));
    let camera = camera();
    for _ in 0..60 {
        state.predict(&config, &EgoMotion::at_rest(DT_S), &camera);
    }
    let place = state.estimate(&camera).person.position;
    let ahead = camera.depth_of(&place);
    assert!(ahead > 0.1 && ahead < 1.0, "{place}");
}

#[test]
fn a_box_of_any_shape_keeps_its_shape() {
    let seen = person(Point3::new(4.0, 0.3, 1.6));
    let Rect { x, y, width, height } = seen.rect().unwrap();
    let tall = seen.with_image(ImageBox::upper_body(Rect::new(x, y, width, 2.6 * height)));
    let state = fed(Config::default(), &vec![tall.clone(); 5], EgoMotion::at_rest(DT_S));
    let estimate = state.estimate(&camera());
    assert!(estimate.region.iou(&tall.rect().unwrap()) > 0.999, "{:?}", estimate.region);
    assert!((estimate.person.position - tall.position).norm() < 1e-6);
}

#[test]
fn a_depth_that_is_a_guess_stays_uncertain() {
    fn sigma(seen: &Detection) -> f64 {
        let state = fed(Config::default(), &vec![seen.clone(); 3], EgoMotion::at_rest(DT_S));
        state.estimate(&camera()).covariance[(0, 0)].sqrt()
    }

    let sure = person(Point3::new(4.0, 0.3, 1.6));
    let toward = camera().robot_from_camera.rotation * Vector3::z();
    let guess = sure.clone().with_covariance(toward * toward.transpose());
    assert!(sigma(&sure) < 0.05 && sigma(&guess) > 0.5, "{} {}", sigma(&sure), sigma(&guess));
}

#[test]
fn sightings_that_make_no_sense_leave_finite_numbers() {
    let seen = person(Point3::new(4.0, 0.3, 1.6));
    let odd = [
        seen.clone().with_image(ImageBox::upper_body(Rect::default())),
        seen.clone().with_position(Point3::new(-3.0, 0.0, 1.6)),
        seen.clone().with_covariance(Matrix3::zeros()),
        seen.clone().with_covariance(Matrix3::identity() * 1e12),
        seen.clone().with_image(ImageBox::upper_body(Rect::new(-1e6, 1e6, 1e5, 1.0))),
    ];
    let moves = EgoMotion { forward: 3.0, turn: 2.0, ..EgoMotion::at_rest(0.0) };
    for odd in odd {
        let mut filter = ImageKalman::new(Config::default()).unwrap();
        filter.start(TrackId(1), &odd, &camera());
        for seen in [&odd, &seen, &odd] {
            filter.predict(&moves, &camera());
            let frame = Frame::new(1, Stamp::default(), camera(), moves, Images::default());
            let matched = [Matched::certain(TrackId(1), seen)];
            let evidence = Evidence::new(&frame, &matched);
            filter.update(&evidence).unwrap();
            let estimate = &filter.estimates(&camera())[&TrackId(1)];
            assert!(estimate.is_sane(), "{odd:?}: {estimate:?}");
        }
    }
}

#[test]
fn settings_that_cannot_work_are_refused() {
    let wrong = [
        Config { sigma_scale: 0.0, ..Config::default() },
        Config { acceleration_noise: f64::NAN, ..Config::default() },
        Config { shape_weight: 1.5, ..Config::default() },
        Config { shape_weight: -0.1, ..Config::default() },
        Config { scale_noise: 0.0, ..Config::default() },
        Config { range_noise: -1.0, ..Config::default() },
        Config { initial_speed: 0.0, ..Config::default() },
        Config { initial_range_speed_mps: 0.0, ..Config::default() },
        Config { sigma_centre: 0.0, ..Config::default() },
        Config { sigma_range_m: 0.0, ..Config::default() },
    ];
    assert!(wrong.into_iter().all(|config| ImageKalman::new(config).is_err()));
}

/// A level camera, and a person straight ahead at an exactly known position.
fn ahead(range_m: f64) -> (Camera, Detection) {
    let lens = Pinhole { fx: 525.0, fy: 520.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
    let camera = Camera::mounted(lens, 640, 480, 1.3, 0.0, 0.0);
    let eye = camera.robot_from_camera.translation.vector;
    let position = Point3::from(eye + Vector3::new(range_m, 0.0, 0.0));
    let region = camera.upper_body(&position);
    let covariance = Matrix3::zeros();
    (
        camera,
        Detection::new("test", position, covariance, 1.0).with_image(ImageBox::upper_body(region)),
    )
}

/// Position and rate of one axis, filtered by the textbook equations.
struct Line {
    mean: [f64; 2],
    covariance: [[f64; 2]; 2],
}

impl Line {
    fn start(at: f64, place: f64, rate: f64) -> Self {
        Self { mean: [at, 0.0], covariance: [[place, 0.0], [0.0, rate]] }
    }

    fn predict(&mut self, density: f64, dt: f64) {
        let [[a, b], [_, d]] = self.covariance;
        let cross = b + dt * d + density * dt * dt / 2.0;
        let place = a + 2.0 * dt * b + dt * dt * d + density * dt * dt * dt / 3.0;
        self.mean[0] += dt * self.mean[1];
        self.covariance = [[place, cross], [cross, d + density * dt]];
    }

    /// Updates by a measurement; returns the normalised innovation squared.
    fn correct(&mut self, measured: f64, noise: f64) -> f64 {
        let [[a, b], [_, d]] = self.covariance;
        let spread = a + noise;
        let innovation = measured - self.mean[0];
        self.mean =
            [self.mean[0] + a / spread * innovation, self.mean[1] + b / spread * innovation];
        let cross = b - a * b / spread;
        self.covariance = [[a - a * a / spread, cross], [cross, d - b * b / spread]];
        innovation * innovation / spread
    }

    fn agrees(&self, mean: [f64; 2], covariance: [f64; 3]) {
        let [[a, b], [_, d]] = self.covariance;
        let numbers = [self.mean[0], self.mean[1], a, b, d];
        let [p, r] = mean;
        let [x, y, z] = covariance;
        for (expected, found) in numbers.into_iter().zip([p, r, x, y, z]) {
            let near = 1e-9 * expected.abs().max(1.0);
            assert!((expected - found).abs() < near, "{expected} {found}");
        }
    }
}

#[test]
fn a_step_is_that_of_the_textbook() {
    let ((camera, first), config, dt) = (ahead(4.0), Config::default(), 0.1);
    let (_, farther) = ahead(4.2);
    let Rect { x, y, width, height } = first.rect().unwrap();
    let second =
        farther.with_image(ImageBox::upper_body(Rect::new(x + 5.0, y - 3.0, width + 4.0, height)));
    let mut state = State::start(&config, &first, &camera);
    let noise = (config.sigma_centre * width).powi(2);
    let speed = (config.initial_speed * width).powi(2);
    let centre = first.rect().unwrap().centre();
    let mut lines = [centre.x, centre.y].map(|at| Line::start(at, noise, speed));
    let rate = config.initial_range_speed_mps.powi(2);
    let mut range = Line::start(4.0, config.sigma_range_m.powi(2), rate);
    let scale = (config.sigma_scale * width).powi(2);
    assert_eq!((state.image[4], state.image_covariance[(4, 4)]), (width, scale));

    state.predict(&config, &EgoMotion::at_rest(dt), &camera);
    lines.iter_mut().for_each(|line| line.predict(config.acceleration_noise * width * width, dt));
    range.predict(config.range_noise, dt);
    let wandered = scale + (config.scale_noise * width).powi(2) * dt;
    assert!((state.image_covariance[(4, 4)] - wandered).abs() < 1e-9);

    let support = state.correct(&config, &second, &camera);
    let seen = second.rect().unwrap().centre();
    let mut nis = lines[0].correct(seen.x, noise) + lines[1].correct(seen.y, noise);
    nis += range.correct(4.2, config.sigma_range_m.powi(2));
    nis += 16.0 / (wandered + scale);
    let (found, freedom) = support.nis.unwrap();
    assert!((found - nis).abs() < 1e-6 && freedom == 4, "{found} {nis} {freedom}");
    for (axis, line) in lines.iter().enumerate() {
        let p = &state.image_covariance;
        let rate = axis + 2;
        let covariance = [p[(axis, axis)], p[(axis, rate)], p[(rate, rate)]];
        line.agrees([state.image[axis], state.image[rate]], covariance);
    }
    let p = &state.range_covariance;
    range.agrees([state.range.x, state.range.y], [p[(0, 0)], p[(0, 1)], p[(1, 1)]]);
    let kept = wandered * scale / (wandered + scale);
    assert!((state.image_covariance[(4, 4)] - kept).abs() < 1e-9);
    let widened = width + 4.0 * wandered / (wandered + scale);
    assert!((state.image[4] - widened).abs() < 1e-9);
}

/// Increase of the variances of x and y in the image and of the range, for a robot at rest with
/// errors of the odometry of these standard deviations.
fn doubts(range_m: f64, [forward, left, turn]: [f64; 3]) -> [f64; 3] {
    let ((camera, seen), config) = (ahead(range_m), Config::default());
    let sigmas = Vector3::new(forward, left, turn);
    let covariance = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
    let [with, without] = [covariance, Matrix3::zeros()].map(|covariance| {
        let mut state = State::start(&config, &seen, &camera);
        state.predict(&config, &EgoMotion { covariance, ..EgoMotion::at_rest(0.1) }, &camera);
        let p = &state.image_covariance;
        [p[(0, 0)], p[(1, 1)], state.range_covariance[(0, 0)]]
    });
    std::array::from_fn(|i| with[i] - without[i])
}

#[test]
fn errors_of_the_odometry_add_to_what_they_move() {
    fn near(found: [f64; 3], expected: [f64; 3]) {
        for (found, expected) in found.iter().zip(expected) {
            let off = (found - expected).abs();
            assert!(off < 1e-3 * expected.max(0.01), "{found:?} {expected:?}");
        }
    }

    near(doubts(4.0, [0.0, 0.0, 0.02]), [(525.0 * 0.02f64).powi(2), 0.0, 0.0]);
    near(doubts(4.0, [0.0, 0.1, 0.0]), [(525.0 * 0.1 / 4.0f64).powi(2), 0.0, 0.0]);
    near(doubts(4.0, [0.1, 0.0, 0.0]), [0.0, 0.0, 0.01]);
}

#[test]
fn a_box_grows_as_the_robot_comes_near() {
    let ((camera, seen), config) = (ahead(4.0), Config::default());
    let mut state = State::start(&config, &seen, &camera);
    state.predict(&config, &EgoMotion { forward: 1.0, ..EgoMotion::at_rest(0.1) }, &camera);
    assert!((state.image[4] / seen.rect().unwrap().width - 4.0 / 3.0).abs() < 1e-9);
    assert!((state.range.x - 3.0).abs() < 1e-9);
    let mut still = State::start(&config, &seen, &camera);
    still.predict(&config, &EgoMotion::at_rest(0.1), &camera);
    assert_eq!((still.image[4], still.range.x), (seen.rect().unwrap().width, 4.0));
}

/// A sideways step moves a near person farther in the image than a far one: the shift is as
/// uncertain as the range.
#[test]
fn a_range_that_is_a_guess_makes_the_place_after_a_step_one() {
    let ((camera, sure), config) = (ahead(4.0), Config::default());
    let guess = sure.clone().with_covariance(Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 0.0)));
    let step = EgoMotion { left: 0.4, ..EgoMotion::at_rest(1e-3) };
    let [of_guess, of_sure] = [&guess, &sure].map(|seen| {
        let mut state = State::start(&config, seen, &camera);
        let before = state.image_covariance[(0, 0)];
        state.predict(&config, &step, &camera);
        (state.image_covariance[(0, 0)] - before).max(0.0).sqrt()
    });
    let expected = 525.0 * 0.4 * (1.0 / 4.0 - 1.0 / 5.0);
    assert!((of_guess - expected).abs() < 0.5, "{of_guess} {expected}");
    assert!(of_sure < 0.5, "{of_sure}");
}

#[test]
fn a_range_that_cannot_be_is_left_out() {
    let ((camera, seen), config) = (ahead(4.0), Config::default());
    let mut state = State::start(&config, &seen, &camera);
    let eye = Point3::from(camera.robot_from_camera.translation.vector);
    let here = seen.clone().with_position(eye + Vector3::new(0.1, 0.0, 0.0));
    assert_eq!(state.correct(&config, &here, &camera).nis.unwrap().1, 3);
    assert_eq!(state.range.x, 4.0);
    let near = seen.with_position(eye + Vector3::new(0.2, 0.0, 0.0));
    assert_eq!(state.correct(&config, &near, &camera).nis.unwrap().1, 4);
    assert!(state.range.x < 4.0);
}

#[test]
fn the_shape_follows_what_is_seen_by_its_weight() {
    let (camera, seen) = ahead(4.0);
    let Rect { x, y, width, height } = seen.rect().unwrap();
    let tall = seen.clone().with_image(ImageBox::upper_body(Rect::new(x, y, width, 2.0 * height)));
    for (shape_weight, aspect) in [(0.0, 1.0), (0.25, 1.25), (1.0, 2.0)] {
        let config = Config { shape_weight, ..Config::default() };
        let mut state = State::start(&config, &seen, &camera);
        state.correct(&config, &tall, &camera);
        let Rect { width, height, .. } = state.estimate(&camera).region;
        assert!((height / width - aspect).abs() < 1e-9, "{shape_weight}: {}", height / width);
    }
    // A box without area has no shape, so that of an upper body is kept.
    let config = Config { shape_weight: 1.0, ..Config::default() };
    for flat in [Rect::new(x, y, width, 0.5), Rect::new(x, y, 0.5, height)] {
        let mut state = State::start(&config, &seen, &camera);
        state.correct(&config, &seen.clone().with_image(ImageBox::upper_body(flat)), &camera);
        let Rect { width, height, .. } = state.estimate(&camera).region;
        assert!((height / width - 1.0).abs() < 1e-9, "{width} {height}");
    }
}

#[test]
fn only_whoever_is_tracked_is_supported_and_a_stopped_one_is_gone() {
    let (camera, seen) = ahead(4.0);
    let mut filter = ImageKalman::new(Config::default()).unwrap();
    filter.start(TrackId(1), &seen, &camera);
    let camera = Arc::new(camera);
    fn frame(camera: &Arc<Camera>) -> Frame {
        let motion = EgoMotion::at_rest(0.1);
        Frame::new(1, Stamp::default(), Arc::clone(camera), motion, Images::default())
    }
    let frame = frame(&camera);
    let matched = [1, 2].map(|id| Matched::certain(TrackId(id), &seen));
    let evidence = Evidence::new(&frame, &matched);
    let supports = filter.update(&evidence).unwrap();
    assert_eq!(supports.keys().collect::<Vec<_>>(), [&TrackId(1)]);
    filter.stop(TrackId(1));
    assert!(filter.estimates(&camera).is_empty());
}

proptest! {
    #[test]
    fn image_and_space_are_two_views_of_one_thing(
        x in 1.5..7.0f64, y in -1.0..1.0f64, z in 0.8..1.9f64,
        vx in -2.0..2.0f64, vy in -2.0..2.0f64, vz in -0.5..0.5f64,
    ) {
        let place = RobotPoint { position: Point3::new(x, y, z), velocity: Vector3::new(vx, vy, vz) };
        let seen = place.seen(&camera()).unwrap();
        let back = seen.in_space(&camera());
        prop_assert!((back.position - place.position).norm() < 1e-9);
        prop_assert!((back.velocity - place.velocity).norm() < 1e-6);
        let later = RobotPoint { position: place.position + place.velocity * 1e-5, ..place };
        let moved = later.seen(&camera()).unwrap();
        let speed = (moved.pixel - seen.pixel) / 1e-5;
        prop_assert!((speed - seen.velocity).norm() < 1e-2 * (1.0 + speed.norm()));
    }

    #[test]
    fn the_uncertainty_in_space_is_that_of_the_sighting(
        x in 1.5..7.0f64, y in -1.0..1.0f64, z in 0.8..1.9f64,
    ) {
        let covariance = Matrix3::new(0.04, 0.01, 0.0, 0.01, 0.09, 0.0, 0.0, 0.0, 0.01);
        let seen = person(Point3::new(x, y, z)).with_covariance(covariance);
        let exact = Config { sigma_centre: 1e-6, sigma_range_m: 1e-6, ..Config::default() };
        let estimate = State::start(&exact, &seen, &camera()).estimate(&camera());
        let toward = (seen.position - camera().robot_from_camera.translation.vector).coords;
        let unit = toward.normalize();
        let found = estimate.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        // Correlation of range and direction is left out, the rest is kept.
        let [found_along, seen_along] = [found, covariance].map(|m| unit.dot(&(m * unit)));
        let across = Matrix3::identity() - unit * unit.transpose();
        prop_assert!((found_along - seen_along).abs() < 1e-4);
        let off = across * (found - covariance) * across;
        prop_assert!(off.norm() < 1e-3 * covariance.norm(), "{off}");
    }

    #[test]
    fn pixels_are_as_uncertain_as_the_place(x in 1.5..7.0f64, y in -1.0..1.0f64, z in 0.8..1.9f64) {
        let camera = camera();
        let place = Point3::new(x, y, z);
        let covariance = Matrix3::new(0.04, 0.01, 0.0, 0.01, 0.09, 0.0, 0.0, 0.0, 0.01);
        let root = covariance.cholesky().unwrap().l();
        let mut expected = Matrix2::zeros();
        for column in root.column_iter() {
            let moved = camera.project(&(place + column * 1e-4)).unwrap();
            let shift = (moved - camera.project(&place).unwrap()) / 1e-4;
            expected += shift * shift.transpose();
        }
        let found = pixel_covariance(&camera, &place, &covariance).unwrap();
        prop_assert!((found - expected).norm() < 1e-2 * expected.norm(), "{found} {expected}");
    }
}

/// Returns the velocity after a gap, pixels a frame: a box moves by 4 pixels a frame to frame 10, is
/// missed, and is seen in frame 20 where it would have been in the frame of number `reached`.
fn after_a_gap(reupdate: bool, reached: u32) -> f64 {
    let (camera, seen) = ahead(4.0);
    let config = Config { reupdate, ..Config::default() };
    let mut filter = ImageKalman::new(config).unwrap();
    filter.start(TrackId(1), &seen, &camera);
    let Rect { width, height, .. } = seen.rect().unwrap();
    let camera = Arc::new(camera);
    for index in 1..=20_u32 {
        let motion = EgoMotion::at_rest(0.1);
        filter.predict(&motion, &camera);
        if (11..20).contains(&index) {
            continue;
        }
        let x = 4.0 * f64::from(if index == 20 { reached } else { index });
        let region = Rect::new(x, 100.0, width, height);
        let found = seen.clone().with_image(ImageBox::upper_body(region));
        let stamp = Stamp::default();
        let frame = Frame::new(index.into(), stamp, Arc::clone(&camera), motion, Images::default());
        let matched = [Matched::certain(TrackId(1), &found)];
        let evidence = Evidence::new(&frame, &matched);
        filter.update(&evidence).unwrap();
    }
    let place = filter.estimates(&camera)[&TrackId(1)].region.x;
    filter.predict(&EgoMotion::at_rest(0.1), &camera);
    filter.estimates(&camera)[&TrackId(1)].region.x - place
}

#[test]
fn a_gap_that_is_filtered_anew_leaves_no_wrong_velocity() {
    let with = after_a_gap(true, 10);
    let without = after_a_gap(false, 10);
    assert!(with.abs() < 0.5, "pixels a frame: {with}");
    assert!(without.abs() > 2.0 * with.abs().max(0.1), "{without} {with}");
    let went_on = after_a_gap(true, 20);
    assert!((went_on - 4.0).abs() < 0.2, "pixels a frame: {went_on}");
}

#[test]
fn without_a_gap_nothing_is_filtered_anew() {
    let (camera, seen) = ahead(4.0);
    let states = [false, true].map(|reupdate| {
        let mut filter = ImageKalman::new(Config { reupdate, ..Config::default() }).unwrap();
        filter.start(TrackId(1), &seen, &camera);
        let camera = Arc::new(camera.clone());
        for index in 1..9 {
            let motion = EgoMotion { turn: 0.01, ..EgoMotion::at_rest(0.1) };
            filter.predict(&motion, &camera);
            let stamp = Stamp::default();
            let frame = Frame::new(index, stamp, Arc::clone(&camera), motion, Images::default());
            let matched = [Matched::certain(TrackId(1), &seen)];
            let evidence = Evidence::new(&frame, &matched);
            filter.update(&evidence).unwrap();
        }
        filter.estimates(&camera)[&TrackId(1)].clone()
    });
    assert_eq!(states[0].region, states[1].region);
}

#[test]
fn a_velocity_may_decay() {
    fn after(velocity_decay_s: f64) -> (f64, f64) {
        let config = Config { velocity_decay_s, ..Config::default() };
        let mut state = fed(config.clone(), &sliding(30), EgoMotion::at_rest(DT_S));
        let place = state.image[0];
        let speed = state.image[2];
        for _ in 0..100 {
            state.predict(&config, &EgoMotion::at_rest(0.1), &camera());
        }
        ((state.image[0] - place) / speed, state.image[2] / speed)
    }

    let (way_s, left) = after(0.0);
    assert!((way_s - 10.0).abs() < 1e-9 && left == 1.0, "{way_s} {left}");
    // The whole way of a decaying velocity is the time constant times the velocity.
    let (way_s, left) = after(0.5);
    assert!((way_s - 0.5).abs() < 1e-6 && left < 1e-6, "{way_s} {left}");
}

#[test]
fn a_shaking_camera_moves_boxes_and_gives_them_no_velocity() {
    let [still, shaken] = [0.0, 0.5].map(|position_noise| {
        let config = Config { position_noise, ..Config::default() };
        let mut state = State::start(&config, &ahead(4.0).1, &ahead(4.0).0);
        let before = state.image_covariance;
        let width = state.image[4];
        state.predict(&config, &EgoMotion::at_rest(0.1), &camera());
        (state.image_covariance - before) / width.powi(2)
    });
    for axis in 0..2 {
        let grown = shaken[(axis, axis)] - still[(axis, axis)];
        assert!((grown - 0.25 * 0.1).abs() < 1e-9, "{grown}");
        assert_eq!(shaken[(axis + 2, axis + 2)], still[(axis + 2, axis + 2)]);
    }
}

#[test]
fn the_box_of_a_detection_may_be_reported_as_it_is() {
    fn region(observed_boxes: bool) -> (bool, Rect) {
        let config = Config { observed_boxes, ..Config::default() };
        let sightings = sliding(3);
        let mut state = fed(config.clone(), &sightings, EgoMotion::at_rest(DT_S));
        let seen = state.estimate(&camera()).region;
        state.predict(&config, &EgoMotion::at_rest(DT_S), &camera());
        (seen == sightings[2].rect().unwrap(), state.estimate(&camera()).region)
    }

    let filtered = region(false);
    let observed = region(true);
    assert_eq!((filtered.0, observed.0), (false, true));
    assert_eq!(filtered.1, observed.1, "what is expected is the filter's in any case");
}
