//! Tests of segmentation, features, model and detector on made-up scans.

use std::f64::consts::TAU;
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
    let mut points = Vec::new();
    let mut numbers = Vec::new();
    for ray in 0..rays {
        let angle = -0.5 * TAU + f64::from(ray) * step;
        let ahead = nalgebra::Vector2::new(angle.cos(), angle.sin());
        let ranges = rounds.iter().filter_map(|(at, radius)| {
            let at = nalgebra::Vector2::new(at[0], at[1]);
            let along = at.dot(&ahead);
            let square = radius * radius - (at.norm_squared() - along * along);
            (along > 0.0 && square > 0.0).then(|| along - square.sqrt())
        });
        if let Some(range) = ranges.min_by(f64::total_cmp) {
            points.push(pose * Point3::new(range * ahead.x, range * ahead.y, 0.0));
            numbers.push(ray);
        }
    }
    LaserScan::of_points(points).with_scanner(pose).with_rays(-0.5 * TAU, step, numbers)
}

fn context() -> Context {
    let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
    Context::new(1, ".", wheels)
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
    let failures = tagalong_conformance::Suite::new(&registry).must_discover(NAME).check_all();
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

/// By a model that gives each segment log-odds of 2.0.
#[test]
fn the_log_odds_of_a_person_are_those_of_the_legs_and_a_setting() {
    fn of(config: &Config, things: &Rounds) -> Detection {
        let found = detections(config.clone(), scan(720, things, Isometry3::identity()));
        let [one] = &found[..] else { panic!("{found:?}") };
        one.clone()
    }

    let folder = tempfile::tempdir().unwrap();
    let leaf = Node { feature: 0, below: 0.0, next: [0, 0], leaves: [0.5, 0.5] };
    let model = Model { trees: vec![vec![leaf]], slope: 2.0, offset: 1.0 };
    let path = folder.path().join("model.toml");
    std::fs::write(&path, model.to_text().unwrap()).unwrap();
    let config = Config {
        model: path.to_string_lossy().into_owned(),
        pair_log_odds: 0.7,
        single_log_odds: -0.9,
        limit: 100.0,
        ..Config::default()
    };
    let pair = of(&config, &LEGS);
    let single = of(&config, &LEGS[..1]);
    assert!((pair.score - 4.7).abs() < 1e-9 && (single.score - 1.1).abs() < 1e-9);
    for (found, sigma_m) in [(&pair, 0.08), (&single, 0.16)] {
        assert!((found.covariance[(1, 1)] - sigma_m * sigma_m).abs() < 1e-12);
        assert_eq!(found.position.z, 1.6);
    }
    assert_eq!(of(&Config { limit: 3.0, ..config }, &LEGS).score, 3.0);
}

/// A wall is no leg however likely, and a leg that is none is counted.
#[test]
fn wide_things_and_unlikely_legs_are_left_out() {
    let wide = [LEGS[0], ([3.0, -2.0], 0.5)];
    assert_eq!(detections(all(), scan(720, &wide, Isometry3::identity())).len(), 1);
    let config = Config { min_leg_log_odds: 100.0, ..Config::default() };
    let mut detector = LaserLegs::new(config, &context()).unwrap();
    let camera = Arc::new(Camera::blind(Isometry3::identity()));
    let frame = Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.1), Images::default())
        .with_laser(Some(scan(720, &LEGS, Isometry3::identity())));
    let mut funnel = Funnel::default();
    let query = Query::Discover { occupied: &[] };
    assert!(detector.detect(&frame, &query, &mut funnel).unwrap().is_empty());
    assert_eq!(funnel.count("no leg"), 2);
}

/// Of three legs in a row the nearer two are a person.
#[test]
fn the_nearest_legs_make_a_pair() {
    let three = [([2.0, 0.5], 0.06), ([2.0, 0.0], 0.06), ([2.0, -0.3], 0.06)];
    let found = detections(all(), scan(1440, &three, Isometry3::identity()));
    let mut sides: Vec<f64> = found.iter().map(|d| d.position.y).collect();
    sides.sort_by(f64::total_cmp);
    assert!((sides[0] + 0.15).abs() < 0.03 && (sides[1] - 0.5).abs() < 0.03, "{sides:?}");
    assert_eq!(sides.len(), 2);
}

/// Where nothing was for a second, a person is more likely than where something stands.
#[test]
fn a_place_that_was_free_speaks_for_a_person() {
    let config = Config { free_log_odds: 2.0, limit: 100.0, ..all() };
    let mut detector = LaserLegs::new(config.clone(), &context()).unwrap();
    assert!(detector.remembers() && !LaserLegs::new(all(), &context()).unwrap().remembers());
    let camera = Arc::new(Camera::blind(Isometry3::identity()));
    let both = [([2.0, 1.5], 0.06), ([2.0, -1.5], 0.06)];
    let mut found = Vec::new();
    for look in 0..=11 {
        let things = if look == 11 { &both[..] } else { &both[..1] };
        let still = EgoMotion::at_rest(0.1);
        let frame = Frame::new(1, Stamp::default(), Arc::clone(&camera), still, Images::default())
            .with_laser(Some(scan(720, things, Isometry3::identity())));
        let query = Query::Discover { occupied: &[] };
        found.push(detector.detect(&frame, &query, &mut Funnel::default()).unwrap());
    }
    let first = found[0][0].score;
    let later = found[10][0].score;
    assert!((later - first + 2.0).abs() < 1e-9, "it stood there: {first} {later}");
    let new = found[11].iter().find(|d| d.position.y < 0.0).unwrap();
    let unknown = detections(config, scan(720, &both, Isometry3::identity()));
    let alone = unknown.iter().find(|d| d.position.y < 0.0).unwrap();
    assert!(new.score >= alone.score, "{} {}", new.score, alone.score);
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

/// 2 m away, with 1.5 rays of 0.1 rad: 0.1 m and 0.3 m more.
#[test]
fn a_segment_ends_at_a_jump_of_so_many_rays() {
    fn count(places: &[(u32, [f64; 2])]) -> usize {
        let settings = Segmentation { min_points: 1, ..Segmentation::default() };
        reflections(places).segments(&settings).len()
    }

    assert_eq!(count(&[(0, [2.0, 0.0]), (1, [2.0, 0.39])]), 1);
    assert_eq!(count(&[(0, [2.0, 0.0]), (1, [2.0, 0.41])]), 2);
    assert_eq!(count(&[(0, [2.0, 0.0]), (2, [2.0, 0.1])]), 1, "one ray without a reflection");
    assert_eq!(count(&[(0, [2.0, 0.0]), (3, [2.0, 0.1])]), 2);
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
    let values = features(&beams, &segments[0], &segments);
    for (name, expected, tolerance) in [
        ("width", 0.12, 0.02),
        ("radius", 0.06, 0.005),
        ("circularity", 0.0, 1e-3),
        ("depth", 0.05, 0.015),
        ("neighbour", 0.3, 0.02),
    ] {
        let found = feature_of(&values, name);
        assert!((found - expected).abs() < tolerance, "{name}: {found}");
    }
    for (name, expected) in [
        ("second_neighbour", 1.0),
        ("neighbours", 1.0),
        ("wall", 1.0),
        ("smaller_jump", 0.5),
        ("occluded_sides", 0.0),
    ] {
        assert_eq!(feature_of(&values, name), expected, "{name}");
    }
}

/// Returns reflections at places, all 0.1 rad apart, by the numbers of their rays.
fn reflections(places: &[(u32, [f64; 2])]) -> Beams {
    let points: Vec<Point2<f64>> = places.iter().map(|(_, at)| Point2::from(*at)).collect();
    let ranges = points.iter().map(|point| point.coords.norm()).collect();
    let rays = places.iter().map(|(ray, _)| *ray).collect();
    Beams { points, ranges, rays, step_rad: 0.1 }
}

/// Returns a feature by its name.
fn feature_of(features: &Features, name: &str) -> f64 {
    let at = FEATURES.iter().position(|feature| *feature == name).expect("a feature");
    f64::from(features[at])
}

#[track_caller]
fn assert_features(of: &Features, expected: &[(&str, f64)]) {
    for (name, value) in expected {
        let found = feature_of(of, name);
        assert!((found - value).abs() < 1e-4, "{name}: {found} instead of {value}");
    }
}

/// The radius is the root mean square distance from the middle.
#[test]
fn points_on_a_line_have_a_small_circle_around_their_middle() {
    for (count, radius_m) in [(3, 0.081650), (5, 0.141421)] {
        let places: Vec<(u32, [f64; 2])> =
            (0..count).map(|k| (k, [2.0, 0.1 * f64::from(k)])).collect();
        let line = 0..places.len();
        let found = features(&reflections(&places), &line, std::slice::from_ref(&line));
        assert_features(&found, &[("radius", radius_m)]);
    }
}

/// Three points on a right angle, between two other small things and before a wide one.
#[test]
fn each_feature_is_that_of_its_definition() {
    let mut places = vec![
        (0, [1.8, -0.2]),
        (1, [1.8, -0.1]),
        (2, [2.0, 0.0]),
        (3, [2.0, 0.2]),
        (4, [2.3, 0.2]),
        (7, [2.4, 0.5]),
        (8, [2.4, 0.6]),
        (9, [2.6, 0.8]),
        (10, [2.6, 1.3]),
    ];
    let segments = [0..2, 2..5, 5..7, 7..9];
    // The middle is (2.1, 0.1333), 2.1042 away: rays are 0.21042 apart there.
    let expected = [
        ("width", 0.360555),
        ("deviation", 0.208167),
        ("deviation_from_median", (0.2 + 0.3) / 3.0),
        // Half of the hypotenuse.
        ("radius", 0.180278),
        ("circularity", 0.0),
        ("linearity", 0.0759368),
        ("length", 0.5),
        ("regularity", 0.05 / 0.210423),
        ("curvature", 1.0 / 0.180278),
        ("depth", 0.143363),
        ("aspect", 0.499384),
        ("span", 3.0 * 0.210423),
        ("smaller_jump", 0.05_f64.sqrt()),
        ("larger_jump", 0.1_f64.sqrt()),
        ("occluded_sides", 1.0),
        ("points", 3.0),
        ("neighbour", 0.412645),
        ("second_neighbour", 0.513431),
        ("neighbours", 2.0),
        ("wall", 0.833333),
    ];
    let found = features(&reflections(&places), &segments[1], &segments);
    assert_features(&found, &expected);
    // Four rays without a reflection: that side is open.
    places[5..].iter_mut().for_each(|(ray, _)| *ray += 1);
    let found = features(&reflections(&places), &segments[1], &segments);
    assert_features(&found, &[("larger_jump", 0.5), ("smaller_jump", 0.05_f64.sqrt())]);
    // The neighbours at both ends of a scan are those that there are.
    let first = features(&reflections(&places), &segments[0], &segments);
    assert_features(&first, &[("smaller_jump", 0.05_f64.sqrt()), ("larger_jump", 0.5)]);
    let last = features(&reflections(&places), &segments[3], &segments);
    assert_features(&last, &[("larger_jump", 0.5), ("smaller_jump", 0.08_f64.sqrt())]);
}

#[test]
fn what_is_exactly_as_far_hides_nothing() {
    let beams = reflections(&[(0, [2.0, -0.5]), (1, [2.0, 0.5]), (2, [2.0, 0.25])]);
    for (middle, occluded) in [(0..1, 0.0), (1..2, 1.0), (2..3, 0.0)] {
        let found = features(&beams, &middle, &[0..1, 1..2, 2..3]);
        assert_features(&found, &[("occluded_sides", occluded)]);
    }
}

/// Four points that lie on no circle, by the normal equations.
#[test]
fn the_circle_is_that_of_least_squares() {
    let beams = reflections(&[(0, [2.0, 0.0]), (1, [2.0, 0.2]), (2, [2.2, 0.2]), (3, [2.2, 0.1])]);
    let whole = 0..4;
    let found = features(&beams, &whole, std::slice::from_ref(&whole));
    assert_features(&found, &[("radius", 0.131624), ("circularity", 0.0120996)]);
    let two = features(&beams, &(0..2), &[0..2, 2..4]);
    assert_features(&two, &[("radius", 1.0), ("circularity", 0.0), ("curvature", 0.0)]);
}

#[test]
fn a_model_survives_its_file_and_a_broken_one_is_refused() {
    fn leaf(value: f32) -> Node {
        Node { feature: 3, below: 0.5, next: [0, 0], leaves: [value, -value] }
    }

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
    for (from, to, why) in [
        ("legs 1", "legs 9", "legs 9"),
        ("slope = 2.0", "slope = inf", "finite"),
        ("\"width\"", "\"girth\"", "features"),
        // A way back to a node before it would have no end.
        ("[0, 0.25, 1,", "[0, 0.25, 7,", "hang together"),
        ("[0, 0.25, 1,", "[99, 0.25, 1,", "hang together"),
        // To itself.
        ("[3, 0.5, 0,", "[3, 0.5, 1,", "hang together"),
    ] {
        assert!(text.contains(from), "{text}");
        let refusal = Model::from_text(&text.replace(from, to)).unwrap_err();
        assert!(refusal.contains(why), "{refusal}");
    }
}

#[test]
fn settings_out_of_range_are_refused() {
    fn broken(change: fn(&mut Config)) -> bool {
        let mut config = Config::default();
        change(&mut config);
        LaserLegs::new(config, &context()).is_err()
    }

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
        let mut scan = LaserScan::of_points(points);
        scan.increment_rad = increment_rad;
        let found = detections(all(), scan);
        prop_assert!(found.iter().all(Detection::is_sane), "{found:?}");
    }
}

#[cfg(feature = "train")]
mod training {
    use tagalong_config::{Example, Trainer};

    use super::*;

    fn candidate(at: [f64; 2]) -> Detection {
        Detection::new("test", Point3::new(at[0], at[1], 0.0), nalgebra::Matrix3::zeros(), 0.0)
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
        let [fitted, again] = [(); 2].map(|()| {
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
        });
        assert_eq!(fitted, again, "the same bytes");
        // One leg and two poles in each of 24 scans, with all rays and with every second one.
        for (name, expected) in [("legs", 48), ("others", 96), ("trees", 10)] {
            assert_eq!(fitted.figures[name].as_integer(), Some(expected), "{name}");
        }
        let model = Model::from_text(&fitted.model).unwrap();
        assert!(
            (fitted.figures["slope"].as_float().unwrap() - model.slope).abs() < 1e-4
                && model.slope > 0.01
        );
        let row = fitted.figures["cross_validation"].as_array().unwrap()[0].as_table().unwrap();
        let [legs, others, area] = ["legs_accepted", "others_accepted", "area_under_roc"]
            .map(|name| row[name].as_float().expect("a number"));
        assert!(legs > 0.9 && others < 0.1 && area > 0.99, "{row:?}");
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
