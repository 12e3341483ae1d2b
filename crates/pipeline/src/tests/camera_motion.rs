//! `[odometry] source = "image"`: people before a camera that jerks, in a log without odometry and
//! depth.

use std::sync::Arc;

use nalgebra::{Isometry2, Point2, Point3, Rotation2, Vector2};
use tagalong_core::{Detection, EgoMotion, Frame, GreyImage, Images};

use super::doubles::{World, camera, frame, person};
use crate::{FrameReport, Pipeline};

const FRAMES: u64 = 24;
/// Image shift of a jerk, px: more than half of the way from one person to the next.
const JERK_PX: f64 = 30.0;

const BOXES: &str = "
    without = ['depth']
    merge = { same_person_m = 0.0, same_person_iou = 1.0, duplicate_m = 0.0 }
    associator.config = { cost = 'overlap', min_overlap = 0.2 }
    filter.plugin = 'image-kalman'
    manager.config = { confirm_hits = 2, confirm_within = 3 }
    [[detectors]]
    plugin = 'script'
";

/// Returns the heading of the camera in a frame, rad: every fourth frame it jerks, to and fro.
fn heading(index: u64) -> f64 {
    let away = (index / 4) % 2 == 1;
    if away { (JERK_PX / 500.0_f64).atan() } else { 0.0 }
}

/// Paints a wall far away, by the direction of a pixel.
fn paint(u: f64, v: f64) -> f64 {
    let waves = [(31.0, 9.0), (-14.0, 37.0), (8.0, -5.0), (73.0, 51.0), (-47.0, 83.0)];
    let sum: f64 = waves.iter().map(|(a, b)| (a * u + b * v + 0.1 * a).sin()).sum();
    128.0 + 24.0 * sum
}

/// The image of a camera with this heading, with a pale box where each person is.
fn image(turned: f64, people: &[Detection]) -> GreyImage {
    GreyImage::from_fn(640, 480, |x, y| {
        let at = Point2::new(x as f64, y as f64);
        for person in people {
            let rect = person.rect().unwrap();
            if (rect.x..rect.right()).contains(&at.x)
                && (rect.y..rect.y + 3.0 * rect.height).contains(&at.y)
            {
                return 230;
            }
        }
        let ray = camera().ray(at);
        let bearing = turned - ray.x.atan();
        paint(bearing, ray.y * (1.0 + ray.x * ray.x).sqrt().recip()) as u8
    })
}

/// Two people standing side by side, as a camera with this heading sees them.
fn people(turned: f64) -> Vec<Detection> {
    let people = [0.3, -0.3].map(|y| {
        let place = Rotation2::new(-turned) * Vector2::new(6.0, y);
        let mut seen = person(place.x, place.y);
        seen.position = Point3::new(place.x, place.y, 1.6);
        seen
    });
    people.to_vec()
}

fn run(config: &str, motion: impl Fn(u64) -> EgoMotion) -> Vec<FrameReport> {
    let world = World::of((1..=FRAMES).map(|index| people(heading(index))));
    let mut pipeline = world.pipeline(config);
    (1..=FRAMES)
        .map(|index| {
            let blank = frame(index, 0.1 * index as f64);
            let grey = image(heading(index), &people(heading(index)));
            let images = Images { grey: Some(Arc::new(grey)), ..Images::default() };
            let frame = Frame::new(index, blank.stamp, blank.camera, motion(index), images);
            pipeline.step(&frame).unwrap()
        })
        .collect()
}

/// Returns the numbers of the left and of the right person in each frame that shows both.
fn numbers(reports: &[FrameReport]) -> Vec<[u32; 2]> {
    reports
        .iter()
        .skip(3)
        .filter_map(|report| {
            let mut seen: Vec<_> = report.tracks.iter().filter(|track| track.seen).collect();
            seen.sort_by(|a, b| a.estimate.region.x.total_cmp(&b.estimate.region.x));
            <[u32; 2]>::try_from(seen.iter().map(|track| track.id.0).collect::<Vec<_>>()).ok()
        })
        .collect()
}

fn by_image() -> String {
    format!("odometry.source = 'image'\n{BOXES}")
}

#[test]
fn people_keep_their_numbers_before_a_camera_that_jerks() {
    fn still(_: u64) -> EgoMotion {
        EgoMotion::at_rest(0.1)
    }

    let with = numbers(&run(&by_image(), still));
    assert!(with.len() as u64 >= FRAMES - 4, "{with:?}");
    assert!(with.iter().all(|pair| *pair == with[0]), "{with:?}");
    let without = numbers(&run(BOXES, still));
    assert!(without.iter().any(|pair| *pair != without[0]), "{without:?}");
}

#[test]
fn the_turn_is_reported_as_the_motion_of_the_robot() {
    let reports = run(&by_image(), |_| EgoMotion::at_rest(0.1));
    let mut worst = 0.0_f64;
    for (index, report) in (1..).zip(&reports).skip(1) {
        let expected = heading(index) - heading(index - 1);
        worst = worst.max((report.motion.turn - expected).abs());
    }
    assert!(worst < 1e-3, "{worst} rad");
    assert!(reports.iter().all(|report| report.funnel.entries().is_empty()));
}

#[test]
fn no_robot_drives_by_it() {
    let config = format!("{}\n[controller]\nplugin = 'drive'\n", by_image());
    let built = Pipeline::builder(&World::default().registry()).from_toml(&config);
    let message = built.err().unwrap().to_string();
    assert!(message.contains("by which no robot may drive"), "{message}");
}

/// The odometry of a log is better than any image; what it says stays.
#[test]
fn a_log_with_odometry_keeps_it() {
    fn by_wheels(index: u64) -> EgoMotion {
        let step = Isometry2::rotation(heading(index) - heading(index.saturating_sub(1)));
        let motion = EgoMotion::between(&Isometry2::identity(), &step, 0.1, 0.01);
        EgoMotion { forward: 1e-4, ..motion }
    }

    let reports = run(&by_image(), by_wheels);
    for (index, report) in (1..).zip(&reports).skip(1) {
        assert_eq!(report.motion, by_wheels(index), "{index}");
    }
}
