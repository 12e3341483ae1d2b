//! The equations, one by one.

use nalgebra::{Matrix3, Point3, SMatrix, Vector3, Vector5};
use proptest::prelude::*;
use tagalong_config::{Context, Registry};
use tagalong_core::{DiffDrive, EgoMotion, PersonFilter};

use super::world::{DT_S, World, camera, detection, normal3};
use crate::ekf::filter::{inverse, less_seen, motion_jacobian, moved, state_jacobian};
use crate::ekf::{Config, Ekf, State};

fn filter(config: Config) -> Ekf {
    Ekf::new(config).unwrap()
}

fn belief_at(position: Point3<f64>) -> State {
    filter(Config::default()).start(&detection(position, 0.1))
}

prop_compose! {
    fn motions()(dt in 0.0..1.0f64, forward in -1.0..1.0f64, left in -0.5..0.5f64,
                 turn in -2.0..2.0f64) -> EgoMotion {
        EgoMotion { forward, left, turn, ..EgoMotion::at_rest(dt) }
    }
}

prop_compose! {
    fn states()(x in -5.0..5.0f64, y in -5.0..5.0f64, z in 0.5..2.0f64,
                vx in -2.0..2.0f64, vy in -2.0..2.0f64) -> Vector5<f64> {
        Vector5::new(x, y, z, vx, vy)
    }
}

fn with(motion: &EgoMotion, index: usize, by: f64) -> EgoMotion {
    let mut motion = *motion;
    *[&mut motion.forward, &mut motion.left, &mut motion.turn][index] += by;
    motion
}

proptest! {
    #[test]
    fn the_state_jacobian_is_that_of_the_transition(
        state in states(), motion in motions(), decay_s in 0.0..3.0f64,
    ) {
        let filter = filter(Config { velocity_decay_s: decay_s, ..Config::default() });
        let f = state_jacobian(&motion, decay_s);
        for i in 0..5 {
            let mut step = Vector5::zeros();
            step[i] = 1e-3;
            let ahead = filter.transition(&(state + step), &motion);
            let behind = filter.transition(&(state - step), &motion);
            prop_assert!(((ahead - behind) / 2e-3 - f.column(i)).norm() < 1e-9);
        }
    }

    #[test]
    fn the_motion_jacobian_is_that_of_the_transition(state in states(), motion in motions()) {
        let filter = filter(Config::default());
        let j = motion_jacobian(&filter.transition(&state, &motion), &motion);
        for i in 0..3 {
            let ahead = filter.transition(&state, &with(&motion, i, 1e-4));
            let behind = filter.transition(&state, &with(&motion, i, -1e-4));
            prop_assert!(((ahead - behind) / 2e-4 - j.column(i)).norm() < 1e-6);
        }
    }

    #[test]
    fn products_without_zeros_are_the_whole_ones_to_the_last_bit(
        motion in motions(), m in prop::array::uniform25(-5.0..5.0f64),
        gain in prop::array::uniform15(-1.0..1.0f64), decay_s in 0.0..3.0f64,
    ) {
        let m = SMatrix::<f64, 5, 5>::from_iterator(m);
        let f = state_jacobian(&motion, decay_s);
        prop_assert_eq!(moved(&m, &motion, decay_s), f * m * f.transpose());
        let gain = SMatrix::<f64, 5, 3>::from_iterator(gain);
        let mut kept = SMatrix::<f64, 5, 5>::identity();
        let mut seen = kept.fixed_columns_mut::<3>(0);
        seen -= gain;
        prop_assert_eq!(less_seen(&gain, &m), kept * m);
        let both = less_seen(&gain, &less_seen(&gain, &m).transpose()).transpose();
        prop_assert_eq!(both, kept * m * kept.transpose());
    }

    #[test]
    fn an_inverse_by_minors_is_that_of_the_factors(
        root in prop::array::uniform9(-1.0..1.0f64), scale in prop::array::uniform3(-3.0..3.0f64),
        off in -0.5..2.0f64,
    ) {
        // Standard deviations from a millimetre to a kilometre, as of what was not measured.
        let scale = Matrix3::from_diagonal(&Vector3::from(scale.map(|s| 10f64.powf(s))));
        let root = Matrix3::from_iterator(root);
        let core = root * root.transpose() + Matrix3::identity() * 0.05;
        let m = scale * core * scale;
        let ours = inverse(&m).unwrap();
        let slow = m.cholesky().unwrap().inverse();
        let unit = scale * (ours - slow) * scale;
        prop_assert!(unit.amax() < 1e-10, "{}", unit);
        let shifted = core - Matrix3::identity() * off;
        if shifted.symmetric_eigenvalues().min().abs() > 1e-9 {
            prop_assert_eq!(inverse(&shifted).is_some(), shifted.cholesky().is_some());
        }
    }

    #[test]
    fn the_covariance_stays_symmetric_and_positive(
        seed in any::<u64>(), sigma in 1e-4..1.0f64, motion in motions(),
    ) {
        let filter = filter(Config::default());
        let mut random = tagalong_math::SplitMix64::new(seed);
        let mut state = belief_at(Point3::new(3.0, 0.0, 1.6));
        for _ in 0..30 {
            filter.predict(&mut state, &motion);
            let seen = detection(Point3::from(normal3(&mut random)), sigma);
            filter.correct(&mut state, &seen, &camera());
            prop_assert_eq!(state.covariance, state.covariance.transpose());
            prop_assert!(state.covariance.cholesky().is_some());
        }
    }
}

/// The textbook filter in the frame of the odometry, where nothing rotates.
struct InOdometry {
    mean: Vector5<f64>,
    covariance: SMatrix<f64, 5, 5>,
}

impl InOdometry {
    fn step(&mut self, measured: Vector3<f64>, r: Matrix3<f64>, config: &Config) {
        let mut f = SMatrix::<f64, 5, 5>::identity();
        (f[(0, 3)], f[(1, 4)]) = (DT_S, DT_S);
        let mut g = SMatrix::<f64, 5, 5>::zeros();
        for i in 0..2 {
            g[(i, i)] = DT_S.powi(3) / 3.0;
            g[(i, i + 3)] = DT_S.powi(2) / 2.0;
            g[(i + 3, i)] = DT_S.powi(2) / 2.0;
            g[(i + 3, i + 3)] = DT_S;
        }
        g *= config.acceleration_noise;
        g[(2, 2)] = config.height_noise.powi(2) * DT_S;
        self.mean = f * self.mean;
        self.covariance = f * self.covariance * f.transpose() + g;
        let h = SMatrix::<f64, 3, 5>::identity();
        let s = h * self.covariance * h.transpose() + r;
        let k = self.covariance * h.transpose() * s.try_inverse().unwrap();
        self.mean += k * (measured - h * self.mean);
        self.covariance -= k * h * self.covariance;
    }
}

#[test]
fn tracking_in_the_robot_frame_equals_tracking_in_the_odometry_frame() {
    let config = Config { extra_sigma_m: 0.0, ..Config::default() };
    let filter = filter(config.clone());
    let mut world = World::new(3);
    let seen = world.look();
    let mut state = filter.start(&seen);
    let mut reference = InOdometry { mean: state.mean, covariance: state.covariance };
    for _ in 0..60 {
        world.walk(0.5, 0.05);
        let motion = world.drive(0.5, 0.4);
        filter.predict(&mut state, &motion);
        let seen = world.look();
        filter.correct(&mut state, &seen, &camera());
        let floor = world.robot * seen.position.xy();
        let measured = Vector3::new(floor.x, floor.y, seen.position.z);
        reference.step(measured, seen.covariance, &config);
        let (position, velocity) = world.of_belief(&state);
        let x = reference.mean.fixed_rows::<2>(0);
        let v = reference.mean.fixed_rows::<2>(3);
        assert!((position.coords - x).norm() < 1e-9);
        assert!((velocity - v).norm() < 1e-9);
        assert!((state.covariance.trace() - reference.covariance.trace()).abs() < 1e-9);
    }
}

/// Variance of the velocity after one second of steps.
fn velocity_variance_after_1s(config: &Config, steps: u32) -> f64 {
    let filter = filter(config.clone());
    let mut state = belief_at(Point3::new(3.0, 0.0, 1.6));
    let before = state.covariance[(3, 3)];
    let motion = EgoMotion::at_rest(1.0 / f64::from(steps));
    (0..steps).for_each(|_| filter.predict(&mut state, &motion));
    state.covariance[(3, 3)] - before
}

#[test]
fn the_process_noise_does_not_depend_on_the_frame_rate() {
    let config = Config::default();
    let slow = velocity_variance_after_1s(&config, 5);
    let fast = velocity_variance_after_1s(&config, 50);
    assert!((slow - 0.5).abs() < 1e-9 && (fast - 0.5).abs() < 1e-9);
}

/// Returns x and the velocity along it, predicted from 3 m and 1 m/s over two seconds.
fn predicted_over_2s(velocity_decay_s: f64, frames: u32) -> [f64; 2] {
    let filter = filter(Config { velocity_decay_s, ..Config::default() });
    let mut state = belief_at(Point3::new(3.0, 0.0, 1.6));
    state.mean[3] = 1.0;
    for _ in 0..frames {
        filter.predict(&mut state, &EgoMotion::at_rest(2.0 / f64::from(frames)));
    }
    [state.mean[0], state.mean[3]]
}

#[test]
fn a_velocity_decays_by_time_and_not_by_frames() {
    for frames in [1, 6, 22] {
        let [[x, speed], [constant, same]] =
            [1.0, 0.0].map(|decay_s| predicted_over_2s(decay_s, frames));
        let kept = (-2.0f64).exp();
        assert!((speed - kept).abs() < 1e-9 && (x - 3.0 - (1.0 - kept)).abs() < 1e-9, "{frames}");
        assert!((same - 1.0).abs() < 1e-9 && (constant - 5.0).abs() < 1e-9, "{frames}");
    }
}

/// Returns the estimated height of a person that stands for 20 s and has sat for 1 s.
fn height_after_sitting_down(config: Config) -> f64 {
    let filter = filter(config);
    let mut state = belief_at(Point3::new(3.0, 0.0, 1.6));
    for i in 0..231 {
        filter.predict(&mut state, &EgoMotion::at_rest(DT_S));
        let height = if i < 220 { 1.6 } else { 1.2 };
        filter.correct(&mut state, &detection(Point3::new(3.0, 0.0, height), 0.05), &camera());
    }
    state.mean[2]
}

#[test]
fn the_height_follows_a_person_who_sits_down() {
    assert!(height_after_sitting_down(Config::default()) < 1.25);
}

#[test]
fn a_heading_error_moves_far_people_sideways() {
    let filter = filter(Config::default());
    let mut motion = EgoMotion::at_rest(0.0);
    motion.covariance[(2, 2)] = 0.5_f64.to_radians().powi(2);
    let mut state = belief_at(Point3::new(5.0, 0.0, 1.6));
    let before = state.covariance;
    filter.predict(&mut state, &motion);
    let added = state.covariance - before;
    assert!((added[(1, 1)].sqrt() - 0.0436).abs() < 1e-4, "4 cm at 5 m");
    assert!(added[(0, 0)].abs() < 1e-12);
}

#[test]
fn the_update_keeps_the_covariance_symmetric() {
    let filter = filter(Config::default());
    let mut state = belief_at(Point3::new(3.0, 0.0, 1.6));
    let mut world = World::new(1);
    for _ in 0..50 {
        filter.predict(&mut state, &world.drive(0.5, 0.7));
        let mut seen = world.look();
        seen.covariance[(0, 1)] = 1e-3;
        seen.covariance[(1, 0)] = 1e-3;
        filter.correct(&mut state, &seen, &camera());
        assert_eq!(state.covariance, state.covariance.transpose());
    }
}

#[test]
fn a_detections_own_covariance_decides_how_far_it_is_believed() {
    fn move_by(config: Config, far_sigma_m: f64) -> f64 {
        let filter = filter(config);
        let mut state = belief_at(Point3::new(3.0, 0.0, 1.6));
        let seen = detection(Point3::new(3.5, 0.0, 1.6), far_sigma_m);
        filter.correct(&mut state, &seen, &camera());
        state.mean[0] - 3.0
    }

    assert!(move_by(Config::default(), 0.5) < 0.1 * move_by(Config::default(), 0.01));
}

#[test]
fn an_unmeasured_height_is_not_touched_and_not_counted() {
    let filter = filter(Config::default());
    let mut state = belief_at(Point3::new(3.0, 0.0, 1.6));
    let mut seen = detection(Point3::new(3.1, 0.0, 0.0), 0.05);
    seen.covariance[(2, 2)] = 1e6;
    let support = filter.correct(&mut state, &seen, &camera());
    assert!((state.mean[2] - 1.6).abs() < 1e-6);
    assert_eq!(support.nis.map(|(_, dof)| dof), Some(2));
}

#[test]
fn uncertainty_grows_without_evidence() {
    let filter = filter(Config::default());
    let mut state = belief_at(Point3::new(3.0, 0.0, 1.6));
    for _ in 0..20 {
        let before = state.covariance.trace();
        filter.predict(&mut state, &EgoMotion::at_rest(DT_S));
        assert!(state.covariance.trace() > before);
    }
}

#[test]
fn the_region_is_that_of_the_estimated_place() {
    let filter = filter(Config::default());
    let estimate = filter.estimate(&belief_at(Point3::new(3.0, 0.4, 1.6)), &camera());
    assert_eq!(estimate.region, camera().upper_body(&Point3::new(3.0, 0.4, 1.6)));
    assert!(estimate.is_sane());
}

#[test]
fn settings_that_cannot_work_are_refused() {
    let mut registry = Registry::default();
    crate::ekf::register(&mut registry);
    let context = Context::new(0, ".", DiffDrive { half_separation_m: 0.2, slip: 0.0 });
    assert!(registry.build_filter("ekf", None, &context).is_ok());
    for line in ["acceleration_noise = 0.0", "height_noise = -1.0", "extra_sigma_m = nan"] {
        let text = format!("{{ {line} }}");
        let value = toml::de::DeValue::parse(&text).unwrap();
        let error = registry.build_filter("ekf", Some(value), &context).err().unwrap();
        let key = line.split(' ').next().unwrap();
        assert!(error.message.starts_with(&format!("`{key}` must ")), "{error}");
    }
}

#[test]
fn by_students_t_an_outlier_pulls_less_and_a_good_detection_as_much() {
    fn pull(student_dof: f64, off_m: f64) -> f64 {
        let filter = filter(Config { student_dof, ..Config::default() });
        let mut state = filter.start(&detection(Point3::new(3.0, 0.0, 1.6), 0.1));
        let seen = detection(Point3::new(3.0 + off_m, 0.0, 1.6), 0.1);
        filter.correct(&mut state, &seen, &camera());
        state.mean[0] - 3.0
    }

    assert!((pull(4.0, 0.05) - pull(0.0, 0.05)).abs() < 1e-12);
    // By hand: prior and noise have the same variance on each axis.
    let variance = 0.1f64.powi(2) + Config::default().extra_sigma_m.powi(2);
    let weight = (0..2).fold(1.0, |weight, _| {
        let squared = 0.6f64.powi(2) / (variance + variance / weight);
        (4.0 + 3.0) / (4.0 + squared)
    });
    let expected = 0.6 / (1.0 + 1.0 / weight);
    assert!((pull(4.0, 0.6) - expected).abs() < 1e-9, "{} {expected}", pull(4.0, 0.6));
    assert!(expected < 0.75 * pull(0.0, 0.6));
}

#[test]
fn a_newcomer_is_where_the_detection_is_and_may_go_anywhere() {
    let filter = filter(Config { initial_velocity_variance: 3.0, ..Config::default() });
    let state = filter.start(&detection(Point3::new(3.0, 0.4, 1.6), 0.1));
    assert_eq!(state.mean, Vector5::new(3.0, 0.4, 1.6, 0.0, 0.0));
    let place = 0.1f64.powi(2) + Config::default().extra_sigma_m.powi(2);
    let expected = SMatrix::from_diagonal(&Vector5::new(place, place, place, 3.0, 3.0));
    assert!((state.covariance - expected).norm() < 1e-12, "{}", state.covariance);
}

/// The state after a sighting half a metre away, by hand where all is diagonal.
#[test]
fn the_update_is_that_of_the_textbook() {
    let filter = filter(Config { extra_sigma_m: 0.0, ..Config::default() });
    let mut state = belief_at(Point3::new(3.0, 0.0, 1.6));
    let p = state.covariance[(0, 0)];
    let seen = detection(Point3::new(3.5, 0.0, 1.6), 0.3);
    let support = filter.correct(&mut state, &seen, &camera());
    let gain = p / (p + 0.09);
    assert!((state.mean[0] - 3.0 - 0.5 * gain).abs() < 1e-12);
    assert!((state.covariance[(0, 0)] - (1.0 - gain) * p).abs() < 1e-12);
    let (nis, measured) = support.nis.unwrap();
    assert!((nis - 0.25 / (p + 0.09)).abs() < 1e-12 && measured == 3);
}

#[test]
fn every_number_has_its_bound_and_zero_is_allowed_where_it_means_none() {
    type Key = (&'static str, fn(&mut Config) -> &mut f64, bool);
    let keys: [Key; 5] = [
        ("acceleration_noise", |c| &mut c.acceleration_noise, false),
        ("height_noise", |c| &mut c.height_noise, true),
        ("initial_velocity_variance", |c| &mut c.initial_velocity_variance, false),
        ("extra_sigma_m", |c| &mut c.extra_sigma_m, true),
        ("student_dof", |c| &mut c.student_dof, true),
    ];
    for (key, of, may_be_zero) in keys {
        let bound =
            if may_be_zero { "lie between 0 and 1e6" } else { "be positive and at most 1e6" };
        for value in [0.5, 0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut config = Config::default();
            *of(&mut config) = value;
            let refusal = Ekf::new(config).err().map(|error| error.to_string());
            let is_right = value == 0.5 || (value == 0.0 && may_be_zero);
            let expected = format!("`{key}` must {bound}, not {value}");
            assert_eq!(refusal, (!is_right).then_some(expected));
        }
    }
}

#[test]
fn the_weight_of_an_outlier_depends_on_how_much_was_measured() {
    fn pull(covariance_of_height: f64) -> f64 {
        let filter = filter(Config { student_dof: 4.0, ..Config::default() });
        let mut state = filter.start(&detection(Point3::new(3.0, 0.0, 1.6), 0.1));
        let mut seen = detection(Point3::new(3.6, 0.0, 1.6), 0.1);
        seen.covariance[(2, 2)] = covariance_of_height;
        filter.correct(&mut state, &seen, &camera());
        state.mean[0] - 3.0
    }

    // With three coordinates right, an error in one of them says less of the detection.
    assert!(pull(0.01) > pull(1e6) + 1e-3, "{} {}", pull(0.01), pull(1e6));
}
