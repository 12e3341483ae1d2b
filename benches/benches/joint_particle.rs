//! Weighing scenes of two people, which P3 counts as template matching.
#![allow(clippy::expect_used, missing_docs, reason = "a broken test or bench may stop loudly")]

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_benches::overlapping::{camera, depth, frame, scenes};
use tagalong_core::Likelihood;
use tagalong_depth_template::{DepthTemplateConfig, Weigher};

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
        c.bench_function(name, |b| {
            b.iter_batched(
                || {
                    index += 1;
                    let frame = frame(index, &depth, &camera);
                    // The reduced image is shared with the detector; it is not weighing.
                    weigher.log_likelihood(&frame, &[]).expect("a frame with depth");
                    frame
                },
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
