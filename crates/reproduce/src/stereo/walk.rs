//! P4, Fig. 11: where is a person who walks along two edges of a square?

use tagalong_eval::{Bootstrap, PositionError, percentile};
use tagalong_trials::{Judge, Trial, TrialError};

use super::{PIPELINES, STEREO};
use crate::{Cell, Findings, Lab, ReproduceError, Row, Table};

/// Errors of one contender on one walk, m.
#[derive(Clone, Debug, Default)]
struct Errors {
    /// In the frame of the robot as it is.
    in_robot: Vec<f64>,
    /// In the frame of the robot at the start, drift of the odometry included.
    in_start: Vec<f64>,
}

/// A figure that sums up the errors of some walks.
type Walks<'a> = Vec<&'a [f64]>;

/// The error of the one who walks ahead.
///
/// # Errors
/// As [`Lab::trials`].
pub fn walk(lab: &Lab) -> Result<Findings, ReproduceError> {
    let scenes = lab.scenes("square-walk", &[STEREO], lab.seeds(50))?;
    let contenders = lab.contenders(&PIPELINES)?;
    let walks = lab.trials("walks along two edges", &scenes, &contenders, errors)?;
    Ok(table(&walks).into())
}

/// The other person is nobody's miss and nobody's false alarm.
fn errors(mut trial: Trial) -> Result<Vec<Errors>, TrialError> {
    let walker = trial.moments.iter().flat_map(|m| &m.truth).map(|truth| truth.id).min();
    let everybody = trial.moments.iter_mut().flat_map(|moment| &mut moment.truth);
    everybody.filter(|truth| Some(truth.id) != walker).for_each(|truth| truth.ignore = true);
    let judge = Judge { coasting: true, ..Judge::default() };
    let of_run = |run| {
        let judged = judge.judge(&trial, run)?;
        Ok(Errors { in_robot: judged.errors_in_robot_m, in_start: judged.errors_in_start_m })
    };
    trial.runs.iter().map(of_run).collect()
}

fn table(walks: &[Vec<Errors>]) -> Table {
    let published = [125.0, f64::NAN, f64::NAN, 336.0].map(|mm| Cell::number(mm, 0)).to_vec();
    let mut rows = vec![Row::published("one walk, frame of the start", published)];
    for (at, name) in PIPELINES.iter().enumerate() {
        let of = |frame: fn(&Errors) -> &[f64]| walks.iter().map(|w| frame(&w[at])).collect();
        rows.push(Row::ours(format!("{name}, frame of the start"), cells(&of(|e| &e.in_start))));
        rows.push(Row::ours(format!("{name}, frame of the robot"), cells(&of(|e| &e.in_robot))));
    }
    let columns = ["mean mm", "95 % below mm", "worst of a walk, median mm", "worst mm"];
    Table {
        title: "Error of the place of the person who is followed (P4, Fig. 11)".into(),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
        notes: vec![
            format!(
                "{} drawn walks in front of a stereo camera; intervals over walks",
                walks.len()
            ),
            "Predicted places count, too: the other person passes between.".into(),
            "The robot drives on a path of its own, with the errors of its odometry.".into(),
        ],
    }
}

fn cells(walks: &Walks<'_>) -> Vec<Cell> {
    let all: Vec<f64> = walks.concat();
    let mean = |drawn: &[usize]| {
        let errors = || drawn.iter().flat_map(|&walk| walks[walk]);
        errors().sum::<f64>() / errors().count() as f64
    };
    let worst: Vec<f64> =
        walks.iter().filter_map(|walk| walk.iter().copied().reduce(f64::max)).collect();
    let error = PositionError::of(&all).unwrap_or_default();
    let millimetres = |metres: Option<f64>| Cell::number(1e3 * metres.unwrap_or(f64::NAN), 0);
    let mean = Bootstrap::default().interval(walks.len(), |drawn| 1e3 * mean(drawn));
    vec![
        Cell::estimate(mean, 0),
        millimetres(Some(error.p95_m)),
        millimetres(percentile(&worst, 0.5)),
        millimetres(Some(error.max_m)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_is_over_frames_and_the_worst_over_walks() {
        let (short, long) = ([0.1], [0.2, 0.2, 0.5]);
        let cells = cells(&vec![&short[..], &long[..]]);
        let values: Vec<f64> =
            [0, 2, 3].iter().map(|&column: &usize| cells[column].value.unwrap()).collect();
        let expected = [250.0, 300.0, 500.0];
        assert!(values.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{values:?}");
    }
}
