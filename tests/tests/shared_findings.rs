//! Pipelines that share their detections in a frame give the same results, bit by bit, as those
//! that run all detectors themselves.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test that cannot go on fails")]

use std::path::Path;

use tagalong_core::Frame;
use tagalong_pipeline::{FrameReport, Pipeline, with_values};
use tagalong_sim::Scene;
use tagalong_trials::{Contender, Draw};

/// Scene with two people that pass each other before a turning robot, and with furniture.
const SCENE: &str = "seed = 3\nduration_s = 1.5\n[camera]\nwidth = 320\nheight = 240\n\
    field_of_view_deg = 70.0\n[room]\nclutter = 4\n[robot]\nstart = [0.8, 2.0]\n\
    path = [[2.2, 2.2], [2.8, 3.4]]\nspeed_mps = 0.5\n\
    [[people]]\npath = [[3.8, 3.4], [3.8, 1.6]]\nspeed_mps = 0.8\n\
    [[people]]\npath = [[4.8, 1.9], [4.8, 4.8]]\nspeed_mps = 0.8\n";

/// Settings of detector, verifier and track manager, each changed alone.
const CHANGES: [(&str, &str); 4] = [
    ("manager.config.confirm_hits", "1"),
    ("manager.config.start_score", "1.5"),
    ("detectors.0.config.discover_cost", "0.12"),
    ("verifiers.0.config.weight", "0.5"),
];

/// Returns shipped configs, and each with every change to which it has a key.
fn pipelines() -> Vec<Pipeline> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs");
    let registry = tagalong_catalog::registry();
    let mut all = Vec::new();
    for name in ["depth-ekf", "depth-color-ekf", "depth-svm-ekf", "rgbd-ekf"] {
        let text = std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap();
        let build = |text: &str| {
            let contender = Contender { folder: folder.clone(), ..Contender::new(name, text) };
            contender.pipeline(&registry, 1).unwrap()
        };
        let shipped = build(&text);
        let values = CHANGES.map(|(key, value)| (key, value.parse::<toml::Value>().unwrap()));
        for (key, value) in &values {
            if let Ok(changed) = with_values(&shipped.resolved(), &[(key, value)]) {
                all.push(build(&changed));
            }
        }
        all.push(shipped);
    }
    all
}

fn run(pipelines: &mut [Pipeline]) -> Vec<Vec<String>> {
    let scene = Scene::parse(SCENE).unwrap();
    let mut draw = Draw::new(&scene, 1);
    let frames: Vec<Frame> =
        std::iter::from_fn(|| draw.next_frame()).map(|drawn| drawn.frame).collect();
    frames
        .iter()
        .map(|frame| -> Vec<String> {
            let reports = pipelines.iter_mut().map(|pipeline| pipeline.step(frame).unwrap());
            reports.map(|report| format!("{:?}", untimed(report))).collect()
        })
        .collect()
}

/// Returns a report without timings, which differ between any two runs.
fn untimed(mut report: FrameReport) -> FrameReport {
    report.timings.clear();
    report.plugin_timings.clear();
    report
}

#[test]
fn sharing_changes_no_bit() {
    let mut alone = pipelines();
    let mut sharing = pipelines();
    sharing.iter_mut().for_each(Pipeline::share_findings);
    let alone = run(&mut alone);
    let sharing = run(&mut sharing);
    assert!(alone.len() > 8, "{} frames", alone.len());
    let last: std::collections::BTreeSet<&String> = alone.iter().flatten().collect();
    // Pipelines with equal results would not show that shared results are kept apart.
    assert!(last.len() > alone.len() * 5, "the pipelines hardly differ");
    for (number, (alone, sharing)) in alone.iter().zip(&sharing).enumerate() {
        for (pipeline, (alone, sharing)) in alone.iter().zip(sharing).enumerate() {
            assert_eq!(alone, sharing, "frame {number}, pipeline {pipeline}");
        }
    }
}
