//! How long the circular image of a conical mirror takes to draw and to unwrap.
#![allow(clippy::expect_used, missing_docs, reason = "a broken bench may stop loudly")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use tagalong_core::{GreyImage, RgbImage};
use tagalong_sim::{Event, Scene, Shot, Simulation};
use tagalong_vision::Unwrapper;

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

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = drawing, unwrapping
}
criterion_main!(benches);
