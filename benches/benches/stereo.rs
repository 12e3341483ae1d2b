//! Disparities of a pair of 512x384 pixels, of 64 disparities, and everything from
//! such a pair of images to wheel speeds, stage by stage; on one thread. Times are of
//! the processor, not of the clock on the wall: other programs hardly matter.
#![allow(clippy::expect_used, missing_docs, reason = "a broken test or bench may stop loudly")]
#![allow(clippy::print_stdout, reason = "the shares of the stages are for whoever runs it")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use cpu_time::ThreadTime;
use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_core::{EgoMotion, Frame, GreyImage, Images, Stamp};
use tagalong_geometry::Camera;
use tagalong_pipeline::{FrameReport, Pipeline};
use tagalong_sim::{Event, Scene, Shot, Simulation};
use tagalong_stereo::{Matcher, Method, StereoSettings};

const SIZE: (usize, usize) = (512, 384);
const METHODS: [(&str, Method); 2] =
    [("block", Method::Block), ("semi-global", Method::SemiGlobal)];
/// Without a verifier, with that of P4, and with the better one.
const CONFIGS: [(&str, &str); 3] = [
    ("stereo-ekf", include_str!("../../configs/stereo-ekf.toml")),
    ("stereo-svm-ekf", include_str!("../../configs/stereo-svm-ekf.toml")),
    ("stereo-verified", include_str!("../../configs/stereo-verified.toml")),
];
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
path = [[3.6, 2.0]]
heading_deg = 180.0
";

/// Processor time of the thread.
struct ProcessorTime;

impl Measurement for ProcessorTime {
    type Intermediate = ThreadTime;
    type Value = Duration;

    fn start(&self) -> ThreadTime {
        ThreadTime::now()
    }

    fn end(&self, start: ThreadTime) -> Duration {
        start.elapsed()
    }

    fn add(&self, a: &Duration, b: &Duration) -> Duration {
        *a + *b
    }

    fn zero(&self) -> Duration {
        Duration::ZERO
    }

    fn to_f64(&self, value: &Duration) -> f64 {
        WallTime.to_f64(value)
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter()
    }
}

/// Smooth noise: each pixel the mean of hashes around it.
fn pattern(x: usize, y: usize) -> u8 {
    fn hash(x: usize, y: usize) -> usize {
        let h = (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA77);
        ((h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D) >> 24) as usize
    }

    let sum: usize = (0..9).map(|i| hash(x + i % 3, y + i / 3)).sum();
    (sum / 9) as u8
}

/// A wall at 8 px, and in front of it a box at 30 px.
fn pair() -> (GreyImage, GreyImage) {
    fn boxed(x: usize, y: usize) -> bool {
        (180..330).contains(&x) && y > 100
    }

    let left = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        if boxed(x, y) { pattern(x + 1000, y) } else { pattern(x, y) }
    });
    let right = GreyImage::from_fn(SIZE.0, SIZE.1, |x, y| {
        if boxed(x + 30, y) { pattern(x + 1030, y) } else { pattern(x + 8, y) }
    });
    (left, right)
}

fn matchers(criterion: &mut Criterion<ProcessorTime>) {
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

fn shot(seed: u64) -> (Arc<Camera>, Images) {
    let scene = format!("seed = {seed}\n{SCENE}");
    let mut simulation = Simulation::new(&Scene::parse(&scene).expect("a scene"), 1);
    let camera = Arc::new(simulation.camera().clone());
    let images = std::iter::from_fn(|| simulation.next_event()).find_map(|event| match event {
        Event::Shot(shot) => Some(Shot::clone(&shot).images),
        _ => None,
    });
    (camera, images.expect("an image"))
}

/// A pipeline in front of the two people, with everything on one thread.
struct Bench {
    pipeline: Pipeline,
    camera: Arc<Camera>,
    images: Images,
    index: u64,
}

impl Bench {
    fn new(config: &str, method: &str, (camera, images): (Arc<Camera>, Images)) -> Self {
        let registry = tagalong_catalog::registry();
        let mut config: toml::Table = config.parse().expect("a shipped config");
        let stereo = config["stereo"].as_table_mut().expect("it matches pairs");
        stereo.insert("method".into(), method.into());
        stereo.insert("threads".into(), 1.into());
        let controller = toml::Table::from_iter([("plugin".to_owned(), "arc-follow".into())]);
        config.insert("controller".into(), controller.into());
        let pipeline =
            Pipeline::builder(&registry).from_toml(&config.to_string()).expect("a shipped config");
        Self { pipeline, camera, images, index: 0 }
    }

    fn step(&mut self) -> FrameReport {
        self.index += 1;
        let stamp = Stamp::from_nanos(self.index * 100_000_000);
        let motion = EgoMotion::at_rest(if self.index == 1 { 0.0 } else { 0.1 });
        let camera = Arc::clone(&self.camera);
        let frame = Frame::new(self.index, stamp, camera, motion, self.images.clone());
        self.pipeline.step(&frame).expect("a frame with a pair")
    }

    /// The median of each stage over some frames, by the clock on the wall.
    fn shares(&mut self) -> String {
        let reports: Vec<FrameReport> = (0..101).map(|_| self.step()).collect();
        let mut medians = Vec::new();
        for (stage, (name, _)) in reports[0].timings.iter().enumerate() {
            let mut ms: Vec<f64> = reports.iter().map(|r| r.timings[stage].1).collect();
            ms.sort_by(f64::total_cmp);
            medians.push(format!("{name} {:.2}", ms[ms.len() / 2]));
        }
        medians.join(", ")
    }
}

/// Returns all configs with both matchers, in front of the first two people that all of them see:
/// the simulator decides on clothes and posture.
fn all() -> Vec<(String, Bench)> {
    fn of_seed(seed: u64) -> Option<Vec<(String, Bench)>> {
        let seen = shot(seed);
        let mut all = Vec::new();
        for (config, text) in CONFIGS {
            for (method, _) in METHODS {
                let mut bench = Bench::new(text, method, seen.clone());
                let report = (0..10).map(|_| bench.step()).last()?;
                if report.tracks.iter().filter(|t| t.confirmed && t.seen).count() != 2 {
                    return None;
                }
                assert!(report.command.is_some());
                all.push((format!("pair to wheel speeds, {config}, {method}, 2 people"), bench));
            }
        }
        Some(all)
    }

    (0..50).find_map(of_seed).expect("two people whom all see")
}

fn to_wheel_speeds(criterion: &mut Criterion<ProcessorTime>) {
    for (name, mut bench) in all() {
        println!("{name}, ms: {}", bench.shares());
        criterion.bench_function(&name, |bencher| bencher.iter(|| bench.step().tracks.len()));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().with_measurement(ProcessorTime);
    targets = matchers, to_wheel_speeds
}
criterion_main!(benches);
