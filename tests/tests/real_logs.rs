//! The shipped `depth-ekf` config, unchanged, on every real log with depth, and `joint-particle` and
//! `rgbd-ekf` on a log with occlusions. Without `../shared/data/logs` each test reports that it
//! skips.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a broken test or bench may stop loudly"
)]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use tagalong_core::Funnel;
use tagalong_log::{FrameSource, InputSettings, Limits};
use tagalong_pipeline::Pipeline;
use tagalong_tests::people::{Boxes, Score, read, score};

#[derive(Default)]
struct Run {
    /// Boxes of confirmed tracks that were seen in the frame.
    confirmed: Boxes,
    /// Number of detections in each frame, dropped ones included.
    detections: BTreeMap<u64, usize>,
    frames: u64,
    funnel: Funnel,
}

fn data(file: &str) -> Option<PathBuf> {
    tagalong_conformance::testdata::find(&format!("logs/{file}"))
}

fn run(path: &Path, config: &str) -> Run {
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let text = std::fs::read_to_string(configs.join(format!("{config}.toml"))).unwrap();
    let registry = tagalong_catalog::registry();
    let mut pipeline = Pipeline::builder(&registry).folder(&configs).from_toml(&text).unwrap();
    let mut source =
        FrameSource::open(path, &InputSettings::default(), &Limits::default(), pipeline.inputs())
            .unwrap();
    let mut run = Run::default();
    while let Some(frame) = source.next_frame() {
        let frame = frame.frame;
        let report = pipeline.step(&frame).unwrap();
        run.frames += 1;
        run.funnel.merge(&report.funnel);
        run.detections.insert(frame.index, report.candidates.len());
        let width = frame.camera.width;
        let height = frame.camera.height;
        let seen = report.tracks.iter().filter(|t| t.confirmed && t.seen);
        let boxes: Vec<_> =
            seen.map(|t| (t.id.0, t.estimate.region.clipped(width, height))).collect();
        if !boxes.is_empty() {
            run.confirmed.insert(frame.index, boxes);
        }
    }
    // A lost frame would change the score without a message.
    assert!(!source.data_lost(), "{:?}", source.counters());
    run
}

fn scored(name: &str) -> Option<(Run, Score)> {
    scored_with(name, "depth-ekf")
}

fn scored_with(name: &str, config: &str) -> Option<(Run, Score)> {
    let path = data(&format!("{name}.mcap"))?;
    let truth = read(&path.with_file_name(format!("{name}.people.csv"))).unwrap();
    let run = run(&path, config);
    let score = score(&truth, &run.confirmed);
    println!("{name}, {config}: {score:?}\n{name}: {:?}", run.funnel);
    Some((run, score))
}

#[test]
fn the_walker_of_um_is_found_and_keeps_at_most_two_numbers() {
    let Some((run, score)) = scored("um") else { return };
    assert_eq!(run.frames, 38);
    assert_eq!((score.people, score.covered_soon), (1, 1));
    assert!(score.covered * 10 >= score.rows * 7, "{score:?}");
    assert!(score.ids[&1].len() <= 2, "{score:?}");
    assert!(score.false_boxes <= 2, "{score:?}");
}

#[test]
fn people_who_walk_past_lab2_are_found_within_two_frames() {
    let Some((_, score)) = scored("lab2-camera2") else { return };
    assert!(score.covered_soon * 10 >= score.people * 7, "{score:?}");
    assert_eq!(score.false_boxes, 0, "{score:?}");
}

#[test]
fn nobody_is_confirmed_in_the_empty_frames_of_filinha() {
    let Some((run, score)) = scored("filinha") else { return };
    assert_eq!(run.frames, 108);
    for frame in (1..=4).chain(7..=26).chain(103..=108) {
        assert!(!run.confirmed.contains_key(&frame), "frame {frame}: {:?}", run.confirmed[&frame]);
    }
    assert!(score.covered * 10 >= score.rows * 7, "{score:?}");
}

/// Returns the track numbers in excess of one per person.
fn surplus(score: &Score) -> usize {
    score.ids.values().map(|ids| ids.len().saturating_sub(1)).sum()
}

#[test]
fn particles_find_as_many_people_in_filinha_as_the_ekf_with_few_false_boxes() {
    let Some((_, ekf)) = scored("filinha") else { return };
    let Some((_, particles)) = scored_with("filinha", "joint-particle") else { return };
    for (name, score) in [("depth-ekf", &ekf), ("joint-particle", &particles)] {
        let Score { covered, rows, false_boxes, .. } = score;
        let surplus = surplus(score);
        println!(
            "{name}: {covered} of {rows} covered, {false_boxes} false, {surplus} more numbers"
        );
    }
    assert!(particles.covered >= ekf.covered, "{particles:?} {ekf:?}");
    assert!(particles.false_boxes <= ekf.false_boxes + 5, "{particles:?}");
    assert!(surplus(&particles) <= surplus(&ekf) + 4, "{particles:?} {ekf:?}");
}

#[test]
fn gradients_beside_silhouettes_find_no_fewer_people_of_filinha() {
    let Some((_, ekf)) = scored("filinha") else { return };
    let Some((_, best)) = scored_with("filinha", "rgbd-ekf") else { return };
    println!("depth-ekf: {} of {} covered", ekf.covered, ekf.rows);
    println!("rgbd-ekf: {} of {} covered, {} false", best.covered, best.rows, best.false_boxes);
    assert!(best.covered >= ekf.covered, "{best:?} {ekf:?}");
    assert!(best.false_boxes <= ekf.false_boxes + 2, "{best:?} {ekf:?}");
}

#[test]
fn five_people_are_five_and_the_office_is_empty() {
    let Some(path) = data("pcl-single-frames.mcap") else { return };
    let run = run(&path, "depth-ekf");
    println!("five_people: {} detections; {:?}", run.detections[&1], run.funnel);
    assert_eq!(run.detections[&1], 5);
    assert!(!run.confirmed.contains_key(&2), "office1: {:?}", run.confirmed[&2]);
}

#[test]
fn every_log_with_depth_runs() {
    for (name, frames) in [("lab2-camera1", 39), ("uc3m-single-frames", 12)] {
        let Some(path) = data(&format!("{name}.mcap")) else { return };
        let run = run(&path, "depth-ekf");
        println!("{name}: {:?}", run.funnel);
        assert_eq!(run.frames, frames, "{name}");
    }
}

/// The blanket on the desk is found in most frames.
#[test]
fn a_blanket_that_never_moves_is_no_person_and_the_people_who_pass_are() {
    let Some((run, score)) = scored_with("lab2-camera1", "depth-verified") else { return };
    for frame in 1..=12 {
        assert!(!run.confirmed.contains_key(&frame), "frame {frame}: {:?}", run.confirmed[&frame]);
    }
    assert!(score.false_boxes <= 3, "{score:?}");
    assert!(score.covered * 10 >= score.rows * 3, "{score:?}");
}

#[test]
fn the_wall_of_a_corridor_is_no_person_and_two_people_keep_few_numbers() {
    let Some((_, score)) = scored_with("corredor1-camera1", "depth-verified") else { return };
    assert!(score.false_boxes <= 10, "{score:?}");
    assert!(score.covered * 10 >= score.rows * 7, "{score:?}");
    assert!(surplus(&score) <= 6, "{score:?}");
}
