//! Comparison of the printed pipeline, the corrected one and ours on the same scenes.

use tagalong_eval::{mean_interval, paired_gain};
use tagalong_report::{Cell, Row, Table};
use tagalong_trials::{Judge, Judged, Trial, TrialError};

use super::{PIPELINES, STEREO};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Suites of P1 and P4, a crowd, and crossings.
const SUITES: [&str; 5] =
    ["following", "square-walk", "full-occlusion", "crowd", "crossing-oblique"];

/// A score of one contender on one draw.
type Figure = fn(&Judged) -> f64;

/// A score with its digits after the point and the range of its values.
#[derive(Clone, Copy)]
struct Score {
    digits: usize,
    range: [f64; 2],
    of: Figure,
}

/// Compares the three pipelines, with the gain of each step.
pub fn ladder(lab: &Lab) -> Result<Findings, ReproduceError> {
    let contenders = lab.contenders(&PIPELINES)?;
    let mut draws = Vec::new();
    for suite in SUITES {
        let scenes = lab.scenes(suite, &[STEREO], lab.seeds(50))?;
        draws.push(lab.trials(suite, &scenes, &contenders, judged)?);
    }
    let tables = vec![
        table(
            "IDF1: are all people found, each under one number?",
            &draws,
            Score { digits: 3, range: [0.0, 1.0], of: |j| j.tally.identity.idf1() },
        ),
        table(
            "MOTA: misses, false alarms, switched numbers",
            &draws,
            Score { digits: 3, range: [f64::NEG_INFINITY, 1.0], of: |j| j.tally.clear.mota() },
        ),
        table(
            "Mean error of matched places, robot frame, mm",
            &draws,
            Score { digits: 0, range: [0.0, f64::INFINITY], of: mean_error_mm },
        ),
    ];
    Ok(Findings { tables, pictures: Vec::new() })
}

/// Returns the mean error of matched places in the frame of the robot, mm.
fn mean_error_mm(judged: &Judged) -> f64 {
    let errors = &judged.errors_in_robot_m;
    1e3 * errors.iter().sum::<f64>() / errors.len() as f64
}

fn judged(trial: Trial) -> Result<Vec<Judged>, TrialError> {
    trial.runs.iter().map(|run| Judge::default().judge(&trial, run)).collect()
}

fn table(title: &str, draws: &[Vec<Vec<Judged>>], score: Score) -> Table {
    let mut rows: Vec<Row> = SUITES
        .iter()
        .zip(draws)
        .map(|(suite, draws)| Row::ours(*suite, cells(draws, score)))
        .collect();
    let all: Vec<Vec<Judged>> = draws.concat();
    rows.push(Row::ours("all", cells(&all, score)));
    let columns = ["printed", "corrected", "ours", "corrected - printed", "ours - corrected"];
    Table {
        title: title.into(),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
        notes: vec![
            format!(
                "{} simulated stereo scenes; intervals: 95 %, over scenes, in pairs",
                all.len()
            ),
            "Each interval stands for itself: of twenty, one misses what it is of.".into(),
            format!("printed, corrected, ours: {}", PIPELINES.join(", ")),
        ],
    }
}

/// Returns the cells of the three pipelines, and of the two steps between them on the same draws.
fn cells(draws: &[Vec<Judged>], score: Score) -> Vec<Cell> {
    let Score { digits, range: [least, most], of: figure } = score;
    let scores: Vec<Vec<f64>> =
        draws.iter().map(|draw| draw.iter().map(figure).collect()).collect();
    // A draw without a score of one pipeline cannot be paired.
    let known: Vec<&Vec<f64>> =
        scores.iter().filter(|draw| draw.iter().all(|v| v.is_finite())).collect();
    let all = [0, 1, 2].map(|at| known.iter().map(|draw| draw[at]).collect::<Vec<f64>>());
    let means = all.iter().map(|of| Cell::estimate(mean_interval(of), digits).within(least, most));
    let steps = all.windows(2).map(|pair| {
        let gain = paired_gain(&pair[0], &pair[1]);
        Cell::estimate(gain.map(|gain| gain.difference), digits)
    });
    means.chain(steps).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(errors: [f64; 3]) -> Vec<Judged> {
        errors.map(|error| Judged { errors_in_robot_m: vec![error], ..Judged::default() }).to_vec()
    }

    #[test]
    fn steps_are_paired_and_draws_that_say_nothing_are_left_out() {
        let draws = [draw([0.3, 0.2, 0.1]), draw([0.5, 0.4, 0.2]), draw([f64::NAN, 0.0, 0.0])];
        let range = [0.0, f64::INFINITY];
        let score = Score { digits: 1, range, of: |judged| judged.errors_in_robot_m[0] };
        let cells = cells(&draws, score);
        let values: Vec<f64> = cells.iter().map(|cell| cell.value.unwrap()).collect();
        let expected = [0.4, 0.3, 0.15, -0.1, -0.15];
        assert!(values.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{values:?}");
        assert_eq!(cells[3].interval, None, "both steps are the same");
        assert_eq!(cells[0].interval.unwrap()[0], 0.0, "no error is below zero");
        let [lower, upper] = cells[4].interval.unwrap();
        let half = 12.7062 * 0.05; // Student's with one degree of freedom
        assert!((upper - lower - 2.0 * half).abs() < 1e-4, "{lower} {upper}");
    }
}
