//! A failure that must occur in simulation, too: the printed filter gives a wrong velocity to a
//! standing person before a moving robot, and only there.
#![allow(clippy::unwrap_used, reason = "a broken test may stop loudly")]

use std::path::Path;

use tagalong_config::Registry;
use tagalong_pipeline::flattened;
use tagalong_sim::{Scene, Split, Variant};
use tagalong_trials::{Contender, Run, Trial, TrialError, each};

fn contender(file: &str) -> Contender {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let folder = path.parent().unwrap().to_owned();
    let text = std::fs::read_to_string(&path).unwrap();
    Contender { folder: folder.clone(), ..Contender::new(file, flattened(&text, &folder).unwrap()) }
}

/// A standing person before a robot that drives along a path.
fn scenes(path: &str) -> Vec<Scene> {
    let text = format!(
        "duration_s = 5.0\n[room]\nsize_m = [10.0, 6.0]\n[camera]\nwidth = 320\nheight = 240\n\
         [robot]\nstart = [1.0, 3.0]\npath = {path}\nspeed_mps = 0.5\n\
         [[people]]\npath = [[6.0, 3.2]]\nheading_deg = 180.0\n"
    );
    let seeds = Split::Test.seeds(0, 3).unwrap();
    seeds
        .numbers()
        .map(|seed| {
            let variant =
                Variant { seed: Some(seed), split: Some(Split::Test), ..Variant::default() };
            Scene::parse_with(&text, &variant).unwrap()
        })
        .collect()
}

/// Returns the mean forward velocity of the tracks near the only person, once they have settled.
fn velocity_bias_mps(trial: &Trial, run: usize) -> f64 {
    let Run { reports, .. } = &trial.runs[run];
    let mut speeds = Vec::new();
    for (moment, report) in trial.moments.iter().zip(reports) {
        let Some(person) = moment.truth.first() else { continue };
        let near = report.tracks.iter().filter(|track| {
            let off = track.estimate.person.position - person.head_in_robot;
            track.confirmed && track.age > 10 && off.xy().norm() < 1.0
        });
        speeds.extend(near.map(|track| track.estimate.person.velocity.x));
    }
    speeds.iter().sum::<f64>() / speeds.len() as f64
}

/// Returns the bias of the corrected and of the printed filter, m/s.
fn biases_mps(path: &str) -> [f64; 2] {
    fn keep(trial: Trial) -> Result<[f64; 2], TrialError> {
        Ok([0, 1].map(|run| velocity_bias_mps(&trial, run)))
    }

    let mut registry = Registry::default();
    tagalong_papers::register(&mut registry);
    let contenders =
        [contender("../../configs/depth-ekf.toml"), contender("configs/depth-ekf-as-printed.toml")];
    let scenes = scenes(path);
    let all = each(&scenes, &contenders, &registry, 2, keep, |_| ()).unwrap();
    [0, 1].map(|run| (all.iter().map(|both| both[run]).sum::<f64>() / all.len() as f64).abs())
}

#[test]
fn the_printed_filter_fails_before_a_moving_robot_and_only_there() {
    let [corrected, printed] = biases_mps("[]");
    assert!(corrected < 0.15 && printed < 0.15, "at rest: {corrected} {printed}");
    let [corrected, printed] = biases_mps("[[8.0, 3.0]]");
    assert!(corrected < 0.15 && printed > 0.4, "moving: {corrected} {printed}");
}
