use std::sync::Arc;

use nalgebra::{Matrix2, Matrix3, Point3, Vector2};
use proptest::prelude::*;
use tagalong_core::{
    Camera, Detection, Distortion, Estimate, Evidence, Filter, Frame, Images, Matched, Motion,
    Pinhole, Rect, Stamp, TrackId,
};

use crate::belief::Belief;
use crate::{Config, FloorKalman, Form, Measurement};

const ID: TrackId = TrackId(1);

fn camera() -> Camera {
    let lens = Pinhole { fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0, distortion: Distortion::None };
    Camera::mounted(lens, 320, 240, 1.2, 0.0, 0.0)
}

fn frame() -> Frame {
    let camera = Arc::new(camera());
    Frame::new(1, Stamp::default(), camera, Motion::at_rest(0.1), Images::default())
}

fn sighting(x: f64, y: f64) -> Detection {
    Detection {
        region: Rect::new(0.0, 0.0, 9.0, 9.0),
        position: Point3::new(x, y, 1.6),
        covariance: Matrix3::from_diagonal_element(0.02),
        score: 1.0,
        source: "test",
    }
}

fn see(filter: &mut FloorKalman, detection: &Detection) -> (f64, u32) {
    let matched = [Matched { id: ID, detection }];
    let frame = frame();
    let evidence = Evidence { frame: &frame, matched: &matched, unmatched: &[], likelihood: None };
    filter.update(&evidence).unwrap()[&ID].nis.unwrap()
}

fn estimate(filter: &FloorKalman) -> Estimate {
    filter.estimates(&camera())[&ID].clone()
}

fn forms() -> [Form; 3] {
    [Form::Still, Form::LastDifference, Form::ConstantVelocity]
}

/// Somebody at a steady walk, seen without noise.
fn after_a_walk(config: Config) -> FloorKalman {
    let mut filter = FloorKalman::new(config).unwrap();
    filter.start(ID, &sighting(2.0, 0.0));
    for step in 1..=30 {
        filter.predict(&Motion::at_rest(1.0 / 3.0));
        see(&mut filter, &sighting(2.0 + 0.2 * f64::from(step), 0.0));
    }
    filter
}

#[test]
fn the_printed_filter_is_the_printed_filter() {
    let config = Config { form: Form::Still, measurement: Measurement::Fixed, ..Config::default() };
    let mut filter = FloorKalman::new(config).unwrap();
    filter.start(ID, &sighting(1.0, 2.0));
    let r = Matrix2::new(0.011, -0.004, -0.004, 0.020);
    let q = Matrix2::new(0.024, -0.001, -0.001, 0.043);
    let (mut x, mut p) = (Vector2::new(1.0, 2.0), r);
    for z in [Vector2::new(1.2, 2.1), Vector2::new(1.3, 2.5), Vector2::new(1.1, 2.9)] {
        // Equations 5 to 9, as they stand.
        p += q;
        let k = p * (p + r).try_inverse().unwrap();
        x += k * (z - x);
        p = (Matrix2::identity() - k) * p;
        filter.predict(&Motion::at_rest(1.0 / 3.0));
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
    let ahead = |form, compat_printed_u| {
        let config = Config { form, compat_printed_u, ..Config::default() };
        let mut filter = after_a_walk(config);
        filter.predict(&Motion::at_rest(1.0 / 3.0));
        estimate(&filter).person.position.x - 8.2
    };
    assert!(ahead(Form::Still, false) < -0.19, "{}", ahead(Form::Still, false));
    for foreseen in [
        ahead(Form::LastDifference, false),
        ahead(Form::LastDifference, true),
        ahead(Form::ConstantVelocity, false),
    ] {
        assert!(foreseen.abs() < 0.03, "{foreseen}");
    }
}

#[test]
fn the_noise_of_u_makes_the_prediction_less_certain() {
    let spread = |compat_printed_u| {
        let form = Form::LastDifference;
        let mut filter = after_a_walk(Config { form, compat_printed_u, ..Config::default() });
        filter.predict(&Motion::at_rest(1.0 / 3.0));
        estimate(&filter).covariance[(0, 0)]
    };
    assert!(spread(false) > 1.3 * spread(true), "{} {}", spread(false), spread(true));
}

#[test]
fn a_polar_measurement_is_wide_where_it_is_far() {
    let spread = |range: f64| {
        let config = Config { measurement: Measurement::Polar, ..Config::default() };
        let mut filter = FloorKalman::new(config).unwrap();
        filter.start(ID, &sighting(0.0, range));
        let c = estimate(&filter).covariance;
        (c[(1, 1)].sqrt(), c[(0, 0)].sqrt())
    };
    let ((near_along, near_across), (far_along, far_across)) = (spread(1.0), spread(6.0));
    assert!((near_along - 0.08).abs() < 1e-9 && (far_along - 0.23).abs() < 1e-9);
    assert!((far_across / near_across - 6.0).abs() < 1e-6);
}

#[test]
fn settings_that_cannot_work_are_refused() {
    let refused = |config: Config| FloorKalman::new(config).is_err();
    assert!(refused(Config { process_m2: [1.0, 2.0, 1.0], ..Config::default() }));
    assert!(refused(Config { measurement_m2: [f64::NAN, 0.0, 1.0], ..Config::default() }));
    assert!(refused(Config { step_s: 0.0, ..Config::default() }));
}

#[test]
fn it_keeps_the_promises_of_its_kind() {
    let mut registry = tagalong_core::Registry::default();
    crate::register(&mut registry);
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}

/// The cross covariance that `last-difference` carries along is that of the
/// errors of two posteriors: many walks, drawn and filtered.
#[test]
fn the_prediction_by_differences_is_as_uncertain_as_it_says() {
    let config = Config { form: Form::LastDifference, ..Config::default() };
    let mut state = 7u64;
    let mut normal = move || {
        let uniform = (0..12).map(|_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 11) as f64 / (1u64 << 53) as f64
        });
        uniform.sum::<f64>() - 6.0
    };
    let r = Matrix2::from_diagonal_element(0.02);
    let root = config.process(config.step_s).cholesky().unwrap().l();
    let (mut squares, mut count, mut said) = (0.0, 0.0, 0.0);
    for _ in 0..4000 {
        let mut truth = [Vector2::zeros(), Vector2::new(0.1, 0.0)];
        let noisy = |at: Vector2<f64>, n: &mut dyn FnMut() -> f64| {
            at + Vector2::new(n(), n()) * 0.02_f64.sqrt()
        };
        let mut belief = Belief::new(noisy(truth[1], &mut normal), &r, (1.6, 0.01), &config);
        for step in 0..3 {
            let noise = root * Vector2::new(normal(), normal());
            // The first step of the filter knows no difference, and so has none.
            let u = if step == 0 { Vector2::zeros() } else { truth[1] - truth[0] };
            truth = [truth[1], truth[1] + u + noise];
            belief.predict(config.step_s, &Matrix2::zeros(), &config);
            if step < 2 {
                belief.correct(&noisy(truth[1], &mut normal), &r, config.form);
            }
        }
        squares += (belief.position() - truth[1]).norm_squared();
        said = belief.position_covariance().trace();
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
            filter.start(ID, &sighting(x, y));
            let motion = Motion { forward, left, turn, ..Motion::at_rest(0.3) };
            let mut at = nalgebra::Point2::new(x, y);
            for _ in 0..4 {
                filter.predict(&motion);
                at = motion.apply_to_point(at);
                let found = estimate(&filter);
                prop_assert!((found.person.position.xy() - at).norm() < 1e-9);
                see(&mut filter, &sighting(at.x, at.y));
                prop_assert!(estimate(&filter).covariance.fixed_view::<2, 2>(0, 0).into_owned().cholesky().is_some());
            }
        }
    }
}
