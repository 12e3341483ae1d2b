use std::sync::Arc;

use nalgebra::{Point3, SMatrix, Vector2};
use proptest::prelude::*;
use tagalong_conformance::pattern::{blotches, part_of_box};
use tagalong_core::{
    DepthImage, Detection, Detector, EgoMotion, Estimate, Frame, Funnel, GreyImage, Images, Person,
    Query, Stamp, Track, TrackId,
};
use tagalong_geometry::{Camera, Distortion, HEAD_RADIUS_M, Pinhole, Rect};
use tagalong_vision::Integral;

use crate::appearance::Samples;
use crate::{Appearance, Compressive, Config, Features, Learning, LearningRule, Rectangle};

const SIZE: (usize, usize) = (320, 240);

fn camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 262.0, fy: 262.0, cx: 159.5, cy: 119.5, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, SIZE.0, SIZE.1, 1.3, 0.0, 0.0))
}

/// A person as a patterned square, 0.57 m wide, at a place; and the objects in front.
struct World {
    head: Point3<f64>,
    /// A board of the given depth, over the columns up to this one.
    board: Option<(f32, usize)>,
    with_depth: bool,
}

impl World {
    fn at(head: Point3<f64>) -> Self {
        Self { head, board: None, with_depth: true }
    }

    /// Returns the depth of the board in a column, m.
    fn board_depth(&self, x: usize) -> Option<f32> {
        self.board.filter(|(_, to)| x < *to).map(|(metres, _)| metres)
    }

    fn frame(&self) -> Frame {
        let camera = camera();
        let region = camera.upper_body(&self.head);
        let face_m = (camera.depth_of(&self.head) - HEAD_RADIUS_M) as f32;
        let grey = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let value = match (self.board_depth(x), part_of_box(&region, x, y)) {
                (Some(_), _) => blotches(x as f64 / 40.0, y as f64 / 40.0, 8.0),
                (None, Some((u, v))) => blotches(u, v, 1.0),
                (None, None) => blotches(x as f64 / 90.0, y as f64 / 90.0, 4.0),
            };
            value.clamp(0.0, 255.0) as u8
        });
        let depth = DepthImage::from_fn(SIZE.0, SIZE.1, |x, y| {
            let behind = if part_of_box(&region, x, y).is_some() { face_m } else { 6.0 };
            self.board_depth(x).unwrap_or(behind)
        });
        let images = Images {
            grey: Some(Arc::new(grey)),
            depth: self.with_depth.then(|| Arc::new(depth)),
            ..Images::default()
        };
        Frame::new(1, Stamp::default(), camera, EgoMotion::at_rest(0.05), images)
    }
}

/// A track that believes in a head there.
fn track(head: Point3<f64>, seen: bool) -> Track {
    let person = Person { position: head, velocity: Vector2::zeros() };
    let covariance = SMatrix::identity() * 0.01;
    let estimate = Estimate::new(person, covariance, camera().upper_body(&head));
    Track::new(TrackId(3), estimate, 2.0).with_seen(seen).with_age(5)
}

fn near(
    detector: &mut Compressive,
    frame: &Frame,
    expected: Point3<f64>,
) -> (Option<Detection>, Funnel) {
    let mut funnel = Funnel::default();
    let track = track(expected, true);
    let found = detector.detect(frame, &Query::Track(&track), &mut funnel).unwrap();
    (found.into_iter().next(), funnel)
}

/// A detector that was shown a person there.
fn taught(config: Config, head: Point3<f64>) -> Compressive {
    let mut detector = Compressive::new(config, 7).unwrap();
    detector.learn(&World::at(head).frame(), &[track(head, true)]).unwrap();
    detector
}

fn place(x: f64, y: f64) -> Point3<f64> {
    Point3::new(x, y, 1.35)
}

#[test]
fn it_conforms() {
    tagalong_conformance::assert_conforms(crate::register);
}

#[test]
fn a_person_is_followed_who_moves_by_a_third_of_their_width() {
    for with_depth in [true, false] {
        let before = place(3.0, 0.0);
        let after = place(3.0, 0.19);
        let mut detector = taught(Config::default(), before);
        let frame = World { with_depth, ..World::at(after) }.frame();
        let (found, funnel) = near(&mut detector, &frame, before);
        let found = found.unwrap_or_else(|| panic!("{funnel:?}"));
        let off = found.rect().unwrap().centre() - camera().upper_body(&after).centre();
        assert!(off.norm() < 2.0, "{off}");
        assert!((found.position - after).norm() < 0.06 || !with_depth, "{}", found.position);
    }
}

/// The coarse search looks at every third pixel.
#[test]
fn the_fine_search_finds_the_pixel() {
    let before = place(3.0, 0.0);
    for step in 0..8 {
        let after = place(3.0, 0.1 + 0.01 * f64::from(step));
        let (found, _) =
            near(&mut taught(Config::default(), before), &World::at(after).frame(), before);
        let truth = camera().upper_body(&after);
        let off = found.unwrap().rect().unwrap().centre() - truth.centre();
        assert!(off.x.abs() < 1.3, "{step}: {off}");
    }
}

#[test]
fn somebody_who_goes_a_long_way_is_kept_and_the_box_has_their_size() {
    let mut here = place(3.0, -0.6);
    let mut detector = taught(Config::default(), here);
    let mut believed = here;
    for _ in 0..40 {
        here += nalgebra::Vector3::new(-0.025, 0.03, 0.0);
        let frame = World::at(here).frame();
        let (found, funnel) = near(&mut detector, &frame, believed);
        let found = found.unwrap_or_else(|| panic!("{funnel:?} at {here}"));
        believed = found.position;
        detector.learn(&frame, &[track(believed, true)]).unwrap();
    }
    let truth = camera().upper_body(&here);
    let iou = camera().upper_body(&believed).iou(&truth);
    assert!(iou > 0.8, "{iou} at {here}: {believed}");
}

#[test]
fn a_person_behind_a_board_is_hidden_and_one_who_left_is_gone() {
    let head = place(3.0, 0.0);
    let mut detector = taught(Config::default(), head);
    let hidden = World { board: Some((1.5, SIZE.0)), ..World::at(head) }.frame();
    let (found, funnel) = near(&mut detector, &hidden, head);
    assert_eq!((found, funnel.count("appearance: hidden by something nearer")), (None, 1));
    let gone = World::at(place(3.0, 1.5)).frame();
    let (found, funnel) = near(&mut detector, &gone, head);
    assert_eq!((found, funnel.count("appearance: gone, something farther is seen")), (None, 1));
}

#[test]
fn depth_leaves_few_boxes_of_a_wide_search() {
    let head = place(3.0, 0.0);
    let frame = World::at(head).frame();
    let wide = Config { search_radius: 1.0, ..Config::default() };
    let mut detector = taught(wide.clone(), head);
    let (found, funnel) = near(&mut detector, &frame, head);
    let dropped = funnel.count("box: depth");
    assert!(found.is_some() && (400..700).contains(&dropped), "{dropped} of some 800");
    let blind = Config { depth_filter: false, ..wide };
    let (found, funnel) = near(&mut taught(blind, head), &frame, head);
    assert!(found.is_some() && funnel.count("box: depth") == 0);
}

/// Returns true if a standing person is found, and the tests that failed.
fn answer(config: Config) -> (bool, Vec<&'static str>) {
    let head = place(3.0, 0.0);
    let (found, funnel) = near(&mut taught(config, head), &World::at(head).frame(), head);
    let failed = funnel.entries().iter().map(|entry| entry.test);
    (found.is_some(), failed.filter(|test| test.starts_with("appearance: ")).collect())
}

#[test]
fn the_best_box_has_to_be_sure_and_ahead_of_other_places() {
    fn config(search_radius: f64, min_confidence: f64, min_lead: f64) -> Config {
        Config { search_radius, min_confidence, min_lead, ..Config::default() }
    }

    assert_eq!(answer(config(0.4, -1e6, 0.0)), (true, vec![]));
    assert_eq!(answer(config(0.4, 1e6, 0.0)), (false, vec!["appearance: confidence"]));
    // Within 0.4 widths there is no other place; within a whole one there are some.
    assert_eq!(answer(config(0.4, -1e6, 1e6)), (true, vec![]));
    let blind = Config { depth_filter: false, ..config(1.0, -1e6, 1e6) };
    assert_eq!(answer(blind.clone()), (false, vec!["appearance: two places"]));
    assert_eq!(answer(Config { min_lead: -1e6, ..blind }), (true, vec![]));
}

/// Returns the width of the box found at the expected place of a person learned 3 m away, in parts
/// of the width there.
fn grown(config: Config, expected_m: f64, widened: f64) -> f64 {
    let before = place(3.0, 0.0);
    let now = place(expected_m, 0.0);
    let mut detector = taught(config, before);
    let mut expected = track(now, true);
    let region = expected.estimate.region;
    let width = widened * region.width;
    let height = widened * region.height;
    let centre = region.centre();
    expected.estimate.region =
        Rect::new(centre.x - 0.5 * width, centre.y - 0.5 * height, width, height);
    let frame = World::at(now).frame();
    let search = Query::Track(&expected);
    let found = detector.detect(&frame, &search, &mut Funnel::default()).unwrap();
    let found = found[0].rect().unwrap();
    let before = camera().upper_body(&before);
    let stretched = found.height / found.width / (before.height / before.width);
    assert!((stretched - 1.0).abs() < 0.021, "{stretched}");
    found.width / before.width
}

#[test]
fn the_size_goes_by_the_distance_and_does_not_jump() {
    // The box is some 50 pixels wide: whole pixels are 2 % of it.
    fn near(found: f64, expected: f64) -> bool {
        (found - expected).abs() < 0.021
    }

    let config = Config { min_confidence: -1e6, ..Config::default() };
    let by_box = Config { scale_from_depth: false, ..config.clone() };
    let cases = [
        (&config, 2.9, 1.0, 3.0 / 2.9),
        (&config, 2.0, 1.0, 1.08),
        (&config, 4.5, 1.0, 0.92),
        (&config, 3.0, 1.06, 1.0),
        (&by_box, 3.0, 1.06, 1.06),
        (&by_box, 3.0, 1.3, 1.08),
    ];
    for (config, expected_m, widened, ratio) in cases {
        let found = grown(config.clone(), expected_m, widened);
        assert!(near(found, ratio), "{expected_m} m, {widened}: {found} instead of {ratio}");
    }
}

#[test]
fn who_is_too_small_or_beyond_the_image_is_not_learnt() {
    for head in [place(15.0, 0.0), place(3.0, 1.8)] {
        let mut detector = taught(Config::default(), head);
        let (found, funnel) = near(&mut detector, &World::at(head).frame(), head);
        assert_eq!((found, funnel.count("appearance: not learnt yet")), (None, 1), "{head}");
    }
}

/// Returns ten samples of one number with this value.
fn ten_samples(value: f32) -> Samples {
    let mut samples = Samples::default();
    samples.clear(1);
    (0..10).for_each(|_| samples.add(&[value]));
    samples
}

#[test]
fn a_number_that_never_changed_does_not_decide_alone() {
    // Both deviations are the least one: ((v - 10)^2 - (v - 40)^2) / (2 sigma^2).
    for (min_sigma, at) in [(1.0, 39.0_f32), (5.0, 39.0), (5.0, 20.0)] {
        let [other, person] = [10.0, 40.0].map(|mean| (at - mean).powi(2));
        let expected = (other - person) / (2.0 * (min_sigma as f32).powi(2));
        let mut appearance = Appearance::blank(1);
        appearance.learn(&ten_samples(40.0), &ten_samples(10.0), 0.0, min_sigma);
        let found = appearance.confidence(&[at]);
        assert!((found - expected).abs() < 1e-3 * expected.abs(), "{found} {expected}");
    }
}

#[test]
fn the_board_that_hides_a_person_is_not_learned_unless_a_rule_learns_everything() {
    let head = place(3.0, 0.0);
    let hidden = World { board: Some((1.5, SIZE.0)), ..World::at(head) }.frame();
    let printed = Config {
        learning: Learning::new(Everything),
        depth_filter: false,
        min_confidence: 0.5,
        ..Config::default()
    };
    for (config, takes_the_board) in [(Config::default(), false), (printed, true)] {
        let mut detector = taught(config, head);
        assert_eq!(near(&mut detector, &hidden, head).0, None);
        learn_often(&mut detector, &hidden, head);
        assert_eq!(near(&mut detector, &hidden, head).0.is_some(), takes_the_board);
    }
    let mut detector = taught(Config::default(), head);
    learn_often(&mut detector, &hidden, head);
    let (found, funnel) = near(&mut detector, &World::at(head).frame(), head);
    assert!(found.is_some(), "the person is still known: {funnel:?}");
}

/// Lets a detector learn the same frame twenty times.
fn learn_often(detector: &mut Compressive, frame: &Frame, head: Point3<f64>) {
    for _ in 0..20 {
        detector.learn(frame, &[track(head, true)]).expect("it learns");
    }
}

/// A rule that learns from every frame.
#[derive(Debug)]
struct Everything;

impl LearningRule for Everything {
    fn memory(
        &self,
        config: &Config,
        _: &Track,
        _: Option<(Rect, f32)>,
        is_new: bool,
    ) -> Option<f64> {
        Some(if is_new { 0.0 } else { config.memory })
    }

    fn ignores_depth(&self) -> bool {
        true
    }
}

#[test]
fn the_first_frame_counts_fully_and_in_the_public_code_by_a_seventh() {
    let [fully, by_a_seventh] = [0.0, 0.85].map(|memory| {
        let mut appearance = Appearance::blank(1);
        appearance.learn(&ten_samples(40.0), &ten_samples(10.0), memory, 1.0);
        appearance.person(0).expect("a person").0
    });
    assert_eq!(fully, 40.0);
    assert!((by_a_seventh - 6.0).abs() < 1e-4, "{by_a_seventh}");
}

#[test]
fn the_deviation_is_updated_with_the_mean_from_before() {
    let mut samples = Samples::default();
    samples.clear(1);
    [3.0, 5.0].iter().for_each(|v| samples.add(&[*v]));
    let mut appearance = Appearance::blank(1);
    appearance.learn(&samples, &samples, 0.5, 0.1);
    let (mean, sigma) = appearance.person(0).unwrap();
    let expected = (0.5 * 1.0 + 0.5 * 1.0 + 0.25 * 16.0_f32).sqrt();
    assert_eq!(mean, 2.0);
    assert!((sigma - expected).abs() < 1e-6, "{sigma} {expected}");
}

#[test]
fn two_to_four_rectangles_are_drawn_and_four_as_well() {
    let features = Features::draw(300, 4, 1);
    let mut counts = [0; 5];
    for list in features.lists() {
        counts[list.len()] += 1;
    }
    assert_eq!(counts[..2], [0, 0]);
    assert_eq!(counts[2..].iter().sum::<usize>(), 300);
    assert!(counts[2..].iter().all(|count| *count > 60), "{counts:?}");
}

#[test]
fn rectangles_lie_inside_and_are_a_twentieth_to_a_half_of_the_box() {
    let features = Features::draw(300, 4, 1);
    let all: Vec<&Rectangle> = features.lists().iter().flatten().collect();
    for sides in [
        all.iter().map(|r| (r.left, r.width)).collect::<Vec<_>>(),
        all.iter().map(|r| (r.top, r.height)).collect(),
    ] {
        assert!(sides.iter().all(|(from, _)| *from >= 0.0));
        assert!(sides.iter().all(|(from, length)| from + length <= 1.0 + 1e-12));
        assert!(sides.iter().all(|(_, length)| (0.05..=0.5).contains(length)));
        assert!(sides.iter().any(|s| s.1 < 0.1) && sides.iter().any(|s| s.1 > 0.45));
        assert!(sides.iter().any(|s| s.0 + s.1 > 0.95), "up to the border");
    }
    let positive = all.iter().filter(|r| r.weight > 0.0).count();
    assert!((0.4..0.6).contains(&(positive as f64 / all.len() as f64)));
}

#[test]
fn a_rectangle_takes_its_part_of_a_box_and_a_pixel_at_least() {
    let rectangle = Rectangle { left: 0.25, top: 0.5, width: 0.5, height: 0.25, weight: 1.0 };
    assert_eq!(rectangle.pixels(40, 20), [10, 10, 30, 15]);
    let narrow = Rectangle { left: 0.98, width: 0.01, ..rectangle };
    assert_eq!(narrow.pixels(10, 20), [9, 10, 10, 15]);
    let line = Rectangle { left: 0.5, width: 0.001, ..rectangle };
    assert_eq!(line.pixels(10, 20), [5, 10, 6, 15]);
    assert_eq!(rectangle.pixels(1, 1), [0, 0, 1, 1]);
}

#[test]
fn people_who_left_are_forgotten() {
    let head = place(3.0, 0.0);
    let mut detector = taught(Config::default(), head);
    let frame = World::at(head).frame();
    detector.learn(&frame, &[]).unwrap();
    let (found, funnel) = near(&mut detector, &frame, head);
    assert_eq!((found, funnel.count("appearance: not learnt yet")), (None, 1));
}

#[test]
fn settings_that_cannot_work_are_refused() {
    let wrong = [
        Config { features: 0, ..Config::default() },
        Config { coarse_step: 1e-9, ..Config::default() },
        Config { memory: 1.0, ..Config::default() },
        Config { negative_to: 0.1, ..Config::default() },
        Config { score: f64::NAN, ..Config::default() },
    ];
    assert!(wrong.into_iter().all(|config| Compressive::new(config, 1).is_err()));
    assert_eq!(Rect::default().area(), 0.0);
}

proptest! {
    #[test]
    fn fast_numbers_are_those_of_the_pixels(
        pixels in prop::collection::vec(any::<u8>(), 40 * 30),
        seed in any::<u64>(), width in 1..40usize, height in 1..30usize,
        x in 0..40usize, y in 0..30usize,
    ) {
        let Some(image) = GreyImage::from_pixels(40, 30, pixels) else {
            return Err(TestCaseError::fail("1200 pixels are 40 by 30"));
        };
        let features = Features::draw(20, 4, seed);
        let integral = Integral::new(&image);
        let scaled = features.scaled(width, height, integral.stride());
        let fits = x + width <= 40 && y + height <= 30;
        prop_assert_eq!(scaled.fits(&integral, x as i64, y as i64), fits);
        if fits {
            let mut numbers = [0.0_f32; 20];
            scaled.measure(&integral, x, y, &mut numbers);
            for (number, list) in numbers.iter().zip(features.lists()) {
                let slow: f64 =
                    list.iter().map(|r| r.of_pixels(&image, x, y, (width, height))).sum();
                prop_assert!((f64::from(*number) - slow).abs() < 1e-2, "{number} {slow}");
            }
        }
    }
}
