//! P4, Fig. 7: identities after full occlusions.

use tagalong_report::{Cell, Row, Table};
use tagalong_trials::{Outcome, Trial, TrialError, occlusions, outcome};

use super::{PIPELINES, STEREO};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Edges of the bins of the duration, s.
const HIDDEN_S: [f64; 4] = [0.0, 1.0, 2.0, 4.0];
/// Edges of the bins of the gap between the two people, m.
const GAP_M: [f64; 3] = [0.0, 1.1, 2.0];

/// One occlusion, with the outcome for each contender.
struct Case {
    hidden_s: f64,
    gap_m: f64,
    outcomes: Vec<Outcome>,
}

/// Counts kept identities by gap and duration.
pub fn occlusion(lab: &Lab) -> Result<Findings, ReproduceError> {
    let scenes = lab.scenes("full-occlusion", &[STEREO], lab.seeds(100))?;
    let contenders = lab.contenders(&PIPELINES)?;
    let cases = lab.trials("full occlusions", &scenes, &contenders, cases)?;
    Ok(table(&cases.into_iter().flatten().collect::<Vec<_>>(), scenes.len()).into())
}

fn cases(trial: Trial) -> Result<Vec<Case>, TrialError> {
    Ok(occlusions(&trial)
        .into_iter()
        .map(|occlusion| Case {
            hidden_s: occlusion.duration_s,
            gap_m: occlusion.gap_m,
            outcomes: trial.runs.iter().map(|run| outcome(&trial, run, &occlusion)).collect(),
        })
        .collect())
}

fn table(cases: &[Case], draws: usize) -> Table {
    let mut rows = Vec::new();
    for gap in GAP_M.windows(2) {
        for hidden in HIDDEN_S.windows(2) {
            let some: Vec<&Case> = cases
                .iter()
                .filter(|case| {
                    (gap[0]..gap[1]).contains(&case.gap_m)
                        && (hidden[0]..hidden[1]).contains(&case.hidden_s)
                })
                .collect();
            let name = format!("gap {}-{} m, hidden {}-{} s", gap[0], gap[1], hidden[0], hidden[1]);
            rows.push(Row::ours(name, row(&some)));
        }
    }
    rows.push(Row::ours("all", row(&cases.iter().collect::<Vec<_>>())));
    Table {
        title: "Full occlusions after which the person keeps the number, % (P4, Fig. 7)".into(),
        columns: PIPELINES.iter().map(|name| (*name).to_owned()).collect(),
        rows,
        notes: vec![
            format!(
                "{draws} simulated stereo scenes; {} occlusions; Wilson intervals",
                cases.len()
            ),
            "The paper shows one occlusion in pictures and counts none.".into(),
            "Who had no track before the occlusion is not counted.".into(),
        ],
    }
}

/// Returns the share of kept identities for each pipeline.
fn row(cases: &[&Case]) -> Vec<Cell> {
    (0..PIPELINES.len())
        .map(|at| {
            let tracked = cases.iter().map(|case| case.outcomes[at]).filter(tracked_before);
            let count = tracked.clone().count() as u64;
            let kept = tracked.filter(|outcome| *outcome == Outcome::Kept).count() as u64;
            Cell::share(kept, count, 0)
        })
        .collect()
}

fn tracked_before(outcome: &Outcome) -> bool {
    *outcome != Outcome::Untracked
}
