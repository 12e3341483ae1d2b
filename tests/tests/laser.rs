//! Detection of people in a log without images, with the detector of the example `laser_legs`.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

#[path = "../../crates/cli/examples/laser_legs/legs.rs"]
mod legs;

use std::path::Path;

use legs::{Config, Legs};
use tagalong_config::Registry;
use tagalong_geometry::Rect;
use tagalong_log::{FrameSource, InputSettings, Limits};
use tagalong_pipeline::Pipeline;

const CONFIG: &str = include_str!("../../crates/cli/examples/laser_legs/legs.toml");

fn source(name: &str, pipeline: &Pipeline) -> Option<FrameSource> {
    let log = tagalong_testdata::find(name)?;
    let (input, limits) = (InputSettings::default(), Limits::default());
    Some(FrameSource::open(&log, &input, &limits, pipeline.inputs()).unwrap())
}

fn pipeline() -> Pipeline {
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    registry.detector("legs", "pairs of legs", |config: Config, _| Ok(Legs(config)));
    Pipeline::from_toml(CONFIG, Path::new("."), &registry).unwrap().0
}

/// The wheelchair drives 110 m by the odometry of the log, and people beside it are tracked
/// although there is not a single image.
#[test]
fn scans_alone_make_the_frames_of_a_log_without_images() {
    let mut pipeline = pipeline();
    let Some(mut source) = source("laser/laser-moving.mcap", &pipeline) else { return };
    let (mut frames, mut way_m, mut confirmed) = (0, 0.0, 0);
    while let Some(item) = source.next_frame() {
        let report = pipeline.step(&item.frame).unwrap();
        frames += 1;
        way_m += report.motion.forward.hypot(report.motion.left);
        confirmed += report.tracks.iter().filter(|track| track.confirmed).count();
        assert!(item.frame.camera.is_blind() && item.frame.scan().is_ok());
        assert!(report.tracks.iter().all(|track| track.estimate.region == Rect::default()));
    }
    assert_eq!(frames, 336);
    assert!((20.0..150.0).contains(&way_m), "{way_m}");
    assert!(confirmed > 30, "{confirmed}");
}

/// Without tf the scanner is assumed at the robot's origin, and a note says so.
#[test]
fn a_scanner_that_tf_does_not_know_is_at_the_origin() {
    let mut pipeline = pipeline();
    let Some(mut source) = source("laser/laser-following.mcap", &pipeline) else { return };
    let (mut frames, mut seen) = (0, 0);
    while let Some(item) = source.next_frame() {
        let report = pipeline.step(&item.frame).unwrap();
        frames += 1;
        seen += u32::from(report.tracks.iter().any(|track| track.confirmed));
    }
    assert_eq!(frames, 1500);
    assert!(seen > 1000, "{seen}");
    assert!(source.notes().iter().any(|note| note.contains("scanner sits at the robot's origin")));
}
