//! Hand-weighted networks for re-identification against the vectors of onnxruntime
//! (`make_models.py`).
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::time::Duration;

use serde::Deserialize;
use tagalong_core::RgbImage;
use tagalong_geometry::Rect;
use tagalong_network::{Choices, Convention, EmbeddingNetwork, Limits, PersonNetwork};

/// Output of onnxruntime.
#[derive(Deserialize)]
struct Expected {
    values: Vec<f32>,
}

fn path(name: &str) -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "tests", "models", name].iter().collect()
}

fn network(name: &str) -> EmbeddingNetwork {
    EmbeddingNetwork::load(&path(name), None, &Limits::default()).unwrap()
}

/// The image of `make_models.py`.
fn scene() -> RgbImage {
    RgbImage::from_fn(128, 256, |x, y| {
        let inside = (32..48).contains(&x) && (16..48).contains(&y);
        [0, 1, 2]
            .map(|c| if inside { 230 + 10 * c as u8 } else { ((x + 2 * y + 7 * c) % 40) as u8 })
    })
}

#[test]
fn vectors_equal_those_of_onnxruntime() {
    for (name, convention) in [("osnet", Convention::OsNet), ("omz", Convention::Omz)] {
        let text = fs::read_to_string(path(&format!("{name}.json"))).unwrap();
        let expected: BTreeMap<String, Expected> = serde_json::from_str(&text).unwrap();
        let expected = &expected["output"].values;
        let mut network = network(&format!("{name}.onnx"));
        assert_eq!((network.convention(), convention.name()), (convention, name));
        let vector = network.embed(&scene(), &Rect::new(0.0, 0.0, 128.0, 256.0)).unwrap().unwrap();
        assert_eq!(vector.len(), expected.len(), "{name}");
        for (ours, theirs) in vector.iter().zip(expected) {
            assert!(
                (ours - theirs).abs() <= 1e-4 * theirs.abs().max(1.0),
                "{name}: {ours} {theirs}"
            );
        }
    }
}

/// Red on the left half of an image, blue on the right one.
fn two_people() -> RgbImage {
    RgbImage::from_fn(200, 200, |x, _| if x < 100 { [200, 20, 20] } else { [20, 20, 200] })
}

#[test]
fn the_part_of_the_image_in_the_box_is_described() {
    fn cosine(a: &[f32], b: &[f32]) -> f32 {
        fn dot(a: &[f32], b: &[f32]) -> f32 {
            a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>()
        }
        dot(a, b) / (dot(a, a) * dot(b, b)).sqrt()
    }

    for name in ["osnet.onnx", "omz.onnx"] {
        let mut network = network(name);
        let boxes = [(10.0, 60.0), (120.0, 60.0), (-40.0, 80.0)];
        let [red, blue, outside] = boxes.map(|(x, width)| {
            let found = network.embed(&two_people(), &Rect::new(x, 20.0, width, 150.0)).unwrap();
            found.unwrap()
        });
        assert!(cosine(&red, &blue) < 0.5, "{name}");
        assert!(cosine(&red, &outside) > 0.999, "{name}: the part inside the image counts");
        assert_eq!(network.embed(&two_people(), &Rect::new(300.0, 0.0, 9.0, 9.0)), Ok(None));
    }
}

#[test]
fn other_networks_are_refused_and_the_choice_of_a_convention_is_kept() {
    let limits = Limits::default();
    let why = EmbeddingNetwork::load(&path("yolox.onnx"), None, &limits).err().unwrap();
    assert!(
        why.contains("is no network for re-identification: it has `output` [1, 84, 7]"),
        "{why}"
    );
    let why = PersonNetwork::load(&path("osnet.onnx"), &Choices::default(), &limits).err().unwrap();
    assert!(why.contains("no decoder fits the outputs `output` [1, 24]"), "{why}");
    let chosen = EmbeddingNetwork::load(&path("osnet.onnx"), Some(Convention::Omz), &limits);
    assert_eq!(chosen.unwrap().convention(), Convention::Omz);
}

#[test]
fn a_call_beyond_its_deadline_is_none() {
    let limits = Limits { deadline: Duration::ZERO, ..Limits::default() };
    let mut late = EmbeddingNetwork::load(&path("osnet.onnx"), None, &limits).unwrap();
    assert_eq!(late.embed(&scene(), &Rect::new(0.0, 0.0, 128.0, 256.0)), Ok(None));
}
