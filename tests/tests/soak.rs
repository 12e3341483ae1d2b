//! Long and crowded runs: memory, numbers of tracks and time stay bounded. The longer ones are
//! `cargo run --release -p tagalong-trials --example soak`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing test may panic")]

use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use tagalong_core::{DepthImage, EgoMotion, ExternalDetection, Frame, Images, Stamp, WheelSpeeds};
use tagalong_geometry::{Camera, Pinhole, Rect};
use tagalong_pipeline::Pipeline;

/// The memory of the process is that of all its tests, so one runs at a time.
static ALONE: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn pipeline(config: &str) -> Pipeline {
    let registry = tagalong_catalog::registry();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let text = std::fs::read_to_string(folder.join(config)).unwrap();
    Pipeline::builder(&registry).folder(&folder).from_toml(&text).unwrap()
}

/// Returns the resident memory of this process, KiB; `None` where the system does not tell it.
fn resident_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

fn camera() -> Arc<Camera> {
    Arc::new(Camera::mounted(Pinhole::centred(80.0, 160, 120), 160, 120, 1.2, 0.0, 0.0))
}

/// Returns the depth of an empty room: the floor, and a wall 6 m away.
fn empty_room(camera: &Camera) -> DepthImage {
    DepthImage::from_fn(camera.width, camera.height, |_: usize, y: usize| {
        let below = (y as f64 - 59.5) / 80.0;
        if below > 0.0 { (1.2 / below).min(6.0) as f32 } else { 6.0 }
    })
}

#[test]
fn s3_an_empty_room_for_ten_minutes_takes_no_memory() {
    let _alone = alone();
    let camera = camera();
    let depth = Arc::new(empty_room(&camera));
    let mut pipeline = pipeline("follow-depth.toml");
    let mut before = None;
    // Ten minutes at 15 Hz; what is allocated in the first is kept for good.
    for index in 1..=9000_u64 {
        let stamp = Stamp::default().plus_seconds(index as f64 / 15.0);
        let images = Images { depth: Some(Arc::clone(&depth)), ..Images::default() };
        let motion = EgoMotion::at_rest(1.0 / 15.0);
        let frame = Frame::new(index, stamp, Arc::clone(&camera), motion, images);
        let report = pipeline.step(&frame).unwrap();
        assert!(report.tracks.is_empty(), "{index}: {:?}", report.tracks);
        assert_eq!(report.command.unwrap().wheels, WheelSpeeds::STOP, "{index}");
        if index == 900 {
            before = resident_kib();
        }
    }
    if let (Some(before), Some(after)) = (before, resident_kib()) {
        assert!(after < before + 5 * 1024, "{before} KiB became {after} KiB");
    }
}

/// Returns boxes of people that another program found, all over the image.
fn boxes(count: usize) -> Vec<ExternalDetection> {
    (0..count)
        .map(|at| {
            ExternalDetection::in_image(
                Rect::new((at % 150) as f64, (at / 150 % 110) as f64, 10.0, 10.0),
                0.5 + 0.4 * (at % 97) as f64 / 97.0,
            )
        })
        .collect()
}

#[test]
fn s4_a_hundred_thousand_boxes_in_a_frame_are_bounded_in_time() {
    let _alone = alone();
    let camera = camera();
    let mut pipeline = pipeline("recorded.toml");
    let begin = Instant::now();
    for index in 1..=3_u64 {
        let stamp = Stamp::default().plus_seconds(index as f64 * 0.1);
        let motion = EgoMotion::at_rest(0.1);
        let frame = Frame::new(index, stamp, Arc::clone(&camera), motion, Images::default());
        let report = pipeline.step(frame.with_recorded(Some(boxes(100_000)))).unwrap();
        assert!(report.tracks.len() <= 256, "{}", report.tracks.len());
        assert!(report.funnel.entries().iter().map(|entry| entry.count).sum::<u64>() > 90_000);
    }
    let took = begin.elapsed().as_secs_f64();
    eprintln!("three frames of 100,000 boxes: {took:.2} s");
    assert!(took < 30.0, "{took} s");
}
