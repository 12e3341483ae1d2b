//! The hand-weighted networks of `crates/network/tests` on onnxruntime: the outputs that Python's
//! onnxruntime has. Without the library the tests say that they skip.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and says why not")]

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::{env, fs};

use serde::Deserialize;
use tagalong_core::RgbImage;
use tagalong_network::{Choices, Family, InputSize, Limits, PersonNetwork};
use tagalong_onnxruntime::{LIBRARY, onnxruntime};

/// Output of onnxruntime in Python.
#[derive(Deserialize)]
struct Expected {
    shape: Vec<usize>,
    values: Vec<f32>,
}

fn path(name: &str) -> PathBuf {
    let models = ["..", "..", "crates", "network", "tests", "models", name];
    [env!("CARGO_MANIFEST_DIR")].iter().chain(&models).collect()
}

/// Returns false, and says so, where no library is named.
fn has_library() -> bool {
    let named = env::var_os(LIBRARY).is_some();
    if !named {
        println!("skipped: {LIBRARY} names no library of onnxruntime");
    }
    named
}

fn load(family: Family) -> Result<PersonNetwork, String> {
    let file = path(&format!("{family}.onnx"));
    PersonNetwork::load_with(onnxruntime, &file, &Choices::default(), &Limits::default())
}

/// The image of `make_models.py`.
fn scene() -> RgbImage {
    RgbImage::from_fn(64, 64, |x, y| {
        let inside = (32..48).contains(&x) && (16..48).contains(&y);
        [0, 1, 2]
            .map(|c| if inside { 230 + 10 * c as u8 } else { ((x + 2 * y + 7 * c) % 40) as u8 })
    })
}

#[test]
fn outputs_are_those_of_the_library_in_python() {
    if !has_library() {
        return;
    }
    for family in Family::ALL {
        let text = fs::read_to_string(path(&format!("{family}.json"))).unwrap();
        let expected: BTreeMap<String, Expected> = serde_json::from_str(&text).unwrap();
        let mut network = load(family).unwrap();
        let channels_last = family == Family::MoveNet;
        let input = InputSize { width: 64, height: 64, channels_last };
        let (tensor, _) = family.preparation().apply(&scene(), input).unwrap();
        let outputs = network.run(tensor).unwrap().unwrap();
        for (port, found) in network.about().outputs.iter().zip(&outputs) {
            let expected = &expected[&port.name];
            assert_eq!(found.shape(), expected.shape, "{family}");
            for (ours, theirs) in found.values().iter().zip(&expected.values) {
                assert!((ours - theirs).abs() <= 1e-4 * theirs.abs().max(1.0), "{family}");
            }
        }
        let found = network.find(&scene(), &family.preparation(), 0.5, 0.5).unwrap().unwrap();
        assert_eq!(found.len(), 1, "{family}");
    }
}

#[test]
fn damaged_files_are_refused() {
    if !has_library() {
        return;
    }
    let whole = fs::read(path("yolox.onnx")).unwrap();
    let why = onnxruntime(whole[..whole.len() / 2].to_vec(), &Limits::default()).err().unwrap();
    assert!(why.contains("truncated"), "{why}");
    let mut other = whole;
    // The operator, and its name.
    for at in 0..other.len() - 7 {
        if other[at..].starts_with(b"Sigmoid") {
            other[at] = b'Z';
        }
    }
    let why = onnxruntime(other, &Limits::default()).err().unwrap();
    assert!(why.contains("onnxruntime refuses it"), "{why}");
}

#[test]
fn without_a_library_the_error_says_how_to_name_it() {
    // One may be found that no variable names.
    let Err(why) = load(Family::Yolox) else { return };
    assert!(why.contains("ORT_DYLIB_PATH"), "{why}");
}
