use std::sync::Arc;

use nalgebra::{Matrix2, Matrix3, Point3, Vector3};
use proptest::prelude::*;
use tagalong_core::{
    Camera, Detection, Distortion, Evidence, Filter, Frame, Images, Matched, Motion, Pinhole, Rect,
    Registry, Stamp, TrackId,
};

use crate::space::{Place, pixel_covariance};
use crate::{Belief, Config, ImageKalman};

const DT_S: f64 = 1.0 / 23.0;

fn camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 525.0, fy: 520.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, 640, 480, 1.3, 0.15, 0.05))
}

fn person(head: Point3<f64>) -> Detection {
    Detection {
        region: camera().upper_body(&head),
        position: head,
        covariance: Matrix3::identity() * 1e-4,
        score: 3.0,
        source: "test",
    }
}

/// Feeds one person's sightings, each after a motion of the robot.
fn fed(config: Config, sightings: &[Detection], motion: Motion) -> Belief {
    let camera = camera();
    let mut belief = Belief::start(&config, &sightings[0], &camera);
    for seen in &sightings[1..] {
        belief.predict(&config, &motion, &camera);
        belief.correct(&config, seen, &camera);
    }
    belief
}

/// A box that slides by 120 pixels a second.
fn sliding(frames: usize) -> Vec<Detection> {
    let start = person(Point3::new(4.0, 1.0, 1.6));
    let shifted = |i: usize| Rect { x: start.region.x + 120.0 * DT_S * i as f64, ..start.region };
    (0..frames).map(|i| Detection { region: shifted(i), ..start.clone() }).collect()
}

#[test]
fn it_conforms() {
    let mut registry = Registry::default();
    crate::register(&mut registry);
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn the_printed_measurement_lags_by_one_frame_and_ours_does_not() {
    let sightings = sliding(60);
    let lag = |compat_printed_measurement| {
        let config = Config { compat_printed_measurement, ..Config::default() };
        let belief = fed(config, &sightings, Motion::at_rest(DT_S));
        sightings[59].region.centre().x - belief.image[0]
    };
    assert!(lag(false).abs() < 0.1, "{}", lag(false));
    let step = 120.0 * DT_S;
    assert!((lag(true) - step).abs() < 0.2, "{} instead of {step}", lag(true));
}

/// Sightings of a standing person from a robot that turns and drives.
fn from_a_moving_robot(motion: &Motion, frames: usize) -> Vec<Detection> {
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
fn a_standing_person_has_no_velocity_while_the_robot_turns_in_print_they_run() {
    let motion = Motion { forward: 0.02, turn: 0.015, ..Motion::at_rest(DT_S) };
    let sightings = from_a_moving_robot(&motion, 30);
    let speed = |compat_printed_ego_motion| {
        let config = Config { compat_printed_ego_motion, ..Config::default() };
        fed(config, &sightings, motion).estimate(&camera()).person.velocity.norm()
    };
    assert!(speed(false) < 0.1, "{} m/s", speed(false));
    assert!(speed(true) > 1.0, "{} m/s", speed(true));
}

#[test]
fn the_box_coasts_with_the_picture_while_the_robot_turns() {
    let motion = Motion { turn: 0.02, ..Motion::at_rest(DT_S) };
    let sightings = from_a_moving_robot(&motion, 30);
    let (seen, hidden) = sightings.split_at(20);
    let (config, camera) = (Config::default(), camera());
    let mut belief = fed(config.clone(), seen, motion);
    hidden.iter().for_each(|_| belief.predict(&config, &motion, &camera));
    let iou = belief.estimate(&camera).region.iou(&hidden[9].region);
    assert!(iou > 0.85, "{iou}");
}

#[test]
fn whoever_the_robot_turns_its_back_on_is_found_again_where_they_were() {
    let (config, camera) = (Config::default(), camera());
    let place = Point3::new(3.0, 0.2, 1.6);
    let mut belief = fed(config.clone(), &vec![person(place); 10], Motion::at_rest(DT_S));
    let turn = |belief: &mut Belief, turn: f64| {
        let motion = Motion { turn, ..Motion::at_rest(DT_S) };
        (0..20).for_each(|_| belief.predict(&config, &motion, &camera));
    };
    turn(&mut belief, 0.15);
    let gone = belief.estimate(&camera);
    assert!(gone.person.position.x < -2.0 && gone.region.area() == 0.0, "{gone:?}");
    turn(&mut belief, -0.15);
    let back = belief.estimate(&camera);
    assert!((back.person.position - place).norm() < 0.05, "{back:?}");
    assert!(back.region.iou(&person(place).region) > 0.9);
}

#[test]
fn a_box_of_any_shape_keeps_its_shape() {
    let seen = person(Point3::new(4.0, 0.3, 1.6));
    let Rect { x, y, width, height } = seen.region;
    let tall = Detection { region: Rect::new(x, y, width, 2.6 * height), ..seen };
    let belief = fed(Config::default(), &vec![tall.clone(); 5], Motion::at_rest(DT_S));
    let estimate = belief.estimate(&camera());
    assert!(estimate.region.iou(&tall.region) > 0.999, "{:?}", estimate.region);
    assert!((estimate.person.position - tall.position).norm() < 1e-6);
}

#[test]
fn a_depth_that_is_a_guess_stays_uncertain() {
    let sure = person(Point3::new(4.0, 0.3, 1.6));
    let toward = camera().robot_from_camera.rotation * Vector3::z();
    let guess = Detection { covariance: toward * toward.transpose(), ..sure.clone() };
    let sigma = |seen: &Detection| {
        let belief = fed(Config::default(), &vec![seen.clone(); 3], Motion::at_rest(DT_S));
        belief.estimate(&camera()).covariance[(0, 0)].sqrt()
    };
    assert!(sigma(&sure) < 0.05 && sigma(&guess) > 0.5, "{} {}", sigma(&sure), sigma(&guess));
}

#[test]
fn sightings_that_make_no_sense_leave_finite_numbers() {
    let seen = person(Point3::new(4.0, 0.3, 1.6));
    let odd = [
        Detection { region: Rect::default(), ..seen.clone() },
        Detection { position: Point3::new(-3.0, 0.0, 1.6), ..seen.clone() },
        Detection { covariance: Matrix3::zeros(), ..seen.clone() },
        Detection { covariance: Matrix3::identity() * 1e12, ..seen.clone() },
        Detection { region: Rect::new(-1e6, 1e6, 1e5, 1.0), ..seen.clone() },
    ];
    let moves = Motion { forward: 3.0, turn: 2.0, ..Motion::at_rest(0.0) };
    for odd in odd {
        let mut filter = ImageKalman::new(Config::default()).unwrap();
        filter.start(TrackId(1), &odd);
        for seen in [&odd, &seen, &odd] {
            filter.predict(&moves);
            let frame = Frame::new(1, Stamp::default(), camera(), moves, Images::default());
            let matched = [Matched { id: TrackId(1), detection: seen }];
            let evidence =
                Evidence { frame: &frame, matched: &matched, unmatched: &[], likelihood: None };
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
    ];
    assert!(wrong.into_iter().all(|config| ImageKalman::new(config).is_err()));
}

proptest! {
    #[test]
    fn image_and_space_are_two_views_of_one_thing(
        x in 1.5..7.0f64, y in -1.0..1.0f64, z in 0.8..1.9f64,
        vx in -2.0..2.0f64, vy in -2.0..2.0f64, vz in -0.5..0.5f64,
    ) {
        let place = Place { position: Point3::new(x, y, z), velocity: Vector3::new(vx, vy, vz) };
        let seen = place.seen(&camera()).unwrap();
        let back = seen.in_space(&camera());
        prop_assert!((back.position - place.position).norm() < 1e-9);
        prop_assert!((back.velocity - place.velocity).norm() < 1e-6);
        let later = Place { position: place.position + place.velocity * 1e-5, ..place };
        let moved = later.seen(&camera()).unwrap();
        let speed = (moved.pixel - seen.pixel) / 1e-5;
        prop_assert!((speed - seen.velocity).norm() < 1e-2 * (1.0 + speed.norm()));
    }

    #[test]
    fn the_uncertainty_in_space_is_that_of_the_sighting(
        x in 1.5..7.0f64, y in -1.0..1.0f64, z in 0.8..1.9f64,
    ) {
        let covariance = Matrix3::new(0.04, 0.01, 0.0, 0.01, 0.09, 0.0, 0.0, 0.0, 0.01);
        let seen = Detection { covariance, ..person(Point3::new(x, y, z)) };
        let exact = Config { sigma_centre: 1e-6, sigma_range_m: 1e-6, ..Config::default() };
        let estimate = Belief::start(&exact, &seen, &camera()).estimate(&camera());
        let toward = (seen.position - camera().robot_from_camera.translation.vector).coords;
        let unit = toward.normalize();
        let found = estimate.covariance.fixed_view::<3, 3>(0, 0).into_owned();
        // What ties range and direction together is left out, the rest is kept.
        let along = |m: Matrix3<f64>| unit.dot(&(m * unit));
        let across = Matrix3::identity() - unit * unit.transpose();
        prop_assert!((along(found) - along(covariance)).abs() < 1e-4);
        let off = across * (found - covariance) * across;
        prop_assert!(off.norm() < 1e-3 * covariance.norm(), "{off}");
    }

    #[test]
    fn pixels_are_as_uncertain_as_the_place(x in 1.5..7.0f64, y in -1.0..1.0f64, z in 0.8..1.9f64) {
        let (camera, place) = (camera(), Point3::new(x, y, z));
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
