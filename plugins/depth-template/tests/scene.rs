//! The detector on painted scenes: a body from the body model in front of a wall.
#![allow(clippy::unwrap_used, reason = "a broken test or bench may stop loudly")]

use std::sync::Arc;

use nalgebra::{Matrix5, Point3, Vector2};
use tagalong_core::{
    DepthImage, Detection, Detector, EgoMotion, Estimate, Frame, Funnel, Images, Measured, Person,
    Query, Stamp, Track, TrackId,
};
use tagalong_depth_template::{Cost, DepthTemplate, DepthTemplateConfig, render};
use tagalong_geometry::{Camera, HEAD_RADIUS_M, Pinhole};

const CAMERA_HEIGHT_M: f64 = 1.2;

fn camera(width: usize) -> Arc<Camera> {
    let lens = Pinhole::centred(0.83 * width as f64, width, 3 * width / 4);
    Arc::new(Camera::mounted(lens, width, 3 * width / 4, CAMERA_HEIGHT_M, 0.0, 0.0))
}

/// People, by the centre of their heads, on a floor in front of a wall.
fn frame(width: usize, wall_m: f64, heads: &[Point3<f64>]) -> Frame {
    let camera = camera(width);
    let body = render(std::f64::consts::PI, 0.0);
    let depth = DepthImage::from_fn(width, 3 * width / 4, |u, v| {
        let ray = camera.ray(nalgebra::Point2::new(u as f64, v as f64));
        let floor = if ray.y > 0.0 { CAMERA_HEIGHT_M / ray.y } else { f64::INFINITY };
        let mut depth = wall_m.min(floor);
        for head in heads {
            let plane = head.x;
            let right = ray.x * plane + head.y;
            let down = ray.y * plane - (CAMERA_HEIGHT_M - head.z);
            // Legs: the silhouette of the hips, down to the floor.
            let behind = body.at(right, down.min(0.45));
            if behind.is_finite() {
                depth = depth.min((plane + behind).min(floor));
            }
        }
        depth as f32
    });
    let images = Images { depth: Some(Arc::new(depth)), ..Images::default() };
    Frame::new(1, Stamp::from_nanos(1), camera, EgoMotion::at_rest(0.1), images)
}

fn discover(config: DepthTemplateConfig, frame: &Frame) -> (Vec<Detection>, Funnel) {
    let mut funnel = Funnel::default();
    let mut detector = DepthTemplate::new(config).unwrap();
    let found = detector.detect(frame, &Query::Discover { occupied: &[] }, &mut funnel).unwrap();
    (found, funnel)
}

#[test]
fn one_person_is_found_where_she_stands_at_any_resolution() {
    for width in [320, 512, 640, 1280] {
        for range in [1.5, 2.5, 4.0] {
            let head = Point3::new(range, 0.2, 1.6);
            let (found, funnel) =
                discover(DepthTemplateConfig::default(), &frame(width, 7.0, &[head]));
            assert_eq!(found.len(), 1, "width {width}, range {range}: {funnel:?}");
            let error = (found[0].position - head).norm();
            assert!(error < 0.12, "width {width}, range {range}: {error} m");
        }
    }
}

#[test]
fn the_centre_of_the_head_is_as_far_behind_its_surface_as_told() {
    let frame = frame(320, 5.0, &[Point3::new(2.5, 0.0, 1.6)]);
    let [far_m, near_m] = [0.08, 0.03].map(|centre_behind_m| {
        let config = DepthTemplateConfig { centre_behind_m, ..DepthTemplateConfig::default() };
        frame.camera.depth_of(&discover(config, &frame).0[0].position)
    });
    assert!((far_m - near_m - 0.05).abs() < 1e-9);
}

/// Returns the least cost above the limit of looking closer, with the settings that it breaks.
fn least_unrefined(funnel: &Funnel) -> Measured {
    let of_test = funnel.entries().iter().find(|entry| entry.test == "not refined");
    let measured = of_test.unwrap().measured.iter().map(|one| &one.1);
    measured.min_by(|a, b| a.value.total_cmp(&b.value)).unwrap().clone()
}

#[test]
fn what_is_not_looked_at_more_closely_tells_its_cost_and_the_limits_that_let_it_pass() {
    let scene = frame(640, 3.5, &[Point3::new(2.5, 0.0, 1.6)]);
    let strict =
        DepthTemplateConfig { refine_cost: 1e-3, discover_cost: 1e-3, ..Default::default() };
    let (found, funnel) = discover(strict.clone(), &scene);
    assert!(found.is_empty() && funnel.count("template cost") == 0, "{funnel:?}");
    let Measured { what, value, limits } = least_unrefined(&funnel);
    assert_eq!(what, "cost");
    assert_eq!(limits, [("refine_cost", 1e-3), ("discover_cost", 1e-3)]);
    let passing = value + 1e-6;
    let refine = DepthTemplateConfig { refine_cost: passing, ..strict };
    let (found, funnel) = discover(refine.clone(), &scene);
    assert!(found.is_empty() && funnel.count("not refined") > 0, "others still cost more");
    let both = DepthTemplateConfig { discover_cost: passing, min_cells: 1, ..refine };
    assert_eq!(discover(both, &scene).0.len(), 1);
    let lenient =
        DepthTemplateConfig { discover_cost: 1.0, refine_cost: 1e-3, ..Default::default() };
    let limits = least_unrefined(&discover(lenient, &scene).1).limits;
    assert_eq!(limits, [("refine_cost", 1e-3)], "the other one would let it pass");
    let (found, funnel) = discover(DepthTemplateConfig::default(), &scene);
    let of_test = funnel.entries().iter().find(|entry| entry.test == "not refined");
    let places = of_test.map_or(&[][..], |entry| &entry.places);
    let person = found[0].rect().expect("a box");
    for place in places {
        assert!(!person.contains(place.centre()), "{place:?} is at the person who was found");
    }
}

#[test]
fn a_silhouette_without_enough_readings_tells_their_part() {
    let scene = frame(320, 5.0, &[Point3::new(2.5, 0.0, 1.6)]);
    let depth = scene.depth().expect("a depth image");
    let holes = DepthImage::from_fn(depth.width(), depth.height(), |x, y| {
        // Rows below the chin have no reading.
        let is_body = y > depth.height() / 3;
        if is_body { f32::NAN } else { depth.get(x as i64, y as i64).unwrap_or(f32::NAN) }
    });
    let images = Images { depth: Some(Arc::new(holes)), ..Images::default() };
    let scene = Frame::new(1, Stamp::from_nanos(1), camera(320), EgoMotion::at_rest(0.1), images);
    let config = DepthTemplateConfig { min_body: 0.0, ..Default::default() };
    let (_, funnel) = discover(config, &scene);
    let Measured { what, value, limits } = least_unrefined(&funnel);
    assert_eq!((what, limits), ("part with depth", vec![("min_foreground_valid", 0.5)]));
    assert!(value > 0.02 && value < 0.5, "{value}");
}

#[test]
fn a_candidate_that_fails_a_limit_tells_its_value() {
    let scene = frame(640, 3.5, &[Point3::new(2.5, 0.0, 1.6)]);
    let wide =
        DepthTemplateConfig { min_head_width_m: 0.3, max_head_width_m: 0.36, ..Default::default() };
    let strict = DepthTemplateConfig { min_body: 1.01, ..Default::default() };
    let costly = DepthTemplateConfig { discover_cost: 1e-3, ..Default::default() };
    let many = DepthTemplateConfig { min_cells: 1000, ..Default::default() };
    for (config, test, what, setting) in [
        (wide, "head width", "width", "min_head_width_m"),
        (strict, "body below", "body", "min_body"),
        (costly, "template cost", "cost", "discover_cost"),
        (many, "component size", "cells", "min_cells"),
    ] {
        let (_, funnel) = discover(config, &scene);
        let entry = funnel.entries().iter().find(|entry| entry.test == test).expect(test);
        let (_, measured) = entry.measured.first().expect(test);
        assert_eq!((measured.what, measured.limits[0].0), (what, setting));
        assert!(entry.places.len() <= 6 && entry.count >= entry.places.len() as u64, "{entry:?}");
    }
}

#[test]
fn a_person_close_to_a_wall_is_found() {
    let scene = frame(640, 3.5, &[Point3::new(3.0, 0.0, 1.6)]);
    assert_eq!(discover(DepthTemplateConfig::default(), &scene).0.len(), 1);
    let printed = DepthTemplateConfig { boundary_margin_m: 1.0, ..Default::default() };
    let (found, funnel) = discover(printed, &scene);
    assert!(found.is_empty(), "P4's margin of 1 m loses this person");
    assert!(funnel.count("boundary points") > 0);
}

#[test]
fn head_height_is_a_setting() {
    let scene = frame(640, 6.0, &[Point3::new(2.0, 0.0, 1.05)]);
    assert!(discover(DepthTemplateConfig::default(), &scene).0.is_empty());
    let low = DepthTemplateConfig { min_head_height_m: 0.9, ..Default::default() };
    assert_eq!(discover(low, &scene).0.len(), 1);
}

#[test]
fn an_empty_room_and_a_wall_stay_empty() {
    for wall in [1.5, 3.0, 5.0] {
        let (found, _) = discover(DepthTemplateConfig::default(), &frame(640, wall, &[]));
        assert!(found.is_empty(), "wall at {wall} m");
    }
}

#[test]
fn people_side_by_side_are_two() {
    let heads = [Point3::new(2.5, 0.35, 1.6), Point3::new(2.5, -0.35, 1.7)];
    assert_eq!(discover(DepthTemplateConfig::default(), &frame(640, 6.0, &heads)).0.len(), 2);
}

#[test]
fn somebody_already_found_is_not_found_again() {
    let scene = frame(640, 6.0, &[Point3::new(2.5, 0.0, 1.6)]);
    let (occupied, _) = discover(DepthTemplateConfig::default(), &scene);
    let mut detector = DepthTemplate::new(DepthTemplateConfig::default()).unwrap();
    let mut funnel = Funnel::default();
    let search = Query::Discover { occupied: &occupied };
    assert!(detector.detect(&scene, &search, &mut funnel).unwrap().is_empty());
    assert_eq!(funnel.count("occupied"), 1);
}

fn track_at(position: Point3<f64>, camera: &Camera) -> Track {
    let person = Person { position, velocity: Vector2::zeros() };
    let estimate = Estimate::new(person, Matrix5::identity() * 0.02, camera.upper_body(&position));
    Track::new(TrackId(1), estimate, 1.0).with_age(5)
}

#[test]
fn following_finds_the_person_near_the_prediction_and_nobody_else() {
    let heads = [Point3::new(2.5, 0.5, 1.6), Point3::new(2.5, -0.7, 1.6)];
    let scene = frame(640, 6.0, &heads);
    let mut detector = DepthTemplate::new(DepthTemplateConfig::default()).unwrap();
    for head in heads {
        let track = track_at(head + nalgebra::Vector3::new(0.1, -0.1, 0.0), &scene.camera);
        let found = detector.detect(&scene, &Query::Track(&track), &mut Funnel::default()).unwrap();
        assert_eq!(found.len(), 1);
        assert!((found[0].position - head).norm() < HEAD_RADIUS_M + 0.05);
    }
}

/// A head without a body below it, as a ball on a string.
#[test]
fn a_head_alone_is_no_person() {
    let head = Point3::new(2.5, 0.0, 1.6);
    let person = frame(640, 6.0, &[head]);
    let chin = person.camera.project(&Point3::new(2.5, 0.0, 1.45)).unwrap().y as usize;
    let whole = person.depth().unwrap();
    let ball = DepthImage::from_fn(640, 480, |x, y| if y > chin { 6.0 } else { whole.row(y)[x] });
    let images = Images { depth: Some(Arc::new(ball)), ..Images::default() };
    let still = EgoMotion::at_rest(0.1);
    let scene = Frame::new(1, Stamp::from_nanos(1), camera(640), still, images);
    // The silhouette alone must not decide.
    let config = DepthTemplateConfig { discover_cost: 10.0, ..Default::default() };
    let (found, funnel) = discover(config, &scene);
    assert!(found.is_empty() && funnel.count("body below") > 0, "{found:?} {funnel:?}");
}

#[test]
fn it_weighs_scenes_for_filters() {
    let detector = DepthTemplate::new(DepthTemplateConfig::default()).unwrap();
    assert!(detector.likelihood().is_some());
}

#[test]
fn settings_that_hold_nothing_are_refused() {
    let wrong = DepthTemplateConfig { min_depth_m: 6.0, ..Default::default() };
    let message = DepthTemplate::new(wrong).err().unwrap().to_string();
    assert_eq!(message, "`min_depth_m` = 6 must be below `max_depth_m` = 5.5");
}

#[test]
fn the_papers_background_is_the_wall_where_the_percentile_is_high() {
    let head = Point3::new(2.5, 0.0, 1.6);
    let scene = frame(320, 6.0, &[head]);
    let usual = DepthTemplateConfig::default().background_percentile;
    let [usual, low] = [usual, 10.0].map(|background_percentile| {
        let config = DepthTemplateConfig {
            cost: Cost::Squared,
            background_percentile,
            discover_cost: 1e3,
            refine_cost: 1e3,
            ..Default::default()
        };
        let (found, _) = discover(config, &scene);
        let here = found.iter().filter(|d| (d.position - head).norm() < 0.3).map(|d| d.score);
        here.fold(f64::MIN, f64::max)
    });
    assert!(usual > low + 0.5, "{usual} {low}");
}

#[test]
fn the_depth_of_a_head_is_the_less_certain_the_farther_away_it_is() {
    let config = DepthTemplateConfig { sigma_depth_per_m2: 0.01, ..Default::default() };
    for range_m in [2.0, 4.0] {
        let scene = frame(640, 7.0, &[Point3::new(range_m, 0.0, CAMERA_HEIGHT_M)]);
        let low = DepthTemplateConfig { min_head_height_m: 0.9, ..config.clone() };
        let found = discover(low, &scene).0.remove(0);
        let depth_m = scene.camera.depth_of(&found.position) - config.centre_behind_m;
        let expected_m = config.sigma_depth_m + 0.01 * depth_m * depth_m;
        let sigma_m = found.covariance[(0, 0)].sqrt();
        assert!((sigma_m - expected_m).abs() < 0.003, "{range_m} m: {sigma_m}, {expected_m}");
    }
}

#[test]
fn a_confirmed_track_is_judged_by_a_cost_of_its_own() {
    let head = Point3::new(2.5, 0.0, 1.6);
    let scene = frame(640, 6.0, &[head]);
    for (confirmed, discover_cost, follow_cost, expected) in
        [(true, 0.0, 10.0, 1), (false, 0.0, 10.0, 0), (true, 10.0, 0.0, 0), (false, 10.0, 0.0, 1)]
    {
        let config = DepthTemplateConfig { discover_cost, follow_cost, ..Default::default() };
        let mut detector = DepthTemplate::new(config).unwrap();
        let track = track_at(head, &scene.camera).with_confirmed(confirmed);
        let found = detector.detect(&scene, &Query::Track(&track), &mut Funnel::default()).unwrap();
        assert_eq!(found.len(), expected, "{confirmed} {discover_cost} {follow_cost}");
    }
}
