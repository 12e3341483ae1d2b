//! Tests of segmentation, features, model and detector on made-up scans.

use std::f64::consts::TAU;
use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::{Isometry3, Point2, Point3};
use proptest::prelude::*;
use tagalong_config::{Context, Registry};
use tagalong_core::{
    Detection, Detector, DiffDrive, EgoMotion, Frame, Funnel, Images, LaserScan, Query, Stamp,
};
use tagalong_geometry::Camera;

use super::*;

/// Round things at places in front of a scanner, with their radii, m.
type Rounds = [([f64; 2], f64)];

/// Returns what a scanner with so many rays all around measures, at a height in the robot frame.
fn scan(rays: u32, rounds: &Rounds, pose: Isometry3<f64>) -> LaserScan {
    let step = TAU / f64::from(rays);
    let (mut points, mut numbers) = (Vec::new(), Vec::new());
    for ray in 0..rays {
        let angle = -0.5 * TAU + f64::from(ray) * step;
        let ahead = nalgebra::Vector2::new(angle.cos(), angle.sin());
        let range = |(at, radius): &([f64; 2], f64)| {
            let at = nalgebra::Vector2::new(at[0], at[1]);
            let along = at.dot(&ahead);
            let square = radius * radius - (at.norm_squared() - along * along);
            (along > 0.0 && square > 0.0).then(|| along - square.sqrt())
        };
        if let Some(range) = rounds.iter().filter_map(range).min_by(f64::total_cmp) {
            points.push(pose * Point3::new(range * ahead.x, range * ahead.y, 0.0));
            numbers.push(ray);
        }
    }
    LaserScan {
        robot_from_scanner: pose,
        increment_rad: step,
        points: points.into(),
        rays: numbers.into(),
    }
}

fn context() -> Context {
    let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
    Context { seed: 1, base_dir: PathBuf::from("."), wheels }
}

fn detections(config: Config, scan: LaserScan) -> Vec<Detection> {
    let mut detector = LaserLegs::new(config, &context()).unwrap();
    let camera = Arc::new(Camera::blind(Isometry3::identity()));
    let frame = Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), Images::default())
        .with_laser(Some(scan));
    let query = Query::Discover { occupied: &[] };
    detector.detect(&frame, &query, &mut Funnel::default()).unwrap()
}

/// Every segment counts as a leg.
fn all() -> Config {
    Config { min_leg_log_odds: -100.0, ..Config::default() }
}

const LEGS: [([f64; 2], f64); 2] = [([2.0, 0.15], 0.06), ([2.0, -0.15], 0.06)];

#[test]
fn the_plugin_conforms() {
    let mut registry = Registry::default();
    register(&mut registry);
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:?}");
}

#[test]
fn two_legs_make_a_person_and_one_makes_a_less_certain_one() {
    let pair = detections(all(), scan(720, &LEGS, Isometry3::identity()));
    let single = detections(all(), scan(720, &LEGS[..1], Isometry3::identity()));
    let ([pair], [single]) = (&pair[..], &single[..]) else {
        panic!("{pair:?} {single:?}");
    };
    assert!((pair.position.xy() - Point2::new(1.95, 0.0)).norm() < 0.03, "{pair:?}");
    assert!((single.position.xy() - Point2::new(1.95, 0.15)).norm() < 0.03, "{single:?}");
    assert!(single.score < pair.score, "{} {}", single.score, pair.score);
    assert!(single.covariance[(0, 0)] > pair.covariance[(0, 0)]);
    assert!(pair.covariance[(2, 2)] >= 100.0, "a scan contains no height");
}

#[test]
fn legs_far_apart_belong_to_two_people() {
    let apart = [([2.0, 0.5], 0.06), ([2.0, -0.5], 0.06)];
    assert_eq!(detections(all(), scan(720, &apart, Isometry3::identity())).len(), 2);
}

#[test]
fn a_scanner_anywhere_on_the_robot_finds_the_same_place() {
    let turned = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, 0.7);
    let pose = Isometry3::from_parts(nalgebra::Translation3::new(0.5, -0.2, 0.9), turned);
    let found = detections(all(), scan(720, &LEGS, pose));
    let expected = pose * Point3::new(1.95, 0.0, 0.0);
    assert!((found[0].position.xy() - expected.xy()).norm() < 0.03, "{found:?}");
}

#[test]
fn the_segments_are_those_of_the_things_at_any_resolution() {
    let things = [LEGS[0], LEGS[1], ([4.0, 1.5], 0.1)];
    for rays in [1440, 720, 360] {
        let beams = Beams::new(&scan(rays, &things, Isometry3::identity()), 1);
        assert_eq!(beams.segments(&Segmentation::default()).len(), 3, "{rays}");
    }
    // The threshold grows with range: the edges of a far thing are several rays apart.
    let far = Beams::new(&scan(360, &[([7.0, 0.0], 0.3)], Isometry3::identity()), 1);
    assert_eq!(far.segments(&Segmentation::default()).len(), 1);
    let strict = Segmentation { jump_rays: 0.0, ..Segmentation::default() };
    assert_ne!(far.segments(&strict).len(), 1);
}

#[test]
fn every_second_ray_is_a_scanner_of_half_the_resolution() {
    let whole = scan(720, &LEGS, Isometry3::identity());
    let half = Beams::new(&whole, 2);
    assert!((half.step_rad - 2.0 * whole.increment_rad).abs() < 1e-12);
    assert!(half.rays.windows(2).all(|pair| pair[0] < pair[1]));
    let expected = whole.rays.iter().filter(|ray| *ray % 2 == 0).count();
    assert_eq!(half.points.len(), expected);
}

#[test]
fn features_measure_the_thing_in_metres() {
    let beams = Beams::new(&scan(2880, &LEGS, Isometry3::identity()), 1);
    let segments = beams.segments(&Segmentation::default());
    let of = |name: &str| {
        let at = FEATURES.iter().position(|feature| *feature == name).unwrap();
        f64::from(features(&beams, &segments[0], &segments)[at])
    };
    assert!((of("width") - 0.12).abs() < 0.02, "{}", of("width"));
    assert!((of("radius") - 0.06).abs() < 0.005, "{}", of("radius"));
    assert!(of("circularity") < 1e-3);
    assert!((of("depth") - 0.05).abs() < 0.015, "{}", of("depth"));
    assert!((of("neighbour") - 0.3).abs() < 0.02, "{}", of("neighbour"));
    assert_eq!((of("second_neighbour"), of("neighbours"), of("wall")), (1.0, 1.0, 1.0));
    assert_eq!((of("smaller_jump"), of("occluded_sides")), (0.5, 0.0));
}

#[test]
fn a_model_survives_its_file_and_a_broken_one_is_refused() {
    let leaf = |value: f32| Node { feature: 3, below: 0.5, next: [0, 0], leaves: [value, -value] };
    let root = Node { feature: 0, below: 0.25, next: [1, 0], leaves: [0.0, -1.0] };
    let model = Model { trees: vec![vec![root, leaf(0.75)]], slope: 2.0, offset: -0.5 };
    let text = model.to_text().unwrap();
    assert_eq!(Model::from_text(&text).unwrap(), model);
    let mut values = [0.0; COUNT];
    assert_eq!(model.log_odds(&values), 1.0);
    values[3] = 0.5;
    assert_eq!(model.log_odds(&values), -2.0);
    values[0] = f32::NAN;
    assert_eq!(model.log_odds(&values), -2.5, "a value that is not a number is not below");
    let refusal = |from: &str, to: &str| {
        assert!(text.contains(from), "{text}");
        Model::from_text(&text.replace(from, to)).unwrap_err()
    };
    assert!(refusal("legs 1", "legs 9").contains("legs 9"));
    assert!(refusal("slope = 2.0", "slope = inf").contains("finite"));
    assert!(refusal("\"width\"", "\"girth\"").contains("features"));
    // A way back to a node before it would have no end.
    assert!(refusal("[0, 0.25, 1,", "[0, 0.25, 7,").contains("hang together"));
    assert!(refusal("[0, 0.25, 1,", "[99, 0.25, 1,").contains("hang together"));
}

#[test]
fn settings_out_of_range_are_refused() {
    let broken = |change: fn(&mut Config)| {
        let mut config = Config::default();
        change(&mut config);
        LaserLegs::new(config, &context()).is_err()
    };
    assert!(broken(|c| c.segments.jump_m = f64::NAN) && broken(|c| c.training.trees.clear()));
    assert!(broken(|c| c.training.every_ray = vec![1]) && broken(|c| c.pair_sigma_m = 0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Any points give finite detections.
    #[test]
    fn odd_scans_are_survived(
        points in prop::collection::vec((-20.0..20.0_f64, -20.0..20.0_f64), 0..60),
        increment_rad in prop_oneof![Just(0.0), Just(0.006), Just(-0.01)],
    ) {
        let points: Vec<Point3<f64>> =
            points.iter().map(|(x, y)| Point3::new(x.round() / 8.0, y.round() / 8.0, 0.2)).collect();
        let scan = LaserScan { increment_rad, ..LaserScan::of_points(points) };
        let found = detections(all(), scan);
        prop_assert!(found.iter().all(Detection::is_sane), "{found:?}");
    }
}

#[cfg(feature = "train")]
mod training {
    use tagalong_config::{Example, Trainer};

    use super::*;

    fn candidate(at: [f64; 2]) -> Detection {
        Detection {
            image: None,
            position: Point3::new(at[0], at[1], 0.0),
            covariance: nalgebra::Matrix3::zeros(),
            score: 0.0,
            source: "test",
        }
    }

    fn frame(scan: LaserScan) -> Frame {
        let camera = Arc::new(Camera::blind(Isometry3::identity()));
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), Images::default())
            .with_laser(Some(scan))
    }

    /// Thin legs beside thick poles, at changing places.
    #[test]
    fn a_fit_tells_legs_from_poles() {
        let config = Config {
            training: Training { trees: vec![10], every_ray: vec![2], ..Training::default() },
            ..Config::default()
        };
        let fit = || {
            let mut trainer = train::LegTrainer::new(&config, 1).unwrap();
            for number in 0..24_u32 {
                let x = 1.5 + 0.1 * f64::from(number % 12);
                let things = [([x, 0.4], 0.06), ([x, -0.8], 0.2), ([-x, 1.0], 0.2)];
                let frame = frame(scan(720, &things, Isometry3::identity()));
                let group = u64::from(number / 6);
                let leg = Example { is_person: true, group };
                trainer.add(&frame, &candidate([x - 0.05, 0.4]), leg).unwrap();
                let rest = Example { is_person: false, group };
                trainer.add(&frame, &candidate([0.0, 0.0]), rest).unwrap();
            }
            trainer.fit(&mut |_| ()).unwrap()
        };
        let fitted = fit();
        assert_eq!(fitted, fit(), "the same bytes");
        let model = Model::from_text(&fitted.model).unwrap();
        let beams = Beams::new(
            &scan(720, &[([2.05, 0.1], 0.06), ([2.0, 2.0], 0.2)], Isometry3::identity()),
            1,
        );
        let segments = beams.segments(&Segmentation::default());
        let log_odds: Vec<f64> =
            segments.iter().map(|s| model.log_odds(&features(&beams, s, &segments))).collect();
        assert!(log_odds[0] > 1.0 && log_odds[1] < -1.0, "{log_odds:?}");
    }

    #[test]
    fn too_few_examples_are_refused() {
        let mut trainer = train::LegTrainer::new(&Config::default(), 1).unwrap();
        let error = trainer.fit(&mut |_| ()).unwrap_err().to_string();
        assert!(error.contains("fewer than ten"), "{error}");
    }
}
