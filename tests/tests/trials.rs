//! Pipelines of the catalog on simulated scenes.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot go on fails")]

use std::path::Path;

use tagalong_eval::Tally;
use tagalong_sim::{Scene, Variant};
use tagalong_trials::{Contender, Judge, each};

/// Scene with two people that pass before a turning robot, one behind the other; small images,
/// which keep the test fast.
const SCENE: &str = "duration_s = 6.0\n[camera]\nwidth = 320\nheight = 240\n\
    field_of_view_deg = 70.0\n[room]\nclutter = 4\n[robot]\nstart = [0.8, 2.0]\n\
    path = [[2.2, 2.2], [2.8, 3.4]]\nspeed_mps = 0.5\n\
    [[people]]\npath = [[3.8, 4.4], [3.8, 1.6]]\nspeed_mps = 0.8\n\
    [[people]]\npath = [[4.8, 1.4], [4.8, 4.8]]\nspeed_mps = 0.8\n";

fn contenders(names: &[&str]) -> Vec<Contender> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    names
        .iter()
        .map(|name| {
            let config = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
            Contender { folder: folder.clone(), ..Contender::new(*name, config) }
        })
        .collect()
}

fn scenes(seeds: u64, duration_s: f64) -> Vec<Scene> {
    let scene = Scene::parse(SCENE).unwrap();
    (1..=seeds).map(|seed| Scene { seed, duration_s, ..scene.clone() }).collect()
}

/// Returns one tally per contender and scene.
fn tallies(names: &[&str], seeds: u64, duration_s: f64, threads: usize) -> Vec<Vec<Tally>> {
    judged(names, &scenes(seeds, duration_s), threads)
}

fn judged(names: &[&str], scenes: &[Scene], threads: usize) -> Vec<Vec<Tally>> {
    let keep = |trial: tagalong_trials::Trial| {
        let judge = Judge::default();
        trial.runs.iter().map(|run| Ok(judge.judge(&trial, run)?.tally)).collect()
    };
    each(scenes, &contenders(names), &tagalong_catalog::registry(), threads, keep, |_| ()).unwrap()
}

#[test]
fn the_naive_baseline_is_clearly_worse() {
    let all = tallies(&["naive", "depth-ekf"], 4, 6.0, 2);
    let scores = |at: usize| Tally::combine(all.iter().map(|trial| &trial[at])).scores();
    let naive = scores(0);
    let ekf = scores(1);
    assert!(ekf.idf1 > naive.idf1.map(|f| f + 0.1), "{:?} {:?}", ekf.idf1, naive.idf1);
    assert!(ekf.mota > naive.mota, "{:?} {:?}", ekf.mota, naive.mota);
}

/// People in like clothes hide each other from the camera; the scanner sees the legs of both, and
/// tells nobody from the next.
#[test]
fn camera_and_laser_together_lose_fewer_people_than_each_alone() {
    let crossing = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/scenes/crossing.toml");
    let text = std::fs::read_to_string(crossing).unwrap();
    let laser = ("laser".to_owned(), "{}".to_owned());
    let variant = |seed| Variant { seed: Some(seed), set: vec![laser.clone()], split: None };
    let scenes: Vec<Scene> =
        [1, 2].map(|seed| Scene::parse_with(&text, &variant(seed)).unwrap()).into();
    let all = judged(&["depth-laser", "depth-ekf", "laser-follow"], &scenes, 2);
    let [both, camera, laser] =
        [0, 1, 2].map(|at| Tally::combine(all.iter().map(|t| &t[at])).scores().idf1.unwrap_or(0.0));
    assert!(both > camera.max(laser) + 0.05, "{both} {camera} {laser}");
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let all = ["depth-ekf", "joint-particle"];
    assert_eq!(tallies(&all, 3, 1.0, 1), tallies(&all, 3, 1.0, 3));
}
