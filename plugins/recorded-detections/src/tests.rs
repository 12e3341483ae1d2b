use std::sync::Arc;

use nalgebra::{Matrix5, Point3, Vector2};
use tagalong_config::Context;
use tagalong_core::{
    DepthImage, Detection, Detector, DiffDrive, EgoMotion, Estimate, ExternalDetection, Frame,
    Funnel, Images, Input, Person, Query, Stamp, Track, TrackId,
};
use tagalong_geometry::{Camera, Extent, HEAD_RADIUS_M, Pinhole, Rect};
use tagalong_vision::{BoxSettings, BoxedBody};

use super::*;

const EVERYWHERE: Query<'_> = Query::Discover { occupied: &[] };

fn camera() -> Arc<Camera> {
    Arc::new(Camera::mounted(Pinhole::centred(520.0, 640, 480), 640, 480, 1.4, 0.0, 0.0))
}

fn frame(index: u64, depth_m: Option<f32>) -> Frame {
    let depth = depth_m.map(|metres| Arc::new(DepthImage::filled(640, 480, metres)));
    let images = Images { depth, ..Images::default() };
    Frame::new(index, Stamp::from_nanos(index * 100), camera(), EgoMotion::at_rest(0.1), images)
}

fn context(folder: &std::path::Path) -> Context {
    let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
    Context::new(1, folder.to_owned(), wheels)
}

fn with_boxes(boxes: BoxSettings) -> Config {
    Config { boxes, ..Config::default() }
}

fn of_file(text: &str, config: Config) -> tagalong_core::Result<RecordedDetections> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("det.txt"), text).unwrap();
    RecordedDetections::new(Config { path: "det.txt".into(), ..config }, &context(folder.path()))
}

fn detect(detector: &mut RecordedDetections, frame: &Frame) -> Vec<Detection> {
    detector.detect(frame, &EVERYWHERE, &mut Funnel::default()).unwrap()
}

/// A track manager starts tracks from zero on.
#[test]
fn newcomers_are_judged_by_the_threshold_of_their_detector() {
    fn config(min_score: f64) -> Config {
        Config { min_score, ..Config::default() }
    }

    fn rounded(config: &Config, score: f64) -> f64 {
        (config.score_of(score) * 1e6).round() / 1e6
    }

    assert_eq!(rounded(&config(0.2), 0.2), 0.0);
    assert_eq!(rounded(&config(0.5), 0.8), (4.0_f64.ln() * 1e6).round() / 1e6);
    assert_eq!(config(0.7).score_of(0.7), config(0.5).score_of(0.7), "even odds start tracks");
    let apart = Config { discover_score: Some(0.6), ..config(0.1) };
    assert_eq!(rounded(&apart, 0.6), 0.0);
    assert!(apart.score_of(0.59) < 0.0);
    let below = Config { discover_score: Some(0.05), ..config(0.1) };
    let why = of_file("", below).err().unwrap().to_string();
    assert!(why.contains("`discover_score` must be at least 0.1, as `min_score`"), "{why}");
}

/// Formats a person at this head position as a whole-body box of the file.
fn whole_body(head: Point3<f64>) -> String {
    let upper = camera().upper_body(&head);
    let px_per_m = upper.width / 0.57;
    let width = 0.5 * px_per_m;
    let height = 1.7 * px_per_m;
    let x = upper.centre().x - 0.5 * width;
    let y = upper.y + 0.025 * px_per_m;
    format!("2,-1,{x},{y},{width},{height},0.9,-1,-1,-1\n")
}

#[test]
fn it_conforms() {
    tagalong_conformance::assert_conforms(register);
}

#[test]
fn a_whole_body_becomes_an_upper_body_with_a_place() {
    let head = Point3::new(3.0, 0.4, 1.585);
    let mut detector = of_file(&whole_body(head), Config::default()).unwrap();
    assert!(detect(&mut detector, &frame(1, None)).is_empty(), "it is of frame 2");
    let by_size = &detect(&mut detector, &frame(2, None))[0];
    assert!((by_size.position - head).norm() < 0.05, "{}", by_size.position);
    assert!(by_size.rect().unwrap().iou(&camera().upper_body(&head)) > 0.95);
    assert!(by_size.covariance[(0, 0)].sqrt() > 0.5, "a distance by size is a guess");
    let face_m = (camera().depth_of(&head) - HEAD_RADIUS_M) as f32;
    let by_depth = &detect(&mut detector, &frame(2, Some(face_m)))[0];
    assert!((by_depth.position - head).norm() < 0.02, "{}", by_depth.position);
    assert!(by_depth.covariance[(0, 0)].sqrt() < 0.15);
}

#[test]
fn a_whole_body_can_be_tracked_as_the_box_that_it_is() {
    fn config(body: BoxedBody) -> Config {
        with_boxes(BoxSettings { body, ..BoxSettings::default() })
    }

    let text = whole_body(Point3::new(3.0, 0.4, 1.585));
    let mut square = of_file(&text, config(BoxedBody::Full)).unwrap();
    let mut whole = of_file(&text, config(BoxedBody::FullBox)).unwrap();
    let square = detect(&mut square, &frame(2, None)).remove(0);
    let whole = detect(&mut whole, &frame(2, None)).remove(0);
    let upper = square.image.unwrap();
    let full = whole.image.unwrap();
    assert_eq!((upper.extent, full.extent), (Extent::UpperBody, Extent::FullBody));
    assert!((full.rect.height / full.rect.width - 3.4).abs() < 1e-6, "{full:?}");
    assert_eq!((square.position, square.covariance), (whole.position, whole.covariance));
}

#[test]
fn depth_beats_the_size_and_holes_do_not_count() {
    let head = Point3::new(3.0, 0.0, 1.585);
    let mut detector = of_file(&whole_body(head), Config::default()).unwrap();
    let near = &detect(&mut detector, &frame(2, Some(2.0)))[0];
    assert!((near.position.x - 2.08).abs() < 0.02, "{}", near.position);
    let holes = &detect(&mut detector, &frame(2, Some(f32::NAN)))[0];
    assert!((holes.position - head).norm() < 0.05, "{}", holes.position);
}

#[test]
fn low_scores_are_dropped_and_counted() {
    let text = "1,-1,100,100,50,170,0.2\n1,-1,300,100,50,170,0.8\n";
    let even = Config { min_score: 0.5, ..Config::default() };
    let mut detector = of_file(text, even).unwrap();
    let mut funnel = Funnel::default();
    let found = detector.detect(&frame(1, None), &EVERYWHERE, &mut funnel).unwrap();
    assert_eq!((found.len(), funnel.count("recorded score")), (1, 1));
    assert!((found[0].score - 4.0_f64.ln()).abs() < 1e-9, "log-odds of 0.8");
    let log_odds = Config {
        score: ScoreScale::LogOdds,
        min_score: -5.0,
        discover_score: Some(0.0),
        ..Config::default()
    };
    let mut detector = of_file(text, log_odds).unwrap();
    assert_eq!(detect(&mut detector, &frame(1, None))[0].score, 0.2);
}

#[test]
fn boxes_come_from_the_log_unless_a_file_has_them() {
    let of_log = RecordedDetections::new(Config::default(), &context(".".as_ref())).unwrap();
    let of_file = of_file("1,-1,100,100,50,170,0.2\n", Config::default()).unwrap();
    let inputs = [of_log.capabilities().inputs, of_file.capabilities().inputs];
    assert_eq!(inputs.map(|inputs| inputs.requires(Input::Detections)), [true, false]);
    assert!(
        inputs.iter().all(|inputs| inputs.uses(Input::Depth) && !inputs.requires(Input::Depth))
    );
    assert!(of_file.capabilities().discovers && of_file.capabilities().tracks);
}

#[test]
fn recorded_positions_of_the_log_are_taken_as_they_are() {
    let mut detector = RecordedDetections::new(Config::default(), &context(".".as_ref())).unwrap();
    let head = Point3::new(2.5, -0.3, 1.6);
    let recorded = ExternalDetection::at(head, 0.9);
    let frame = frame(1, None).with_recorded(Some(vec![recorded]));
    let found = detect(&mut detector, &frame);
    assert_eq!(found[0].position, head);
    assert_eq!(found[0].rect().unwrap(), camera().upper_body(&head));
}

#[test]
fn a_position_outside_of_the_image_is_kept_without_a_box_if_the_settings_say_so() {
    let behind = Point3::new(-2.5, 0.3, 1.6);
    let recorded = ExternalDetection::at(behind, 0.9);
    let frame = frame(1, None).with_recorded(Some(vec![recorded]));
    let [without, found] = [false, true].map(|outside_image| {
        let config = Config { outside_image, ..Config::default() };
        detect(&mut RecordedDetections::new(config, &context(".".as_ref())).unwrap(), &frame)
    });
    assert!(without.is_empty());
    assert_eq!((found[0].position, found[0].image), (behind, None));
}

#[test]
fn a_log_that_is_not_read_for_boxes_is_told_in_the_funnel() {
    let mut detector = RecordedDetections::new(Config::default(), &context(".".as_ref())).unwrap();
    let mut funnel = Funnel::default();
    assert!(detector.detect(&frame(1, None), &EVERYWHERE, &mut funnel).unwrap().is_empty());
    assert_eq!(funnel.count("nothing recorded"), 1);
}

#[test]
fn a_search_near_a_track_finds_the_right_box_first() {
    let left = Point3::new(3.0, 0.5, 1.585);
    let right = Point3::new(3.0, -0.4, 1.585);
    let text = whole_body(left) + &whole_body(right);
    let mut detector = of_file(&text, Config::default()).unwrap();
    let person = Person { position: right, velocity: Vector2::zeros() };
    let region = camera().upper_body(&right);
    let estimate = Estimate::new(person, Matrix5::identity() * 0.01, region);
    let track = Track::new(TrackId(1), estimate, 2.0).with_age(3);
    let near = Query::Track(&track);
    let found = detector.detect(&frame(2, None), &near, &mut Funnel::default()).unwrap();
    assert_eq!(found.len(), 1);
    assert!((found[0].position - right).norm() < 0.1, "{}", found[0].position);
}

#[test]
fn mistakes_are_named_by_file_and_line() {
    fn message(text: &str) -> String {
        of_file(text, Config::default()).err().unwrap().to_string()
    }

    assert!(message("1,-1,5,5,9,9,1\n2,-1,5,5\n").contains("det.txt`, line 2: 4 fields"));
    assert!(message("0,-1,5,5,9,9,1\n").contains("numbered from 1"));
    assert!(message("1700000000,-1,5,5,9,9,1\n").contains("up to 1000000000"));
    assert!(message("1,-1,5,x,9,9,1\n").contains("`y` is `x`"));
    assert!(message("1,-1,5,5,0,9,1\n").contains("without area"));
    let config = Config { path: "none.txt".into(), ..Config::default() };
    let error = RecordedDetections::new(config, &context("nowhere".as_ref())).err().unwrap();
    assert!(error.to_string().contains("none.txt"), "{error}");
    let wrong = with_boxes(BoxSettings { height_m: 0.0, ..BoxSettings::default() });
    assert!(RecordedDetections::new(wrong, &context(".".as_ref())).is_err());
    assert_eq!(Rect::default().area(), 0.0);
}

fn track_at(head: Point3<f64>) -> Track {
    let person = Person { position: head, velocity: Vector2::zeros() };
    let region = camera().upper_body(&head);
    let estimate = Estimate::new(person, Matrix5::identity() * 0.01, region);
    Track::new(TrackId(1), estimate, 2.0).with_age(3)
}

/// Returns true if a search near a track 3 m ahead finds a position from the log.
fn finds_near(at: Point3<f64>, config: Config) -> bool {
    let mut detector = RecordedDetections::new(config, &context(".".as_ref())).unwrap();
    let recorded = ExternalDetection::at(at, 0.9);
    let frame = frame(1, None).with_recorded(Some(vec![recorded]));
    let track = track_at(Point3::new(3.0, 0.0, 1.6));
    !detector.detect(&frame, &Query::Track(&track), &mut Funnel::default()).unwrap().is_empty()
}

#[test]
fn near_a_track_is_what_is_near_on_the_floor() {
    fn at(x: f64, y: f64) -> bool {
        finds_near(Point3::new(x, y, 1.6), Config::default())
    }

    assert!(at(3.79, 0.0) && at(3.0, -0.79) && !at(3.81, 0.0) && !at(3.6, 0.6));
    assert!(finds_near(Point3::new(3.0, 0.0, 1.2), Config::default()), "whatever the height");
    // The same direction, and so nearly the same box, a metre behind.
    assert!(!at(4.0, 0.0), "a place that is told is no guess");
    let vague = Config { sigma_position_m: 0.5, ..Config::default() };
    assert!(finds_near(Point3::new(4.0, 0.0, 1.6), vague.clone()), "it overlaps");
    assert!(!finds_near(Point3::new(4.0, 1.0, 1.6), vague));
}

#[test]
fn the_most_like_of_several_near_a_track_comes_first() {
    let mut detector = RecordedDetections::new(Config::default(), &context(".".as_ref())).unwrap();
    let heads = [3.5, 3.1, 3.3].map(|x| Point3::new(x, 0.0, 1.6));
    let recorded = heads.map(|head| ExternalDetection::at(head, 0.9));
    let frame = frame(1, None).with_recorded(Some(recorded.to_vec()));
    let track = track_at(Point3::new(3.0, 0.0, 1.6));
    let found = detector.detect(&frame, &Query::Track(&track), &mut Funnel::default()).unwrap();
    assert_eq!(found.iter().map(|d| d.position.x).collect::<Vec<_>>(), [3.1, 3.3, 3.5]);
}

#[test]
fn boxes_without_a_score_are_certain_and_blank_lines_are_none() {
    fn refused(text: &str) -> bool {
        of_file(text, Config::default()).is_err()
    }

    let text = "\n 1 , -1, 100, 100, 50, 170\n\n1,-1,300,100,50,170,0.8\n";
    let even = Config { min_score: 0.5, ..Config::default() };
    let mut detector = of_file(text, even).unwrap();
    let found = detect(&mut detector, &frame(1, None));
    let scores: Vec<f64> = found.iter().map(|d| d.score).collect();
    let sure = (0.999_f64 / 0.001).ln();
    assert!((scores[0] - sure).abs() < 1e-9 && (scores[1] - 4.0_f64.ln()).abs() < 1e-9);
    assert!(
        refused("1.5,-1,5,5,9,9,1") && refused("1,-1,5,5,-9,9,1") && refused("1,-1,5,5,9,-9,1")
    );
    assert!(refused("1,-1,5,5,9,inf,1") && refused("-1,-1,5,5,9,9,1"));
}

#[test]
fn who_is_outside_of_the_image_is_dropped_and_counted() {
    let text = "1,-1,-400,100,50,170,0.9\n1,-1,300,100,50,170,0.3\n1,-1,-20,100,50,170,0.9\n";
    let mut detector = of_file(text, Config::default()).unwrap();
    let mut funnel = Funnel::default();
    let found = detector.detect(&frame(1, None), &EVERYWHERE, &mut funnel).unwrap();
    assert_eq!((found.len(), funnel.count("outside")), (2, 1), "0.3 is enough");
    assert_eq!(funnel.entries()[0].example, Some(Rect::new(-400.0, 100.0, 50.0, 170.0)));
}

#[test]
fn a_square_of_head_and_shoulders_is_taken_as_it_is() {
    let head = Point3::new(3.0, 0.4, 1.585);
    let square = camera().upper_body(&head);
    let text = format!("1,-1,{},{},{},{},0.9", square.x, square.y, square.width, square.height);
    let upper = BoxSettings { body: BoxedBody::Upper, ..BoxSettings::default() };
    let mut detector = of_file(&text, with_boxes(upper)).unwrap();
    let found = detect(&mut detector, &frame(1, None)).remove(0);
    assert_eq!(found.rect().unwrap(), square);
    assert!((found.position - head).norm() < 1e-3, "{}", found.position);
    let ahead_m = camera().depth_of(&found.position);
    let sigma = found.covariance[(0, 0)].sqrt();
    assert!((sigma - 0.2 * (ahead_m - HEAD_RADIUS_M)).abs() < 1e-3, "a fifth: {sigma}");
}

/// The face is 14 cm high and wide, its middle 14 cm below the upper edge of the square: in a box of
/// head and shoulders, which shows no trunk.
#[test]
fn the_depth_is_that_of_the_face_alone() {
    let head = Point3::new(3.0, 0.0, 1.585);
    let square = camera().upper_body(&head);
    let Rect { x, y, width, height } = square;
    let upper = BoxSettings { body: BoxedBody::Upper, ..BoxSettings::default() };
    let config = Config { boxes: upper, ..Config::default() };
    let mut detector =
        of_file(&format!("2,-1,{x},{y},{width},{height},0.9,-1,-1,-1\n"), config).unwrap();
    let px_per_m = square.width / 0.57;
    let x = square.centre().x;
    let y = square.y + 0.14 * px_per_m;
    for (half_m, inside, outside, expected_m, tolerance_m, why) in [
        (0.085, 2.0, 5.0, 2.08, 0.02, "nothing beside it is looked at"),
        (0.03, f32::NAN, 2.0, 2.08, 0.02, "and its edge is"),
        (0.06, 5.0, 2.0, 5.08, 0.02, "most of it counts"),
        (0.085, f32::NAN, 2.0, 3.0, 0.05, "holes do not count"),
    ] {
        let half = half_m * px_per_m;
        let depth = DepthImage::from_fn(640, 480, |u, v| {
            let u = u as f64 + 0.5 - x;
            let v = v as f64 + 0.5 - y;
            if u.abs() < half && v.abs() < half { inside } else { outside }
        });
        let images = Images { depth: Some(Arc::new(depth)), ..Images::default() };
        let frame =
            Frame::new(2, Stamp::from_nanos(200), camera(), EgoMotion::at_rest(0.1), images);
        let seen_m = detect(&mut detector, &frame).remove(0).position.x;
        assert!((seen_m - expected_m).abs() < tolerance_m, "{why}: {seen_m}");
    }
}

#[test]
fn each_setting_that_cannot_work_is_named() {
    for (key, config) in [
        ("height_m", with_boxes(BoxSettings { height_m: f64::INFINITY, ..BoxSettings::default() })),
        ("sigma_px", with_boxes(BoxSettings { sigma_px: 0.0, ..BoxSettings::default() })),
        (
            "sigma_depth_m",
            with_boxes(BoxSettings { sigma_depth_m: -1.0, ..BoxSettings::default() }),
        ),
        (
            "sigma_distance",
            with_boxes(BoxSettings { sigma_distance: f64::NAN, ..BoxSettings::default() }),
        ),
        ("sigma_position_m", Config { sigma_position_m: 0.0, ..Config::default() }),
    ] {
        let error = RecordedDetections::new(config, &context(".".as_ref())).err().unwrap();
        assert!(error.to_string().starts_with(&format!("`{key}`")), "{error}");
    }
}
