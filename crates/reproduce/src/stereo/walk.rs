//! P4, Fig. 11: where is a person who walks along two edges of a square?

use tagalong_eval::{Bootstrap, PositionError, percentile};
use tagalong_trials::{Judge, Moment, Trial, TrialError};

use super::{PIPELINES, STEREO};
use crate::{Cell, Findings, Lab, ReproduceError, Row, Table};

/// Errors of one contender on one walk, m.
#[derive(Clone, Debug, Default)]
struct Errors {
    /// In the frame of the robot as it is.
    in_robot: Vec<f64>,
    /// In the frame of the robot at the start, drift included: by the motions that the
    /// pipeline believed, those of the wheels or corrected ones.
    in_start: Vec<f64>,
    /// Frames in which the person is in view, and those of them without a place: no track
    /// is within the half metre of the judge.
    frames: u64,
    without: u64,
}

/// One walk.
struct Walk {
    /// Of each contender.
    errors: Vec<Errors>,
    /// How far the true place is from itself, seen from where the odometry believes the
    /// robot to be, m: no tracker is better in the frame of the start.
    drift: Vec<f64>,
}

/// Errors of some walks.
type Walks<'a> = Vec<&'a [f64]>;

/// The robot keeps behind whom it follows, as the paper's does, and so in view.
const FOLLOWED: [(&str, &str); 3] = [STEREO, ("robot.behind_m", "2.0"), ("robot.speed_mps", "0.7")];

/// The error of the one who walks ahead.
///
/// # Errors
/// As [`Lab::trials`].
pub fn walk(lab: &Lab) -> Result<Findings, ReproduceError> {
    let scenes = lab.scenes("square-walk", &FOLLOWED, lab.seeds(50))?;
    let contenders = lab.contenders(&PIPELINES)?;
    let walks = lab.trials("walks along two edges", &scenes, &contenders, errors)?;
    Ok(table(&walks).into())
}

/// The other person is nobody's miss and nobody's false alarm.
fn errors(mut trial: Trial) -> Result<Walk, TrialError> {
    let walker = trial.moments.iter().flat_map(|m| &m.truth).map(|truth| truth.id).min();
    let drift = drift(&trial.moments, walker);
    let everybody = trial.moments.iter_mut().flat_map(|moment| &mut moment.truth);
    everybody.filter(|truth| Some(truth.id) != walker).for_each(|truth| truth.ignore = true);
    let judge = Judge { coasting: true, ..Judge::default() };
    let of_run = |run| {
        let judged = judge.judge(&trial, run)?;
        let scores = judged.tally.scores();
        Ok(Errors {
            in_robot: judged.errors_in_robot_m,
            in_start: judged.errors_in_start_m,
            frames: scores.truths,
            without: scores.fn_,
        })
    };
    let errors = trial.runs.iter().map(of_run).collect::<Result<_, TrialError>>()?;
    Ok(Walk { errors, drift })
}

/// What the odometry alone does to the places of the one who walks ahead.
fn drift(moments: &[Moment], walker: Option<u16>) -> Vec<f64> {
    let Some(first) = moments.first() else { return Vec::new() };
    let off = |moment: &Moment| {
        let seen = moment.truth.iter().find(|truth| Some(truth.id) == walker && !truth.ignore)?;
        let head = seen.head_in_robot.xy();
        let real = first.world_from_robot.inverse() * moment.world_from_robot * head;
        let believed = first.odom_from_robot.inverse() * moment.odom_from_robot * head;
        Some((real - believed).norm())
    };
    moments.iter().filter_map(off).collect()
}

fn table(walks: &[Walk]) -> Table {
    let nan = f64::NAN;
    let published = [125.0, nan, nan, 336.0, nan].map(|mm| Cell::number(mm, 0)).to_vec();
    let mut rows = vec![Row::published("one walk, frame of the start", published)];
    for (at, name) in PIPELINES.iter().enumerate() {
        let of =
            |frame: fn(&Errors) -> &[f64]| walks.iter().map(|w| frame(&w.errors[at])).collect();
        let count = |of: fn(&Errors) -> u64| walks.iter().map(|w| of(&w.errors[at])).sum();
        let without = Cell::share(count(|e| e.without), count(|e| e.frames), 1);
        let mut row = |frame: &str, errors: Walks<'_>| {
            let cells = cells(&errors).into_iter().chain([without.clone()]).collect();
            rows.push(Row::ours(format!("{name}, frame of the {frame}"), cells));
        };
        row("start", of(|e| &e.in_start));
        row("robot", of(|e| &e.in_robot));
    }
    let drift: Walks<'_> = walks.iter().map(|walk| &walk.drift[..]).collect();
    let drift = cells(&drift).into_iter().chain([Cell::default()]).collect();
    rows.push(Row::ours("no tracker: the drift of the wheels, frame of the start", drift));
    let columns =
        ["mean mm", "95 % below mm", "worst of a walk, median mm", "worst mm", "without a place %"];
    Table {
        title: "Error of the place of the person who is followed (P4, Fig. 11)".into(),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
        notes: vec![
            format!(
                "{} drawn walks in front of a stereo camera; intervals over walks",
                walks.len()
            ),
            "Predicted places count, too: the other person passes between. Without a place: \
             nobody is believed to be within half a metre of the person in view."
                .into(),
            "The robot keeps 2 m behind, by the true place: the same way for all, with the \
             errors of its wheels, which `stereo-best` corrects by what stands still \
             (`[odometry]`); the last row is the true place, seen from where the wheels \
             believe the robot to be."
                .into(),
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
    use nalgebra::{Isometry2, Point3, Vector2};
    use tagalong_core::Stamp;
    use tagalong_sim::Truth;

    use super::*;

    #[test]
    fn drift_is_what_the_odometry_does_to_the_true_place_of_the_walker() {
        let head = Point3::new(2.0, 0.0, 1.6);
        let truth = |id: u16| Truth {
            id,
            head_in_robot: head,
            torso_in_robot: head,
            upper_body: None,
            visible: None,
            visible_fraction: 1.0,
            occluder: None,
            ignore: false,
        };
        let moment = |at: f64, ids: &[u16]| Moment {
            stamp: Stamp::default(),
            truth: ids.iter().map(|id| truth(*id)).collect(),
            odom_from_robot: Isometry2::new(Vector2::new(at, 0.0), 0.1 * at),
            world_from_robot: Isometry2::new(Vector2::new(5.0 + at, 1.0), 0.0),
        };
        let moments = [moment(0.0, &[1, 2]), moment(1.0, &[2, 1]), moment(2.0, &[2])];
        let found = drift(&moments, Some(1));
        assert_eq!(found.len(), 2, "who is not there has no place");
        // A turn by 0.1 rad that was none moves what is 2 m away along a chord.
        assert!(found[0] < 1e-12 && (found[1] - 4.0 * 0.05f64.sin()).abs() < 1e-12, "{found:?}");
    }

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
