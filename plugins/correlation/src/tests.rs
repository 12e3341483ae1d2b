use std::sync::Arc;

use nalgebra::{Point2, Point3, SMatrix, Vector2};
use proptest::prelude::*;
use tagalong_core::{
    Camera, DepthImage, Detection, Detector, Distortion, Estimate, Frame, Funnel, GreyImage,
    HEAD_RADIUS_M, Images, Motion, Person, Pinhole, Registry, Search, Stamp, Track, TrackId,
};

use crate::picture::{CELLS, Distance, SIDE};
use crate::strip::Lattice;
use crate::{Config, Correlation, Fit, Picture, Strip};

const SIZE: (usize, usize) = (320, 240);

fn camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 215.0, fy: 215.0, cx: 160.0, cy: 120.0, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, SIZE.0, SIZE.1, 1.3, 0.0, 0.0))
}

/// A reproducible pattern of blotches.
fn pattern(u: f64, v: f64, kind: f64) -> f64 {
    let wave = |a: f64, b: f64| (a * u + b * v + kind).sin();
    127.0 + 60.0 * wave(9.0, 2.0) + 40.0 * wave(-4.0, 7.0 + kind) + 25.0 * wave(15.0, -11.0)
}

/// A person as a patterned square, and who stands in front of the camera.
#[derive(Clone)]
struct World {
    head: Point3<f64>,
    /// What the person wears.
    kind: f64,
    /// Somebody half a metre away, from the first to the second column.
    passer: Option<(usize, usize)>,
    /// Columns without depth, which one camera alone sees.
    shadow: std::ops::Range<usize>,
    at_s: f64,
}

impl World {
    fn at(head: Point3<f64>) -> Self {
        Self { head, kind: 1.0, passer: None, shadow: 0..0, at_s: 1.0 }
    }

    fn frame(&self) -> Frame {
        let camera = camera();
        let of = camera.upper_body(&self.head);
        let face_m = (camera.depth_of(&self.head) - HEAD_RADIUS_M) as f32;
        let on_person = |x: usize, y: usize| {
            let (u, v) = ((x as f64 + 0.5 - of.x) / of.width, (y as f64 + 0.5 - of.y) / of.height);
            ((0.0..1.0).contains(&u) && (0.0..1.0).contains(&v)).then_some((u, v))
        };
        let passes = |x: usize| self.passer.is_some_and(|(from, to)| (from..to).contains(&x));
        let grey = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let value = match on_person(x, y) {
                _ if passes(x) => pattern(x as f64 / 40.0, y as f64 / 40.0, 8.0),
                Some((u, v)) => pattern(u, v, self.kind),
                None => pattern(x as f64 / 90.0, y as f64 / 90.0, 4.0),
            };
            value.clamp(0.0, 255.0) as u8
        });
        let depth = DepthImage::from_fn(SIZE.0, SIZE.1, |x, y| match on_person(x, y) {
            _ if passes(x) => 0.5,
            _ if self.shadow.contains(&x) => f32::NAN,
            Some(_) => face_m,
            None => 6.0,
        });
        let images = Images {
            grey: Some(Arc::new(grey)),
            depth: Some(Arc::new(depth)),
            ..Images::default()
        };
        let stamp = Stamp::default().plus_seconds(self.at_s);
        Frame::new(1, stamp, camera, Motion::at_rest(0.05), images)
    }
}

/// A track that believes in a head there.
fn track(head: Point3<f64>, seen: bool) -> Track {
    let person = Person { position: head, velocity: Vector2::zeros() };
    let covariance = SMatrix::identity() * 0.03;
    let estimate = Estimate { person, covariance, region: camera().upper_body(&head) };
    Track {
        id: TrackId(3),
        estimate,
        seen,
        occluded: false,
        confirmed: true,
        age: 5,
        unseen_s: 0.0,
        score: 2.0,
    }
}

const HEAD: Point3<f64> = Point3::new(2.5, 0.0, 1.6);
/// Where they come into view again, 0.3 m to the left of where they are expected.
const ASIDE: Point3<f64> = Point3::new(2.5, 0.3, 1.6);
/// The columns around that place.
const SHADOW: std::ops::Range<usize> = 90..190;

/// Who was remembered at [`HEAD`] and is expected there, and the test that failed.
fn look(taught: &World, now: &World) -> (Option<Detection>, Vec<&'static str>) {
    let mut detector = Correlation::new(Config::default()).unwrap();
    detector.learn(&taught.frame(), &[track(HEAD, true)]).unwrap();
    let mut funnel = Funnel::default();
    let expected = track(HEAD, false);
    let found = detector.detect(&now.frame(), &Search::Near(&expected), &mut funnel).unwrap();
    assert!(found.len() <= 1);
    (found.into_iter().next(), funnel.entries().iter().map(|entry| entry.test).collect())
}

fn in_shadow() -> World {
    World { shadow: SHADOW, at_s: 2.0, ..World::at(ASIDE) }
}

#[test]
fn who_has_no_depth_is_found_by_what_they_look_like() {
    let (found, _) = look(&World::at(HEAD), &in_shadow());
    let found = found.unwrap();
    assert!((found.position - ASIDE).norm() < 0.03, "{found:?}");
    // A picture tells the direction, not the distance.
    assert!(found.covariance[(0, 0)].sqrt() > 2.5 && found.covariance[(1, 1)].sqrt() < 0.5);
}

#[test]
fn where_depth_shows_the_person_others_are_left_to_find_them() {
    let seen = World { at_s: 2.0, ..World::at(HEAD) };
    let (found, tests) = look(&World::at(HEAD), &seen);
    assert_eq!((found, tests), (None, vec!["correlation: depth shows the person"]));
    let beside = World { shadow: 0..0, ..in_shadow() };
    let (found, tests) = look(&World::at(HEAD), &beside);
    assert_eq!((found, tests), (None, vec!["correlation: depth knows better"]));
}

#[test]
fn who_is_half_hidden_is_found_and_who_is_hidden_is_not() {
    let square = camera().upper_body(&ASIDE);
    let behind = |part: f64| {
        let from = (square.x + (1.0 - part) * square.width) as usize;
        look(&World::at(HEAD), &World { passer: Some((from, 260)), ..in_shadow() })
    };
    let found = behind(0.5).0.unwrap();
    assert!((found.position - ASIDE).norm() < 0.03, "{found:?}");
    let (found, tests) = behind(1.0);
    assert!(found.is_none() && tests[0].starts_with("correlation: "), "{found:?} {tests:?}");
}

#[test]
fn somebody_else_is_not_taken_for_the_person() {
    let other = World { kind: 2.0, ..in_shadow() };
    let (found, tests) = look(&World::at(HEAD), &other);
    assert_eq!((found, tests), (None, vec!["correlation: too low"]));
}

#[test]
fn nobody_is_remembered_behind_somebody_nor_for_long() {
    let square = camera().upper_body(&HEAD);
    let half = World { passer: Some((square.centre().x as usize, 260)), ..World::at(HEAD) };
    assert_eq!(look(&half, &in_shadow()), (None, vec!["correlation: not seen well yet"]));
    let late = World { at_s: 4.5, ..in_shadow() };
    assert_eq!(look(&World::at(HEAD), &late), (None, vec!["correlation: forgotten"]));
}

#[test]
fn who_left_is_forgotten() {
    let mut detector = Correlation::new(Config::default()).unwrap();
    detector.learn(&World::at(HEAD).frame(), &[track(HEAD, true)]).unwrap();
    detector.learn(&World::at(HEAD).frame(), &[]).unwrap();
    let (expected, mut funnel) = (track(HEAD, false), Funnel::default());
    let found = detector.detect(&in_shadow().frame(), &Search::Near(&expected), &mut funnel);
    assert_eq!(found.unwrap(), []);
    assert!(funnel.count("correlation: not seen well yet") == 1);
}

/// The definition, in double precision, cell by cell.
fn slow_fit(strip: [&[f32]; 3], columns: usize, picture: &Picture, at: (usize, usize)) -> Fit {
    let cell =
        |values: &[f32], i: usize| f64::from(values[(at.1 + i / SIDE) * columns + at.0 + i % SIDE]);
    let [grey, shown, known] = strip;
    let of: Vec<usize> =
        (0..CELLS).filter(|i| picture.body[*i] > 0.0 && cell(shown, *i) > 0.0).collect();
    let n = of.len() as f64;
    let pairs: Vec<(f64, f64)> =
        of.iter().map(|i| (f64::from(picture.grey[*i]), cell(grey, *i))).collect();
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / n;
    let (a, b) = (mean(|p| p.0), mean(|p| p.1));
    let sum =
        |of: &dyn Fn(f64, f64) -> f64| -> f64 { pairs.iter().map(|(x, y)| of(x - a, y - b)).sum() };
    let (aa, bb, ab) = (sum(&|x, _| x * x), sum(&|_, y| y * y), sum(&|x, y| x * y));
    let has_contrast = n > 0.0 && aa > 4.0 * n && bb > 4.0 * n;
    let body = f64::from(picture.count);
    Fit {
        correlation: if has_contrast { ab / (aa * bb).sqrt() } else { 0.0 },
        shown: n / body,
        known: of.iter().map(|i| cell(known, *i)).sum::<f64>() / body,
    }
}

proptest! {
    #[test]
    fn the_fit_is_that_of_the_definition(
        seed in 0.0..100.0f64, holes in 2..9usize, column in 0..8usize, row in 0..5usize,
    ) {
        let grey = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            pattern(x as f64 / 30.0, y as f64 / 30.0, seed).clamp(0.0, 255.0) as u8
        });
        let depth = DepthImage::from_fn(SIZE.0, SIZE.1, |x, y| match (x * 7 + y * 13) % holes {
            0 => f32::NAN,
            1 => 0.7,
            _ => 2.5,
        });
        let distance = Distance { ahead_m: 2.5, tolerance_m: 0.5 };
        let lattice =
            Lattice { corner: Point2::new(90.3, 60.8), step: 2.3, columns: SIDE + 7, rows: SIDE + 4 };
        let mut strip = Strip::default();
        strip.read(&grey, &depth, &lattice, &distance);
        prop_assert_eq!(strip.places(), (8, 5));
        let own = |i: usize| pattern((i % SIDE) as f64 / 6.0, (i / SIDE) as f64 / 9.0, seed) as f32;
        let body: [f32; CELLS] = std::array::from_fn(|i| f32::from(i % holes != 1));
        let count = body.iter().sum();
        let picture = Picture { grey: std::array::from_fn(|i| own(i) - 128.0), body, count };
        let cells = strip.cells();
        let slow = slow_fit(cells, lattice.columns, &picture, (column, row));
        let fast = strip.fit(&picture, column, row);
        let pairs =
            [(fast.correlation, slow.correlation), (fast.shown, slow.shown), (fast.known, slow.known)];
        for (fast, slow) in pairs {
            prop_assert!((fast - slow).abs() < 1e-3, "{fast} {slow}");
        }
    }
}

#[test]
fn it_conforms() {
    let mut registry = Registry::default();
    crate::register(&mut registry);
    let failures = tagalong_conformance::check_all(&registry);
    assert!(failures.is_empty(), "{failures:#?}");
}
