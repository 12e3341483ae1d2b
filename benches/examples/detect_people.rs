//! Writes the detections of `hog-upper-body` in each frame of a log as MOTChallenge text:
//! `detect_people LOG OUT.csv EXTENT INPUTS [KEY=VALUE ...]`, with settings as TOML. EXTENT is
//! `upper` or `whole`: the box of the upper body, or that of the standing person around it. INPUTS
//! is `colour` or `depth`, which is colour with depth. Each detection has a number of its own and
//! its log-odds. For the comparison with OpenCV in `benches/peers/`.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a program for developers")]

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use cpu_time::ThreadTime;
use tagalong_config::Context;
use tagalong_core::{Detection, Detector, DiffDrive, Frame, Funnel, Query};
use tagalong_geometry::{Rect, UPPER_BODY_SIDE_M};
use tagalong_hog_upper_body::{Config, HogUpperBody};
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};

/// Height of a standing person, m: that by which boxes of whole bodies become upper bodies when
/// the truth is read.
const STANDING_M: f64 = 1.7;
/// Width of a standing person as a part of the height (P. Dollar et al., *Pedestrian detection: an
/// evaluation of the state of the art*, PAMI 34, 2012).
const WIDTH: f64 = 0.41;
/// Height of the square above the head, m (see `Rect::upper_body_of_standing`).
const ABOVE_M: f64 = 0.025;

/// Returns the box of the standing person with this upper body.
fn whole_body(square: &Rect) -> Rect {
    let px_per_m = square.width / UPPER_BODY_SIDE_M;
    let height = STANDING_M * px_per_m;
    let width = WIDTH * STANDING_M * px_per_m;
    Rect::new(square.centre().x - 0.5 * width, square.y + ABOVE_M * px_per_m, width, height)
}

/// Adds the lines of the detections in one frame.
fn add_lines(text: &mut String, frame: &Frame, found: &[Detection], is_whole: bool) {
    for (number, detection) in found.iter().enumerate() {
        let square = detection.rect_in(&frame.camera);
        let region = if is_whole { whole_body(&square) } else { square };
        let Rect { x, y, width, height } = region.clipped(frame.camera.width, frame.camera.height);
        let index = frame.index;
        let id = frame.index * 1000 + number as u64;
        let score = detection.score;
        writeln!(text, "{index},{id},{x:.2},{y:.2},{width:.2},{height:.2},{score:.6},-1,-1,-1")
            .expect("a string takes any text");
    }
}

fn source(log: &Path, with_depth: bool) -> FrameSource {
    let colour = Inputs::NONE.require(Input::Colour);
    let inputs = if with_depth { colour.require(Input::Depth) } else { colour };
    FrameSource::open(log, &InputSettings::default(), &Limits::default(), inputs)
        .expect("the log can be read")
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (settings, words): (Vec<String>, Vec<String>) =
        words.into_iter().partition(|word| word.contains('='));
    let [log, out, extent, inputs] = &words[..] else { panic!("LOG OUT.csv EXTENT INPUTS") };
    let config: Config = toml::from_str(&settings.join("\n")).expect("settings are KEY=VALUE");
    let wheels = DiffDrive { half_separation_m: 0.2, slip: 0.0 };
    let context = Context::new(1, PathBuf::new(), wheels);
    let mut detector = HogUpperBody::new(config, &context).expect("the settings are right");
    let mut frames = source(Path::new(log), inputs == "depth");
    let mut text = String::new();
    let mut count = 0_u32;
    let mut work_ms = 0.0;
    let everywhere = Query::Discover { occupied: &[] };
    while let Some(item) = frames.next_frame() {
        // The grey image is made here, so that its decoding is not timed.
        item.frame.grey().expect("it has images");
        let before = ThreadTime::now();
        let found = detector.detect(&item.frame, &everywhere, &mut Funnel::default());
        work_ms += 1e3 * before.elapsed().as_secs_f64();
        add_lines(&mut text, &item.frame, &found.expect("it has its inputs"), extent == "whole");
        count += 1;
    }
    std::fs::write(out, text).expect("the file can be written");
    println!("{count} frames, {:.2} ms a frame", work_ms / f64::from(count.max(1)));
}
