//! Beyond the paper: several people, and a robot that drives.

use tagalong_eval::Tally;
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::Scene;
use tagalong_trials::{Judge, Trial, TrialError};

use super::FRESH;
use crate::draws::{over_draws, pooled};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// The printed method, the corrected one, its detector with the filter of P1, and the best.
const PIPELINES: [&str; 4] =
    ["omni-appearance-as-printed", "omni-appearance", "omni-ekf", "omni-rich"];
/// Number of draws of each scene.
const SEEDS: u64 = 6;
/// Duration, s: more draws are more informative than longer ones.
const LONG_S: f64 = 29.0;

/// Title, scene, and number of people that walk in it.
const WORLDS: [(&str, &str, usize); 3] = [
    ("two people", "omni-people", 2),
    ("three people", "omni-people", 3),
    ("two people, the robot drives", "omni-moving", 2),
];

/// Results of one pipeline.
struct PipelineResult {
    tally: Tally,
    errors_m: Vec<f64>,
}

pub(super) fn people(lab: &Lab) -> Result<Findings, ReproduceError> {
    let contenders = lab.contenders(&PIPELINES)?;
    let mut tables = Vec::new();
    for (title, name, people) in WORLDS {
        let scenes = scenes(lab, name, people)?;
        let all = lab.trials(title, &scenes, &contenders, judged)?;
        tables.push(table(title, &all));
    }
    Ok(Findings { tables, pictures: Vec::new() })
}

fn scenes(lab: &Lab, name: &str, people: usize) -> Result<Vec<Scene>, ReproduceError> {
    let mut scenes = lab.scenes(name, &[], lab.seeds(SEEDS))?;
    for scene in &mut scenes {
        scene.webcams.clear();
        scene.people.truncate(people);
        scene.duration_s = LONG_S;
    }
    Ok(scenes)
}

fn judged(trial: Trial) -> Result<Vec<PipelineResult>, TrialError> {
    let judge = Judge::default();
    trial
        .runs
        .iter()
        .map(|run| {
            let judged = judge.judge(&trial, run)?;
            Ok(PipelineResult { tally: judged.tally, errors_m: judged.errors_in_robot_m })
        })
        .collect()
}

fn table(title: &str, trials: &[Vec<PipelineResult>]) -> Table {
    let columns = ["IDF1, %", "MOTA, %", "renamed", "position error, m"];
    let rows = PIPELINES.iter().enumerate().map(|(at, name)| {
        let tallies: Vec<&Tally> = trials.iter().map(|done| &done[at].tally).collect();
        let swaps = Cell::number(Tally::combine(tallies.iter().copied()).scores().idsw as f64, 0);
        let errors: Vec<Vec<f64>> = trials.iter().map(|done| done[at].errors_m.clone()).collect();
        let cells = vec![
            pooled(&tallies, 3, |s| s.idf1).within(0.0, 1.0).percent(),
            pooled(&tallies, 3, |s| s.mota).within(f64::NEG_INFINITY, 1.0).percent(),
            swaps,
            over_draws(&errors, 3).within(0.0, f64::INFINITY),
        ];
        Row::ours(*name, cells)
    });
    Table {
        title: format!("{title}: who is where (not in P5)"),
        columns: columns.map(String::from).to_vec(),
        rows: rows.collect(),
        notes: vec![format!(
            "{} draws; a report is right within half a metre; people beyond 6 m do not count. {FRESH} \
             The printed method is one for one person.",
            trials.len()
        )],
    }
}
