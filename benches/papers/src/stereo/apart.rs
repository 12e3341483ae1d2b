//! P4, section III-C: how near to each other two people may be to be told apart.

use nalgebra::Point3;
use tagalong_pipeline::{Candidate, Fate};
use tagalong_report::{Cell, Row, Table};
use tagalong_trials::{Moment, Run, Trial, TrialError};

use super::{PIPELINES, STEREO};
use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Scene with two people before a robot at rest.
const SCENE: &str = "crossing-parallel";
/// Position of the robot, which looks along X, m.
const ROBOT_M: [f64; 2] = [0.8, 4.0];
/// Distances between the two people along the line of sight, m.
const GAPS_M: [f64; 5] = [0.3, 0.5, 0.7, 1.0, 1.5];
/// Distances of the farther person, m.
const RANGES_M: [f64; 5] = [1.5, 2.0, 3.0, 4.0, 5.0];
/// Least distance of the nearer person, m.
const NEAREST_M: f64 = 0.8;
/// Distance of the farther head beside the nearer one, as it appears at the nearer one, m: the
/// shoulders overlap and both heads are in view.
const BESIDE_M: f64 = 0.3;
/// Largest distance on the floor at which a detection belongs to a person, m.
const FOUND_M: f64 = 0.5;
/// Direction in which the nearer person looks at the start, and turning speeds, degrees: an image of
/// each 45 degrees.
const TURNS: [(&str, &str); 6] = [
    ("people.0.heading_deg", "180"),
    ("people.1.heading_deg", "180"),
    ("people.0.spin_deg_per_s", "45"),
    ("people.1.spin_deg_per_s", "-45"),
    ("camera.rate_hz", "1"),
    ("duration_s", "8"),
];

/// Images in which both people are found, and images, for each pipeline.
type Found = Vec<[u64; 2]>;

/// Measures the share of images in which both of two people are found, by gap and range.
pub fn apart(lab: &Lab) -> Result<Findings, ReproduceError> {
    let contenders = lab.contenders(&PIPELINES)?;
    let seeds = lab.seeds(8);
    let mut all = Vec::new();
    for gap_m in GAPS_M {
        let mut row = Vec::new();
        for range_m in RANGES_M {
            let mut draws = Vec::new();
            if range_m - gap_m >= NEAREST_M {
                let set = standing(gap_m, range_m);
                let set: Vec<(&str, &str)> = set.iter().map(|(k, v)| (*k, v.as_str())).collect();
                let scenes = lab.scenes(SCENE, &set, seeds)?;
                let what = format!("{gap_m} m apart, {range_m} m away");
                draws = lab.trials(&what, &scenes, &contenders, found)?;
            }
            row.push(draws);
        }
        all.push(row);
    }
    Ok(table(&all, seeds).into())
}

/// Returns the settings of a scene in which two people stand one before the other.
fn standing(gap_m: f64, range_m: f64) -> Vec<(&'static str, String)> {
    let near_m = range_m - gap_m;
    let [x, y] = ROBOT_M;
    let beside_m = BESIDE_M * range_m / near_m;
    let mut set = vec![
        (STEREO.0, STEREO.1.to_owned()),
        ("room.clutter", "0".to_owned()),
        ("robot.start", format!("[{x:.3}, {y:.3}]")),
        ("people.0.path", format!("[[{:.3}, {y:.3}]]", x + near_m)),
        ("people.1.path", format!("[[{:.3}, {:.3}]]", x + range_m, y + beside_m)),
    ];
    set.extend(TURNS.map(|(key, value)| (key, value.to_owned())));
    set
}

fn found(trial: Trial) -> Result<Found, TrialError> {
    Ok(trial.runs.iter().map(|run| counts(&trial.moments, run)).collect())
}

/// Returns the images in which both people are found, and those in which both are in view.
fn counts(moments: &[Moment], run: &Run) -> [u64; 2] {
    let mut found = [0, 0];
    for (moment, report) in moments.iter().zip(&run.reports) {
        let counting = moment.truth.iter().filter(|truth| !truth.ignore);
        let heads: Vec<Point3<f64>> = counting.map(|truth| truth.head_in_robot).collect();
        let [near, far] = heads[..] else { continue };
        found[0] += u64::from(are_both_found([near, far], &seen(&report.candidates)));
        found[1] += 1;
    }
    found
}

/// Returns the positions of the accepted detections.
fn seen(candidates: &[Candidate]) -> Vec<Point3<f64>> {
    let accepted = candidates.iter().filter(|c| !matches!(c.fate, Fate::Dropped(_)));
    accepted.map(|candidate| candidate.detection.position).collect()
}

/// Tells whether each person has a detection that is nearer to them than to the other one.
fn are_both_found(heads: [Point3<f64>; 2], seen: &[Point3<f64>]) -> bool {
    let mut found = [false; 2];
    for place in seen {
        let [first_m, second_m] = heads.map(|head| (place - head).xy().norm());
        if first_m.min(second_m) <= FOUND_M {
            found[usize::from(second_m < first_m)] = true;
        }
    }
    found == [true; 2]
}

/// Returns the share of images of one pipeline; empty without images.
fn cell(draws: &[Found], pipeline: usize) -> Cell {
    let counts: Vec<[u64; 2]> = draws.iter().map(|draw| draw[pipeline]).collect();
    if counts.iter().all(|[_, images]| *images == 0) {
        return Cell::default();
    }
    Cell::clustered(&counts, 0)
}

/// Builds the table from the draws of each gap and range.
fn table(all: &[Vec<Vec<Found>>], seeds: u64) -> Table {
    let mut rows = Vec::new();
    for (pipeline, name) in PIPELINES.iter().enumerate() {
        for (gap_m, row) in GAPS_M.iter().zip(all) {
            let cells = row.iter().map(|draws| cell(draws, pipeline)).collect();
            rows.push(Row::ours(format!("{name}, {gap_m} m apart"), cells));
        }
    }
    Table {
        title: "Images in which two people, one before the other, are both found, % (P4, section \
                III-C)"
            .into(),
        columns: RANGES_M.iter().map(|range_m| format!("{range_m} m")).collect(),
        rows,
        notes: vec![
            format!(
                "{seeds} draws each of a simulated stereo scene, eight images a draw, every image by \
                 itself; intervals: 95 %, with the spread between draws"
            ),
            "Apart: along the line of sight. Columns: distance of the farther person, so far to the \
             side that the shoulders overlap and the head does not. Both turn on the spot. Images \
             count in which both are in view."
                .into(),
            format!(
                "Found: a detection within {FOUND_M} m on the floor that is not nearer to the other \
                 person. Left out: a nearer person within {NEAREST_M} m."
            ),
            "The paper says that people one metre apart can be told up to about four metres, and \
             has no table of it."
                .into(),
        ],
    }
}

#[cfg(test)]
mod tests {
    use tagalong_config::Registry;
    use tagalong_trials::Draw;

    use super::*;
    use crate::lab::testing::lab;

    fn at(x: f64, y: f64) -> Point3<f64> {
        Point3::new(x, y, 1.6)
    }

    #[test]
    fn each_person_needs_a_detection_of_their_own() {
        let heads = [at(2.0, 0.0), at(3.0, 0.4)];
        assert!(are_both_found(heads, &[at(2.1, 0.0), at(2.9, 0.3)]));
        assert!(
            !are_both_found(heads, &[at(2.1, 0.0), at(1.9, 0.1)]),
            "both are of the nearer one"
        );
        assert!(!are_both_found(heads, &[at(2.1, 0.0), at(3.6, 0.4)]), "too far off");
        assert!(!are_both_found(heads, &[at(2.5, 0.2)]), "one for both");
    }

    /// A person at the given distance behind the other one, whose head is beside the other's.
    #[test]
    fn the_scene_has_two_people_one_before_the_other() {
        let registry = Registry::default();
        let lab = lab(&registry, true, None);
        let set = standing(1.0, 3.0);
        let set: Vec<(&str, &str)> = set.iter().map(|(k, v)| (*k, v.as_str())).collect();
        let scene = lab.scenes(SCENE, &set, 1).unwrap().remove(0);
        let truth = Draw::new(&scene, 1).next_frame().unwrap().truth;
        let heads: Vec<Point3<f64>> = truth.iter().map(|truth| truth.head_in_robot).collect();
        let [near, far] = heads[..] else { panic!("{heads:?}") };
        let gap_m = far.x - near.x;
        assert!((gap_m - 1.0).abs() < 0.1 && (far.x - 3.0).abs() < 0.1, "{near} {far}");
        assert!(truth.iter().all(|truth| !truth.ignore), "both are in view");
        let beside_m = far.y * near.x / far.x - near.y;
        assert!((beside_m - BESIDE_M).abs() < 0.1, "{beside_m}");
        let squares: Vec<_> = truth.iter().filter_map(|truth| truth.upper_body).collect();
        assert!(squares[0].intersection(&squares[1]).area() > 0.0, "the shoulders overlap");
    }

    #[test]
    fn gaps_and_ranges_that_do_not_fit_are_empty() {
        let draw = vec![[1, 8], [4, 8], [8, 8]];
        let mut all = vec![vec![vec![draw.clone(), draw]; RANGES_M.len()]; GAPS_M.len()];
        all[4][0] = Vec::new();
        let table = table(&all, 2);
        assert_eq!(table.rows.len(), PIPELINES.len() * GAPS_M.len());
        let values: Vec<Vec<Option<f64>>> = table
            .rows
            .iter()
            .map(|row| row.cells.iter().map(|cell| cell.value).collect())
            .collect();
        assert_eq!([values[0][0], values[5][0], values[14][4]], [12.5, 50.0, 100.0].map(Some));
        assert_eq!([values[4][0], values[14][0]], [None, None]);
        assert_eq!(table.rows[9].name, "stereo-svm-ekf, 1.5 m apart");
    }
}
