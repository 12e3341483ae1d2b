//! Pipelines that share their findings give the same reports as those that do not.

use tagalong_core::Frame;

use super::doubles::{World, bare_frame, person};
use crate::{FrameReport, Pipeline};

/// Of two scripts the first has no memory; verifiers and thresholds differ.
const CONFIGS: [&str; 4] = [
    "",
    "manager.config.drop_after_s = 0.3\nmanager.config.drop_after_misses = 1",
    "[[verifiers]]\nplugin = 'choosy'",
    "[[verifiers]]\nplugin = 'choosy'\nconfig = { how = 'once' }",
];

fn config(around: &str, script: &str) -> String {
    format!(
        "filter.plugin = 'steady'\n{around}\n[[detectors]]\nplugin = 'script'\n\
         roles = ['track', 'discover']\nconfig = {{ {script} }}"
    )
}

fn world() -> World {
    World::of((0..20).map(|i| {
        let aside = 0.05 * f64::from(i);
        let all = [person(3.0, 0.4 + aside), person(2.0, -0.8 - aside), person(4.0, 1.5)];
        all.into_iter().take(if i % 5 == 4 { 1 } else { 3 }).collect()
    }))
}

/// A report without its times.
fn untimed(report: FrameReport) -> String {
    format!("{:?}", FrameReport { timings: Vec::new(), plugin_timings: Vec::new(), ..report })
}

/// Reports of several pipelines for the same frames, step by step side by side.
fn together(pipelines: &mut [Pipeline]) -> Vec<Vec<String>> {
    let frames: Vec<Frame> = (1..=20).map(|i| bare_frame(i, i as f64 * 0.1)).collect();
    frames
        .iter()
        .map(|frame| -> Vec<String> {
            pipelines.iter_mut().map(|p| untimed(p.step(frame).unwrap())).collect()
        })
        .collect()
}

fn texts() -> Vec<String> {
    let scripts = ["how = 'picky'", "how = 'picky', script = 1", "how = ''"];
    scripts.into_iter().flat_map(|script| CONFIGS.map(|around| config(around, script))).collect()
}

#[test]
fn what_is_shared_is_what_would_have_been_found() {
    let world = world();
    world.show(1, 7, vec![person(2.5, 0.0)]);
    let [mut lonely, mut sharing]: [Vec<Pipeline>; 2] =
        std::array::from_fn(|_| texts().iter().map(|text| world.pipeline(text)).collect());
    let alone = together(&mut lonely);
    let asked_alone = std::mem::take(&mut *world.asked.lock().unwrap()).len();
    sharing.iter_mut().for_each(Pipeline::share_findings);
    let shared = together(&mut sharing);
    assert_eq!(alone, shared);
    let asked = world.asked.lock().unwrap().len();
    assert!(5 * asked < 4 * asked_alone, "{asked} of {asked_alone} questions");
    let sights = alone.iter().map(|all| all.iter().collect::<std::collections::BTreeSet<_>>());
    assert!(sights.map(|all| all.len()).max() > Some(5), "the configs differ in what they say");
}

#[test]
fn who_remembers_is_asked_each_time() {
    for (how, questions) in [("picky", 20), ("", 40)] {
        let world = world();
        let text = format!(
            "filter.plugin = 'steady'\n[[detectors]]\nplugin = 'script'\nconfig.how = '{how}'"
        );
        let mut pair = [world.pipeline(&text), world.pipeline(&text)];
        pair.iter_mut().for_each(Pipeline::share_findings);
        together(&mut pair);
        assert_eq!(world.asked.lock().unwrap().len(), questions, "{how}");
    }
}

#[test]
fn another_frame_is_looked_at_anew() {
    let world = world();
    let mut pair = [world.pipeline(&texts()[0]), world.pipeline(&texts()[0])];
    pair.iter_mut().for_each(Pipeline::share_findings);
    for pipeline in &mut pair {
        pipeline.step(bare_frame(1, 0.1)).unwrap();
    }
    assert_eq!(world.asked.lock().unwrap().len(), 2);
}
