//! Detection of people in logs without images, with the detector of the example `laser_legs` and with
//! `laser-legs`.
#![allow(clippy::unwrap_used, reason = "a failing test may panic")]

#[path = "../../crates/cli/examples/laser_legs/legs.rs"]
mod legs;

use std::path::Path;

use legs::Legs;
use nalgebra::Point2;
use tagalong_eval::formats::floor;
use tagalong_geometry::Rect;
use tagalong_log::{FrameSource, InputSettings, Limits};
use tagalong_pipeline::Pipeline;

const CONFIG: &str = include_str!("../../crates/cli/examples/laser_legs/legs.toml");

fn source(name: &str, pipeline: &Pipeline) -> Option<FrameSource> {
    let log = tagalong_conformance::testdata::find(name)?;
    let input = InputSettings::default();
    let limits = Limits::default();
    Some(FrameSource::open(&log, &input, &limits, pipeline.inputs()).unwrap())
}

fn pipeline() -> Pipeline {
    let mut registry = tagalong_catalog::registry();
    registry.detector("legs", "pairs of legs", |legs: Legs, _| Ok(legs));
    Pipeline::builder(&registry).from_toml(CONFIG).unwrap()
}

/// The wheelchair drives 110 m by the odometry of the log, and people beside it are tracked
/// although there is not a single image.
#[test]
fn scans_alone_make_the_frames_of_a_log_without_images() {
    let mut pipeline = pipeline();
    let Some(mut source) = source("laser/laser-moving.mcap", &pipeline) else { return };
    let mut frames = 0;
    let mut way_m = 0.0;
    let mut confirmed = 0;
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
    let mut frames = 0;
    let mut seen = 0;
    while let Some(item) = source.next_frame() {
        let report = pipeline.step(&item.frame).unwrap();
        frames += 1;
        seen += u32::from(report.tracks.iter().any(|track| track.confirmed));
    }
    assert_eq!(frames, 1500);
    assert!(seen > 1000, "{seen}");
    assert!(source.notes().iter().any(|note| note.contains("scanner sits at the robot's origin")));
}

/// The detector `laser-legs` as it is by default: the shipped configs give up people standing, for
/// fewer false positives.
const LEGS: &str = "[[detectors]]\nplugin = \"laser-legs\"\n[filter]\nplugin = \"ekf\"\n\
                    [manager]\nplugin = \"manage-sprt\"\n";

/// Two people stand while the robot drives past them and turns: in the odometry frame their tracks
/// stay where they are.
#[test]
fn people_at_rest_stay_at_rest_while_the_robot_drives() {
    let registry = tagalong_catalog::registry();
    let mut pipeline = Pipeline::builder(&registry).from_toml(LEGS).unwrap();
    let Some(mut source) = source("laser/laser-moving.mcap", &pipeline) else { return };
    let truth =
        tagalong_conformance::testdata::find("laser/laser-moving.people-floor.csv").unwrap();
    let rows = floor::parse(&std::fs::read_to_string(truth).unwrap(), "truth").unwrap();
    let mut places: [Vec<Point2<f64>>; 2] = Default::default();
    let mut robots: [Vec<Point2<f64>>; 2] = Default::default();
    let mut number = 0;
    while let Some(item) = source.next_frame() {
        let report = pipeline.step(&item.frame).unwrap();
        let tracks = report.tracks.iter().filter(|track| track.confirmed && track.seen);
        let tracks: Vec<Point2<f64>> = tracks
            .map(|track| item.odom_from_robot * track.estimate.person.position.xy())
            .collect();
        for (index, id) in [1000, 1001].into_iter().enumerate() {
            let is_person = |row: &&floor::Row| row.scan == number && row.person.id == id;
            let Some(row) = rows.iter().find(is_person) else { continue };
            let [x, y] = row.odom_m.unwrap();
            let off = |place: &&Point2<f64>| (*place - Point2::new(x, y)).norm();
            let nearest = tracks.iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            if let Some(place) = nearest.filter(|place| off(place) < 0.75) {
                places[index].push(*place);
                robots[index].push(item.odom_from_robot.translation.vector.into());
            }
        }
        number += 1;
    }
    for (places, robots) in places.iter().zip(&robots) {
        assert!(places.len() >= 8, "{}", places.len());
        let way_m = (robots[robots.len() - 1] - robots[0]).norm();
        let count = places.len() as f64;
        let sum: nalgebra::Vector2<f64> = places.iter().map(|place| place.coords).sum();
        let mean = Point2::from(sum / count);
        let square: f64 = places.iter().map(|place| (place - mean).norm_squared()).sum();
        let spread_m = (square / count).sqrt();
        assert!(way_m > 1.0, "the robot drove {way_m} m");
        assert!(spread_m < 0.2, "{} places spread by {spread_m} m", places.len());
    }
}

/// The person stands for eight seconds before the robot follows, and is tracked within one, without a
/// switch.
#[test]
fn a_person_who_stands_still_starts_a_track() {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let text = std::fs::read_to_string(configs.join("laser-follow.toml")).unwrap();
    let registry = tagalong_catalog::registry();
    let mut pipeline = Pipeline::builder(&registry).folder(&configs).from_toml(&text).unwrap();
    let Some(mut source) = source("laser/laser-following.mcap", &pipeline) else { return };
    let truth =
        tagalong_conformance::testdata::find("laser/laser-following.people-floor.csv").unwrap();
    let rows = floor::parse(&std::fs::read_to_string(truth).unwrap(), "truth").unwrap();
    let mut found = 0;
    let mut first = None;
    let mut ids = std::collections::BTreeSet::new();
    let mut number = 0;
    while let Some(item) = source.next_frame() {
        let report = pipeline.step(&item.frame).unwrap();
        if let Some(row) = rows.iter().find(|row| row.scan == number) {
            let at = Point2::from(row.person.at_m);
            let is_it = |track: &&tagalong_core::Track| {
                let apart = (track.estimate.person.position.xy() - at).norm();
                track.confirmed && track.seen && apart < 0.75
            };
            if let Some(track) = report.tracks.iter().find(is_it) {
                found += 1;
                first.get_or_insert(number);
                ids.insert(track.id);
            }
        }
        number += 1;
    }
    assert!(first.is_some_and(|scan| scan <= 10), "{first:?}");
    assert!(f64::from(found) > 0.97 * rows.len() as f64, "{found} of {}", rows.len());
    assert!(ids.len() <= 2, "{ids:?}");
}
