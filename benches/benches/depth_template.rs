//! The silhouette kernels: one template at one place, everything else of a
//! frame, and a whole frame of the pipeline.
#![allow(clippy::expect_used, missing_docs, reason = "a broken test or bench may stop loudly")]

use std::f64::consts::PI;
use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Point2, Point3};
use tagalong_config::Registry;
use tagalong_core::{DepthImage, Detector, EgoMotion, Frame, Funnel, Images, Query, Stamp};
use tagalong_depth_template::{
    Bank, DepthTemplate, DepthTemplateConfig, Direction, Matcher, Pose, render,
};
use tagalong_geometry::{Camera, Pinhole};
use tagalong_pipeline::Pipeline;
use tagalong_vision::RowSums;

const CONFIG: &str = include_str!("../../configs/depth-ekf.toml");

fn camera() -> Arc<Camera> {
    Arc::new(Camera::mounted(Pinhole::centred(525.0, 640, 480), 640, 480, 1.2, 0.0, 0.0))
}

/// Four people in front of a wall, on a floor, at 640x480.
fn depth(camera: &Camera) -> DepthImage {
    let body = render(PI, 0.0);
    let heads =
        [(1.8, 0.6), (2.4, -0.5), (3.0, 0.3), (4.0, -1.7)].map(|(x, y)| Point3::new(x, y, 1.6));
    DepthImage::from_fn(640, 480, |u, v| {
        let ray = camera.ray(Point2::new(u as f64, v as f64));
        let floor = if ray.y > 0.0 { 1.2 / ray.y } else { f64::INFINITY };
        let people = heads.iter().map(|head| {
            let down = ray.y * head.x - (1.2 - head.z);
            head.x + body.at(ray.x * head.x + head.y, down.min(0.45))
        });
        people.fold(floor.min(6.0), f64::min) as f32
    })
}

fn frame(camera: &Arc<Camera>, depth: &Arc<DepthImage>, index: u64) -> Frame {
    let images = Images { depth: Some(Arc::clone(depth)), ..Images::default() };
    let stamp = Stamp::from_nanos(index * 33_000_000);
    let motion = EgoMotion::at_rest(if index == 0 { 0.0 } else { 0.033 });
    Frame::new(index, stamp, Arc::clone(camera), motion, images)
}

fn kernels(c: &mut Criterion) {
    let camera = camera();
    let depth = Arc::new(depth(&camera));
    c.bench_function("row sums, 640x480 to 320x240", |b| {
        b.iter(|| RowSums::new(black_box(&depth), 2))
    });
    let rows = RowSums::new(&depth, 2);
    let matcher = Matcher::new(&DepthTemplateConfig::default(), 0.0);
    let mut bank = Bank::new(28);
    let template = bank.template(Pose::nearest(Direction::Along, 0.0, 0.0, 131.0));
    c.bench_function("one template at one place, 2 m", |b| {
        b.iter(|| matcher.fit(&rows, template, black_box(100), black_box(80), 2.0));
    });
}

fn frames(c: &mut Criterion) {
    let camera = camera();
    let depth = Arc::new(depth(&camera));
    let mut detector =
        DepthTemplate::new(DepthTemplateConfig::default()).expect("default settings");
    c.bench_function("depth-template, discover, 640x480, 4 people", |b| {
        b.iter(|| {
            let frame = frame(&camera, &depth, 1);
            let search = Query::Discover { occupied: &[] };
            let found = detector.detect(&frame, &search, &mut Funnel::default());
            assert_eq!(found.map(|f| f.len()), Ok(4));
        });
    });
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    let mut pipeline = Pipeline::builder(&registry).from_toml(CONFIG).expect("shipped config");
    let mut index = 0;
    c.bench_function("depth-ekf, whole frame, 640x480, 4 people", |b| {
        b.iter(|| {
            index += 1;
            pipeline.step(frame(&camera, &depth, index)).expect("a frame with depth").tracks.len()
        });
    });
}

criterion_group!(benches, kernels, frames);
criterion_main!(benches);
