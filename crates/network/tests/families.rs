//! Hand-weighted networks of all families against the outputs of onnxruntime (`make_models.py`),
//! and files that are refused.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may fail")]

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use serde::Deserialize;
use tagalong_core::RgbImage;
use tagalong_geometry::Rect;
use tagalong_network::{
    BoxOrder, BoxUnit, Choices, Family, Fit, Limits, PersonNetwork, Preparation, inspect,
};

/// Output of onnxruntime.
#[derive(Deserialize)]
struct Expected {
    shape: Vec<usize>,
    values: Vec<f32>,
}

fn path(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "models", name].iter().collect()
}

fn network(family: Family) -> PersonNetwork {
    let file = path(&format!("{family}.onnx"));
    PersonNetwork::load(&file, &Choices::default(), &Limits::default()).unwrap()
}

fn is_blob(x: usize, y: usize) -> bool {
    (32..48).contains(&x) && (16..48).contains(&y)
}

/// The image of `make_models.py`, with each pixel `scale` times as large.
fn scene(scale: usize) -> RgbImage {
    RgbImage::from_fn(64 * scale, 64 * scale, |x, y| {
        let x = x / scale;
        let y = y / scale;
        [0, 1, 2].map(|c| {
            if is_blob(x, y) { 230 + 10 * c as u8 } else { ((x + 2 * y + 7 * c) % 40) as u8 }
        })
    })
}

/// Files as tools write them, with the families that they are of: decoded in the network, with rows
/// for boxes, as fractions of the image, channels last, open sizes, half precision, the outputs side
/// by side, the score after the class, a row for each cell, no dimension for images, and their numbers
/// in a column.
const LAYOUTS: [(&str, Family); 13] = [
    ("yolox-decoded", Family::Yolox),
    ("yolov8-rows", Family::YoloV8),
    ("yolov8-fractions", Family::YoloV8),
    ("fractions", Family::YoloV10),
    ("yolov8-last", Family::YoloV8),
    ("yolov8-open", Family::YoloV8),
    ("yolov8-half", Family::YoloV8),
    ("nanodet-m-concat", Family::NanoDetM),
    ("score-last", Family::YoloV10),
    ("deepstream", Family::YoloV10),
    ("no-batch", Family::YoloV10),
    ("yolov7", Family::YoloV10),
    ("own-size", Family::MoveNet),
];

/// Returns the networks of all families and layouts, by their names.
fn all_networks() -> impl Iterator<Item = (&'static str, PersonNetwork)> {
    let families = Family::ALL.into_iter().map(|family| (family.name(), family));
    families.chain(LAYOUTS).map(|(name, family)| {
        let open = (name == "yolov8-open").then_some([64, 64]);
        let choices = Choices { size: open, ..Choices::default() };
        let file = path(&format!("{name}.onnx"));
        let network = PersonNetwork::load(&file, &choices, &Limits::default())
            .unwrap_or_else(|why| panic!("{name}: {why}"));
        assert_eq!(network.family(), family, "{name}");
        (name, network)
    })
}

#[test]
fn outputs_equal_those_of_onnxruntime() {
    for (name, mut network) in all_networks() {
        let text = fs::read_to_string(path(&format!("{name}.json"))).unwrap();
        let expected: BTreeMap<String, Expected> = serde_json::from_str(&text).unwrap();
        let input = network.about().input.clone().unwrap();
        assert_eq!((input.width, input.height), (64, 64), "{name}");
        let (tensor, _) = network.family().preparation().apply(&scene(1), input).unwrap();
        let outputs = network.run(tensor).unwrap().unwrap();
        assert_eq!(outputs.len(), expected.len(), "{name}");
        // Half precision has eleven bits; the runtime computes with more.
        let tolerance = if name == "yolov8-half" { 3e-2 } else { 1e-4 };
        for (port, output) in network.about().outputs.iter().zip(&outputs) {
            let Expected { shape, values } = &expected[&port.name];
            assert_eq!(output.shape(), shape, "{name}");
            let pairs = output.values().iter().zip(values);
            let worst = pairs.map(|(ours, theirs)| (ours - theirs).abs()).fold(0.0, f32::max);
            assert!(worst <= tolerance, "{name}, {}: {worst}", port.name);
        }
    }
}

#[test]
fn the_box_is_where_the_blob_is() {
    for (name, mut network) in all_networks() {
        let preparation = network.family().preparation();
        let images = [scene(3), RgbImage::filled(64, 64, [30; 3]), RgbImage::default()];
        let [found, plain, empty] =
            images.map(|image| network.find(&image, &preparation, 0.5, 0.5).unwrap().unwrap());
        assert_eq!(found.len(), 1, "{name}: {found:?}");
        let overlap = found[0].rect.iou(&Rect::new(96.0, 48.0, 48.0, 96.0));
        assert!(overlap > 0.97 && found[0].score > 0.9, "{name}: {:?}", found[0]);
        assert!(plain.is_empty() && empty.is_empty(), "{name}");
    }
}

/// The image is 128 x 64 pixels, so half of the input is padding, or it is stretched.
#[test]
fn boxes_return_from_the_padded_input() {
    for family in [Family::Yolox, Family::YoloV8] {
        let top = if family == Family::Yolox { 16 } else { 0 };
        // 32 x 64 pixels become 16 x 32 in the input, which starts 16 rows lower if centred.
        let image = RgbImage::from_fn(128, 128 - 2 * top, |x, y| {
            let inside = (64..96).contains(&x) && (32..96).contains(&y);
            if inside { [240; 3] } else { [10; 3] }
        });
        let found = network(family).find(&image, &family.preparation(), 0.5, 0.5);
        let found = found.unwrap().unwrap();
        let overlap = found[0].rect.iou(&Rect::new(64.0, 32.0, 32.0, 64.0));
        assert!(overlap > 0.99, "{family}: {found:?}");
    }
}

/// Returns the refusal of these bytes in a file.
fn refusal(bytes: &[u8], choices: &Choices, limits: &Limits) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("network.onnx");
    fs::write(&file, bytes).unwrap();
    let refused = PersonNetwork::load(&file, choices, limits).err();
    refused.expect("it was not refused")
}

#[test]
fn truncated_files_are_refused() {
    let whole = fs::read(path("nanodet.onnx")).unwrap();
    for end in (0..whole.len()).step_by(whole.len() / 23) {
        let why = refusal(&whole[..end], &Choices::default(), &Limits::default());
        assert!(!why.is_empty(), "{end}");
    }
}

/// Files with single bytes changed load or are refused; the process survives all of them.
#[test]
fn files_with_changed_bytes_are_survived() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("network.onnx");
    let mut refused = 0;
    let mut random = 1_u64;
    for round in 0..400 {
        let name = ["yolox.onnx", "rt-detr.onnx", "movenet.onnx", "nanodet.onnx"][round % 4];
        let mut bytes = fs::read(path(name)).unwrap();
        for _ in 0..3 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let at = (random >> 33) as usize % bytes.len();
            bytes[at] = (random >> 24) as u8;
        }
        fs::write(&file, bytes).unwrap();
        refused += usize::from(inspect(&file, None, &Limits::default()).is_err());
    }
    assert!((1..400).contains(&refused), "{refused}");
}

#[test]
fn files_beyond_the_limits_are_refused() {
    let whole = fs::read(path("yolox.onnx")).unwrap();
    let usual = Limits::default();
    for (limits, told) in [
        (Limits { file_bytes: 1000, ..usual }, "at most 1000 are read: raise `max_file_mb`"),
        (Limits { operators: 3, ..usual }, "more than 3 operators"),
        (Limits { tensor_values: 2000, ..usual }, "above 2000 numbers"),
        (Limits { load_deadline: Duration::ZERO, ..usual }, "within 0 s"),
    ] {
        let why = refusal(&whole, &Choices::default(), &limits);
        assert!(why.contains(told), "{why}");
    }
}

#[test]
fn choices_that_do_not_fit_are_refused() {
    let whole = fs::read(path("yolox.onnx")).unwrap();
    let usual = Choices::default();
    for (choices, told) in [
        (
            Choices { family: Some(Family::NanoDet), ..usual.clone() },
            &["not of the family nanodet", "[1, 84, 7]"][..],
        ),
        (Choices { size: Some([320, 320]), ..usual.clone() }, &["fixed size: remove `size`"]),
        (Choices { classes: vec![0, 2], ..usual }, &["2 classes from 0, and no 2"]),
    ] {
        let why = refusal(&whole, &choices, &Limits::default());
        assert!(told.iter().all(|told| why.contains(told)), "{why}");
    }
}

/// Returns the file of YOLOX, of which the first of two classes is that of the blob, with these names
/// in its metadata.
fn with_names(names: &str) -> Vec<u8> {
    fn field(number: u8, bytes: &[u8]) -> Vec<u8> {
        [&[number << 3 | 2, bytes.len() as u8], bytes].concat()
    }

    let entry = [field(1, b"names"), field(2, names.as_bytes())].concat();
    [fs::read(path("yolox.onnx")).unwrap(), field(14, &entry)].concat()
}

#[test]
fn people_are_the_class_that_the_file_calls_so() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("named.onnx");
    for (names, classes, people, why) in [
        ("{0: 'Person', 1: 'helmet'}", vec![], 1, "the blob is a person"),
        ("{0: 'helmet', 1: 'person'}", vec![], 0, "the blob is a helmet"),
        ("{0: 'helmet', 1: 'person'}", vec![0], 1, "the setting is obeyed"),
        ("{0: 'helmet', 1: 'vest'}", vec![0], 1, "no class is called a person"),
    ] {
        fs::write(&file, with_names(names)).unwrap();
        let choices = Choices { classes, ..Choices::default() };
        let mut network = PersonNetwork::load(&file, &choices, &Limits::default()).unwrap();
        let found = network.find(&scene(1), &Family::Yolox.preparation(), 0.5, 0.5);
        assert_eq!(found.unwrap().unwrap().len(), people, "{why}");
    }
    let why =
        refusal(&with_names("{0: 'helmet', 1: 'vest'}"), &Choices::default(), &Limits::default());
    assert!(why.contains("0 helmet, 1 vest") && why.contains("set `classes`"), "{why}");
    let beyond = with_names("{0: 'helmet', 3: 'person'}");
    let why = refusal(&beyond, &Choices::default(), &Limits::default());
    assert!(why.contains("2 classes from 0, and no 3"), "{why}");
}

#[test]
fn the_unit_of_boxes_is_for_families_that_have_several() {
    let whole = fs::read(path("nanodet.onnx")).unwrap();
    let choices = Choices { unit: Some(BoxUnit::Fractions), ..Choices::default() };
    let why = refusal(&whole, &choices, &Limits::default());
    assert!(why.contains("family nanodet") && why.contains("remove `box_unit`"), "{why}");
    // A unit that is set is obeyed: pixels, of which none is within the image.
    let file = path("yolov8-rows.onnx");
    let mut network = PersonNetwork::load(&file, &choices, &Limits::default()).unwrap();
    let found = network.find(&scene(1), &Family::YoloV8.preparation(), 0.5, 0.5).unwrap().unwrap();
    assert!(found[0].rect.x > 1000.0, "{found:?}");
}

#[test]
fn lists_of_wide_people_name_the_order_of_corners() {
    let why = wide_person(None).unwrap_err();
    assert!(why.contains("box_order = \"yxyx\""), "{why}");
    let as_set = wide_person(Some(BoxOrder::Xyxy)).unwrap();
    assert!(as_set.width > 1.5 * as_set.height, "{as_set:?}");
    let exchanged = wide_person(Some(BoxOrder::Yxyx)).unwrap();
    assert!((exchanged.width - 4.0 * as_set.height).abs() < 1e-3, "{exchanged:?}");
    let other = Choices { order: Some(BoxOrder::Yxyx), ..Choices::default() };
    let why = PersonNetwork::load(&path("nanodet.onnx"), &other, &Limits::default());
    assert!(why.err().unwrap().contains("remove `box_order`"));
}

/// Returns the box of a wide person after 31 calls with this order of corners.
fn wide_person(order: Option<BoxOrder>) -> Result<Rect, String> {
    // Four times as wide as the input: that makes a person of 16 x 32 pixels a wide one.
    let square = scene(1);
    let wide = RgbImage::from_fn(256, 64, |x, y| square.row(y)[x / 4]);
    let preparation = Preparation { fit: Fit::Stretch, ..Family::YoloV10.preparation() };
    let choices = Choices { order, ..Choices::default() };
    let file = path("yolov10.onnx");
    let mut network = PersonNetwork::load(&file, &choices, &Limits::default()).unwrap();
    let mut found = Vec::new();
    for _ in 0..31 {
        found = network.find(&wide, &preparation, 0.1, 0.5)?.unwrap();
    }
    Ok(found[0].rect)
}

#[test]
fn paths_that_are_no_files_are_refused() {
    fn why(name: &str) -> String {
        inspect(&path(name), None, &Limits::default()).unwrap_err()
    }

    assert!(why("none.onnx").contains("cannot be read"));
    assert!(why("").contains("is a directory"));
    assert!(why("yolox.json").contains("no ONNX file"), "{}", why("yolox.json"));
}

#[test]
fn a_call_beyond_its_deadline_is_none() {
    let limits = Limits { deadline: Duration::ZERO, ..Limits::default() };
    let mut late = PersonNetwork::load(&path("yolox.onnx"), &Choices::default(), &limits).unwrap();
    let image = RgbImage::filled(64, 64, [200; 3]);
    let outcome = late.find(&image, &Family::Yolox.preparation(), 0.5, 0.5);
    assert_eq!(outcome, Ok(None));
}
