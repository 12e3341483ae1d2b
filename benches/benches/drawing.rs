//! Rendering time of images of 512x384 with five people on two threads: a stereo pair, and depth
//! alone.
#![allow(clippy::expect_used, missing_docs, reason = "a broken bench may stop loudly")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_sim::{CameraKind, Event, Scene, Simulation};

const SCENE: &str = include_str!("../../configs/scenes/stereo-hall.toml");

/// Draws one shot after the other of a scene that starts again at its end.
fn shots(c: &mut Criterion, name: &str, scene: &Scene) {
    let mut simulation = Simulation::new(scene, 2);
    c.bench_function(name, |b| {
        b.iter(|| {
            loop {
                match simulation.next_event() {
                    Some(Event::Shot(shot)) => break black_box(shot),
                    Some(_) => {}
                    None => simulation = Simulation::new(scene, 2),
                }
            }
        });
    });
}

fn images(c: &mut Criterion) {
    let mut scene = Scene::parse(SCENE).expect("the scene is right");
    shots(c, "draw a stereo pair of 512x384 with five people", &scene);
    scene.camera.kind = CameraKind::Rgbd;
    scene.camera.colour = false;
    shots(c, "draw depth of 512x384 with five people", &scene);
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = images
}
criterion_main!(benches);
