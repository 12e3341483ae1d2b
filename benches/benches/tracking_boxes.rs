//! Boxes in the image: the trackers that re-identify people, for one person and one frame, and the
//! whole pipeline on recorded boxes.
#![allow(clippy::expect_used, missing_docs, reason = "a broken test or bench may stop loudly")]

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use tagalong_benches::square::{camera, frame, track};
use tagalong_compressive::{Compressive, Config};
use tagalong_core::{Detector, EgoMotion, ExternalDetection, Frame, Funnel, Images, Query, Stamp};
use tagalong_correlation::Correlation;
use tagalong_geometry::Rect;
use tagalong_pipeline::Pipeline;

const RECORDED: &str = include_str!("../../configs/recorded.toml");

/// Measures the widest search there is, and the cost of each person in plain view.
fn correlation(criterion: &mut Criterion) {
    let camera = camera();
    let sure = track(&camera, 0.1);
    let unsure = track(&camera, 0.4);
    let of = sure.estimate.region;
    let seen = frame(&camera, of, 1, 2.92);
    let in_shadow = frame(&camera, of, 2, f32::NAN);
    let mut detector =
        Correlation::new(tagalong_correlation::Config::default()).expect("the defaults work");
    let all = std::slice::from_ref(&sure);
    detector.learn(&seen, all).expect("the frame has both images");
    criterion.bench_function("correlation: one person, searched and found", |bencher| {
        bencher.iter(|| {
            let found = detector.detect(&in_shadow, &Query::Track(&unsure), &mut Funnel::default());
            assert_eq!(black_box(found).expect("it has what it needs").len(), 1);
        });
    });
    criterion.bench_function("correlation: one person in plain view, learnt", |bencher| {
        bencher.iter(|| {
            let found = detector.detect(&seen, &Query::Track(&sure), &mut Funnel::default());
            detector.learn(&seen, all).expect("the frame has both images");
            assert_eq!(black_box(found).expect("it has what it needs").len(), 0);
        });
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
    (0..8)
        .map(|k| {
            let x = 300.0 + 200.0 * ((index as f64) * 0.02 + k as f64).sin();
            ExternalDetection::in_image(Rect::new(x, 120.0 + 8.0 * k as f64, 70.0, 190.0), 0.95)
        })
        .collect()
}

fn boxes(criterion: &mut Criterion) {
    let camera = camera();
    let registry = tagalong_catalog::registry();
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
            let mut pipeline = Pipeline::builder(&registry)
                .from_toml(RECORDED)
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
