//! Measures of Follow-Bench in a table.

use tagalong_eval::{mean_interval, percentile};
use tagalong_report::{Cell, Row, Table};

use super::rides::{Driven, PLANNERS, SETTINGS, Source, drive, jobs};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Speed of a target that a robot of 0.9 m/s can follow, m/s.
const WALK_MPS: f64 = 0.8;
const COLUMNS: [&str; 9] = [
    "rides",
    "success %",
    "search success %",
    "personal zone s",
    "private zone s",
    "search m",
    "jerk m/s3",
    "ms/frame",
    "99th percentile ms",
];

/// Returns the rides with the places of all people told.
pub(super) fn told(lab: &Lab) -> Result<Findings, ReproduceError> {
    table(lab, Source::Told, None)
}

/// Returns the rides by the laser scanner.
pub(super) fn laser(lab: &Lab) -> Result<Findings, ReproduceError> {
    table(lab, Source::Laser, None)
}

/// Returns the rides by a scanner of more rays.
pub(super) fn fine_laser(lab: &Lab) -> Result<Findings, ReproduceError> {
    table(lab, Source::FineLaser, None)
}

/// Returns the rides by depth images.
pub(super) fn depth(lab: &Lab) -> Result<Findings, ReproduceError> {
    table(lab, Source::Depth, None)
}

/// Returns the rides as [`told`], behind a slower target.
pub(super) fn walk_told(lab: &Lab) -> Result<Findings, ReproduceError> {
    table(lab, Source::Told, Some(WALK_MPS))
}

/// Returns the rides as [`fine_laser`], behind a slower target.
pub(super) fn walk_laser(lab: &Lab) -> Result<Findings, ReproduceError> {
    table(lab, Source::FineLaser, Some(WALK_MPS))
}

/// Returns the rides as [`depth`], behind a slower target.
pub(super) fn walk_depth(lab: &Lab) -> Result<Findings, ReproduceError> {
    table(lab, Source::Depth, Some(WALK_MPS))
}

fn table(lab: &Lab, source: Source, target_mps: Option<f64>) -> Result<Findings, ReproduceError> {
    let jobs = jobs(lab, &PLANNERS, source, target_mps)?;
    let driven = drive(lab, title(source), &jobs)?;
    let mut rows = Vec::new();
    let prefix = prefix(source, target_mps);
    for setting in SETTINGS.map(Some).into_iter().chain([None]) {
        for (planner, _) in PLANNERS {
            let rides: Vec<&Driven> = driven
                .iter()
                .filter(|one| one.planner == planner)
                .filter(|one| setting.is_none_or(|setting| one.setting == setting))
                .collect();
            let setting = setting.unwrap_or("all settings");
            rows.push(Row::ours(format!("{prefix}, {setting}: {planner}"), cells(&rides)));
        }
    }
    let speed = target_mps.map_or(String::new(), |mps| format!(", a target at {mps} m/s"));
    Ok(Table {
        title: format!("{}{speed}", title(source)),
        columns: COLUMNS.map(str::to_owned).to_vec(),
        rows,
        notes: notes(),
    }
    .into())
}

fn title(source: Source) -> &'static str {
    match source {
        Source::Told => "Follow-Bench, told where people are",
        Source::Laser => "Follow-Bench, people by the laser scanner",
        Source::FineLaser => "Follow-Bench, people by a laser scanner of 720 rays",
        Source::Depth => "Follow-Bench, people by depth images",
    }
}

/// Returns the beginning of the names of rows: figures in sentences find a row by its name.
fn prefix(source: Source, target_mps: Option<f64>) -> String {
    let source = match source {
        Source::Told => "told",
        Source::Laser => "laser",
        Source::FineLaser => "fine laser",
        Source::Depth => "depth",
    };
    target_mps.map_or(source.to_owned(), |mps| format!("{source} {mps} m/s"))
}

fn cells(rides: &[&Driven]) -> Vec<Cell> {
    let took: Vec<f64> = rides.iter().flat_map(|ride| &ride.took_ms).copied().collect();
    let [median, most] = [0.5, 0.99]
        .map(|part| percentile(&took, part).map_or_else(Cell::default, |ms| Cell::number(ms, 2)));
    vec![
        Cell::number(rides.len() as f64, 0),
        share_cell(rides, |ride| ride.measures.success),
        share_cell(rides, |ride| ride.measures.search_success),
        mean_cell(rides, |ride| ride.measures.personal_s, 1),
        mean_cell(rides, |ride| ride.measures.private_s, 2),
        mean_cell(rides, |ride| ride.measures.search_m, 1),
        mean_cell(rides, |ride| ride.measures.jerk_mps3, 2),
        median,
        most,
    ]
}

/// Returns the share of rides of which something is true.
fn share_cell(rides: &[&Driven], is_so: fn(&Driven) -> bool) -> Cell {
    let count = rides.iter().filter(|ride| is_so(ride)).count();
    Cell::share(count as u64, rides.len() as u64, 1)
}

/// Returns the mean of a measure over rides.
fn mean_cell(rides: &[&Driven], value: fn(&Driven) -> f64, digits: usize) -> Cell {
    let values: Vec<f64> = rides.iter().map(|ride| value(ride)).collect();
    match mean_interval(&values) {
        Some(interval) => Cell::estimate(Some(interval), digits).within(0.0, f64::INFINITY),
        None => Cell::mean(&values, digits),
    }
}

fn notes() -> Vec<String> {
    [
        "The robot of the benchmark with its laser scanner and a depth camera of 70 degrees for \
         obstacles, but at most 0.9 m/s fast, behind the collision monitor and the command limiter; the \
         people walk at up to 1.5 m/s. Intervals: 95 %, over rides, Wilson for shares, Student for \
         means.",
        "Success: no contact with a person (a disc of 0.3 m) or a thing before the target has arrived. \
         Search success: the target was never out of sight (5 m) for more than 10 s in one go.",
        "Personal zone: time at 0.45 to 1.2 m from the target; private zone: time below 0.45 m from \
         another person, between the circle around the robot and the disc of the person.",
        "Search: length of the path while the target was out of sight. ms: processor time of a step of \
         the whole pipeline, median and 99th percentile.",
    ]
    .map(str::to_owned)
    .to_vec()
}

#[cfg(test)]
mod tests {
    use tagalong_trials::CrowdMeasures;

    use super::*;

    fn driven(success: bool, private_s: f64) -> Driven {
        let measures = CrowdMeasures { success, private_s, ..CrowdMeasures::default() };
        Driven { setting: "clutter", planner: "clear-follow", measures, took_ms: vec![1.0, 3.0] }
    }

    #[test]
    fn shares_and_means_are_over_rides() {
        let rides = [driven(true, 0.0), driven(false, 1.0), driven(true, 2.0)];
        let cells = cells(&rides.iter().collect::<Vec<_>>());
        assert_eq!(cells.len(), COLUMNS.len());
        assert_eq!(cells[0].value, Some(3.0));
        assert!((cells[1].value.unwrap() - 200.0 / 3.0).abs() < 1e-9);
        assert_eq!((cells[2].value, cells[4].value), (Some(0.0), Some(1.0)));
        assert_eq!(cells[4].interval.unwrap()[0], 0.0, "no time is negative");
    }

    #[test]
    fn rows_of_all_tables_have_names_of_their_own() {
        let all = [Source::Told, Source::Laser, Source::FineLaser, Source::Depth]
            .map(|source| [prefix(source, None), prefix(source, Some(WALK_MPS))]);
        assert_eq!(all[0], ["told", "told 0.8 m/s"]);
        let names: std::collections::BTreeSet<_> = all.as_flattened().iter().collect();
        assert_eq!(names.len(), 8);
    }
}
