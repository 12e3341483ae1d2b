//! Section 6.2: the filter against the appearance model alone.

use tagalong_eval::paired_gain;
use tagalong_trials::{Contender, Trial, TrialError};

use super::{BLOCK, IMAGES, alone, mean};
use crate::{Cell, Findings, Lab, ReproduceError, Row, Table};

/// The filters of section 6.2, and what `u` may be.
const FILTERS: [(&str, &str); 6] = [
    ("appearance model alone", "plugin = \"last-seen\""),
    (
        "printed Q and R, u = 0",
        "plugin = \"floor-kalman\"\nconfig = { form = \"still\", measurement = \"fixed\" }",
    ),
    (
        "printed Q and R, u the last difference, without its noise",
        "plugin = \"floor-kalman\"\nconfig = { form = \"last-difference\", \
         measurement = \"fixed\", compat_printed_u = true }",
    ),
    (
        "printed Q and R, u the last difference",
        "plugin = \"floor-kalman\"\nconfig = { form = \"last-difference\", \
         measurement = \"fixed\" }",
    ),
    ("four states, polar noise", "plugin = \"floor-kalman\"\nconfig = { measurement = \"polar\" }"),
    ("four states, the detection's noise", "plugin = \"floor-kalman\""),
];

/// Errors of all filters in the images in which all of them have an answer.
struct Walk {
    errors: Vec<Vec<f64>>,
}

/// The distances that are filtered, with what they are called.
const DISTANCES: [(&str, &str); 2] =
    [("network 3-4-1", "network"), ("network of all features", "rich")];

pub(super) fn kalman(lab: &Lab) -> Result<Findings, ReproduceError> {
    let scenes = alone(lab, "omni-room", 1, IMAGES)?;
    let contender = |distance, (name, filter)| Contender {
        folder: lab.configs.clone(),
        ..Contender::new(name, config(distance, filter))
    };
    let of = |distance| FILTERS.iter().map(move |filter| contender(distance, *filter));
    let contenders: Vec<Contender> = DISTANCES.iter().flat_map(|(_, d)| of(*d)).collect();
    let walks = lab.trials("walking about the room", &scenes, &contenders, walk)?;
    let tables = DISTANCES.iter().enumerate();
    let tables = tables.map(|(at, (title, _))| filters(title, at * FILTERS.len(), &walks));
    Ok(Findings { tables: tables.collect(), pictures: Vec::new() })
}

fn config(distance: &str, filter: &str) -> String {
    format!(
        "[[detectors]]\nplugin = \"omni-appearance\"\nconfig = {{ distance = \"{distance}\" }}\n\
         [filter]\n{filter}\n"
    )
}

fn walk(trial: Trial) -> Result<Walk, TrialError> {
    let mut errors = vec![Vec::new(); trial.runs.len()];
    for (at, moment) in trial.moments.iter().enumerate() {
        let Some(truth) = moment.truth.first().filter(|truth| !truth.ignore) else { continue };
        let error = |run: &tagalong_trials::Run| {
            let seen = run.reports[at].tracks.iter().filter(|track| track.seen);
            let off = |track: &tagalong_core::Track| {
                (track.estimate.person.position - truth.head_in_robot).xy().norm()
            };
            seen.map(off).min_by(f64::total_cmp)
        };
        let all: Option<Vec<f64>> = trial.runs.iter().map(error).collect();
        for (errors, error) in errors.iter_mut().zip(all.into_iter().flatten()) {
            errors.push(error);
        }
    }
    Ok(Walk { errors })
}

/// Section 6.2, with the gain over the first row, block by block; `first` is
/// the number of the first filter among the contenders.
fn filters(title: &str, first: usize, walks: &[Walk]) -> Table {
    let published = |mean, deviation| Cell { deviation: Some(deviation), ..Cell::number(mean, 3) };
    let mut rows = vec![
        Row::published("appearance model", vec![published(0.154, 0.094), Cell::default()]),
        Row::published("with Kalman filter", vec![published(0.145, 0.092), Cell::default()]),
    ];
    let blocks = |filter: usize| -> Vec<f64> {
        let of_walk = |walk: &Walk| {
            walk.errors[first + filter].chunks(BLOCK as usize).map(mean).collect::<Vec<f64>>()
        };
        walks.iter().flat_map(of_walk).collect()
    };
    for (at, (name, _)) in FILTERS.iter().enumerate() {
        let all: Vec<f64> = walks.iter().flat_map(|walk| walk.errors[first + at].clone()).collect();
        let gain = paired_gain(&blocks(0), &blocks(at));
        let gain = gain.filter(|_| at > 0).map(|gain| gain.difference);
        rows.push(Row::ours(*name, vec![Cell::mean(&all, 3), Cell::estimate(gain, 3)]));
    }
    let images = walks.iter().map(|walk| walk.errors[0].len()).sum::<usize>();
    Table {
        title: format!("Error of the position with the {title}, m (P5, section 6.2)"),
        columns: ["error", "difference to the model alone"].map(String::from).to_vec(),
        rows,
        notes: vec![
            format!(
                "{images} images of two walks; the shipped model, fitted to another draw of this scene"
            ),
            "Differences are paired, with Student's 95 % interval over blocks of 5 s: neighbouring \
             images are not independent, as the paper's t-test takes them to be."
                .into(),
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_filter_is_a_config() {
        for (_, filter) in FILTERS {
            let text = config("rich", filter);
            assert!(toml::from_str::<toml::Table>(&text).is_ok(), "{text}");
        }
    }
}
