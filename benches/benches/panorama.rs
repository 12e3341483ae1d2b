//! Rendering and unwrapping time of the circular image of a conical mirror.
#![allow(clippy::expect_used, missing_docs, reason = "a broken bench may stop loudly")]

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_core::{EgoMotion, Frame, Funnel, GreyImage, Images, RgbImage, Stamp};
use tagalong_geometry::{Camera, Lens};
use tagalong_omni_appearance::{Config, Eyes};
use tagalong_sim::{Event, Scene, Shot, Simulation};
use tagalong_vision::{Unwrapper, Unwrapping};

const SCENE: &str = include_str!("../../configs/scenes/omni-people.toml");

fn simulation() -> Simulation {
    let mut scene = Scene::parse(SCENE).expect("the scene is right");
    scene.webcams.clear();
    Simulation::new(&scene, 2)
}

fn next(simulation: &mut Simulation) -> Option<Shot> {
    std::iter::from_fn(|| simulation.next_event()).find_map(|event| match event {
        Event::Shot(shot) => Some(*shot),
        _ => None,
    })
}

fn drawing(c: &mut Criterion) {
    let mut world = simulation();
    c.bench_function("draw 480x480 in a mirror with three people", |b| {
        b.iter(|| {
            let shot = next(&mut world);
            if shot.is_none() {
                world = simulation();
            }
            black_box(shot)
        });
    });
}

fn unwrapping(c: &mut Criterion) {
    let mut world = simulation();
    let panorama = *world.panorama().expect("the scene has a mirror");
    let colour = next(&mut world).and_then(|shot| shot.images.colour).expect("it is in colour");
    let grey = colour.to_grey();
    let mut out = RgbImage::default();
    let mut unwrapper = Unwrapper::new(&panorama, 480, 480).expect("the mirror is right");
    c.bench_function("unwrap colour 480x480 to 480x120", |b| {
        b.iter(|| unwrapper.apply(black_box(&colour), &mut out));
    });
    let mut out = GreyImage::default();
    let mut unwrapper = Unwrapper::new(&panorama, 480, 480).expect("the mirror is right");
    c.bench_function("unwrap grey 480x480 to 480x120", |b| {
        b.iter(|| unwrapper.apply(black_box(&grey), &mut out));
    });
}

/// Measures the cost of a frame for a tracker: unwrapping it and finding three people in it.
fn detecting(c: &mut Criterion) {
    let mut world = simulation();
    let panorama = *world.panorama().expect("the scene has a mirror");
    let camera = Arc::new(Camera {
        lens: Lens::Panorama(panorama),
        width: panorama.columns,
        height: panorama.rows,
        robot_from_camera: world.camera().robot_from_camera,
    });
    let config = Config { background_frames: 12, ..Config::default() };
    let mut sight = Sight {
        camera,
        unwrapping: Unwrapping::default(),
        eyes: Eyes::new(config).expect("the settings are right"),
        index: 0,
    };
    let shots: Vec<Shot> = std::iter::from_fn(|| next(&mut world)).take(40).collect();
    for shot in &shots {
        sight.people_in(&shot.images);
    }
    let last = &shots.last().expect("the scene is long enough").images;
    c.bench_function("unwrap colour and find people, 480x120", |b| {
        b.iter(|| sight.people_in(black_box(last)));
    });
}

/// Detectors of people in circular images.
struct Sight {
    camera: Arc<Camera>,
    unwrapping: Unwrapping,
    eyes: Eyes,
    index: u64,
}

impl Sight {
    /// Unwraps an image, and counts the people in it.
    fn people_in(&mut self, raw: &Images) -> usize {
        self.index += 1;
        let panorama = self.camera.panorama().expect("the camera is a panorama");
        let images = self.unwrapping.apply(panorama, raw).expect("the mirror is right");
        let stamp = Stamp::from_nanos(self.index * 333_000_000);
        let camera = Arc::clone(&self.camera);
        let frame = Frame::new(self.index, stamp, camera, EgoMotion::at_rest(0.333), images);
        let blobs = self.eyes.look(&frame, &mut Funnel::default());
        self.eyes.adapt(&frame, &[]).and(blobs).expect("the frame is in colour").len()
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = drawing, unwrapping, detecting
}
criterion_main!(benches);
