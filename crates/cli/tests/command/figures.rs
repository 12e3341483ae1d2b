//! The figures of shipped configs on real logs, pinned: a change that costs or gains more than
//! [`TOLERANCE`] fails here, and `figures.csv` is then changed on purpose.

use std::collections::BTreeMap;
use std::fs;

use serde_json::Value;

use crate::common::{code, tagalong, text};

/// Figures by pipeline, log and name.
type Figures = BTreeMap<(String, String, String), f64>;

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

#[test]
fn shipped_configs_have_their_pinned_figures_on_real_logs() {
    let Some(logs) = tagalong_conformance::testdata::find("logs") else { return };
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let mut command = tagalong();
    command.args(["bench", "--configs", "depth-verified", "depth-alone", "depth-ekf"]);
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
    assert!(changes.is_empty(), "{changes:#?}");
    assert_eq!(measured.len(), pinned.len(), "a log or a pipeline has no figures any more");
}
