//! `[appearance]` with the hand-weighted network of `crates/network/tests`.

use std::path::PathBuf;
use std::sync::Arc;

use tagalong_core::{Frame, Images, RgbImage};

use super::doubles::{PLAIN, World, frame, person};
use crate::{FrameReport, Pipeline};

const RED: [u8; 3] = [200, 20, 20];
const BLUE: [u8; 3] = [20, 20, 200];

fn model(name: &str) -> String {
    let path: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "..", "network", "tests", "models", name].iter().collect();
    path.display().to_string()
}

fn coloured(index: u64, left: [u8; 3], right: [u8; 3]) -> Frame {
    let colour = RgbImage::from_fn(640, 480, |x, _| if x < 320 { left } else { right });
    let images = Images { colour: Some(Arc::new(colour)), ..Images::default() };
    let blank = frame(index, index as f64 * 0.1);
    Frame::new(index, blank.stamp, blank.camera, blank.motion, images)
}

fn config(appearance: &str, sections: &str) -> String {
    format!("{PLAIN}[appearance]\nmodel = {:?}\n{appearance}\n{sections}\n", model("osnet.onnx"))
}

/// Frame 9 shows one person between two who are known, nearer to the right one, in the colour of
/// the left one.
#[test]
fn vectors_say_whose_detection_it_is_where_places_do_not() {
    fn seen(appearance: &str, weight: f64) -> Vec<u32> {
        let both = (0..8).map(|_| vec![person(3.0, 0.5), person(3.0, -0.5)]);
        let world = World::of(both.chain([vec![person(3.0, -0.1)]]));
        let sections =
            format!("[reidentification]\nremember_s = 9.0\nassociation_weight = {weight:?}");
        let config = format!(
            "associator.config.gate = 1e3\nassociator.config.gate_m = 2.0\n{}",
            config(appearance, &sections)
        );
        let mut pipeline = world.pipeline(&config);
        let reports = (1..=9).map(|index| {
            let right = if index == 9 { RED } else { BLUE };
            pipeline.step(coloured(index, RED, right)).unwrap()
        });
        let last = reports.last().unwrap();
        let is_seen = last.tracks.iter().filter(|track| track.seen);
        is_seen.map(|track| track.id.0).collect::<Vec<_>>()
    }

    let [left, right] = [1, 2];
    assert_eq!(seen("", 0.0), [right]);
    assert_eq!(seen("", 50.0), [left]);
}

/// The numbers of the tracks in the last frame: a person in red left, and a person in `colour`
/// comes.
fn returned(colour: [u8; 3]) -> Vec<u32> {
    let config = config("", "[reidentification]\nremember_s = 30.0");
    let mut pipeline = World::of((0..60).map(|i| match i {
        0..20 | 40.. => vec![person(3.0, 0.0)],
        _ => vec![],
    }))
    .pipeline(&config);
    let reports = (1..=60).map(|index| {
        let colour = if index <= 20 { RED } else { colour };
        pipeline.step(coloured(index, colour, colour)).unwrap()
    });
    reports.last().unwrap().tracks.iter().map(|track| track.id.0).collect()
}

#[test]
fn a_person_who_returns_is_known_by_the_vector() {
    assert_eq!(returned(RED), [1]);
    assert_ne!(returned(BLUE), [1]);
}

fn ride(appearance: &str) -> Vec<FrameReport> {
    let world = World::of((0..30).map(|_| vec![person(3.0, 0.0).with_score(5.0)]));
    let config = config(appearance, "[controller]\nplugin = 'drive'");
    let mut pipeline = world.pipeline(&config);
    (1..=30).map(|index| pipeline.step(coloured(index, RED, RED)).unwrap()).collect()
}

#[test]
fn the_target_lock_compares_vectors() {
    let reports = ride("");
    let lock = reports[29].lock.as_ref().unwrap();
    let differences = lock.likeness[0].differences;
    assert_eq!((differences.torso, differences.texture), (None, None));
    assert!(differences.vector.unwrap() < 1e-6, "{differences:?}");
    assert_eq!(reports[29].funnel.count("appearance: no vector"), 0);
}

/// Whether a call is late depends on the machine; each has a vector or is counted.
#[test]
fn late_calls_are_counted_and_leave_no_appearance() {
    for report in ride("deadline_s = 1e-3") {
        let Some(lock) = &report.lock else { continue };
        let late = report.funnel.count("appearance: no vector");
        let has_vector = lock.likeness.iter().any(|likeness| likeness.differences.vector.is_some());
        assert!(late == 0 || (late == 1 && !has_vector), "{late} {lock:?}");
    }
}

#[test]
fn a_network_that_cannot_be_used_is_an_error_with_its_line() {
    let other = config("", "").replace("osnet.onnx", "yolox.onnx");
    let why = refusal_of(&other);
    assert!(why.contains("is no network for re-identification"), "{why}");
    assert!(why.contains("model = "), "{why}");
    let why = refusal_of(&config("max_operators = 1", ""));
    assert!(
        why.contains("[appearance] model file") && why.contains("raise `max_operators`"),
        "{why}"
    );
    for (line, message) in [
        ("deadline_s = 0.0", "`appearance.deadline_s` must lie between"),
        ("deadline_s = 'long'", "invalid type: string \"long\""),
        ("deadlin_s = 1.0", "did you mean `deadline_s`?"),
        ("convention = 'osnett'", "did you mean `osnet`?"),
    ] {
        let why = refusal_of(&config(line, ""));
        assert!(why.contains(message) && why.contains(&format!("| {line}\n")), "{why}");
    }
    let blind = config("", "[reidentification]\nremember_s = 1.0");
    let why = refusal_of(&format!("without = ['colour']\n{blind}"));
    assert!(why.contains("`[appearance]` requires colour"), "{why}");
}

/// The error that this config leads to.
fn refusal_of(text: &str) -> String {
    let world = World::default();
    let built = Pipeline::builder(&world.registry()).from_toml(text);
    built.err().expect("a refusal").to_string()
}
