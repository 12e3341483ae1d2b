//! How long a stereo pair of 512x384 with five people takes to draw.
#![allow(clippy::expect_used, missing_docs, reason = "a broken bench may stop loudly")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_sim::{Event, Scene, Simulation};

const SCENE: &str = include_str!("../../configs/scenes/stereo-hall.toml");

fn stereo_pair(c: &mut Criterion) {
    let scene = Scene::parse(SCENE).expect("the scene is right");
    let mut simulation = Simulation::new(&scene, 2);
    c.bench_function("draw a stereo pair of 512x384 with five people", |b| {
        b.iter(|| {
            loop {
                match simulation.next_event() {
                    Some(Event::Shot(shot)) => break black_box(shot),
                    Some(_) => {}
                    None => simulation = Simulation::new(&scene, 2),
                }
            }
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = stereo_pair
}
criterion_main!(benches);
