//! The scenes under `configs/scenes/`: all of them can be drawn, for every split.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may fail")]

use std::fs;
use std::path::{Path, PathBuf};

use tagalong_sim::{ApproachBy, CameraKind, Event, Scene, Shot, Simulation, Split, Variant};

fn suites() -> Vec<(String, String)> {
    fn name(path: &Path) -> String {
        path.file_stem().unwrap().to_string_lossy().into_owned()
    }

    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../configs/scenes");
    let mut paths: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    paths.iter().map(|path| (name(path), fs::read_to_string(path).unwrap())).collect()
}

fn suite(name: &str) -> String {
    suites().into_iter().find(|s| s.0 == name).unwrap().1
}

/// The first image of a small version of a scene.
fn first_shot(mut scene: Scene) -> Shot {
    (scene.camera.width, scene.camera.height) = (40, 30);
    scene.faults.dropped = 0.0;
    let mut simulation = Simulation::new(&scene, 1);
    loop {
        if let Event::Shot(shot) = simulation.next_event().unwrap() {
            return *shot;
        }
    }
}

#[test]
fn every_scene_can_be_drawn_for_every_split_and_camera() {
    for (name, text) in suites() {
        for (split, number) in Split::ALL.into_iter().zip([3, 8, 13]) {
            let variant = Variant::of_split(split, number);
            let scene = parse_scene(&name, &text, &variant);
            assert_eq!(scene.split(), split, "{name}");
            assert_eq!(scene, parse_scene(&name, &text, &variant), "{name}");
            let shot = first_shot(scene.clone());
            let late = scene.people.iter().filter(|person| person.enters_s > 0.0);
            let late: usize = late.map(|person| 1 + person.companions).sum();
            let comes = scene.approach.iter().filter(|one| one.by == ApproachBy::Person);
            let late = late + comes.count();
            assert_eq!(shot.truth.len() + late, scene.number_of_people(), "{name}");
            for kind in ["rgbd", "stereo"] {
                // A pair has images of light only.
                let lit = variant.clone().with("camera.colour", true);
                let other = parse_scene(&name, &text, &lit.with("camera.kind", kind));
                assert_eq!(other.camera.kind == CameraKind::Stereo, kind == "stereo", "{name}");
            }
        }
    }
}

/// Reads a scene; an error is told as a user sees it.
fn parse_scene(name: &str, text: &str, variant: &Variant) -> Scene {
    let scene = Scene::parse_with(text, variant);
    scene.map_err(|e| e.render(name, text)).unwrap_or_else(|told| panic!("{told}"))
}

#[test]
fn every_ride_can_have_a_path_of_its_own() {
    for (name, text) in suites().into_iter().filter(|(name, _)| name.starts_with("follow-")) {
        let mut paths = Vec::new();
        let mut changed = false;
        for number in 0..5 {
            let plain = Variant::of_split(Split::Test, number);
            let varied =
                plain.clone().with("variation.path_jitter_m", 0.3).with("variation.mirror", true);
            let scene = parse_scene(&name, &text, &varied);
            let path = scene.people[0].path.clone();
            changed |= path != parse_scene(&name, &text, &plain).people[0].path;
            assert!(!paths.contains(&path), "{name}: two seeds have the same path");
            paths.push(path);
            assert!(!first_shot(scene).truth.is_empty(), "{name}: the person is there");
        }
        assert!(changed, "{name}");
    }
}

#[test]
fn rooms_that_vary_are_shared_by_no_two_splits() {
    for (name, text) in suites().iter().filter(|(_, text)| text.contains("[vary]")) {
        let [train, validation, test] = Split::ALL.map(|split| -> Vec<[f64; 2]> {
            (0..20)
                .map(|n| parse_scene(name, text, &Variant::of_split(split, n)).room.size_m)
                .collect()
        });
        if name == "turntable" {
            continue;
        }
        assert!(!train.iter().any(|s| validation.contains(s) || test.contains(s)), "{name}");
        assert!(!validation.iter().any(|s| test.contains(s)), "{name}");
    }
}

#[test]
fn fourteen_crossings_differ_and_come_again_with_other_people() {
    let text = suite("crossing-parallel");
    let scenes: Vec<Scene> =
        (0..28).map(|n| Scene::parse_with(&text, &Variant::of_seed(n)).unwrap()).collect();
    let shapes: Vec<[f64; 4]> = scenes
        .iter()
        .map(|Scene { people: p, .. }| {
            [p[0].path[0][0], p[0].speed_mps, p[1].path[0][0], p[1].speed_mps]
        })
        .collect();
    for (i, one) in shapes[..14].iter().enumerate() {
        assert!(!shapes[..i].contains(one), "{i}");
        assert_eq!(*one, shapes[14 + i]);
        let [near, _, far, _] = one;
        assert!(far - near >= 0.7, "{near} {far}");
    }
    assert_ne!(scenes[0], Scene { seed: 0, ..scenes[14].clone() });
}

#[test]
fn the_sequences_contain_what_they_are_for() {
    for seed in [0, 5] {
        for (name, least) in
            [("crossing-parallel", 1), ("crossing-oblique", 1), ("full-occlusion", 3)]
        {
            assert!(hidden_shots(name, seed) >= least, "{name} {seed}");
        }
    }
}

/// Counts the shots in which somebody is almost hidden.
fn hidden_shots(name: &str, seed: u64) -> usize {
    let variant = Variant::of_seed(seed).with("camera.width", 48).with("camera.height", 36);
    let mut simulation = Simulation::new(&parse_scene(name, &suite(name), &variant), 1);
    let mut hidden = 0;
    while let Some(event) = simulation.next_event() {
        if let Event::Shot(shot) = event {
            hidden += usize::from(
                shot.truth.iter().any(|t| t.occluder.is_some() && t.visible_fraction < 0.3),
            );
        }
    }
    hidden
}
