//! A real stereo pair, from the images to wheel speeds: a pedestrian 11 m ahead of a car. Without
//! `../shared/data/logs` the test reports that it skips.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a broken test or bench may stop loudly"
)]

use std::path::Path;

use nalgebra::Point2;
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};
use tagalong_pipeline::{FrameReport, Pipeline};

/// Position of the pedestrian in the last frame: straight ahead and to the left, m. The car drives,
/// but its log has no odometry, so that tracks lag behind.
const PEDESTRIAN_M: Point2<f64> = Point2::new(11.2, 3.15);

fn reports() -> Option<Vec<FrameReport>> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let path = tagalong_conformance::testdata::find("logs/kitti-stereo.mcap")?;
    let configs = root.join("configs");
    let text = std::fs::read_to_string(configs.join("stereo-street.toml")).unwrap();
    // The log has no odometry, without which no robot drives unless the config says so.
    let text = format!("robot.odometry = \"none\"\n{text}");
    let registry = tagalong_catalog::registry();
    let mut pipeline = Pipeline::builder(&registry).folder(&configs).from_toml(&text).unwrap();
    let inputs = Inputs::ANY.require(Input::Colour).require(Input::Right);
    let mut source =
        FrameSource::open(&path, &InputSettings::default(), &Limits::default(), inputs).unwrap();
    let frames = std::iter::from_fn(|| source.next_frame());
    Some(frames.map(|frame| pipeline.step(&frame.frame).unwrap()).collect())
}

#[test]
fn a_pedestrian_at_eleven_metres_is_tracked_and_followed() {
    let Some(reports) = reports() else { return };
    assert_eq!(reports.len(), 4);
    let last = &reports[3];
    let near = last.tracks.iter().filter(|track| track.confirmed).find(|track| {
        let place = track.estimate.person.position;
        (place.xy() - PEDESTRIAN_M).norm() < 0.8
    });
    assert!(near.is_some(), "{:?}", last.tracks);
    let wheels = reports.iter().filter_map(|report| report.command).map(|command| command.wheels);
    let moving = wheels.filter(|wheels| wheels.left + wheels.right > 0.0).count();
    assert!(moving > 0, "{:?}", reports.iter().map(|r| r.command).collect::<Vec<_>>());
}
