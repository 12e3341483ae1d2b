use std::sync::Arc;

use nalgebra::{Point2, Point3, SMatrix, Vector2};
use tagalong_config::Registry;
use tagalong_conformance::context;
use tagalong_core::{
    Detection, Detector, EgoMotion, Estimate, Frame, Funnel, Images, Person, Query, RgbImage,
    Stamp, Track, TrackId,
};
use tagalong_geometry::{Camera, ConicalMirror, Lens, Panorama, Rect};

use crate::{AfterMeasuring, Config, Distance, Eyes, Model, OmniAppearance};

const COLUMNS: usize = 480;
const ROWS: usize = 120;

fn camera(height_m: f64) -> Arc<Camera> {
    let d = [67.5_f64.to_radians(), 0.05, 2.0_f64.to_radians().tan(), 53.0_f64.to_radians().tan()];
    let mirror = ConicalMirror::new(1.0, [0.0; 2], d).unwrap();
    Arc::new(Camera {
        lens: Lens::Panorama(Panorama { mirror, columns: COLUMNS, rows: ROWS }),
        width: COLUMNS,
        height: ROWS,
        robot_from_camera: ConicalMirror::upright(height_m),
    })
}

fn detector(config: Config) -> OmniAppearance {
    OmniAppearance::new(Config { background_frames: 12, ..config }, &context()).unwrap()
}

fn analytic() -> Config {
    Config { distance: Distance::Analytic, ..Config::default() }
}

/// Renders a striped scene with noise, and upright boxes in two colours, 1.75 m high and 0.45 m
/// wide, at these places of the robot frame.
fn frame(index: u64, camera: &Arc<Camera>, people: &[Point2<f64>]) -> Frame {
    let panorama = *camera.panorama().unwrap();
    let mut state = index.wrapping_mul(0x9E37_79B9) | 1;
    let mut image = RgbImage::from_fn(COLUMNS, ROWS, |x, y| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        let noise = ((state >> 40) % 5) as u8;
        let wall = 130 + 20 * u8::from(x / 15 % 2 == 0) + y as u8 / 4;
        [wall + noise, wall + noise / 2, wall - noise]
    });
    for place in people {
        let range = place.coords.norm();
        let head = camera.project(&Point3::new(place.x, place.y, 1.75)).unwrap();
        let feet = camera.project(&Point3::new(place.x, place.y, 0.0)).unwrap();
        let half = (0.225 / range).atan() / std::f64::consts::TAU * COLUMNS as f64;
        for row in head.y.ceil().max(0.0) as usize..=(feet.y.floor() as usize).min(ROWS - 1) {
            for column in (head.x - half).ceil() as i64..=(head.x + half).floor() as i64 {
                let at = row * COLUMNS + column.rem_euclid(COLUMNS as i64) as usize;
                let shirt = (row as f64) < 0.5 * (head.y + feet.y);
                image.pixels_mut()[at] = if shirt { [200, 40, 40] } else { [20, 25, 60] };
            }
        }
    }
    assert!(panorama.mirror.is_sane());
    let images = Images { colour: Some(Arc::new(image)), ..Images::default() };
    let stamp = Stamp::from_nanos(index * 333_000_000);
    Frame::new(index, stamp, Arc::clone(camera), EgoMotion::at_rest(0.333), images)
}

fn see(detector: &mut OmniAppearance, frame: &Frame) -> Vec<Detection> {
    let found =
        detector.detect(frame, &Query::Discover { occupied: &[] }, &mut Funnel::default()).unwrap();
    detector.learn(frame, &[]).unwrap();
    found
}

/// A detector with a background of the empty scene.
fn ready(config: Config, camera: &Arc<Camera>) -> OmniAppearance {
    let mut detector = detector(config);
    for index in 1..=14 {
        assert_eq!(see(&mut detector, &frame(index, camera, &[])), []);
    }
    detector
}

fn around(range: f64, bearing_deg: f64) -> Point2<f64> {
    let (sine, cosine) = bearing_deg.to_radians().sin_cos();
    Point2::new(range * cosine, range * sine)
}

#[test]
fn people_are_found_all_around_and_across_the_seam() {
    let camera = camera(1.55);
    let mut detector = ready(analytic(), &camera);
    for step in 0..24_u32 {
        let place = around(2.5 + 0.1 * f64::from(step), 15.0 * f64::from(step) + 172.0);
        let found = see(&mut detector, &frame(20 + u64::from(step), &camera, &[place]));
        assert_eq!(found.len(), 1, "{place}");
        let person = &found[0];
        let off = (person.position.xy() - place).norm();
        assert!(off < 0.35, "{place}: {:?}", person.position);
        assert!((person.position.z - 1.63).abs() < 0.15, "{:?}", person.position);
        assert!(person.is_sane() && person.covariance.cholesky().is_some());
        let region = person.rect().unwrap();
        assert!(region.x >= 0.0 && region.x < COLUMNS as f64, "{region:?}");
    }
}

#[test]
fn panoramas_of_fewer_than_eight_columns_or_rows_are_not_looked_at() {
    let large = camera(1.5);
    for (columns, rows, dropped) in [(8, 8, 0), (9, 10, 0), (7, 8, 1), (8, 7, 1), (3, 3, 1)] {
        let panorama = Panorama { columns, rows, ..*large.panorama().expect("a panorama") };
        let lens = Lens::Panorama(panorama);
        let camera = Arc::new(Camera { lens, width: columns, height: rows, ..(*large).clone() });
        let image = Arc::new(RgbImage::filled(columns, rows, [90; 3]));
        let images = Images { colour: Some(image), ..Images::default() };
        let frame = Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.3), images);
        let mut funnel = Funnel::default();
        let mut eyes = Eyes::new(Config::default()).expect("usual settings");
        let blobs = eyes.look(&frame, &mut funnel).expect("the frame has an image");
        assert!(blobs.is_empty(), "there is no background yet");
        assert_eq!(funnel.count("image of another size"), dropped, "{columns} x {rows}");
    }
}

#[test]
fn a_program_may_change_what_was_measured() {
    let camera = camera(1.55);
    let to_the_front = AfterMeasuring {
        name: "to the front",
        correct: |blob, columns| blob.column = 0.5 * columns.len() as f64,
    };
    let mut found = Vec::new();
    for after_measuring in [None, Some(to_the_front)] {
        let mut detector = ready(Config { after_measuring, ..analytic() }, &camera);
        let behind = around(3.0, 180.0);
        found.push(see(&mut detector, &frame(20, &camera, &[behind]))[0].position.x);
    }
    assert!(found[0] < -2.5 && found[1] > 2.5, "{found:?}");
}

#[test]
fn three_people_are_three() {
    let camera = camera(1.55);
    let mut detector = ready(analytic(), &camera);
    let places = [around(2.5, 178.0), around(3.5, 20.0), around(3.0, -60.0)];
    let found = see(&mut detector, &frame(20, &camera, &places));
    assert_eq!(found.len(), 3);
    for place in places {
        assert_eq!(
            found.iter().filter(|d| (d.position.xy() - place).norm() < 0.35).count(),
            1,
            "{place}"
        );
    }
}

/// The frame of [`frame`], on a robot that turns by a tenth of a column, which counts as motion.
fn turning(index: u64, camera: &Arc<Camera>, people: &[Point2<f64>]) -> Frame {
    let still = frame(index, camera, people);
    let motion = EgoMotion { turn: 0.0013, ..EgoMotion::at_rest(0.333) };
    Frame::new(index, still.stamp, Arc::clone(camera), motion, still.images())
}

#[test]
fn once_the_robot_has_moved_who_shows_no_change_is_furniture() {
    let camera = camera(1.55);
    for (changed_part, when_it_stays) in [(0.3, 0), (0.0, 1)] {
        let mut detector = ready(Config { changed_part, ..analytic() }, &camera);
        assert!(see(&mut detector, &turning(20, &camera, &[])).is_empty());
        for (index, range, expected, why) in [
            (21, 3.0, 1, "who was not there before"),
            (22, 3.0, when_it_stays, "who stays"),
            (23, 2.0, 1, "who comes nearer"),
        ] {
            let seen = see(&mut detector, &turning(index, &camera, &[around(range, 60.0)]));
            assert_eq!(seen.len(), expected, "{why}");
        }
    }
}

/// Returns a confirmed track at a place in the robot frame.
fn track(place: Point2<f64>) -> Track {
    let position = Point3::new(place.x, place.y, 1.63);
    let estimate = Estimate::new(
        Person { position, velocity: Vector2::zeros() },
        SMatrix::identity(),
        Rect::default(),
    );
    let id = TrackId(1);
    Track::new(id, estimate, 1.0).with_age(9)
}

#[test]
fn the_background_of_a_moving_robot_does_not_take_in_who_is_known() {
    let camera = camera(1.55);
    let place = around(3.0, 60.0);
    for (tracks, found) in [(vec![track(place)], 1), (vec![], 0)] {
        let mut detector = ready(Config { changed_part: 0.0, ..analytic() }, &camera);
        see(&mut detector, &turning(20, &camera, &[]));
        let everywhere = Query::Discover { occupied: &[] };
        let mut last = 0;
        // Ten seconds, which is twice as long as what stays there is not taken for furniture.
        for index in 21..51 {
            let frame = turning(index, &camera, &[place]);
            last = detector.detect(&frame, &everywhere, &mut Funnel::default()).unwrap().len();
            detector.learn(&frame, &tracks).unwrap();
        }
        assert_eq!(last, found);
    }
}

#[test]
fn a_model_of_another_camera_is_refused_in_words() {
    let low = camera(1.1);
    let mut learned = ready(Config::default(), &low);
    let person = frame(20, &low, &[around(2.5, 0.0)]);
    let everywhere = Query::Discover { occupied: &[] };
    let error = learned.detect(&person, &everywhere, &mut Funnel::default()).unwrap_err();
    assert!(error.to_string().contains("another camera"), "{error}");
    assert_eq!(see(&mut ready(analytic(), &low), &person).len(), 1);
}

#[test]
fn the_shipped_model_is_one() {
    let text = include_str!("../models/omni-distance.toml");
    let model = Model::from_text(text).unwrap();
    assert_eq!(Model::from_text(&model.to_text().unwrap()).unwrap(), model);
    assert_eq!(model.people.len(), 2);
    for (from, to, why) in [
        ("distance 3", "distance 9", "distance 9"),
        ("\"width\"", "\"girth\"", "features"),
        ("floor_offset_m = ", "floor_offset_m = inf #", "finite"),
    ] {
        let refusal = Model::from_text(&text.replace(from, to)).unwrap_err();
        assert!(refusal.contains(why), "{refusal}");
    }
}

#[test]
fn somebody_whom_the_model_does_not_know_is_refused() {
    let config = Config { person: "person-77".into(), ..Config::default() };
    let error = OmniAppearance::new(config, &context()).err().unwrap().to_string();
    assert!(error.contains("person-77") && error.contains("person-1"), "{error}");
}

#[test]
fn it_keeps_the_promises_of_its_kind() {
    let mut registry = Registry::default();
    crate::register(&mut registry);
    assert!(registry.find(crate::NAME).is_ok());
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}

#[cfg(feature = "train")]
mod fits {
    use super::*;
    use crate::train::{Collector, Training, WAYS, head};

    /// People at known places: all methods give about their distance, and the same seed gives the
    /// same fit.
    #[test]
    fn a_head_is_fitted_to_people_whose_places_are_known() {
        let camera = camera(1.55);
        let config = Config { background_frames: 12, ..Config::default() };
        let mut collector = Collector::new(config).unwrap();
        for index in 1..=132 {
            let range = 2.0 + 0.025 * (index as f64 * 7.0 % 100.0);
            let place = around(range, 11.0 * index as f64);
            let people = if index <= 12 { vec![] } else { vec![place] };
            let heads: Vec<_> =
                people.iter().map(|p: &Point2<f64>| (1, Point3::new(p.x, p.y, 1.63))).collect();
            collector.add(&frame(index, &camera, &people), &heads).unwrap();
        }
        assert!(collector.samples.len() == 120 && collector.missed == 0);
        let training = Training::default();
        let fitted = head(&collector.samples, &training, 3).unwrap();
        assert_eq!(head(&collector.samples, &training, 3).unwrap(), fitted);
        for how in WAYS {
            let errors =
                collector.samples.iter().map(|s| (s.distance(&fitted, how) - s.distance_m).abs());
            let mean = errors.sum::<f64>() / 120.0;
            assert!(mean < 0.12, "{how:?}: {mean}");
        }
        assert!(head(&collector.samples[..5], &training, 3).is_err());
    }
}
