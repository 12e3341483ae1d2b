//! Boxes in the image: the trackers that re-identify people, for one person and one frame, and the
//! whole pipeline on recorded boxes.
#![allow(clippy::expect_used, missing_docs, reason = "a broken test or bench may stop loudly")]

use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Point3, SMatrix, Vector2};
use tagalong_compressive::{Compressive, Config};
use tagalong_config::Registry;
use tagalong_core::{
    DepthImage, Detector, EgoMotion, Estimate, ExternalDetection, Frame, Funnel, GreyImage, Images,
    Person, Query, Stamp, Track, TrackId,
};
use tagalong_correlation::Correlation;
use tagalong_geometry::{Camera, Distortion, Pinhole, Rect};
use tagalong_pipeline::Pipeline;

const RECORDED: &str = include_str!("../../configs/recorded.toml");

fn camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, 640, 480, 1.3, 0.0, 0.0))
}

/// A patterned square before a patterned wall at 6 m, and its depth, m.
fn frame(camera: &Arc<Camera>, of: Rect, index: u64, face_m: f32) -> Frame {
    let inside = |x: usize, y: usize| of.contains(nalgebra::Point2::new(x as f64, y as f64));
    let grey = GreyImage::from_fn(640, 480, |x, y| {
        let (x, y, kind) = if inside(x, y) { (2 * x, y, 90) } else { (x, 3 * y, 20) };
        ((x * x / 64 + y * 7) % 120 + kind) as u8
    });
    let depth = DepthImage::from_fn(640, 480, |x, y| if inside(x, y) { face_m } else { 6.0 });
    let images =
        Images { grey: Some(Arc::new(grey)), depth: Some(Arc::new(depth)), ..Images::default() };
    let stamp = Stamp::default().plus_seconds(index as f64 * 0.04);
    Frame::new(index, stamp, Arc::clone(camera), EgoMotion::at_rest(0.04), images)
}

/// Returns a track at 3 m with this standard deviation, m.
fn track(camera: &Camera, sigma_m: f64) -> Track {
    let head = Point3::new(3.0, 0.0, 1.35);
    let region = camera.upper_body(&head);
    let person = Person { position: head, velocity: Vector2::zeros() };
    let estimate = Estimate { person, covariance: SMatrix::identity() * sigma_m.powi(2), region };
    Track {
        id: TrackId(1),
        estimate,
        seen: true,
        occluded: false,
        confirmed: true,
        age: 9,
        unseen_s: 0.0,
        score: 2.0,
    }
}

/// Measures the widest search there is, and the cost of each person in plain view.
fn correlation(criterion: &mut Criterion) {
    let camera = camera();
    let (sure, unsure) = (track(&camera, 0.1), track(&camera, 0.4));
    let of = sure.estimate.region;
    let (seen, in_shadow) = (frame(&camera, of, 1, 2.92), frame(&camera, of, 2, f32::NAN));
    let mut detector =
        Correlation::new(tagalong_correlation::Config::default()).expect("the defaults work");
    let learn = |detector: &mut Correlation| {
        detector.learn(&seen, std::slice::from_ref(&sure)).expect("the frame has both images");
    };
    learn(&mut detector);
    let mut find = |frame: &Frame, track: &Track, learns: bool| {
        let found = detector.detect(frame, &Query::Track(track), &mut Funnel::default());
        if learns {
            learn(&mut detector);
        }
        black_box(found).expect("it has what it needs").len()
    };
    criterion.bench_function("correlation: one person, searched and found", |bencher| {
        bencher.iter(|| assert_eq!(find(&in_shadow, &unsure, false), 1));
    });
    criterion.bench_function("correlation: one person in plain view, learnt", |bencher| {
        bencher.iter(|| assert_eq!(find(&seen, &sure, true), 0));
    });
}

fn compressive(criterion: &mut Criterion) {
    let camera = camera();
    let track = track(&camera, 0.1);
    let frame = frame(&camera, track.estimate.region, 1, 2.92);
    let mut detector = Compressive::new(Config::default(), 1).expect("the defaults work");
    detector.learn(&frame, std::slice::from_ref(&track)).expect("the frame has a grey image");
    criterion.bench_function("compressive: one person, found and learnt", |bencher| {
        bencher.iter(|| {
            let mut funnel = Funnel::default();
            let found = detector.detect(&frame, &Query::Track(&track), &mut funnel);
            assert_eq!(black_box(found).expect("it has what it needs").len(), 1);
            detector.learn(&frame, std::slice::from_ref(&track)).expect("as before");
        });
    });
}

/// Returns eight people that walk to and fro, as boxes of whole bodies.
fn recorded(index: u64) -> Vec<ExternalDetection> {
    let person = |k: u64| {
        let x = 300.0 + 200.0 * ((index as f64) * 0.02 + k as f64).sin();
        let region = Some(Rect::new(x, 120.0 + 8.0 * k as f64, 70.0, 190.0));
        ExternalDetection { region, head: None, score: 0.95 }
    };
    (0..8).map(person).collect()
}

fn boxes(criterion: &mut Criterion) {
    let camera = camera();
    let mut registry = Registry::default();
    tagalong_catalog::register(&mut registry);
    let frames: Vec<Frame> = (1..=200)
        .map(|index| {
            let stamp = Stamp::default().plus_seconds(index as f64 * 0.04);
            let images = Images::default();
            Frame::new(index, stamp, Arc::clone(&camera), EgoMotion::at_rest(0.04), images)
                .with_recorded(Some(recorded(index)))
        })
        .collect();
    let mut group = criterion.benchmark_group("recorded.toml, eight people");
    group.throughput(Throughput::Elements(frames.len() as u64));
    group.bench_function("200 frames", |bencher| {
        bencher.iter(|| {
            let (mut pipeline, _) = Pipeline::from_toml(RECORDED, Path::new("."), &registry)
                .expect("the shipped config is right");
            for frame in &frames {
                black_box(pipeline.step(frame).expect("nothing can fail"));
            }
        });
    });
    group.finish();
}

criterion_group!(benches, correlation, compressive, boxes);
criterion_main!(benches);
