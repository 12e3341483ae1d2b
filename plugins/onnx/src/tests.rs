use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::{Matrix5, Vector2, Vector3};
use tagalong_config::{Context, OrAuto, parse_settings};
use tagalong_core::{
    Capabilities, DepthImage, Detection, Detector, DiffDrive, EgoMotion, Estimate, Frame, Funnel,
    GreyImage, Images, Person, Query, RgbImage, Stamp, Track, TrackId,
};
use tagalong_geometry::{Camera, Extent, HEAD_RADIUS_M, Pinhole, Rect};
use tagalong_network::{Colours, Family, Fit, LimitSettings};
use tagalong_vision::{BoxSettings, BoxedBody};

use super::config::Thresholds;
use super::*;

const EVERYWHERE: Query<'_> = Query::Discover { occupied: &[] };
/// The whole body in the image: 96 x 192 pixels, as the networks of the tests find in a square
/// image of 384 pixels.
const BODY: Rect = Rect::new(192.0, 96.0, 96.0, 192.0);

/// Folder of the hand-weighted networks; each finds an upright bright blob.
fn models() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "..", "..", "crates", "network", "tests", "models"]
        .iter()
        .collect()
}

fn context() -> Context {
    let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
    Context::new(1, models(), wheels)
}

fn config(family: Family) -> Config {
    Config { model: format!("{family}.onnx"), ..Config::default() }
}

#[test]
fn it_discovers_and_tracks_by_each_frame_alone() {
    let detector = detector(config(Family::Yolox));
    let Capabilities { discovers, tracks, weighs, .. } = detector.capabilities();
    assert_eq!((discovers, tracks, weighs, detector.remembers()), (true, true, false, false));
}

/// They share what a network found in a frame by their settings.
#[test]
fn detectors_with_other_settings_have_answers_of_their_own() {
    let frame = frame(1, 240);
    let mut first = detector(config(Family::Yolox));
    let found = detect(&mut first, &frame);
    let mut blind = detector(Config { classes: vec![1], ..config(Family::Yolox) });
    assert_eq!((found.len(), detect(&mut blind, &frame).len()), (1, 0));
    assert_eq!(detect(&mut first, &frame).len(), 1);
}

/// Returns the settings for boxes that enclose this.
fn of_boxes(body: BoxedBody, family: Family) -> Config {
    let boxes = BoxSettings { body, ..BoxSettings::default() };
    Config { boxes, ..config(family) }
}

fn detector(config: Config) -> Onnx {
    Onnx::new(config, &context()).unwrap()
}

fn camera() -> Arc<Camera> {
    Arc::new(Camera::mounted(Pinhole::centred(300.0, 384, 384), 384, 384, 1.0, 0.0, 0.0))
}

/// Returns an image with a blob of this brightness in place of the body.
fn image(brightness: u8) -> RgbImage {
    RgbImage::from_fn(384, 384, |x, y| {
        let inside = (192..288).contains(&x) && (96..288).contains(&y);
        if inside { [brightness; 3] } else { [10; 3] }
    })
}

fn frame_of(index: u64, images: Images) -> Frame {
    Frame::new(index, Stamp::from_nanos(index * 100), camera(), EgoMotion::at_rest(0.1), images)
}

fn frame(index: u64, brightness: u8) -> Frame {
    let colour = Some(Arc::new(image(brightness)));
    frame_of(index, Images { colour, ..Images::default() })
}

fn detect(detector: &mut Onnx, frame: &Frame) -> Vec<Detection> {
    detector.detect(frame, &EVERYWHERE, &mut Funnel::default()).unwrap()
}

#[test]
fn it_conforms() {
    tagalong_conformance::assert_conforms(register);
}

#[test]
fn every_family_finds_the_person_and_the_place() {
    for family in Family::ALL {
        let mut whole = detector(of_boxes(BoxedBody::FullBox, family));
        let found = detect(&mut whole, &frame(1, 240));
        assert_eq!(found.len(), 1, "{family}");
        let image = found[0].image.unwrap();
        assert_eq!(image.extent, Extent::FullBody);
        assert!(image.rect.iou(&BODY) > 0.97, "{family}: {image:?}");
        let joints = found[0].joints.as_ref();
        assert_eq!(joints.is_some(), family == Family::MoveNet, "{family}");
        for (name, joint) in joints.iter().flat_map(|joints| joints.iter()) {
            // Joints lie on the border of the body.
            let around = Rect::new(BODY.x - 1.0, BODY.y - 1.0, BODY.width + 2.0, BODY.height + 2.0);
            assert!(around.contains(joint.at), "{name:?} in pixels of the image: {joint:?}");
        }
        let upper = detect(&mut detector(config(family)), &frame(1, 240)).remove(0);
        assert!(upper.rect().unwrap().iou(&BODY.upper_body_of_standing(1.7)) > 0.95, "{family}");
        // 1.7 m in 192 pixels of a lens of 300.
        let ahead_m = camera().depth_of(&upper.position) - HEAD_RADIUS_M;
        assert!((ahead_m - 300.0 * 1.7 / 192.0).abs() < 0.05, "{family}: {ahead_m}");
        assert!(detect(&mut whole, &frame(1, 30)).is_empty(), "{family}");
    }
}

#[test]
fn depth_beats_the_size_of_the_box() {
    let depth = Some(Arc::new(DepthImage::filled(384, 384, 2.0)));
    let images = Images { colour: Some(Arc::new(image(240))), depth, ..Images::default() };
    let found = detect(&mut detector(config(Family::Yolox)), &frame_of(1, images)).remove(0);
    assert!((camera().depth_of(&found.position) - 2.0 - HEAD_RADIUS_M).abs() < 1e-6);
    assert!(found.covariance[(0, 0)].sqrt() < 0.15);
}

#[test]
fn grey_images_do_as_well() {
    let bright = image(240);
    let grey = Some(Arc::new(GreyImage::from_fn(384, 384, |x, y| bright.row(y)[x][0])));
    let found = detect(
        &mut detector(config(Family::YoloV8)),
        &frame_of(1, Images { grey, ..Images::default() }),
    );
    assert_eq!(found.len(), 1);
}

fn track(confirmed: bool) -> Track {
    let found = detect(&mut detector(config(Family::Yolox)), &frame(1, 240)).remove(0);
    let person = Person { position: found.position, velocity: Vector2::zeros() };
    let region = found.rect().unwrap();
    let estimate = Estimate::new(person, Matrix5::identity() * 0.01, region);
    Track::new(TrackId(1), estimate, 2.0).with_confirmed(confirmed).with_age(3)
}

/// The scores of the networks rise from 0 to 1 around a brightness of 0.7.
#[test]
fn a_weak_box_is_the_person_of_a_confirmed_track_alone() {
    let mut detector = detector(config(Family::Yolox));
    let weak = frame(1, 170);
    let mut elsewhere = track(true);
    elsewhere.estimate.person.position += Vector3::new(0.0, 3.0, 0.0);
    elsewhere.estimate.region.x -= 200.0;
    for (query, expected) in [
        (EVERYWHERE, (0, 1)),
        (Query::Track(&track(false)), (0, 1)),
        (Query::Track(&track(true)), (1, 0)),
        (Query::Track(&elsewhere), (0, 0)),
    ] {
        let mut funnel = Funnel::default();
        let found = detector.detect(&weak, &query, &mut funnel).unwrap();
        assert_eq!((found.len(), funnel.count("network: score")), expected);
    }
}

/// A network that is never sure starts tracks by its own threshold, in a track manager that starts
/// them from zero on.
#[test]
fn the_threshold_of_newcomers_is_the_zero_of_scores() {
    fn score(discover_score: f64, brightness: u8) -> Option<f64> {
        let config = Config { discover_score, ..config(Family::Yolox) };
        let found = detect(&mut detector(config), &frame(1, brightness));
        found.first().map(|detection| detection.score)
    }

    let by_default = score(0.5, 240).unwrap();
    assert!((score(0.2, 240).unwrap() - by_default - 4.0_f64.ln()).abs() < 1e-6);
    assert_eq!(score(0.5, 170), None);
    let weak = score(0.2, 170).unwrap();
    assert!((0.0..1.5).contains(&weak), "{weak}");
    assert!(score(0.2, 160).is_none_or(|score| score >= 0.0));
}

#[test]
fn thresholds_are_those_of_the_family_unless_they_are_set() {
    fn of(config: Config, family: Family) -> [f64; 2] {
        let Thresholds { discover, track } = config.thresholds(family);
        [discover, track]
    }

    assert_eq!(of(Config::default(), Family::Yolox), [0.5, 0.2]);
    assert_eq!(of(Config::default(), Family::MoveNet), [0.2, 0.4 * 0.2]);
    let set = Config { discover_score: 0.0, ..Config::default() };
    assert_eq!(of(set, Family::Yolox), [0.0, 0.0]);
    let both = Config { discover_score: 0.6, track_score: 0.1, ..Config::default() };
    assert_eq!(of(both, Family::MoveNet), [0.6, 0.1]);
}

#[test]
fn a_config_without_a_model_says_so_in_the_funnel() {
    let mut funnel = Funnel::default();
    let frame = frame(1, 240);
    let mut none = Onnx::new(Config::default(), &context()).unwrap();
    assert!(none.detect(&frame, &EVERYWHERE, &mut funnel).unwrap().is_empty());
    assert_eq!(funnel.count("no model"), 1);
}

#[test]
fn the_preparation_is_that_of_the_family_but_for_the_settings() {
    fn prepare(config: Config) -> tagalong_network::Preparation {
        config.preparation(Family::NanoDet).unwrap()
    }
    assert_eq!(prepare(Config::default()), Family::NanoDet.preparation());
    let rgb = prepare(Config { colours: OrAuto::Chosen(Colours::Rgb), ..Config::default() });
    assert_eq!((rgb.colours, rgb.mean), (Colours::Rgb, [123.675, 116.28, 103.53]));
    let own = prepare(Config {
        fit: OrAuto::Chosen(Fit::TopLeft),
        padding: 0.0,
        mean: vec![1.0, 2.0, 3.0],
        deviation: vec![4.0; 3],
        ..Config::default()
    });
    assert_eq!((own.fit, own.padding, own.colours), (Fit::TopLeft, 0.0, Colours::Bgr));
    assert_eq!((own.mean, own.deviation), ([1.0, 2.0, 3.0], [4.0; 3]));
}

#[test]
fn settings_of_boxes_and_words_stand_beside_the_others() {
    fn read(text: &str) -> Result<Config, String> {
        let value = toml::de::DeValue::parse(text).unwrap();
        parse_settings::<Config>(Some(value)).map_err(|error| error.message)
    }

    let text = "{ family = 'rt-detr', colours = 'auto', fit = 'top-left', height_m = 1.6 }";
    let expected = Config {
        family: OrAuto::Chosen(Family::RtDetr),
        fit: OrAuto::Chosen(Fit::TopLeft),
        boxes: BoxSettings { height_m: 1.6, ..BoxSettings::default() },
        ..Config::default()
    };
    assert_eq!(read(text), Ok(expected));
    let why = read("{ hight_m = 1.6 }").unwrap_err();
    assert!(why.contains("did you mean `height_m`?"), "{why}");
    let why = read("{ family = 'yolov9' }").unwrap_err();
    assert!(why.contains("did you mean `yolov8`?"), "{why}");
}

fn message(config: Config) -> String {
    Onnx::new(config, &context()).err().unwrap().to_string()
}

#[test]
fn bad_files_are_named_with_the_reason() {
    let why = message(Config { model: "none.onnx".into(), ..Config::default() });
    let tried = models().join("none.onnx").display().to_string();
    assert!(why.starts_with(&format!("model file `{tried}`: cannot be read")), "{why}");
    let why = message(Config { model: "yolox.json".into(), ..Config::default() });
    assert!(why.contains("yolox.json`: it is truncated or no ONNX file"), "{why}");
    let wrong = Config { family: OrAuto::Chosen(Family::RfDetr), ..config(Family::Yolox) };
    assert!(message(wrong).contains("is not of the family rf-detr"));
    let limits = LimitSettings { max_operators: 2, ..LimitSettings::default() };
    let small = Config { limits, ..config(Family::Yolox) };
    assert!(message(small).contains("raise `max_operators`"));
}

#[test]
fn each_setting_that_cannot_work_is_named() {
    let late = LimitSettings { deadline_s: 0.0, ..LimitSettings::default() };
    for (key, config) in [
        ("size", Config { size: vec![640], ..Config::default() }),
        ("size", Config { size: vec![640, 0], ..Config::default() }),
        ("mean", Config { mean: vec![1.0], ..Config::default() }),
        ("deviation", Config { deviation: vec![0.0; 3], ..Config::default() }),
        ("discover_score", Config { discover_score: 1.5, ..Config::default() }),
        ("deadline_s", Config { limits: late, ..Config::default() }),
    ] {
        let why = message(config);
        assert!(why.starts_with(&format!("`{key}`")), "{why}");
    }
}

#[test]
fn a_late_call_is_counted_and_is_no_error() {
    let limits = LimitSettings { deadline_s: 1e-3, ..LimitSettings::default() };
    let hurried = Config { limits, ..config(Family::Yolox) };
    let mut detector = detector(hurried);
    // Whether a call is late depends on the machine; a frame has people or is counted.
    for index in 1..20 {
        let mut funnel = Funnel::default();
        let frame = frame(index, 240);
        let found = detector.detect(&frame, &EVERYWHERE, &mut funnel).unwrap();
        assert_eq!(found.len() as u64 + funnel.count("network: late"), 1);
    }
}
