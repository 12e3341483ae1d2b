//! Weighing scenes of two people, which P3 counts as template matching.
#![allow(clippy::expect_used, missing_docs, reason = "a broken test or bench may stop loudly")]

use std::f64::consts::PI;
use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Point2, Point3, Vector2};
use tagalong_core::{DepthImage, EgoMotion, Frame, Images, Likelihood, Person, Stamp};
use tagalong_depth_template::{DepthTemplateConfig, Weigher, render};
use tagalong_geometry::{Camera, Distortion, Pinhole};

const HEADS: [Point3<f64>; 2] = [Point3::new(2.5, 0.1, 1.6), Point3::new(3.4, -0.15, 1.65)];

/// Two people that overlap, in front of a wall, at P3's 512x384.
fn frame(index: u64, depth: &Arc<DepthImage>, camera: &Arc<Camera>) -> Frame {
    let images = Images { depth: Some(Arc::clone(depth)), ..Images::default() };
    let stamp = Stamp::from_nanos(index * 100_000_000);
    Frame::new(index, stamp, Arc::clone(camera), EgoMotion::at_rest(0.1), images)
}

fn camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 366.0, fy: 366.0, cx: 255.5, cy: 191.5, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, 512, 384, 1.2, 0.0, 0.0))
}

fn depth(camera: &Camera) -> DepthImage {
    let body = render(PI, 0.0);
    DepthImage::from_fn(512, 384, |u, v| {
        let ray = camera.ray(Point2::new(u as f64, v as f64));
        let people = HEADS.iter().map(|head| {
            let down = ray.y * head.x - (1.2 - head.z);
            head.x + body.at(ray.x * head.x + head.y, down.min(0.45))
        });
        people.fold(5.5, f64::min) as f32
    })
}

/// A number in -1..1 that looks random.
fn noise(i: usize) -> f64 {
    ((i as f64 * 12.9898).sin() * 43_758.547).fract()
}

/// Scenes around the truth; depth and height vary unless they are held.
fn scenes(count: usize, held: bool) -> Vec<Person> {
    let vary = |i: usize, part: f64| if held { 0.0 } else { part * noise(i) };
    let person = |i: usize| {
        let head = HEADS[i % 2];
        let aside = 0.2 * noise(3 * i);
        let position = Point3::new(
            head.x + vary(3 * i + 1, 0.1),
            head.y + aside,
            head.z + vary(3 * i + 2, 0.04),
        );
        Person { position, velocity: Vector2::zeros() }
    };
    (0..2 * count).map(person).collect()
}

fn weighing(c: &mut Criterion) {
    let camera = camera();
    let depth = Arc::new(depth(&camera));
    let weigher = Weigher::new(&DepthTemplateConfig::default());
    for (name, count, held) in [
        ("625 joint templates (all)", 625, false),
        ("1281 joint templates, depth held (table)", 1281, true),
        ("50 joint templates, depth held (kde50)", 50, true),
    ] {
        let people = scenes(count, held);
        let mut out = Vec::new();
        let mut index = 0;
        let mut setup = || {
            index += 1;
            let frame = frame(index, &depth, &camera);
            // The reduced image is shared with the detector; it is not weighing.
            weigher.log_likelihood(&frame, &[]).expect("a frame with depth");
            frame
        };
        c.bench_function(name, |b| {
            b.iter_batched(
                &mut setup,
                |frame| {
                    let people = black_box(&people);
                    weigher.log_likelihoods(&frame, people, 2, &mut out).expect("depth");
                    frame
                },
                criterion::BatchSize::PerIteration,
            );
        });
    }
}

criterion_group!(benches, weighing);
criterion_main!(benches);
