//! The shipped `onnx` config with a detector on every third frame, as its comments say, and the
//! hand-weighted network of `crates/network/tests`.
#![allow(clippy::unwrap_used, reason = "a broken test may stop loudly")]

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tagalong_core::{EgoMotion, Frame, Images, RgbImage, Stamp};
use tagalong_geometry::{Camera, Pinhole, Rect};
use tagalong_pipeline::{FrameReport, Pipeline};

const FRAMES: u64 = 30;
/// Places of the person beside the one where the network finds a blob, in every third frame,
/// pixels.
const ASIDE: [usize; 3] = [0, 8, 12];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Returns the shipped config with a network on every third frame, with or without a follower.
fn config(follower: bool) -> String {
    let mut text = fs::read_to_string(root().join("configs/onnx.toml")).unwrap();
    let mut change = |from: &str, to: &str| {
        assert!(text.contains(from), "the config has no `{from}`");
        text = text.replacen(from, to, 1);
    };
    change("# config = { model = \"yolox_s.onnx\" }", "\nconfig = { model = \"yolox.onnx\" }");
    change("# every = 3", "every = 3");
    if follower {
        change("# [[detectors]]", "[[detectors]]");
        change("# plugin = \"compressive\"", "plugin = \"compressive\"");
        change("# roles = [\"track\"]", "roles = [\"track\"]");
    }
    text
}

/// Returns even noise that belongs to a place.
fn noise(x: usize, y: usize) -> u32 {
    let mixed = (x as u32).wrapping_mul(73_856_093) ^ (y as u32).wrapping_mul(19_349_663);
    (mixed.wrapping_mul(2_654_435_761) >> 16) % 40
}

/// Left edge of the person in a frame, counted from 0.
fn left(index: u64) -> usize {
    192 + ASIDE[index as usize % ASIDE.len()]
}

/// A bright person of 96 x 192 pixels with stripes before a dark wall.
fn frame(index: u64) -> Frame {
    let camera =
        Arc::new(Camera::mounted(Pinhole::centred(300.0, 384, 384), 384, 384, 1.0, 0.0, 0.0));
    let left = left(index);
    let colour = RgbImage::from_fn(384, 384, |x, y| {
        if !(left..left + 96).contains(&x) || !(96..288).contains(&y) {
            return [noise(x / 6, y / 6) as u8; 3];
        }
        let u = x - left;
        let v = y - 96;
        let stripe = if (u / 12 + v / 24).is_multiple_of(2) { 30 } else { 0 };
        [(185 + stripe + noise(u / 4, v / 4)) as u8; 3]
    });
    let images = Images { colour: Some(Arc::new(colour)), ..Images::default() };
    let stamp = Stamp::from_nanos(index * 33_000_000);
    Frame::new(index + 1, stamp, camera, EgoMotion::at_rest(0.033), images)
}

fn run(follower: bool) -> Vec<FrameReport> {
    let registry = tagalong_catalog::registry();
    let models = root().join("crates/network/tests/models");
    let text = config(follower);
    let built = Pipeline::builder(&registry).folder(&models).from_toml(&text);
    let mut pipeline = built.unwrap();
    (0..FRAMES).map(|index| pipeline.step(frame(index)).unwrap()).collect()
}

/// The mean error of the middle of the tracked box over the frames in which the network does not
/// run, pixels.
fn off_px(reports: &[FrameReport]) -> f64 {
    let between = (15..FRAMES).filter(|index| index % 3 != 0);
    let off = between.map(|index| {
        let region: Rect = reports[index as usize].tracks[0].estimate.region;
        (region.centre().x - (left(index) as f64 + 48.0)).abs()
    });
    let all: Vec<f64> = off.collect();
    all.iter().sum::<f64>() / all.len() as f64
}

fn assert_one_track(reports: &[FrameReport]) {
    for report in &reports[8..] {
        let ids: Vec<u32> = report.tracks.iter().map(|track| track.id.0).collect();
        assert!(ids == [1] && report.tracks[0].confirmed, "frame {}: {ids:?}", report.index);
    }
}

#[test]
fn frames_without_the_network_are_no_misses_and_are_predicted() {
    let reports = run(false);
    assert_one_track(&reports);
    for (index, report) in reports.iter().enumerate().skip(9) {
        assert_eq!(report.tracks[0].seen, index % 3 == 0, "frame {index}");
    }
}

#[test]
fn a_follower_finds_the_person_between_the_frames_of_the_network() {
    let alone = run(false);
    let followed = run(true);
    assert_one_track(&followed);
    assert!(followed[9..].iter().all(|report| report.tracks[0].seen));
    let [alone, followed] = [alone, followed].map(|reports| off_px(&reports));
    assert!(followed < 0.6 * alone, "{followed} px with a follower, {alone} px without");
}
