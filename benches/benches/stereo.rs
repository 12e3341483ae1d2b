//! Disparities of a pair of 512x384 pixels, of 64 disparities, and everything from
//! such a pair of images to wheel speeds; on one thread.
#![allow(clippy::expect_used, missing_docs, reason = "a broken test or bench may stop loudly")]

use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_core::{Camera, Frame, GreyImage, Images, Motion, Registry, Stamp};
use tagalong_pipeline::Pipeline;
use tagalong_sim::{Event, Scene, Shot, Simulation};
use tagalong_stereo::{Matcher, Method, StereoSettings};

const SIZE: (usize, usize) = (512, 384);
const METHODS: [(&str, Method); 2] =
    [("block", Method::Block), ("semi-global", Method::SemiGlobal)];
const CONFIG: &str = include_str!("../../configs/stereo-ekf.toml");
/// Two people at 2 and 3 m in front of the papers' stereo camera.
const SCENE: &str = "
duration_s = 1.0
[room]
size_m = [8.0, 6.0]
wallpaper = true
[camera]
kind = 'stereo'
width = 512
height = 384
field_of_view_deg = 100.0
baseline_m = 0.12
[robot]
start = [1.0, 3.0]
[[people]]
path = [[3.0, 3.4]]
heading_deg = 180.0
[[people]]
path = [[4.0, 2.2]]
heading_deg = 90.0
";

/// Smooth noise: each pixel the mean of hashes around it.
fn pattern(x: usize, y: usize) -> u8 {
    let hash = |x: usize, y: usize| {
        let h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
        ((h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D) >> 24) as usize
    };
    let sum: usize = (0..9).map(|i| hash(x + i % 3, y + i / 3)).sum();
    (sum / 9) as u8
}

/// A wall at 8 px, and in front of it a box at 30 px.
fn pair() -> (GreyImage, GreyImage) {
    let boxed = |x: usize, y: usize| (180..330).contains(&x) && y > 100;
    let left = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        if boxed(x, y) { pattern(x + 1000, y) } else { pattern(x, y) }
    });
    let right = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        if boxed(x + 30, y) { pattern(x + 1030, y) } else { pattern(x + 8, y) }
    });
    (left, right)
}

fn matchers(criterion: &mut Criterion) {
    let (left, right) = pair();
    for (name, method) in METHODS {
        let settings = StereoSettings { method, threads: 1, ..StereoSettings::default() };
        let mut matcher = Matcher::new(settings).expect("valid settings");
        criterion.bench_function(&format!("stereo {name} 512x384, 64 disparities"), |bencher| {
            bencher.iter(|| {
                let found = matcher.disparities(black_box(&left), &right, 63).expect("one size");
                found.values[SIZE.0 * 200 + 250]
            });
        });
    }
}

fn shot() -> (Arc<Camera>, Images) {
    let mut simulation = Simulation::new(&Scene::parse(SCENE).expect("a scene"), 1);
    let camera = Arc::new(simulation.camera().clone());
    let images = std::iter::from_fn(|| simulation.next_event()).find_map(|event| match event {
        Event::Shot(shot) => Some(Shot::clone(&shot).images),
        _ => None,
    });
    (camera, images.expect("an image"))
}

fn to_wheel_speeds(criterion: &mut Criterion) {
    let (camera, images) = shot();
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    for (name, _) in METHODS {
        let method = format!("method = \"{name}\"\nthreads = 1\n");
        let config = CONFIG.replace("method = \"semi-global\"\n", &method)
            + "\n[controller]\nplugin = \"arc-follow\"\n";
        let (mut pipeline, _) =
            Pipeline::from_toml(&config, Path::new("."), &registry).expect("shipped config");
        let mut index = 0;
        let mut step = || {
            index += 1;
            let stamp = Stamp::from_nanos(index * 100_000_000);
            let motion = Motion::at_rest(if index == 1 { 0.0 } else { 0.1 });
            let frame = Frame::new(index, stamp, Arc::clone(&camera), motion, images.clone());
            pipeline.step(&frame).expect("a frame with a pair")
        };
        let report = (0..10).map(|_| step()).last().expect("ten frames");
        assert_eq!(report.tracks.iter().filter(|t| t.confirmed && t.seen).count(), 2);
        assert!(report.command.is_some());
        criterion.bench_function(&format!("pair to wheel speeds, {name}, 2 people"), |bencher| {
            bencher.iter(|| step().tracks.len());
        });
    }
}

criterion_group!(benches, matchers, to_wheel_speeds);
criterion_main!(benches);
