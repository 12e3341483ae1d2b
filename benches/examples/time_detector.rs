//! Runs a detector over the frames of a log, again and again:
//! `time_detector LOG PLUGIN RUNS [FOLDER] [KEY=VALUE ...]`, with settings as TOML.
//! Writes the frames as grey pictures to the folder, if one is named. For the
//! comparison with OpenCV in `benches/peers/`.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a program for developers")]

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use tagalong_config::Context;
use tagalong_core::{Detector, DiffDrive, Frame, Funnel, Query};
use tagalong_face_rgbd::FaceRgbd;
use tagalong_hog_upper_body::HogUpperBody;
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};

/// All frames of a log, with their grey images made.
fn frames(log: &Path) -> Vec<Frame> {
    let input = InputSettings::default();
    let limits = Limits::default();
    let inputs = Inputs::NONE.require(Input::Colour).require(Input::Depth);
    let mut source = FrameSource::open(log, &input, &limits, inputs).expect("the log can be read");
    let mut frames = Vec::new();
    while let Some(item) = source.next_frame() {
        item.frame.grey().expect("it has images");
        frames.push(item.frame);
    }
    frames
}

fn write(frames: &[Frame], folder: &Path) {
    for (index, frame) in frames.iter().enumerate() {
        let grey = frame.grey().expect("it has images");
        let width = grey.width() as u32;
        let height = grey.height() as u32;
        let image = image::GrayImage::from_raw(width, height, grey.pixels().to_vec());
        let path = folder.join(format!("{index:05}.png"));
        image.expect("all pixels").save(path).expect("the folder can be written");
    }
}

fn settings<C: DeserializeOwned>(words: &[String]) -> C {
    toml::from_str(&words.join("\n")).expect("settings are KEY=VALUE")
}

fn detector(name: &str, words: &[String]) -> Box<dyn Detector> {
    let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
    let context = Context::new(1, PathBuf::new(), wheels);
    let detector: tagalong_core::Result<Box<dyn Detector>> = match name {
        "face-rgbd" => FaceRgbd::new(settings(words), &context).map(|it| Box::new(it) as _),
        _ => HogUpperBody::new(settings(words), &context).map(|it| Box::new(it) as _),
    };
    detector.expect("the settings are right")
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (settings, words): (Vec<String>, Vec<String>) =
        words.into_iter().partition(|word| word.contains('='));
    let [log, plugin, runs, folder @ ..] = &words[..] else { panic!("LOG PLUGIN RUNS [FOLDER]") };
    let runs: usize = runs.parse().expect("RUNS is a number");
    let mut detector = detector(plugin, &settings);
    let frames = frames(Path::new(log));
    folder.iter().for_each(|folder| write(&frames, Path::new(folder)));
    let everywhere = Query::Discover { occupied: &[] };
    let mut found = 0;
    for frame in std::iter::repeat_n(&frames, runs).flatten() {
        let detections = detector.detect(frame, &everywhere, &mut Funnel::default());
        found += detections.expect("it has what it needs").len();
    }
    println!("{} frames, {found} people in {runs} runs", frames.len());
}
