//! A long ride after simulated people with one pipeline: memory, numbers of tracks and time per frame
//! must stay as they were in the first hour.
//!
//! ```sh
//! cargo run --release -p tagalong-cli --example soak -- 24
//! ```
#![allow(clippy::print_stdout, reason = "an example tells what it does")]

use std::error::Error;
use std::process::ExitCode;
use std::time::Instant;

use tagalong_core::{Frame, Stamp};
use tagalong_pipeline::{Choice, Enrollment, Pipeline};
use tagalong_sim::{Scene, Variant};
use tagalong_trials::Draw;

/// Scenes that follow each other until the hours are over.
const SCENES: [&str; 3] = ["follow-passing", "follow-crowd", "follow-turns"];
/// Size of the images, pixels: the ride is about time and memory, and small images are simulated fast.
const SIZE: [usize; 2] = [100, 75];
/// The person ahead of the robot.
const NEAREST: Enrollment =
    Enrollment { person: Choice::Nearest, lose_after_s: None, search: None, give_up_s: None };
/// Pause between two scenes, s: the clock jumps ahead, and all tracks end.
const PAUSE_S: f64 = 20.0;
/// Largest growth of the memory after the first part, KiB.
const DRIFT_KIB: u64 = 5 * 1024;
/// Parts into which the ride is divided for the table.
const PARTS: usize = 8;

/// Figures of one part of the ride.
#[derive(Default)]
struct Part {
    frames: u64,
    followed: u64,
    most_tracks: usize,
    last_track: u32,
    ms: f64,
    resident_kib: u64,
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let hours: f64 = std::env::args().nth(1).map_or(Ok(1.0), |hours| hours.parse())?;
    let registry = tagalong_catalog::registry();
    let builder = Pipeline::builder(&registry);
    let mut pipeline = builder.from_toml_file("configs/follow-depth.toml")?;
    println!(
        "| until, h | frames | with the target % | most tracks | last number | ms/frame | memory, MiB |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut now_s = 0.0;
    let mut index = 0;
    let mut number_of_scene = 0;
    let mut parts = Vec::new();
    for number in 1..=PARTS {
        let end_s = hours * 3600.0 * number as f64 / PARTS as f64;
        let mut part = Part::default();
        while now_s < end_s {
            let begin_s = now_s + PAUSE_S;
            now_s = ride(&mut pipeline, &scene(number_of_scene)?, begin_s, &mut index, &mut part)?;
            number_of_scene += 1;
        }
        part.resident_kib = resident_kib();
        print(now_s / 3600.0, &part);
        parts.push(part);
    }
    let grown = parts[PARTS - 1].resident_kib.saturating_sub(parts[0].resident_kib);
    println!("\nmemory after the first part: {grown} KiB more");
    Ok(ExitCode::from(u8::from(grown > DRIFT_KIB)))
}

/// Returns the scene of this number, with a seed of its own.
fn scene(number: u64) -> Result<Scene, Box<dyn Error>> {
    let path = format!("configs/scenes/{}.toml", SCENES[number as usize % SCENES.len()]);
    let text = std::fs::read_to_string(&path)?;
    let [width, height] = SIZE;
    let variant =
        Variant::of_seed(number).with("camera.width", width).with("camera.height", height);
    Ok(Scene::parse_with(&text, &variant).map_err(|error| error.render(&path, &text))?)
}

/// Drives through a scene that begins at `begin_s`, and returns the time of its end, s.
fn ride(
    pipeline: &mut Pipeline,
    scene: &Scene,
    begin_s: f64,
    index: &mut u64,
    part: &mut Part,
) -> Result<f64, Box<dyn Error>> {
    let mut robot = Draw::live(scene, 1);
    let mut end_s = begin_s;
    let mut is_enrolled = false;
    while let Some(drawn) = robot.next_frame() {
        let at_s = drawn.frame.stamp.nanos() as f64 * 1e-9;
        end_s = begin_s + at_s;
        *index += 1;
        let Frame { camera, motion, .. } = &drawn.frame;
        let stamp = Stamp::default().plus_seconds(end_s);
        let sensors = drawn.frame.sensors().clone();
        let frame = Frame::of_sensors(*index, stamp, camera.clone(), *motion, sensors);
        let begin = Instant::now();
        let report = pipeline.step(&frame)?;
        // In each scene it is another person, whom the robot has never seen.
        is_enrolled = is_enrolled || pipeline.enroll(&NEAREST).is_ok();
        part.ms += begin.elapsed().as_secs_f64() * 1e3;
        part.frames += 1;
        part.followed += u64::from(report.target.is_some());
        part.most_tracks = part.most_tracks.max(report.tracks.len());
        let numbers = report.tracks.iter().map(|track| track.id.0);
        part.last_track = numbers.max().unwrap_or(0).max(part.last_track);
        if let Some(command) = report.command {
            robot.steer(command.wheels);
        }
    }
    Ok(end_s)
}

fn print(hours: f64, part: &Part) {
    let Part { frames, followed, most_tracks, last_track, ms, resident_kib } = part;
    let each = ms / *frames as f64;
    let memory = *resident_kib as f64 / 1024.0;
    let share = 100.0 * *followed as f64 / *frames as f64;
    println!(
        "| {hours:.2} | {frames} | {share:.0} | {most_tracks} | {last_track} | {each:.2} | {memory:.1} |"
    );
}

/// Returns the resident memory of this process, KiB; 0 where the system does not tell it.
fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|kib| kib.parse().ok()).unwrap_or(0)
}
