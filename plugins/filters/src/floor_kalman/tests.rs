use std::sync::Arc;

use nalgebra::{DMatrix, DVector, Isometry2, Matrix2, Matrix2x3, Matrix3, Point2, Point3, Vector2};
use proptest::prelude::*;
use tagalong_core::{
    Detection, EgoMotion, Estimate, Evidence, Filter, Frame, Images, Matched, Stamp, TrackId,
};
use tagalong_geometry::{Camera, Distortion, ImageBox, Pinhole, Rect};

use crate::floor_kalman::state::State;
use crate::floor_kalman::{Config, FloorKalman, Form, Measurement};

const ID: TrackId = TrackId(1);

fn camera() -> Camera {
    let lens = Pinhole { fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0, distortion: Distortion::None };
    Camera::mounted(lens, 320, 240, 1.2, 0.0, 0.0)
}

fn frame() -> Frame {
    let camera = Arc::new(camera());
    Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), Images::default())
}

fn sighting(x: f64, y: f64) -> Detection {
    Detection::new("test", Point3::new(x, y, 1.6), Matrix3::from_diagonal_element(0.02), 1.0)
        .with_image(ImageBox::upper_body(Rect::new(0.0, 0.0, 9.0, 9.0)))
}

fn see(filter: &mut FloorKalman, detection: &Detection) -> (f64, u32) {
    let matched = [Matched::certain(ID, detection)];
    let frame = frame();
    let evidence = Evidence::new(&frame, &matched);
    filter.update(&evidence).unwrap()[&ID].nis.unwrap()
}

fn estimate(filter: &FloorKalman) -> Estimate {
    filter.estimates(&camera())[&ID].clone()
}

fn forms() -> [Form; 3] {
    [Form::Still, Form::LastDifference, Form::ConstantVelocity]
}

/// Returns the filter after a person's steady walk, observed without noise.
fn after_a_walk(config: Config) -> FloorKalman {
    let mut filter = FloorKalman::new(config).unwrap();
    filter.start(ID, &sighting(2.0, 0.0), &camera());
    for step in 1..=30 {
        filter.predict(&EgoMotion::at_rest(1.0 / 3.0), &camera());
        see(&mut filter, &sighting(2.0 + 0.2 * f64::from(step), 0.0));
    }
    filter
}

#[test]
fn a_still_person_is_filtered_by_equations_5_to_9() {
    let config = Config { form: Form::Still, measurement: Measurement::Fixed, ..Config::default() };
    let mut filter = FloorKalman::new(config).unwrap();
    filter.start(ID, &sighting(1.0, 2.0), &camera());
    let r = Matrix2::new(0.011, -0.004, -0.004, 0.020);
    let q = Matrix2::new(0.024, -0.001, -0.001, 0.043);
    let mut x = Vector2::new(1.0, 2.0);
    let mut p = r;
    for z in [Vector2::new(1.2, 2.1), Vector2::new(1.3, 2.5), Vector2::new(1.1, 2.9)] {
        // Equations 5 to 9, as they stand.
        p += q;
        let k = p * (p + r).try_inverse().unwrap();
        x += k * (z - x);
        p = (Matrix2::identity() - k) * p;
        filter.predict(&EgoMotion::at_rest(1.0 / 3.0), &camera());
        see(&mut filter, &sighting(z.x, z.y));
        let found = estimate(&filter);
        assert!((found.person.position.xy().coords - x).norm() < 1e-12);
        let block = found.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        assert!((block - p).norm() < 1e-12, "{block} {p}");
    }
    // The gain that these Q and R lead to: a weak smoother.
    let k = (p + q) * (p + q + r).try_inverse().unwrap();
    assert!((0.7..0.85).contains(&k[(0, 0)]), "{k}");
}

#[test]
fn a_walk_is_foreseen_by_those_who_know_a_velocity() {
    fn ahead(form: Form) -> f64 {
        let mut filter = after_a_walk(Config { form, ..Config::default() });
        filter.predict(&EgoMotion::at_rest(1.0 / 3.0), &camera());
        estimate(&filter).person.position.x - 8.2
    }

    assert!(ahead(Form::Still) < -0.19, "{}", ahead(Form::Still));
    for foreseen in [ahead(Form::LastDifference), ahead(Form::ConstantVelocity)] {
        assert!(foreseen.abs() < 0.03, "{foreseen}");
    }
}

#[test]
fn the_process_noise_grows_with_the_time_between_images() {
    let config = Config { step_s: 0.2, process_m2: [0.02, -0.01, 0.04], ..Config::default() };
    let expected = Matrix2::new(0.06, -0.03, -0.03, 0.12);
    assert!((config.process(0.6) - expected).norm() < 1e-12, "{}", config.process(0.6));
}

/// The X axis of the room lies 45 degrees to the left: R is wide along it, so that an error
/// ahead comes with one to the left.
#[test]
fn noise_in_room_axes_is_turned_by_the_heading_of_the_room() {
    let config = Config {
        measurement: Measurement::Fixed,
        measurement_m2: [1.0, 0.0, 0.01],
        room_heading_deg: 45.0,
        ..Config::default()
    };
    let mut filter = FloorKalman::new(config).unwrap();
    filter.start(ID, &sighting(3.0, 1.0), &camera());
    let covariance = estimate(&filter).covariance;
    assert!((covariance[(0, 1)] - 0.495).abs() < 1e-9, "{covariance}");
    assert!((covariance[(0, 0)] - 0.505).abs() < 1e-9, "{covariance}");
}

#[test]
fn a_polar_measurement_is_wide_where_it_is_far() {
    fn spread(range: f64) -> (f64, f64) {
        let config = Config { measurement: Measurement::Polar, ..Config::default() };
        let mut filter = FloorKalman::new(config).unwrap();
        filter.start(ID, &sighting(0.0, range), &camera());
        let c = estimate(&filter).covariance;
        (c[(1, 1)].sqrt(), c[(0, 0)].sqrt())
    }

    let ((near_along, near_across), (far_along, far_across)) = (spread(1.0), spread(6.0));
    assert!((near_along - 0.08).abs() < 1e-9 && (far_along - 0.23).abs() < 1e-9);
    assert!((far_across / near_across - 6.0).abs() < 1e-6);
}

#[test]
fn settings_that_cannot_work_are_refused() {
    fn refused(config: Config) -> bool {
        FloorKalman::new(config).is_err()
    }

    assert!(refused(Config { process_m2: [1.0, 2.0, 1.0], ..Config::default() }));
    assert!(refused(Config { measurement_m2: [f64::NAN, 0.0, 1.0], ..Config::default() }));
    assert!(refused(Config { step_s: 0.0, ..Config::default() }));
}

/// The cross covariance that `last-difference` carries along is that of the
/// errors of two posteriors: many walks, drawn and filtered.
#[test]
fn the_prediction_by_differences_is_as_uncertain_as_it_says() {
    /// Draws from the sum of twelve uniform numbers.
    fn next_normal(random: &mut u64) -> f64 {
        let uniform = (0..12).map(|_| {
            *random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (*random >> 11) as f64 / (1u64 << 53) as f64
        });
        uniform.sum::<f64>() - 6.0
    }

    /// Returns a place with the noise of a sighting.
    fn noisy(at: Vector2<f64>, random: &mut u64) -> Vector2<f64> {
        at + Vector2::new(next_normal(random), next_normal(random)) * 0.02_f64.sqrt()
    }

    let config = Config { form: Form::LastDifference, ..Config::default() };
    let mut random = 7_u64;
    let r = Matrix2::from_diagonal_element(0.02);
    let root = config.process(config.step_s).cholesky().unwrap().l();
    let mut squares = 0.0;
    let mut count = 0.0;
    let mut said = 0.0;
    for _ in 0..4000 {
        let mut truth = [Vector2::zeros(), Vector2::new(0.1, 0.0)];
        let mut state = State::new(noisy(truth[1], &mut random), &r, (1.6, 0.01), &config);
        for step in 0..3 {
            let noise = root * Vector2::new(next_normal(&mut random), next_normal(&mut random));
            // The first step of the filter knows no difference, and so has none.
            let u = if step == 0 { Vector2::zeros() } else { truth[1] - truth[0] };
            truth = [truth[1], truth[1] + u + noise];
            state.predict(config.step_s, &Matrix2::zeros(), &config);
            if step < 2 {
                state.correct(&noisy(truth[1], &mut random), &r, config.form);
            }
        }
        squares += (state.position() - truth[1]).norm_squared();
        said = state.position_covariance().trace();
        count += 1.0;
    }
    let seen = squares / count;
    assert!((seen / said - 1.0).abs() < 0.08, "seen {seen}, said {said}");
}

proptest! {
    #[test]
    fn who_stands_stays_in_the_room(
        forward in -0.5..0.5f64, left in -0.2..0.2f64, turn in -1.0..1.0f64,
        x in -4.0..4.0f64, y in -4.0..4.0f64, room in -180.0..180.0f64,
    ) {
        for form in forms() {
            let config = Config { form, room_heading_deg: room, ..Config::default() };
            let mut filter = FloorKalman::new(config).unwrap();
            filter.start(ID, &sighting(x, y), &camera());
            let motion = EgoMotion { forward, left, turn, ..EgoMotion::at_rest(0.3) };
            let mut at = Point2::new(x, y);
            for _ in 0..4 {
                filter.predict(&motion, &camera());
                at = motion.apply_to_point(at);
                let found = estimate(&filter);
                prop_assert!((found.person.position.xy() - at).norm() < 1e-9);
                see(&mut filter, &sighting(at.x, at.y));
                prop_assert!(estimate(&filter).covariance.fixed_view::<2, 2>(0, 0).into_owned().cholesky().is_some());
            }
        }
    }
}

/// The four states as a textbook has them, in the room, in matrices of any size.
struct Textbook {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Textbook {
    fn predict(&mut self, dt: f64, q: f64, ego: &DMatrix<f64>) {
        let f = DMatrix::from_row_slice(
            4,
            4,
            &[1.0, 0.0, dt, 0.0, 0.0, 1.0, 0.0, dt, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        );
        let a = q * dt * dt * dt / 3.0;
        let b = q * dt * dt / 2.0;
        let c = q * dt;
        let noise = DMatrix::from_row_slice(
            4,
            4,
            &[a, 0.0, b, 0.0, 0.0, a, 0.0, b, b, 0.0, c, 0.0, 0.0, b, 0.0, c],
        );
        self.mean = &f * &self.mean;
        self.covariance = &f * &self.covariance * f.transpose() + noise;
        let mut position = self.covariance.view_mut((0, 0), (2, 2));
        position += ego;
    }

    /// Returns the normalised innovation squared.
    fn correct(&mut self, z: &DVector<f64>, r: &DMatrix<f64>) -> f64 {
        let h = DMatrix::identity(2, 4);
        let innovation = z - &h * &self.mean;
        let s = (&h * &self.covariance * h.transpose() + r).try_inverse().unwrap();
        let gain = &self.covariance * h.transpose() * &s;
        self.mean += &gain * &innovation;
        self.covariance = (DMatrix::identity(4, 4) - &gain * &h) * &self.covariance;
        (innovation.transpose() * s * innovation)[(0, 0)]
    }
}

/// A robot that drives a curve, in a room that is turned, with detections whose
/// covariance has a direction: place, velocity and covariance in the robot's axes are
/// those of the textbook's filter in the room.
#[test]
fn four_states_are_those_of_a_filter_written_down() {
    fn dynamic(m: &Matrix2<f64>) -> DMatrix<f64> {
        DMatrix::from_fn(2, 2, |i, j| m[(i, j)])
    }

    fn turn(pose: &Isometry2<f64>) -> Matrix2<f64> {
        *pose.rotation.to_rotation_matrix().matrix()
    }

    let config = Config { room_heading_deg: 30.0, ..Config::default() };
    let q = config.acceleration_noise;
    let speed = config.initial_speed_mps;
    let mut filter = FloorKalman::new(config).unwrap();
    let r = Matrix2::new(0.05, 0.02, 0.02, 0.03);
    let mut of_sighting = Matrix3::from_diagonal_element(0.02);
    of_sighting.fixed_view_mut::<2, 2>(0, 0).copy_from(&r);
    let mut room_from_robot = Isometry2::new(Vector2::zeros(), -30.0_f64.to_radians());
    filter.start(ID, &sighting(2.0, 1.0).with_covariance(of_sighting), &camera());
    let start = room_from_robot * Point2::new(2.0, 1.0);
    let mut covariance = DMatrix::from_diagonal_element(4, 4, speed * speed);
    let first = turn(&room_from_robot) * r * turn(&room_from_robot).transpose();
    covariance.view_mut((0, 0), (2, 2)).copy_from(&dynamic(&first));
    let mean = DVector::from_vec(vec![start.x, start.y, 0.0, 0.0]);
    let mut book = Textbook { mean, covariance };
    for (x, y) in [(2.1, 1.2), (1.9, 1.3), (1.6, 1.1), (1.7, 0.8)] {
        let uncertain = Matrix3::new(0.01, 0.002, 0.0, 0.002, 0.004, 0.001, 0.0, 0.001, 0.003);
        let motion = EgoMotion {
            forward: 0.2,
            left: 0.05,
            turn: 0.3,
            covariance: uncertain,
            ..EgoMotion::at_rest(0.4)
        };
        room_from_robot *= motion.isometry();
        let rotation = turn(&room_from_robot);
        // A turn of the robot moves the person across, in proportion to their distance.
        let away = book.mean.rows(0, 2) - room_from_robot.translation.vector;
        let j = Matrix2x3::from_columns(&[
            rotation.column(0).into_owned(),
            rotation.column(1).into_owned(),
            Vector2::new(-away[1], away[0]),
        ]);
        book.predict(0.4, q, &dynamic(&(j * uncertain * j.transpose())));
        filter.predict(&motion, &camera());
        let z = room_from_robot * Point2::new(x, y);
        let of_room = rotation * r * rotation.transpose();
        let expected = book.correct(&DVector::from_vec(vec![z.x, z.y]), &dynamic(&of_room));
        let seen = sighting(x, y).with_covariance(of_sighting);
        let (nis, degrees) = see(&mut filter, &seen);
        assert!((nis - expected).abs() < 1e-9 && degrees == 2, "{nis} {expected}");
        let found = estimate(&filter);
        let place = room_from_robot.inverse() * Point2::new(book.mean[0], book.mean[1]);
        let velocity = rotation.transpose() * Vector2::new(book.mean[2], book.mean[3]);
        assert!((found.person.position.xy() - place).norm() < 1e-9);
        assert!((found.person.velocity - velocity).norm() < 1e-9);
        for (row, column) in [(0, 0), (0, 2), (2, 0), (2, 2)] {
            let i = row + row / 2;
            let j = column + column / 2;
            let of_book = book.covariance.fixed_view::<2, 2>(row, column).into_owned();
            let of_book = rotation.transpose() * of_book * rotation;
            let of_filter = found.covariance.fixed_view::<2, 2>(i, j).into_owned();
            assert!((of_filter - of_book).norm() < 1e-9, "{row} {column}");
        }
    }
}

#[test]
fn the_height_is_filtered_by_itself_and_kept_where_it_is_not_measured() {
    fn with_height(z: f64, variance: f64) -> Detection {
        let mut detection = sighting(2.0, 0.0);
        detection.position.z = z;
        detection.covariance[(2, 2)] = variance;
        detection
    }

    fn height(filter: &FloorKalman) -> (f64, f64) {
        let found = estimate(filter);
        (found.person.position.z, found.covariance[(2, 2)])
    }

    let mut filter = FloorKalman::new(Config { height_noise: 0.2, ..Config::default() }).unwrap();
    filter.start(ID, &with_height(1.5, 0.04), &camera());
    filter.predict(&EgoMotion::at_rest(0.5), &camera());
    let prior = 0.04 + 0.2 * 0.2 * 0.5;
    assert!((height(&filter).1 - prior).abs() < 1e-12);
    see(&mut filter, &with_height(1.8, 0.03));
    let gain = prior / (prior + 0.03);
    let (z, variance) = height(&filter);
    assert!((z - (1.5 + gain * 0.3)).abs() < 1e-12, "{z}");
    assert!((variance - (1.0 - gain) * prior).abs() < 1e-12, "{variance}");
    for unmeasured in [100.0, 1e6] {
        see(&mut filter, &with_height(9.0, unmeasured));
        assert_eq!(height(&filter), (z, variance));
    }
    see(&mut filter, &with_height(9.0, 99.0));
    assert!(height(&filter).0 > z);
}

#[test]
fn polar_noise_lies_along_the_ray_however_the_robot_is_turned() {
    let config = Config {
        measurement: Measurement::Polar,
        room_heading_deg: 50.0,
        sigma_range_m: 0.2,
        sigma_range_per_m: 0.1,
        sigma_bearing_deg: 2.0,
        ..Config::default()
    };
    let angle = 2.0_f64.to_radians();
    // No person is nearer than the robot's own size.
    for (at, along, expected) in [
        ([3.0, -4.0], Vector2::new(0.6, -0.8), [0.7, 5.0 * angle]),
        ([0.05, 0.0], Vector2::x(), [0.205, 0.1 * angle]),
    ] {
        let mut filter = FloorKalman::new(config.clone()).unwrap();
        filter.start(ID, &sighting(at[0], at[1]), &camera());
        let c = estimate(&filter).covariance.fixed_view::<2, 2>(0, 0).into_owned();
        let across = Vector2::new(-along.y, along.x);
        for (axis, expected) in [along, across].iter().zip(expected) {
            let sigma = axis.dot(&(c * axis)).sqrt();
            assert!((sigma - expected).abs() < 1e-9, "{sigma} {expected}");
        }
    }
}

/// The error that `last-difference` states, against the recursion of the joint covariance of two
/// posteriors.
#[test]
fn the_noise_of_differences_is_that_of_the_joint_covariance() {
    let config = Config { form: Form::LastDifference, ..Config::default() };
    let r = Matrix2::new(0.03, 0.01, 0.01, 0.02);
    let mut state = State::new(Vector2::new(1.0, 2.0), &r, (1.6, 0.01), &config);
    // Errors of the last posterior and of the one before.
    let mut joint = DMatrix::zeros(4, 4);
    joint.view_mut((0, 0), (2, 2)).copy_from(&r);
    for step in 0..5 {
        let dt = 0.2 + 0.05 * f64::from(step);
        let (a, b) = if step == 0 { (1.0, 0.0) } else { (2.0, -1.0) };
        let mut ahead = DMatrix::zeros(4, 4);
        for axis in 0..2 {
            ahead[(axis, axis)] = a;
            ahead[(axis, axis + 2)] = b;
            ahead[(axis + 2, axis)] = 1.0;
        }
        joint = &ahead * joint * ahead.transpose();
        let before = state.position();
        let mut prior = joint.fixed_view::<2, 2>(0, 0) + config.process(dt);
        joint.view_mut((0, 0), (2, 2)).copy_from(&prior);
        state.predict(dt, &Matrix2::zeros(), &config);
        assert!((state.position_covariance() - prior).norm() < 1e-12, "{step}");
        if step > 0 {
            let u = state.position() - before;
            assert!((state.velocity().0 - u / dt).norm() < 1e-12);
        }
        let kept = Matrix2::identity() - prior * (prior + r).try_inverse().unwrap();
        let mut corrected = DMatrix::identity(4, 4);
        corrected.view_mut((0, 0), (2, 2)).copy_from(&kept);
        joint = &corrected * joint * corrected.transpose();
        let gain = Matrix2::identity() - kept;
        prior = kept * prior * kept.transpose() + gain * r * gain.transpose();
        joint.view_mut((0, 0), (2, 2)).copy_from(&prior);
        state.correct(&Vector2::new(1.0 + 0.1 * f64::from(step), 2.2), &r, config.form);
        assert!((state.position_covariance() - prior).norm() < 1e-12, "{step}");
    }
}

#[test]
fn each_number_has_its_least_and_its_most() {
    fn checked(key: &str, value: f64) -> Option<String> {
        let config: Config = toml::from_str(&format!("{key} = {value:?}")).unwrap();
        FloorKalman::new(config).err().map(|error| error.to_string())
    }

    fn covariance(measurement_m2: [f64; 3]) -> Config {
        Config { measurement_m2, ..Config::default() }
    }

    let least = [
        ("step_s", 1e-3),
        ("sigma_range_m", 1e-3),
        ("sigma_range_per_m", 0.0),
        ("sigma_bearing_deg", 1e-3),
        ("acceleration_noise", 1e-6),
        ("initial_speed_mps", 1e-3),
        ("height_noise", 0.0),
        ("room_heading_deg", -360.0),
    ];
    for (key, least) in least {
        assert_eq!((checked(key, least), checked(key, 1000.0)), (None, None), "{key}");
        for wrong in [least - 1e-7, 1000.1] {
            assert!(checked(key, wrong).is_some_and(|why| why.contains(key)), "{key} {wrong}");
        }
    }
    assert!(FloorKalman::new(covariance([9e5, 0.0, 9e5])).is_ok());
    assert!(FloorKalman::new(covariance([1e6, 0.0, 9e5])).is_err());
    assert!(FloorKalman::new(covariance([1.0, 2.0, 1.0])).is_err());
}

#[test]
fn who_is_stopped_is_forgotten_and_a_stranger_gives_no_support() {
    let mut filter = FloorKalman::new(Config::default()).unwrap();
    filter.start(ID, &sighting(2.0, 0.0), &camera());
    let other = TrackId(2);
    let frame = frame();
    let detection = sighting(2.0, 0.1);
    let matched = [Matched::certain(other, &detection)];
    let evidence = Evidence::new(&frame, &matched);
    assert!(filter.update(&evidence).unwrap().is_empty());
    filter.stop(other);
    assert_eq!(filter.estimates(&camera()).len(), 1);
    filter.stop(ID);
    assert!(filter.estimates(&camera()).is_empty());
}
