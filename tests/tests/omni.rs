//! Tracking of people in a conical mirror, from simulated rooms and logs to tracks.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot go on fails")]

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use tagalong_core::{RgbImage, Stamp};
use tagalong_geometry::Panorama;
use tagalong_log::camera_info::{CONICAL_MIRROR, UNWRAPPED, mirror_coefficients};
use tagalong_log::msgs::{CameraInfo, Header, Image, TFMessage, TransformStamped};
use tagalong_log::write::MessageLog;
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};
use tagalong_sim::{Event, Scene, Shot, Simulation};
use tagalong_trials::{Contender, Judge, Trial};

/// Scene in which a person enters after the background is learned, and walks behind the robot,
/// across the seam of the panorama.
const ROOM: &str = "seed = 5\nduration_s = 15.0\n[room]\nsize_m = [10.0, 5.0]\n\
    floor = \"carpet\"\nwallpaper = true\n[camera]\nkind = \"panorama\"\nwidth = 480\n\
    height = 480\nrate_hz = 3.0\nheight_m = 1.55\n[robot]\nstart = [5.0, 2.5]\n\
    [[people]]\npath = [[3.0, 1.4], [2.6, 3.8]]\nspeed_mps = 0.6\nenters_s = 9.0\nlook = 21\n";
/// Number of images of a log; uncompressed ones are large.
const FRAMES_OF_A_LOG: usize = 12;
/// Name of the camera's frame.
const CAMERA: &str = "camera";

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs")
}

fn contender(name: &str) -> Contender {
    let config = std::fs::read_to_string(configs().join(format!("{name}.toml"))).unwrap();
    Contender { folder: configs(), ..Contender::new(name, config) }
}

#[test]
fn a_person_who_crosses_the_seam_keeps_identity_and_place() {
    let scene = Scene::parse(ROOM).unwrap();
    let contenders = [contender("omni-rich"), contender("omni-ekf"), contender("omni-appearance")];
    let trial = Trial::new(&scene, &contenders, &tagalong_catalog::registry(), 2).unwrap();
    let sides: BTreeSet<bool> = trial
        .moments
        .iter()
        .flat_map(|moment| &moment.truth)
        .map(|person| person.head_in_robot.y > 0.0)
        .collect();
    // The seam is straight behind the robot, so a person that crosses it changes the side.
    assert_eq!(sides.len(), 2, "nobody crossed the seam");
    for run in &trial.runs {
        let judged = Judge::default().judge(&trial, run).unwrap();
        let scores = judged.tally.scores();
        let numbers: BTreeSet<_> = run
            .reports
            .iter()
            .flat_map(|r| &r.tracks)
            .filter(|t| t.confirmed)
            .map(|t| t.id)
            .collect();
        assert_eq!((numbers.len(), scores.idsw), (1, 0), "{}: {scores:?}", run.pipeline);
        assert!(scores.recall.is_some_and(|r| r > 0.75), "{}: {scores:?}", run.pipeline);
        let errors = &judged.errors_in_robot_m;
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        assert!(mean < 0.2, "{}: {mean}", run.pipeline);
    }
}

/// Returns the circular images of the first moments, with a person in the last of them.
fn shots(scene: &Scene) -> (Simulation, Vec<Shot>) {
    let mut simulation = Simulation::new(scene, 2);
    let events = std::iter::from_fn(|| simulation.next_event());
    let shots = events.filter_map(|event| match event {
        Event::Shot(shot) => Some(*shot),
        _ => None,
    });
    let shots = shots.take(FRAMES_OF_A_LOG).collect();
    (simulation, shots)
}

/// Writes a log of uncompressed images, as a camera driver does.
fn write(path: &Path, simulation: &Simulation, info: &CameraInfo, images: &[(Stamp, RgbImage)]) {
    let mut log = MessageLog::create(path).unwrap();
    let mount = TransformStamped {
        header: Header::new(images[0].0, "base_link"),
        child_frame_id: CAMERA.into(),
        transform: (&simulation.camera().robot_from_camera).into(),
    };
    log.send("/tf_static", images[0].0, &TFMessage { transforms: vec![mount] }).unwrap();
    for (stamp, image) in images {
        let header = Header::new(*stamp, CAMERA);
        let info = CameraInfo { header: header.clone(), ..info.clone() };
        log.send("/camera/color/camera_info", *stamp, &info).unwrap();
        let message = Image {
            header,
            height: image.height() as u32,
            width: image.width() as u32,
            encoding: "rgb8".into(),
            is_bigendian: 0,
            step: 3 * image.width() as u32,
            data: image.pixels().as_flattened(),
        };
        log.send("/camera/color/image_raw", *stamp, &message).unwrap();
    }
    log.finish().unwrap();
}

fn info(model: &str, size: [usize; 2], focal: f64, centre: [f64; 2], d: [f64; 4]) -> CameraInfo {
    CameraInfo {
        width: size[0] as u32,
        height: size[1] as u32,
        distortion_model: model.into(),
        d: d.to_vec(),
        k: [focal, 0.0, centre[0], 0.0, focal, centre[1], 0.0, 0.0, 1.0],
        r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    }
}

/// Positions of people in each image, m.
type Places = Vec<Vec<[f64; 3]>>;

/// Returns the images of a log as the tracker receives them, and the positions of detections.
fn seen(path: &Path) -> (Vec<(Stamp, RgbImage)>, Places) {
    // A short log has few images from which to learn the background.
    let few = "[[detectors]]\nplugin = \"omni-appearance\"\nconfig = { distance = \"rich\", \
               background_frames = 6 }\n[filter]\nplugin = \"floor-kalman\"\n";
    let mut pipeline =
        Contender::new("few", few).pipeline(&tagalong_catalog::registry(), 0).unwrap();
    let inputs = Inputs::ANY.require(Input::Colour);
    let input = InputSettings::default();
    let limits = Limits::default();
    let mut source = FrameSource::open(path, &input, &limits, inputs).unwrap();
    let mut images = Vec::new();
    let mut places = Vec::new();
    while let Some(item) = source.next_frame() {
        let report = pipeline.step(&item.frame).unwrap();
        places.push(report.candidates.iter().map(|c| c.detection.position.into()).collect());
        images.push((item.frame.stamp, item.frame.colour().unwrap().clone()));
    }
    (images, places)
}

#[test]
fn a_circular_log_and_an_unwrapped_one_show_the_same_people() {
    fn counts(all: &Places) -> Vec<usize> {
        all.iter().map(Vec::len).collect::<Vec<_>>()
    }

    // The log ends after 12 images at 3 Hz, so the person has to enter early.
    let enters_early = ROOM.replace("enters_s = 9.0", "enters_s = 2.5");
    let (simulation, shots) = shots(&Scene::parse(&enters_early).unwrap());
    let panorama: Panorama = *simulation.panorama().unwrap();
    let mirror = panorama.mirror;
    let folder = tempfile::tempdir().unwrap();
    let raw = folder.path().join("raw.mcap");
    let unwrapped = folder.path().join("flat.mcap");
    let circles: Vec<_> = shots
        .iter()
        .map(|shot| {
            let image = shot.images.colour.as_deref().unwrap().clone();
            (Stamp::from_nanos(1_000_000_000 + shot.captured_ns), image)
        })
        .collect();
    let side = [circles[0].1.width(), circles[0].1.height()];
    let centre = mirror.centre_px.into();
    let circular =
        info(CONICAL_MIRROR, side, mirror.focal_px, centre, mirror_coefficients(&mirror));
    write(&raw, &simulation, &circular, &circles);
    let (panoramas, from_circles) = seen(&raw);
    let [half_angle, apex, inner, outer] = mirror_coefficients(&mirror);
    let tangents = [half_angle, apex, inner / mirror.focal_px, outer / mirror.focal_px];
    let size = [panoramas[0].1.width(), panoramas[0].1.height()];
    assert_eq!(size, [480, 120]);
    let across = size[0] as f64 / TAU;
    let middle = [0.5 * size[0] as f64, 0.5 * size[1] as f64];
    write(&unwrapped, &simulation, &info(UNWRAPPED, size, across, middle, tangents), &panoramas);
    let (same, from_panoramas) = seen(&unwrapped);
    assert_eq!(same, panoramas);
    assert!(from_circles.iter().any(|people| people.len() == 1), "{from_circles:?}");
    for (a, b) in from_circles.iter().flatten().zip(from_panoramas.iter().flatten()) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?} {b:?}");
    }
    assert_eq!(counts(&from_circles), counts(&from_panoramas));
}
