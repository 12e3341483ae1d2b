use std::sync::Arc;

use nalgebra::{Point2, Point3, SMatrix, Vector2};
use proptest::prelude::*;
use tagalong_conformance::pattern::{blotches, part_of_box};
use tagalong_core::{
    DepthImage, Detection, Detector, EgoMotion, Estimate, Frame, Funnel, GreyImage, Images, Person,
    Query, Stamp, Track, TrackId,
};
use tagalong_geometry::{Camera, Distortion, HEAD_RADIUS_M, Pinhole, Rect};

use crate::detect::Placed;
use crate::picture::{CELLS, Distance, SIDE};
use crate::strip::Lattice;
use crate::{Config, Correlation, Fit, Picture, Strip};

const SIZE: (usize, usize) = (320, 240);

fn camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 215.0, fy: 215.0, cx: 160.0, cy: 120.0, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, SIZE.0, SIZE.1, 1.3, 0.0, 0.0))
}

/// A person as a patterned square, and a passer-by in front of the camera.
#[derive(Clone)]
struct World {
    head: Point3<f64>,
    /// Number of the clothes' pattern.
    kind: f64,
    /// Columns that a passer-by half a metre away covers, the second excluded.
    passer: Option<(usize, usize)>,
    /// Columns without depth, which one camera alone sees.
    shadow: std::ops::Range<usize>,
    at_s: f64,
}

impl World {
    fn at(head: Point3<f64>) -> Self {
        Self { head, kind: 1.0, passer: None, shadow: 0..0, at_s: 1.0 }
    }

    /// Returns true if a passing person covers a column.
    fn is_passed(&self, x: usize) -> bool {
        self.passer.is_some_and(|(from, to)| (from..to).contains(&x))
    }

    fn frame(&self) -> Frame {
        let camera = camera();
        let region = camera.upper_body(&self.head);
        let face_m = (camera.depth_of(&self.head) - HEAD_RADIUS_M) as f32;
        let grey = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let value = match part_of_box(&region, x, y) {
                _ if self.is_passed(x) => blotches(x as f64 / 40.0, y as f64 / 40.0, 8.0),
                Some((u, v)) => blotches(u, v, self.kind),
                None => blotches(x as f64 / 90.0, y as f64 / 90.0, 4.0),
            };
            value.clamp(0.0, 255.0) as u8
        });
        let depth = DepthImage::from_fn(SIZE.0, SIZE.1, |x, y| match part_of_box(&region, x, y) {
            _ if self.is_passed(x) => 0.5,
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
        Frame::new(1, stamp, camera, EgoMotion::at_rest(0.05), images)
    }
}

/// A track that believes in a head there.
fn track(head: Point3<f64>, seen: bool) -> Track {
    let person = Person { position: head, velocity: Vector2::zeros() };
    let covariance = SMatrix::identity() * 0.03;
    let estimate = Estimate::new(person, covariance, camera().upper_body(&head));
    Track::new(TrackId(3), estimate, 2.0).with_seen(seen).with_age(5)
}

const HEAD: Point3<f64> = Point3::new(2.5, 0.0, 1.6);
/// Where they come into view again, 0.3 m to the left of where they are expected.
const ASIDE: Point3<f64> = Point3::new(2.5, 0.3, 1.6);
/// The columns around that place.
const SHADOW: std::ops::Range<usize> = 90..190;

/// Returns the detection of the person that was learned at [`HEAD`] and is expected there, and the
/// tests that failed.
fn look(taught: &World, now: &World) -> (Option<Detection>, Vec<&'static str>) {
    let mut detector = Correlation::new(Config::default()).unwrap();
    detector.learn(&taught.frame(), &[track(HEAD, true)]).unwrap();
    let mut funnel = Funnel::default();
    let expected = track(HEAD, false);
    let found = detector.detect(&now.frame(), &Query::Track(&expected), &mut funnel).unwrap();
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
    let [(half, _), (found, tests)] = [0.5, 1.0].map(|part| {
        let from = (square.x + (1.0 - part) * square.width) as usize;
        look(&World::at(HEAD), &World { passer: Some((from, 260)), ..in_shadow() })
    });
    let half = half.unwrap();
    assert!((half.position - ASIDE).norm() < 0.03, "{half:?}");
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
    let expected = track(HEAD, false);
    let mut funnel = Funnel::default();
    let found = detector.detect(&in_shadow().frame(), &Query::Track(&expected), &mut funnel);
    assert_eq!(found.unwrap(), []);
    assert!(funnel.count("correlation: not seen well yet") == 1);
}

#[test]
fn each_person_is_remembered_as_long_as_the_track_of_that_person() {
    fn detected(later: &[Track]) -> bool {
        let mut detector = Correlation::new(Config::default()).unwrap();
        detector.learn(&World::at(HEAD).frame(), &[track(HEAD, true)]).unwrap();
        detector.learn(&in_shadow().frame(), later).unwrap();
        let expected = track(HEAD, false);
        let mut funnel = Funnel::default();
        detector.detect(&in_shadow().frame(), &Query::Track(&expected), &mut funnel).unwrap();
        funnel.count("correlation: not seen well yet") == 0
    }

    let lost = track(HEAD, false);
    let other = track(HEAD, false).with_id(TrackId(4));
    assert!(detected(std::slice::from_ref(&lost)) && detected(&[lost, other.clone()]));
    assert!(!detected(&[other]));
}

/// The definition, in double precision, cell by cell.
fn slow_fit(strip: [&[f32]; 3], columns: usize, picture: &Picture, at: (usize, usize)) -> Fit {
    let [grey, shown, known] = strip.map(|values| -> Vec<f64> {
        (0..CELLS)
            .map(|i| f64::from(values[(at.1 + i / SIDE) * columns + at.0 + i % SIDE]))
            .collect()
    });
    let of: Vec<usize> = (0..CELLS).filter(|i| picture.body[*i] > 0.0 && shown[*i] > 0.0).collect();
    let n = of.len() as f64;
    let a = of.iter().map(|i| f64::from(picture.grey[*i])).sum::<f64>() / n;
    let b = of.iter().map(|i| grey[*i]).sum::<f64>() / n;
    let [mut aa, mut bb, mut ab] = [0.0; 3];
    for i in &of {
        let x = f64::from(picture.grey[*i]) - a;
        let y = grey[*i] - b;
        aa += x * x;
        bb += y * y;
        ab += x * y;
    }
    let has_contrast = n > 0.0 && aa > 4.0 * n && bb > 4.0 * n;
    let body = f64::from(picture.count);
    Fit {
        correlation: if has_contrast { ab / (aa * bb).sqrt() } else { 0.0 },
        shown: n / body,
        known: of.iter().map(|i| known[*i]).sum::<f64>() / body,
    }
}

proptest! {
    #[test]
    fn the_fit_is_that_of_the_definition(
        seed in 0.0..100.0f64, holes in 2..9usize, column in 0..8usize, row in 0..5usize,
    ) {
        let grey = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            // Brighter than the middle, so that the means count.
            (100.0 + 0.5 * blotches(x as f64 / 30.0, y as f64 / 30.0, seed)).clamp(0.0, 255.0) as u8
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
        let body: [f32; CELLS] = std::array::from_fn(|i| f32::from(i % holes != 1));
        let count = body.iter().sum();
        let grey = std::array::from_fn(|i| {
            blotches((i % SIDE) as f64 / 6.0, (i / SIDE) as f64 / 9.0, seed) as f32 - 100.0
        });
        let picture = Picture { grey, body, count };
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

/// Chequers of two brightnesses, 2.0 and more from their mean.
#[test]
fn without_contrast_there_is_no_correlation() {
    fn sign(x: usize, y: usize) -> f64 {
        if (x + y).is_multiple_of(2) { 1.0 } else { -1.0 }
    }

    fn correlation(own: f32, seen: f64) -> f64 {
        let grey = GreyImage::from_fn(64, 64, |x, y| (128.0 + seen * sign(x, y)) as u8);
        let depth = DepthImage::filled(64, 64, 2.5);
        let corner = Point2::new(10.0, 10.0);
        let lattice = Lattice { corner, step: 1.0, columns: SIDE, rows: SIDE };
        let mut strip = Strip::default();
        strip.read(&grey, &depth, &lattice, &Distance { ahead_m: 2.5, tolerance_m: 0.5 });
        let grey = std::array::from_fn(|i| own * sign(i % SIDE, i / SIDE) as f32);
        let picture = Picture { grey, body: [1.0; CELLS], count: CELLS as f32 };
        strip.fit(&picture, 0, 0).correlation
    }

    assert!((correlation(2.5, 3.0) - 1.0).abs() < 1e-3);
    assert_eq!([correlation(1.5, 9.0), correlation(9.0, 1.0), correlation(0.0, 0.0)], [0.0; 3]);
}

#[test]
fn it_conforms() {
    tagalong_conformance::assert_conforms(crate::register);
}

/// A picture laid somewhere, so many cells from the expected place.
fn placed(aside: i64, correlation: f64, shown: f64, known: f64) -> Placed {
    Placed { aside, down: 0, fit: Fit { correlation, shown, known } }
}

fn chosen(fits: &[Placed]) -> Result<i64, &'static str> {
    crate::detect::choose(&Config::default(), fits).map(|best| best.aside)
}

/// Eleven cells are 0.26 m, ten are 0.24 m.
#[test]
fn the_best_place_must_be_good_and_better_than_all_others() {
    let best = placed(3, 0.9, 1.0, 0.0);
    assert_eq!(chosen(&[placed(0, 0.5, 1.0, 0.0), best]), Ok(3));
    assert_eq!(chosen(&[placed(-7, 0.89, 1.0, 0.0), best]), Ok(3), "that is the same place");
    assert_eq!(chosen(&[placed(-8, 0.82, 1.0, 0.0), best]), Err("correlation: two places"));
    assert_eq!(chosen(&[placed(14, 0.82, 1.0, 0.0), best]), Err("correlation: two places"));
    assert_eq!(chosen(&[placed(-8, 0.79, 1.0, 0.0), best]), Ok(3), "0.1 worse");
    let below = Placed { down: 6, ..best };
    let above = Placed { down: -6, ..placed(3, 0.85, 1.0, 0.0) };
    assert_eq!(chosen(&[below, above]), Err("correlation: two places"), "one above the other");
    let beside = Placed { down: 3, ..placed(3, 0.89, 1.0, 0.0) };
    assert_eq!(chosen(&[below, beside]), Ok(3), "that is the same place");
    assert_eq!(chosen(&[placed(-8, 0.95, 0.3, 0.0), best]), Ok(3), "that place is hidden");
    assert_eq!(chosen(&[placed(0, 0.77, 1.0, 0.0)]), Err("correlation: too low"));
    assert_eq!(chosen(&[placed(0, 0.9, 0.39, 0.0)]), Err("correlation: hidden"));
    assert_eq!(chosen(&[placed(0, 0.9, 0.4, 0.5)]), Ok(0));
    assert_eq!(chosen(&[placed(0, 0.9, 1.0, 0.51)]), Err("correlation: depth knows better"));
    assert_eq!(chosen(&[]), Err("correlation: hidden"));
}

#[test]
fn people_are_searched_as_far_as_they_can_have_got_but_not_farther() {
    fn reach(aside: f64, up: f64) -> (i64, i64) {
        let mut track = track(HEAD, false);
        track.estimate.covariance = SMatrix::zeros();
        // Ahead of the camera, aside is to the left; the distance does not count.
        for (axis, sigma) in [(0, 9.0), (1, aside), (2, up)] {
            track.estimate.covariance[(axis, axis)] = sigma * sigma;
        }
        crate::detect::reach(&Config::default(), &camera(), &track)
    }

    // Three standard deviations in cells of 2.375 cm.
    assert_eq!(reach(0.1, 0.05), (13, 7));
    assert_eq!(reach(1.0, 1.0), (26, 9), "0.6 m aside, 0.2 m up and down");
    assert_eq!(reach(0.0, 0.0), (0, 0));
}

/// A camera 2.5 m to the right sees the person at 45 degrees: uncertain along that ray alone, the
/// person is not aside of it.
#[test]
fn aside_is_across_the_ray_of_the_camera() {
    let mut camera = camera().as_ref().clone();
    camera.robot_from_camera.translation.vector.y = -2.5;
    // Across: three times 0.14 m, in cells of 2.375 cm.
    for (slant, expected) in [(0.01, 0), (-0.01, 18)] {
        let mut track = track(HEAD, false);
        track.estimate.covariance = SMatrix::zeros();
        for (row, column, value) in [(0, 0, 0.01), (0, 1, slant), (1, 0, slant), (1, 1, 0.01)] {
            track.estimate.covariance[(row, column)] = value;
        }
        let (aside, _) = crate::detect::reach(&Config::default(), &camera, &track);
        assert_eq!(aside, expected, "{slant}");
    }
}

#[test]
fn who_is_not_in_plain_view_is_not_remembered() {
    fn learned(track: Track, config: Config) -> bool {
        let mut detector = Correlation::new(config).unwrap();
        detector.learn(&World::at(HEAD).frame(), std::slice::from_ref(&track)).unwrap();
        let mut funnel = Funnel::default();
        let expected = self::track(HEAD, false);
        let search = Query::Track(&expected);
        detector.detect(&in_shadow().frame(), &search, &mut funnel).unwrap();
        funnel.count("correlation: not seen well yet") == 0
    }

    fn seen() -> Track {
        track(HEAD, true)
    }

    assert!(learned(seen(), Config::default()));
    assert!(!learned(track(HEAD, false), Config::default()), "nobody is seen");
    assert!(!learned(seen().with_occluded(true), Config::default()));
    for width in [11.0, 1001.0] {
        let mut track = seen();
        track.estimate.region.width = width;
        assert!(!learned(track, Config::default()), "{width} pixels");
    }
    let mut beside = seen();
    beside.estimate.region.x += 0.7 * beside.estimate.region.width;
    assert!(!learned(beside.clone(), Config::default()), "30 % of a body");
    assert!(learned(beside, Config { min_body: 0.25, ..Config::default() }));
    let mut cut = seen();
    cut.estimate.region.x = -1.0;
    assert!(!learned(cut, Config { min_body: 0.0, ..Config::default() }), "cut off");
}

#[test]
fn a_sighting_says_where_by_its_cells_and_how_sure_it_is() {
    let config = Config { score: 0.7, ..Config::default() };
    let camera = camera();
    let expected = track(HEAD, false);
    let square = expected.estimate.region;
    let best = Placed { down: -6, ..placed(12, 0.9, 1.0, 0.0) };
    let found = crate::detect::sighting(&config, &camera, &expected, &square, best);
    assert!((found.rect().unwrap().x - square.x - 0.5 * square.width).abs() < 1e-9);
    assert!((found.rect().unwrap().y - square.y + 0.25 * square.width).abs() < 1e-9);
    assert_eq!((found.rect().unwrap().width, found.score), (square.width, 0.7));
    assert!((camera.depth_of(&found.position) - 2.5).abs() < 1e-9, "as far as expected");
    assert!(camera.upper_body(&found.position).iou(&found.rect().unwrap()) > 0.99);
    let middle =
        crate::detect::sighting(&config, &camera, &expected, &square, placed(0, 0.9, 1.0, 0.0));
    assert!((middle.covariance[(1, 1)].sqrt() - 0.05).abs() < 0.005, "{}", middle.covariance);
    assert!((middle.covariance[(0, 0)].sqrt() - 3.0).abs() < 0.05, "{}", middle.covariance);
}

#[test]
fn brightness_is_that_between_four_pixels_and_depth_that_of_the_nearest() {
    use crate::picture::{brightness, nearest};
    let grey = GreyImage::from_pixels(2, 2, vec![128, 138, 148, 178]).unwrap();
    for (x, y, expected) in [
        (0.5, 0.5, Some(0.0)),
        (0.9, 0.5, Some(4.0)),
        (0.5, 0.75, Some(5.0)),
        // The mean of all.
        (1.0, 1.0, Some(20.0)),
        (0.4, 0.6, None),
        (0.6, 1.6, None),
        (1.6, 0.6, None),
    ] {
        assert_eq!(brightness(&grey, Point2::new(x, y)), expected, "{x} {y}");
    }
    let grey = GreyImage::from_fn(4, 4, |x, y| (128 + 10 * x + 3 * y) as u8);
    let sloped = brightness(&grey, Point2::new(2.75, 1.75)).unwrap();
    assert!((sloped - (22.5 + 3.75)).abs() < 1e-4, "{sloped}");
    let depth = DepthImage::from_pixels(2, 1, vec![1.0, 2.0]).unwrap();
    assert_eq!(
        [-0.1, 0.0, 0.9, 1.1, 2.0].map(|x| nearest(&depth, Point2::new(x, 0.9))),
        [None, Some(1.0), Some(1.0), Some(2.0), None]
    );
}

#[test]
fn depth_says_whether_somebody_else_is_before_or_behind() {
    use crate::picture::Shows;
    let distance = Distance { ahead_m: 2.5, tolerance_m: 0.5 };
    let shows = [1.9, 2.1, 2.9, 3.1].map(|metres| distance.shows(metres));
    assert_eq!(shows, [Shows::Nearer, Shows::Body, Shows::Body, Shows::Farther]);
    for nothing in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(distance.shows(nothing), Shows::Nothing);
    }
}

#[test]
fn the_lattice_goes_on_around_the_square() {
    let square = Rect::new(100.0, 50.0, 48.0, 48.0);
    let lattice = Lattice::around(&square, 2, 1);
    assert_eq!((lattice.columns, lattice.rows, lattice.step), (SIDE + 4, SIDE + 2, 2.0));
    let middles: Vec<_> = lattice.middles().collect();
    assert_eq!((middles[0], middles[1]), (Point2::new(97.0, 49.0), Point2::new(99.0, 49.0)));
    assert_eq!(middles[SIDE + 4], Point2::new(97.0, 51.0));
    assert_eq!(middles.len(), (SIDE + 4) * (SIDE + 2));
}

#[test]
fn settings_that_cannot_work_are_refused_by_name() {
    for (key, config) in [
        ("min_correlation", Config { min_correlation: 1.1, ..Config::default() }),
        ("elsewhere_m", Config { elsewhere_m: 0.0, ..Config::default() }),
        ("search_aside_m", Config { search_aside_m: 2.1, ..Config::default() }),
        ("score", Config { score: f64::NAN, ..Config::default() }),
    ] {
        let error = Correlation::new(config).err().unwrap().to_string();
        assert!(error.contains(&format!("`{key}`")), "{error}");
    }
}
