//! Faults of sensors and clocks, from the log or the frame to the tracks and the wheels. The names
//! of the tests begin with the fault's: T5, time stamps that disagree; S1, a depth camera without
//! readings; S2, images with noise; S3, a room without people for long.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing test may panic")]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tagalong_core::{DepthImage, EgoMotion, Frame, Images, Stamp, Track, WheelSpeeds};
use tagalong_geometry::{Camera, Lens};
use tagalong_log::msgs::{CameraInfo, Header, Image, TFMessage, TransformStamped};
use tagalong_log::write::MessageLog;
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};
use tagalong_math::{RandomSource as _, SplitMix64};
use tagalong_pipeline::{FrameReport, LockState, Pipeline};
use tagalong_sim::{Event, Scene, Shot, Simulation};

const SCENE: &str = include_str!("../scenes/small-room.toml");

const PERIOD_S: f64 = 0.1;

fn shots() -> (Camera, Vec<Shot>) {
    let mut simulation = Simulation::new(&Scene::parse(SCENE).unwrap(), 2);
    let camera = simulation.camera().clone();
    let events = std::iter::from_fn(|| simulation.next_event());
    let shots = events.filter_map(|event| match event {
        Event::Shot(shot) => Some(*shot),
        _ => None,
    });
    (camera, shots.collect())
}

fn pipeline(config: &str) -> Pipeline {
    let registry = tagalong_catalog::registry();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let text = std::fs::read_to_string(folder.join(config)).unwrap();
    Pipeline::builder(&registry).folder(&folder).from_toml(&text).unwrap()
}

fn at(index: usize) -> Stamp {
    Stamp::from_nanos(1_700_000_000_000_000_000).plus_seconds(index as f64 * PERIOD_S)
}

/// Faults of the messages of a recording.
#[derive(Clone, Copy, Default)]
struct Fault {
    /// Lag of the stamps of depth images behind those of colour, s.
    skew_s: f64,
    /// True if every second depth image is missing.
    half_depth: bool,
    /// Image from which on the camera has another calibration.
    zoomed_from: Option<usize>,
    /// Largest delay of recording after the stamp, which changes the order of messages, s.
    delay_s: f64,
}

/// A log with a fault, with its temporary folder.
struct Recorded {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

fn record(camera: &Camera, shots: &[Shot], fault: Fault) -> Recorded {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fault.mcap");
    let mut log = MessageLog::create(&path).unwrap();
    let fixed = TransformStamped {
        header: Header::new(at(0), "base_link"),
        child_frame_id: "camera".into(),
        transform: (&camera.robot_from_camera).into(),
    };
    log.send("/tf_static", at(0), &TFMessage { transforms: vec![fixed] }).unwrap();
    log.send("/camera/camera_info", at(0), &info(camera)).unwrap();
    // A fixed sequence that is not sorted.
    let delay = |index: usize| fault.delay_s * ((index * 7) % 5) as f64 / 4.0;
    let mut images = Vec::new();
    for (index, shot) in shots.iter().enumerate() {
        let stamp = at(index);
        let later = at(index).plus_seconds(fault.skew_s);
        images.push((stamp.plus_seconds(delay(2 * index)), stamp, shot, false));
        if !fault.half_depth || index % 2 == 0 {
            images.push((later.plus_seconds(delay(2 * index + 1)), later, shot, true));
        }
    }
    // A log holds its messages in the order of recording.
    images.sort_by_key(|(recorded, ..)| *recorded);
    for (recorded, stamp, shot, is_depth) in images {
        if fault.zoomed_from.is_some_and(|from| stamp == at(from)) {
            log.send("/camera/camera_info", recorded, &zoomed(camera, stamp)).unwrap();
        }
        send(&mut log, recorded, stamp, &shot.images, is_depth);
    }
    log.finish().unwrap();
    Recorded { _folder: folder, path }
}

fn send(log: &mut MessageLog, recorded: Stamp, stamp: Stamp, images: &Images, is_depth: bool) {
    let colour = images.colour.as_ref().unwrap();
    let depth = images.depth.as_ref().unwrap();
    let width = colour.width() as u32;
    let height = colour.height() as u32;
    let floats: Vec<u8> = depth.pixels().iter().flat_map(|z| z.to_le_bytes()).collect();
    let (topic, encoding, step, data) = if is_depth {
        ("/camera/depth", "32FC1", 4 * width, &floats[..])
    } else {
        ("/camera/color", "rgb8", 3 * width, colour.pixels().as_flattened())
    };
    let header = Header::new(stamp, "camera");
    let encoding = encoding.into();
    let image = Image { header, height, width, encoding, is_bigendian: 0, step, data };
    log.send(topic, recorded, &image).unwrap();
}

fn info(camera: &Camera) -> CameraInfo {
    let Lens::Pinhole(lens) = camera.lens else { panic!("a pinhole camera") };
    let size = (camera.width, camera.height);
    CameraInfo::of_lens(&Header::new(at(0), "camera"), &lens, size, 0.0)
}

/// Returns the calibration of a lens of another focal length.
fn zoomed(camera: &Camera, stamp: Stamp) -> CameraInfo {
    let mut info = CameraInfo { header: Header::new(stamp, "camera"), ..info(camera) };
    info.k[0] *= 1.2;
    info
}

/// Result of a run over a log: stamps with tracks, and the number of colour and depth images
/// without a partner.
#[derive(Debug)]
struct Run {
    tracks: Vec<(Stamp, Vec<Track>)>,
    colour_alone: u64,
    depth_alone: u64,
}

fn run(recorded: &Recorded) -> Run {
    let inputs = Inputs::ANY.require(Input::Colour).require(Input::Depth);
    let input = InputSettings::default();
    let limits = Limits::default();
    let mut source = FrameSource::open(&recorded.path, &input, &limits, inputs).unwrap();
    let mut pipeline = pipeline("depth-ekf.toml");
    let mut tracks = Vec::new();
    while let Some(found) = source.next_frame() {
        tracks.push((found.frame.stamp, pipeline.step(&found.frame).unwrap().tracks));
    }
    let count = |name| source.counters().get(name).copied().unwrap_or(0);
    let colour_alone = count("colour_without_depth");
    let depth_alone = count("depth_without_colour");
    Run { tracks, colour_alone, depth_alone }
}

#[test]
fn t5_when_a_message_was_recorded_does_not_matter() {
    let (camera, shots) = shots();
    let prompt = run(&record(&camera, &shots, Fault::default()));
    // More than two periods, so that messages of several frames change their order.
    let late = run(&record(&camera, &shots, Fault { delay_s: 0.25, ..Fault::default() }));
    assert_eq!(prompt.tracks.len(), shots.len());
    assert!(prompt.tracks.iter().any(|(_, tracks)| tracks.iter().any(|track| track.confirmed)));
    assert_eq!(format!("{prompt:?}"), format!("{late:?}"));
    assert_eq!((prompt.colour_alone, prompt.depth_alone), (0, 0));
}

#[test]
fn t5_images_are_paired_within_the_tolerance_and_others_are_counted() {
    let (camera, shots) = shots();
    let all = shots.len();
    // The tolerance is 30 ms, and depth that is 80 ms late is 20 ms from the next image.
    for (skew_ms, frames) in [(0, all), (20, all), (-20, all), (40, 0), (60, 0), (80, all - 1)] {
        let skew_s = f64::from(skew_ms) * 1e-3;
        let run = run(&record(&camera, &shots, Fault { skew_s, ..Fault::default() }));
        let alone = (all - frames) as u64;
        assert_eq!(run.tracks.len(), frames, "{skew_ms} ms");
        assert_eq!((run.colour_alone, run.depth_alone), (alone, alone), "{skew_ms} ms");
    }
}

#[test]
fn t5_depth_at_half_rate_halves_the_frames_and_nothing_else() {
    fn confirmed(tracks: &[Track]) -> usize {
        tracks.iter().filter(|t| t.confirmed && t.seen).count()
    }

    let (camera, shots) = shots();
    let run = run(&record(&camera, &shots, Fault { half_depth: true, ..Fault::default() }));
    assert_eq!(run.tracks.len(), shots.len().div_ceil(2));
    assert_eq!((run.colour_alone, run.depth_alone), (shots.len() as u64 / 2, 0));
    assert_eq!(confirmed(&run.tracks.last().unwrap().1), 1);
}

#[test]
fn c1_another_calibration_in_a_log_freezes_the_tracks() {
    let (camera, shots) = shots();
    let from = shots.len() / 2;
    let run = run(&record(&camera, &shots, Fault { zoomed_from: Some(from), ..Fault::default() }));
    let places = |tracks: &[Track]| -> Vec<_> {
        tracks.iter().map(|track| (track.id, track.estimate.person.position)).collect()
    };
    let (before, after) = run.tracks.split_at(from);
    let last = places(&before.last().unwrap().1);
    assert!(!last.is_empty() && after.len() == shots.len() - from);
    for (_, tracks) in after {
        assert!(places(tracks) == last && tracks.iter().all(|track| !track.seen), "{tracks:?}");
    }
}

fn frame(camera: &Arc<Camera>, index: usize, images: Images) -> Frame {
    let motion = EgoMotion::at_rest(if index == 0 { 0.0 } else { PERIOD_S });
    Frame::new(index as u64 + 1, at(index), Arc::clone(camera), motion, images)
}

/// Processes the simulated images, then for six seconds the last one with this depth everywhere.
fn go_blind(camera: &Arc<Camera>, shots: &[Shot], depth_m: f32) -> Vec<FrameReport> {
    let mut pipeline = pipeline("depth-ekf-follow.toml");
    let blind = DepthImage::filled(camera.width, camera.height, depth_m);
    let last = Images { depth: Some(Arc::new(blind)), ..shots[shots.len() - 1].images.clone() };
    let images = shots.iter().map(|shot| &shot.images).chain(std::iter::repeat_n(&last, 60));
    let frames = images.enumerate().map(|(index, images)| frame(camera, index, images.clone()));
    frames.map(|frame| pipeline.step(&frame).unwrap()).collect()
}

#[test]
fn s1_depth_that_shows_nothing_ends_tracks_and_starts_none() {
    let (camera, shots) = shots();
    let camera = Arc::new(camera);
    // Forms of "no reading"; 65.535 m is the largest value of depth in 16-bit millimetres.
    for depth_m in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, 65.535] {
        let reports = go_blind(&camera, &shots, depth_m);
        let (seeing, blind) = reports.split_at(shots.len());
        let before = seeing.last().unwrap();
        let followed = before.target.expect("somebody is followed");
        assert_eq!(before.lock.as_ref().unwrap().state, LockState::Locked, "{depth_m}");
        let known: Vec<_> = before.tracks.iter().map(|track| track.id).collect();
        for report in blind {
            assert!(report.candidates.is_empty(), "{depth_m}: {:?}", report.candidates);
            assert!(report.tracks.iter().all(|track| known.contains(&track.id) && !track.seen));
            let WheelSpeeds { left, right } = report.command.unwrap().wheels;
            assert!(left.abs() <= 0.9 && right.abs() <= 0.9, "{depth_m}: {left} {right}");
        }
        assert!(blind[0].tracks.iter().any(|track| track.id == followed), "{depth_m}: it coasts");
        let last = blind.last().unwrap();
        assert!(last.tracks.is_empty(), "{depth_m}: {:?}", last.tracks);
        assert_eq!(
            (last.lock.as_ref().unwrap().state, last.target),
            (LockState::Lost, None),
            "{depth_m}"
        );
        let lost =
            blind.iter().filter(|report| report.lock.as_ref().unwrap().state == LockState::Lost);
        let commands: Vec<_> = lost.map(|report| report.command.unwrap().wheels).collect();
        assert!(commands.iter().all(|wheels| *wheels == WheelSpeeds::STOP), "{depth_m}");
    }
}

/// A spoilt copy of a scene's images.
struct Spoilt {
    spoil: fn(&Images, &mut SplitMix64) -> Images,
}

const SPOILT: [Spoilt; 5] = [
    Spoilt { spoil: |images, _| images.clone() },
    Spoilt {
        spoil: |images, random| {
            with_depth(images, |z| if random.uniform() < 0.5 { f32::NAN } else { z })
        },
    },
    Spoilt {
        spoil: |images, random| {
            with_depth(images, |z| match random.uniform() {
                salt if salt < 0.02 => (0.3 + 400.0 * salt) as f32,
                _ => z,
            })
        },
    },
    Spoilt { spoil: |images, _| with_colour(images, [255; 3]) },
    Spoilt { spoil: |images, _| with_colour(images, [0; 3]) },
];

fn with_depth(images: &Images, change: impl FnMut(f32) -> f32) -> Images {
    let depth = images.depth.as_ref().unwrap().map(change);
    Images { depth: Some(Arc::new(depth)), ..images.clone() }
}

fn with_colour(images: &Images, colour: [u8; 3]) -> Images {
    let image = images.colour.as_ref().unwrap().map(|_| colour);
    Images { colour: Some(Arc::new(image)), ..images.clone() }
}

/// Returns the part of the frames in which a confirmed track is within half a metre of the person.
fn recall(config: &str, camera: &Arc<Camera>, shots: &[Shot], spoilt: &Spoilt) -> f64 {
    let mut pipeline = pipeline(config);
    let mut random = SplitMix64::new(7);
    let mut found = 0;
    for (index, shot) in shots.iter().enumerate() {
        let images = (spoilt.spoil)(&shot.images, &mut random);
        let report = pipeline.step(frame(camera, index, images)).unwrap();
        let head = shot.truth[0].head_in_robot;
        let confirmed = report.tracks.iter().filter(|track| track.confirmed && track.seen);
        let mut places = confirmed.map(|track| track.estimate.person.position);
        found += usize::from(places.any(|place| (place - head).xy().norm() < 0.5));
    }
    found as f64 / shots.len() as f64
}

#[test]
fn s2_noise_breaks_nothing_and_its_cost_in_recall_is_known() {
    let (camera, shots) = shots();
    let camera = Arc::new(camera);
    let recalls = SPOILT.map(|spoilt| recall("depth-ekf.toml", &camera, &shots, &spoilt));
    let [clean, holes, salt, white, black] = recalls;
    assert!(clean > 0.9, "{recalls:?}");
    assert!(holes > 0.8 && salt > 0.8, "{recalls:?}");
    // The detector of this config reads depth alone.
    assert_eq!((clean, clean), (white, black));
    // Pipelines that read colour may lose the person, and nothing else.
    for spoilt in &SPOILT {
        recall("depth-verified.toml", &camera, &shots, spoilt);
        recall("mono.toml", &camera, &shots, spoilt);
    }
}
