//! P4, Fig. 11: position error of a person that walks along two edges of a square.

use nalgebra::{Point2, Vector2};
use tagalong_eval::{PositionError, draws_interval, percentile};
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::Scene;
use tagalong_trials::{Judge, Moment, Trial, TrialError};

use super::STEREO;
use super::variants::{OF_P1, OF_P4, Variant};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Errors of one contender on one walk, m.
#[derive(Clone, Debug, Default)]
struct Errors {
    /// In the true frame of the robot.
    in_robot: Vec<f64>,
    /// In the frame of the robot at the start, drift included: by the motions that the pipeline
    /// used, those of the wheels or corrected ones.
    in_start: Vec<f64>,
    /// Frames with the person in view, and those of them without an estimate: no track is within
    /// the half metre of the judge.
    frames: u64,
    without: u64,
}

/// Results of one walk.
struct Walk {
    /// Errors of each contender.
    errors: Vec<Errors>,
    /// Distance between the true position and the same by the odometry's pose, m: a lower bound for
    /// trackers in the frame of the start.
    drift: Vec<f64>,
    /// Error of a predictor that knows every position exactly while half of the person is visible,
    /// and keeps the velocity after that, m.
    pace: Vec<f64>,
}

/// Least visible part of the upper body for an exact position, in [`Walk::pace`], ...
const HALF: f64 = 0.5;
/// ... and duration over which the velocity is fitted, s.
const PACE_S: f64 = 1.0;

/// Errors of some walks.
type Walks<'a> = Vec<&'a [f64]>;

/// Errors of a walk that a table shows.
type ErrorsOf = fn(&Walk) -> &[f64];

/// Settings of a robot that follows behind the walker, as the paper's does, and so keeps the walker
/// in view.
pub const FOLLOWED: [(&str, &str); 3] =
    [STEREO, ("robot.behind_m", "2.0"), ("robot.speed_mps", "0.7")];

/// Measures the error of the walker's position, by the forms of P1's filter.
pub fn of_p1(lab: &Lab) -> Result<Findings, ReproduceError> {
    walk(lab, &OF_P1)
}

/// Measures the error of the walker's position, by the forms of P4.
pub fn of_p4(lab: &Lab) -> Result<Findings, ReproduceError> {
    walk(lab, &OF_P4)
}

/// Errors of the wheels that are tried: the standard deviation of the radius of each wheel and of
/// their distance, as a fraction.
const WHEEL_ERRORS: [&str; 4] = ["0", "0.001", "0.002", "0.005"];

/// Measures the error of the walker's position by how wrong the wheels are.
pub fn by_wheels(lab: &Lab) -> Result<Findings, ReproduceError> {
    let contenders = lab.contenders(&["stereo-svm-ekf", "stereo-verified"])?;
    let columns: Vec<Vec<Walk>> = WHEEL_ERRORS
        .iter()
        .map(|error| {
            let set = [&FOLLOWED[..], &[("robot.wheel_bias", *error)]].concat();
            let scenes = lab.scenes("square-walk", &set, lab.seeds(20))?;
            lab.trials(&format!("walks with wheels off by {error}"), &scenes, &contenders, errors)
        })
        .collect::<Result<_, _>>()?;
    Ok(wheels_table(&columns).into())
}

fn wheels_table(columns: &[Vec<Walk>]) -> Table {
    let errors: [(&str, ErrorsOf); 5] = [
        ("stereo-svm-ekf, frame of the start", |walk| &walk.errors[0].in_start),
        ("stereo-svm-ekf, frame of the robot", |walk| &walk.errors[0].in_robot),
        ("stereo-verified, frame of the start", |walk| &walk.errors[1].in_start),
        ("stereo-verified, frame of the robot", |walk| &walk.errors[1].in_robot),
        ("no tracker: the drift of the wheels, frame of the start", |walk| &walk.drift),
    ];
    let rows = errors.map(|(name, of)| {
        let cells = columns.iter().map(|walks| mean_mm(&walks.iter().map(of).collect()));
        Row::ours(name, cells.collect())
    });
    let draws = columns.first().map_or(0, Vec::len);
    Table {
        title: "Mean error of the place of the person who is followed, mm, by the error of the \
                wheels"
            .into(),
        columns: WHEEL_ERRORS.map(|error| format!("wheels off by {error}")).to_vec(),
        rows: rows.into(),
        notes: vec![
            format!("{draws} simulated walks for each column; intervals: 95 %, over walks"),
            "Off by: the standard deviation of the radius of each wheel and of their distance, as \
             a fraction (`wheel_bias` of the scene's robot); the other tables have 0.005. The paper \
             prints 125 mm for one walk, and nothing on its wheels."
                .into(),
        ],
    }
}

fn walk(lab: &Lab, variants: &[Variant]) -> Result<Findings, ReproduceError> {
    let scenes = lab.scenes("square-walk", &FOLLOWED, lab.seeds(50))?;
    let contenders =
        variants.iter().map(|variant| variant.contender(lab)).collect::<Result<Vec<_>, _>>()?;
    let walks = lab.trials("walks along two edges", &scenes, &contenders, errors)?;
    Ok(table(&walks, variants).into())
}

/// Number of walks of the first table.
const FEW: u64 = 8;

/// Returns walks along two edges, before a robot that follows.
pub(crate) fn walks(lab: &Lab) -> Result<Vec<Scene>, ReproduceError> {
    lab.scenes("square-walk", &FOLLOWED, lab.seeds(FEW))
}

/// Returns the errors of the walker of each run in the frame of the start, m.
pub(crate) fn walker_errors_m(trial: Trial) -> Result<Vec<Vec<f64>>, TrialError> {
    Ok(errors(trial)?.errors.into_iter().map(|of| of.in_start).collect())
}

/// Returns the id of the walker, the first person of the scene.
fn walker(trial: &Trial) -> Option<u16> {
    trial.moments.iter().flat_map(|m| &m.truth).map(|truth| truth.id).min()
}

/// Marks all people except the walker as ignored.
pub fn only_the_walker_counts(trial: &mut Trial) {
    let walker = walker(trial);
    let everybody = trial.moments.iter_mut().flat_map(|moment| &mut moment.truth);
    everybody.filter(|truth| Some(truth.id) != walker).for_each(|truth| truth.ignore = true);
}

fn errors(mut trial: Trial) -> Result<Walk, TrialError> {
    let walker = walker(&trial);
    let drift = drift(&trial.moments, walker);
    let pace = kept_pace(&trial.moments, walker);
    only_the_walker_counts(&mut trial);
    let judge = Judge { coasting: true, ..Judge::default() };
    let errors = trial.runs.iter().map(|run| {
        let judged = judge.judge(&trial, run)?;
        let scores = judged.tally.scores();
        Ok(Errors {
            in_robot: judged.errors_in_robot_m,
            in_start: judged.errors_in_start_m,
            frames: scores.truths,
            without: scores.fn_,
        })
    });
    let errors = errors.collect::<Result<_, TrialError>>()?;
    Ok(Walk { errors, drift, pace })
}

/// Returns the position errors of the walker by the odometry alone.
fn drift(moments: &[Moment], walker: Option<u16>) -> Vec<f64> {
    let Some(first) = moments.first() else { return Vec::new() };
    moments
        .iter()
        .filter_map(|moment| {
            let seen =
                moment.truth.iter().find(|truth| Some(truth.id) == walker && !truth.ignore)?;
            let head = seen.head_in_robot.xy();
            let real = first.world_from_robot.inverse() * moment.world_from_robot * head;
            let believed = first.odom_from_robot.inverse() * moment.odom_from_robot * head;
            Some((real - believed).norm())
        })
        .collect()
}

/// Returns the position errors of the walker for a predictor of constant velocity.
fn kept_pace(moments: &[Moment], walker: Option<u16>) -> Vec<f64> {
    let mut known: Vec<(f64, Point2<f64>)> = Vec::new();
    let mut errors = Vec::new();
    for moment in moments {
        let Some(seen) = moment.truth.iter().find(|truth| Some(truth.id) == walker) else {
            continue;
        };
        let now_s = moment.stamp.seconds_since(moments[0].stamp);
        let place = moment.world_from_robot * seen.head_in_robot.xy();
        if seen.visible_fraction >= HALF {
            known.push((now_s, place));
        }
        if !seen.ignore {
            errors.extend(straight_on(&known, now_s).map(|believed| (believed - place).norm()));
        }
    }
    errors
}

/// Extrapolates known positions with constant velocity (least squares) to a time; returns the last
/// position if it is of that time.
fn straight_on(known: &[(f64, Point2<f64>)], now_s: f64) -> Option<Point2<f64>> {
    let (last_s, last) = *known.last()?;
    let of: Vec<_> = known.iter().filter(|(at_s, _)| *at_s > last_s - PACE_S).collect();
    // A single position has no velocity.
    if last_s >= now_s || of.len() < 2 {
        return Some(last);
    }
    let n = of.len() as f64;
    let mean_s = of.iter().map(|(at_s, _)| at_s).sum::<f64>() / n;
    let mean = of.iter().map(|(_, place)| place.coords).sum::<Vector2<f64>>() / n;
    let spread = of.iter().map(|(at_s, _)| (at_s - mean_s).powi(2)).sum::<f64>();
    let pace = of.iter().map(|(at_s, place)| place.coords * (at_s - mean_s)).sum::<Vector2<f64>>()
        / spread;
    Some(Point2::from(mean + pace * (now_s - mean_s)))
}

fn table(walks: &[Walk], variants: &[Variant]) -> Table {
    let nan = f64::NAN;
    let published = [125.0, nan, nan, 336.0, nan].map(|mm| Cell::number(mm, 0)).to_vec();
    let mut rows = vec![Row::published("one walk, frame of the start", published)];
    for (at, Variant { name, .. }) in variants.iter().enumerate() {
        let lost = walks.iter().map(|w| [w.errors[at].without, w.errors[at].frames]);
        let without = Cell::clustered(&lost.collect::<Vec<_>>(), 1);
        let in_start: Walks<'_> = walks.iter().map(|w| &w.errors[at].in_start[..]).collect();
        let in_robot: Walks<'_> = walks.iter().map(|w| &w.errors[at].in_robot[..]).collect();
        for (frame, errors) in [("start", in_start), ("robot", in_robot)] {
            let cells = cells(&errors).into_iter().chain([without.clone()]).collect();
            rows.push(Row::ours(format!("{name}, frame of the {frame}"), cells));
        }
    }
    let bounds: [(&str, ErrorsOf); 2] = [
        ("the drift of the wheels, frame of the start", |walk| &walk.drift),
        ("exact while half shows, then the pace kept", |walk| &walk.pace),
    ];
    for (what, of) in bounds {
        let errors: Walks<'_> = walks.iter().map(of).collect();
        let cells = cells(&errors).into_iter().chain([Cell::default()]).collect();
        rows.push(Row::ours(format!("no tracker: {what}"), cells));
    }
    let columns =
        ["mean mm", "95 % below mm", "worst of a walk, median mm", "worst mm", "without a place %"];
    Table {
        title: "Error of the place of the person who is followed (P4, Fig. 11)".into(),
        columns: columns.map(str::to_owned).to_vec(),
        rows,
        notes: vec![
            format!(
                "{} simulated walks in front of a stereo camera; intervals: 95 %, over walks",
                walks.len()
            ),
            "Predicted places count, too: the other person passes between. Without a place: \
             no track is within half a metre of the person in view."
                .into(),
            "The robot keeps 2 m behind, by the true place: the same way for all, with the \
             errors of its wheels, which `stereo-verified` corrects by what stands still \
             (`[odometry]`); the row of the drift is the true place, seen from where the wheels \
             believe the robot to be."
                .into(),
            "The last row knows every place exactly in which half of the upper body shows, and \
             goes straight on from there: who turns the corner meanwhile is not found by that."
                .into(),
        ],
    }
}

fn cells(walks: &Walks<'_>) -> Vec<Cell> {
    fn millimetres(metres: Option<f64>) -> Cell {
        Cell::number(1e3 * metres.unwrap_or(f64::NAN), 0)
    }

    let all: Vec<f64> = walks.concat();
    let worst: Vec<f64> =
        walks.iter().filter_map(|walk| walk.iter().copied().reduce(f64::max)).collect();
    let error = PositionError::of(&all).unwrap_or_default();
    vec![
        mean_mm(walks),
        millimetres(Some(error.p95_m)),
        millimetres(percentile(&worst, 0.5)),
        millimetres(Some(error.max_m)),
    ]
}

/// Returns the mean error over all frames, mm, with its interval over walks.
fn mean_mm(walks: &Walks<'_>) -> Cell {
    let interval = draws_interval(walks.len(), |drawn| {
        let errors = drawn.iter().flat_map(|&walk| walks[walk]);
        1e3 * errors.clone().sum::<f64>() / errors.count() as f64
    });
    // A mean of distances is not negative, but the interval may reach below zero.
    Cell::estimate(interval.map(|mean| mean.within(0.0, f64::INFINITY)), 0)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry2, Point3};
    use tagalong_core::Stamp;
    use tagalong_sim::Truth;

    use super::*;

    fn truth(id: u16, head: Point3<f64>) -> Truth {
        Truth {
            id,
            head_in_robot: head,
            torso_in_robot: head,
            upper_body: None,
            visible: None,
            visible_fraction: 1.0,
            occluder: None,
            ignore: false,
            joints: Vec::new(),
        }
    }

    #[test]
    fn drift_is_what_the_odometry_does_to_the_true_place_of_the_walker() {
        fn moment(at: f64, ids: &[u16]) -> Moment {
            Moment {
                stamp: Stamp::default(),
                truth: ids.iter().map(|id| truth(*id, Point3::new(2.0, 0.0, 1.6))).collect(),
                odom_from_robot: Isometry2::new(Vector2::new(at, 0.0), 0.1 * at),
                world_from_robot: Isometry2::new(Vector2::new(5.0 + at, 1.0), 0.0),
            }
        }

        let moments = [moment(0.0, &[1, 2]), moment(1.0, &[2, 1]), moment(2.0, &[2])];
        let found = drift(&moments, Some(1));
        assert_eq!(found.len(), 2, "who is not there has no place");
        // A wrong turn by 0.1 rad moves a point 2 m away along a chord.
        assert!(found[0] < 1e-12 && (found[1] - 4.0 * 0.05f64.sin()).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn the_pace_is_kept_while_less_than_half_shows() {
        fn moment(at_s: f64, y: f64, visible_fraction: f64) -> Moment {
            Moment {
                stamp: Stamp::default().plus_seconds(at_s),
                truth: vec![Truth { visible_fraction, ..truth(1, Point3::new(at_s, y, 1.6)) }],
                odom_from_robot: Isometry2::identity(),
                world_from_robot: Isometry2::identity(),
            }
        }

        let moments = [(0.0, 0.0, 1.0), (0.1, 0.0, 0.5), (0.2, 0.3, 0.4), (0.3, 0.4, 0.9)]
            .map(|(at_s, y, part)| moment(at_s, y, part));
        let found = kept_pace(&moments, Some(1));
        let expected = [0.0, 0.0, 0.3, 0.0];
        assert_eq!(found.len(), expected.len());
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
    }

    #[test]
    fn the_mean_is_over_frames_and_the_worst_over_walks() {
        let short = [0.1];
        let long = [0.2, 0.2, 0.5];
        let cells = cells(&vec![&short[..], &long[..]]);
        let values: Vec<f64> =
            [0, 2, 3].iter().map(|&column: &usize| cells[column].value.unwrap()).collect();
        let expected = [250.0, 300.0, 500.0];
        assert!(values.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{values:?}");
    }
}
