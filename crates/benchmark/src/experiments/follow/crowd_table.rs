//! Table of the measures of Follow-Bench.

use tagalong_report::{Cell, Row, Table};
use tagalong_sim::Seeds;
use tagalong_trials::CrowdMeasures;

use super::Followed;

const COLUMNS: [&str; 12] = [
    "rides",
    "success %",
    "search success %",
    "path m",
    "search m",
    "speed m/s",
    "acceleration m/s2",
    "jerk m/s3",
    "personal zone s",
    "private zone s",
    "out of sight s",
    "time s",
];

/// Returns the row for some rides; `None` if none of them was among reacting people.
pub fn row(label: &str, rides: &[&Followed]) -> Option<Row> {
    let all: Vec<CrowdMeasures> = rides.iter().filter_map(|ride| ride.ridden.crowd).collect();
    if all.is_empty() {
        return None;
    }
    let count = all.len() as u64;
    let reached = all.iter().filter(|ride| ride.success).count() as u64;
    let found = all.iter().filter(|ride| ride.search_success).count() as u64;
    let cells = vec![
        Cell::number(count as f64, 0),
        Cell::share(reached, count, 1),
        Cell::share(found, count, 1),
        mean_cell(&all, |ride| ride.path_m, 1),
        mean_cell(&all, |ride| ride.search_m, 1),
        mean_cell(&all, |ride| ride.speed_mps, 2),
        mean_cell(&all, |ride| ride.acceleration_mps2, 2),
        mean_cell(&all, |ride| ride.jerk_mps3, 1),
        mean_cell(&all, |ride| ride.personal_s, 1),
        mean_cell(&all, |ride| ride.private_s, 1),
        mean_cell(&all, |ride| ride.out_of_sight_s, 1),
        mean_cell(&all, |ride| ride.time_s, 1),
    ];
    Some(Row::ours(label, cells))
}

/// Returns the mean of one measure over all rides.
fn mean_cell(rides: &[CrowdMeasures], measure: fn(&CrowdMeasures) -> f64, digits: usize) -> Cell {
    Cell::mean(&rides.iter().map(measure).collect::<Vec<_>>(), digits)
}

/// Returns the table with these rows; `None` without rows.
pub fn table(rows: Vec<Row>, seeds: Seeds) -> Option<Table> {
    if rows.is_empty() {
        return None;
    }
    let notes = [
        format!("each scene with {seeds}"),
        "measures of Follow-Bench (arXiv 2509.10796), from the start until the target has arrived, every \
         0.1 s; intervals: 95 %, Wilson for shares of rides, Student for means"
            .into(),
        "success: rides without a contact with a person, taken as a disc of 0.3 m, or a thing".into(),
        "search success: rides in which the target was never out of sight for more than 10 s in one go; \
         in sight: within reach of the laser scanner, or of 5 m without one, and not hidden"
            .into(),
        "search: length of the path while the target was out of sight".into(),
        "personal zone: the gap to the target was between 0.45 and 1.2 m; private zone: that to another \
         person was below 0.45 m; the robot is the circle around its outline"
            .into(),
    ];
    Some(Table {
        title: "Following among people: measures of Follow-Bench".into(),
        columns: COLUMNS.map(str::to_owned).to_vec(),
        rows,
        notes: notes.to_vec(),
    })
}

#[cfg(test)]
mod tests {
    use tagalong_sim::Split;
    use tagalong_trials::Ridden;

    use super::*;

    #[test]
    fn rides_among_people_have_a_row_and_others_have_none() {
        fn ride(crowd: Option<CrowdMeasures>) -> Followed {
            Followed { ridden: Ridden { crowd, ..Ridden::default() }, ..Followed::default() }
        }

        fn measured(success: bool, path_m: f64) -> Followed {
            ride(Some(CrowdMeasures { success, path_m, ..CrowdMeasures::default() }))
        }

        let rides = [measured(true, 4.0), measured(false, 6.0), ride(None)];
        let row = row("a", &rides.iter().collect::<Vec<_>>()).unwrap();
        let values: Vec<_> = row.cells[..4].iter().map(|cell| cell.value).collect();
        assert_eq!(values, [Some(2.0), Some(50.0), Some(0.0), Some(5.0)]);
        assert!(super::row("b", &[&ride(None)]).is_none());
        let seeds = Split::Test.seeds(0, 1).unwrap();
        assert_eq!(table(vec![row], seeds).unwrap().columns.len(), 12);
        assert!(table(Vec::new(), seeds).is_none());
    }
}
