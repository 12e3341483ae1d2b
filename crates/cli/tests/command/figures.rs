//! The figures of shipped configs on real logs, pinned: a change that costs or gains more than
//! [`TOLERANCE`] fails here, and `figures.csv` is then changed on purpose: a failing test prints it as
//! it would be now.

use std::collections::BTreeMap;
use std::fs;

use serde_json::Value;

use crate::common::{code, tagalong, text};

/// Figures by pipeline, log and name.
type Figures = BTreeMap<(String, String, String), f64>;

/// The pipelines: those of the README, and the corrected systems of two papers.
const PINNED: [&str; 5] =
    ["depth-verified", "depth-alone", "depth-ekf", "joint-particle", "rgbd-ekf"];

const NAMES: [&str; 3] = ["HOTA", "recall", "fp_per_frame"];

const TOLERANCE: f64 = 0.02;

/// Returns the figures of a report; logs that a pipeline skips have none.
fn measured(report: &Value) -> Figures {
    let mut figures = Figures::new();
    for task in report["tasks"].as_array().unwrap() {
        for name in NAMES {
            if let Some(value) = task["image"][name].as_f64() {
                let [pipeline, log] = ["pipeline", "log"].map(|key| task[key].as_str().unwrap());
                figures.insert((pipeline.into(), log.into(), name.into()), value);
            }
        }
    }
    figures
}

/// Reads the pinned figures: one line for each pipeline and log.
fn pinned() -> Figures {
    let mut figures = Figures::new();
    for line in include_str!("figures.csv").lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        for (name, value) in NAMES.iter().zip(&cells[2..]) {
            let key = (cells[0].into(), cells[1].into(), (*name).into());
            figures.insert(key, value.parse().unwrap());
        }
    }
    figures
}

/// Returns the file that pins these figures; none is left out, as a log has all of them or none.
fn csv(figures: &Figures) -> String {
    let mut rows: BTreeMap<(&str, &str), [String; NAMES.len()]> = BTreeMap::new();
    for ((pipeline, log, name), value) in figures {
        let row = rows.entry((pipeline, log)).or_default();
        if let Some(at) = NAMES.iter().position(|known| known == name) {
            row[at] = format!("{value:.3}");
        }
    }
    let mut text = format!("pipeline,log,{}\n", NAMES.join(","));
    for ((pipeline, log), values) in rows {
        text += &format!("{pipeline},{log},{}\n", values.join(","));
    }
    text
}

#[test]
fn the_printed_file_is_the_one_that_is_read() {
    assert_eq!(csv(&pinned()), include_str!("figures.csv"));
}

#[test]
fn shipped_configs_have_their_pinned_figures_on_real_logs() {
    let Some(logs) = tagalong_conformance::testdata::find("logs") else { return };
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let mut command = tagalong();
    command.args(["bench", "--configs"]).args(PINNED);
    let ran = command.arg("--logs-dir").arg(logs).arg("-o").arg(&out).output().unwrap();
    assert_eq!(code(&ran), 0, "{}", text(&ran.stderr));
    let report = fs::read(out.join("report.json")).unwrap();
    let measured = measured(&serde_json::from_slice(&report).unwrap());
    let pinned = pinned();
    let mut changes = Vec::new();
    for (key, value) in &measured {
        let before = pinned.get(key);
        if !before.is_some_and(|before| (before - value).abs() <= TOLERANCE) {
            changes.push(format!("{key:?}: {value:.3}, pinned {before:?}"));
        }
    }
    let now = csv(&measured);
    assert!(changes.is_empty(), "{changes:#?}\nfigures.csv would be\n{now}");
    let gone = "a log or a pipeline has no figures any more";
    assert_eq!(measured.len(), pinned.len(), "{gone}; figures.csv would be\n{now}");
}
