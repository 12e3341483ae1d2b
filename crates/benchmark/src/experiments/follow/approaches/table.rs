use tagalong_math::{CONFIDENCE, exact_upper_bound, percentile};
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::{ApproachBy, Seeds};
use tagalong_trials::{ApproachJudge, Approached, Contact, Side, Touched};

use super::Outlived;

/// Returns a table for each pipeline and scene: all approaches, then those of each stratum.
pub fn tables(results: &[Outlived], seeds: Seeds) -> Vec<Table> {
    let mut names: Vec<(&str, &str)> = Vec::new();
    for result in results {
        let name = (result.pipeline.as_str(), result.suite.as_str());
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let mut tables = Vec::new();
    for (pipeline, suite) in names {
        let of = results.iter().filter(|one| one.pipeline == pipeline && one.suite == suite);
        let all: Vec<&Approached> = of.map(|one| &one.approached).collect();
        tables.push(Table {
            title: format!("Approaches to {pipeline} in {suite}"),
            columns: COLUMNS.map(str::to_owned).to_vec(),
            rows: rows(&all),
            notes: notes(seeds),
        });
    }
    tables
}

const COLUMNS: [&str; 15] = [
    "approaches",
    "moved",
    "contacts",
    "%",
    "<= %",
    "by approacher",
    "seen",
    "unseen",
    "by turn",
    "standing",
    "least room m",
    "stops",
    "after s",
    "95 % s",
    "fastest m/s",
];

/// Strata of approaches with a common property, in the order of the rows.
struct Strata<'a> {
    all: &'a [&'a Approached],
    named: Vec<(String, Vec<&'a Approached>)>,
}

impl<'a> Strata<'a> {
    /// Adds the approaches for which `is_in` is true, unless these are none or all of them: a
    /// stratum with all approaches would repeat the first row.
    fn add(&mut self, name: String, is_in: impl Fn(&Approached) -> bool) {
        let of: Vec<&Approached> = self.all.iter().copied().filter(|one| is_in(one)).collect();
        if !of.is_empty() && of.len() < self.all.len() {
            self.named.push((name, of));
        }
    }
}

/// Returns the name of each stratum that contains approaches, with those approaches.
fn strata<'a>(all: &'a [&'a Approached]) -> Vec<(String, Vec<&'a Approached>)> {
    let mut strata = Strata { all, named: vec![("all".to_owned(), all.to_vec())] };
    for laser in [false, true] {
        let name = if laser { "with laser" } else { "without laser" };
        strata.add(name.to_owned(), |one| one.laser == laser);
        for side in Side::ALL {
            strata.add(format!("{name}, {side}"), |one| {
                one.laser == laser && one.side() == Some(side)
            });
        }
    }
    strata.add("by a person".to_owned(), |one| one.by == ApproachBy::Person);
    strata.add("by a trolley".to_owned(), |one| one.by == ApproachBy::Trolley);
    for [low, high] in [[0.0, 0.6], [0.6, 1.1], [1.1, 1.6]] {
        strata.add(format!("at {low} to {high} m/s"), |one| {
            low < one.approach_mps && one.approach_mps <= high
        });
    }
    for height_m in values(all, |one| one.camera_height_m) {
        strata.add(format!("camera at {height_m} m"), |one| one.camera_height_m == height_m);
    }
    for latency_s in values(all, |one| one.latency_s) {
        strata.add(format!("wheels {latency_s} s late"), |one| one.latency_s == latency_s);
    }
    for reason in names(all, |one| one.reason.into_iter().collect()) {
        strata.add(format!("begun at {reason}"), |one| one.reason == Some(reason));
    }
    for kind in names(all, |one| one.faults.iter().map(|fault| fault.kind.name()).collect()) {
        strata.add(format!("fault {kind}"), |one| has_fault(one, kind));
    }
    strata.named
}

fn has_fault(approached: &Approached, kind: &str) -> bool {
    approached.faults.iter().any(|fault| fault.kind.name() == kind)
}

/// Returns the distinct values of a setting, in ascending order.
fn values(all: &[&Approached], of: fn(&Approached) -> f64) -> Vec<f64> {
    let mut values: Vec<f64> = all.iter().map(|one| of(one)).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    values
}

/// Returns the distinct names, in alphabetical order.
fn names(all: &[&Approached], of: fn(&Approached) -> Vec<&'static str>) -> Vec<&'static str> {
    let mut names: Vec<&'static str> = all.iter().flat_map(|one| of(one)).collect();
    names.sort_unstable();
    names.dedup();
    names
}

fn rows(all: &[&Approached]) -> Vec<Row> {
    strata(all).into_iter().map(|(name, of)| Row::ours(name, cells(&of))).collect()
}

fn cells(all: &[&Approached]) -> Vec<Cell> {
    let moved = all.iter().filter(|one| one.moved).count();
    let standing = all.iter().filter(|one| one.contact.is_none() && one.touched.is_some()).count();
    let contacts: Vec<&Contact> = all.iter().filter_map(|one| one.contact.as_ref()).collect();
    let came = contacts.iter().filter(|contact| contact.with == Touched::Approacher);
    let [seen, unseen] = [true, false]
        .map(|seen| came.clone().filter(|one| (one.camera_saw || one.laser_saw) == seen).count());
    let moves_mps = ApproachJudge::default().moves_mps;
    let turning = contacts.iter().filter(|one| one.speed_mps.abs() <= moves_mps).count();
    let share = 100.0 * contacts.len() as f64 / all.len() as f64;
    let bound = exact_upper_bound(contacts.len() as u64, all.len() as u64, CONFIDENCE);
    let near = all.iter().filter(|one| one.came_near).count();
    let stops: Vec<f64> = all.iter().filter_map(|one| one.stopping_s).collect();
    let room = all.iter().filter_map(|one| one.room_m).min_by(f64::total_cmp);
    let speeds = contacts.iter().map(|contact| contact.speed_mps.abs());
    let fastest = speeds.max_by(f64::total_cmp);
    vec![
        number(all.len()),
        number(moved),
        number(contacts.len()),
        Cell::number(share, 2),
        optional(bound.map(|bound| 100.0 * bound)),
        number(seen + unseen),
        number(seen),
        number(unseen),
        number(turning),
        number(standing),
        optional(room),
        Cell::number(100.0 * stops.len() as f64 / near as f64, 0),
        optional(percentile(&stops, 0.5)),
        optional(percentile(&stops, 0.95)),
        optional(fastest),
    ]
}

fn number(count: usize) -> Cell {
    Cell::number(count as f64, 0)
}

/// Returns a cell with two decimals; an empty one without a value.
fn optional(value: Option<f64>) -> Cell {
    value.map_or_else(Cell::default, |value| Cell::number(value, 2))
}

fn notes(seeds: Seeds) -> Vec<String> {
    let judge = ApproachJudge::default();
    vec![
        format!("{seeds}; a person or a trolley comes at the robot and does not avoid it"),
        format!(
            "contacts: approaches with a contact at whose time the robot moved by more than {} m/s, \
             forward or at its rim by a turn; beside it the share, and the exact one-sided bound of \
             {:.0} % (Clopper and Pearson)",
            judge.moves_mps,
            100.0 * CONFIDENCE
        ),
        "by approacher: contacts with it; the others are with the followed person, furniture or a \
         wall"
            .into(),
        "seen, unseen: of those, whether the approacher was in view of the camera, within its depth, \
         or of the laser in the last second"
            .into(),
        "by turn: of the contacts, those of a robot that only turned".into(),
        "moved: the robot moved after the approacher appeared; standing: contacts of a robot that \
         stood, which are the approacher's"
            .into(),
        "least room: to the approacher while the robot moved; fastest: speed of the robot at a \
         contact"
            .into(),
        format!(
            "stops: of the approaches that came within the separation distance (v_h + v_r)(t_r + \
             v_r / a) + C of a robot that moved, with v_h = {} m/s, t_r = {} s, a = {} m/s2, C = {} \
             m, those after which it stood, %; beside it the median and the 95th percentile of the \
             time",
            judge.human_mps, judge.reaction_s, judge.decel_mps2, judge.margin_m
        ),
    ]
}

#[cfg(test)]
mod tests {
    use tagalong_sim::Split;

    use super::*;

    fn contact(with: Touched, camera_saw: bool) -> Contact {
        Contact {
            at_s: 3.0,
            with,
            speed_mps: -0.4,
            turn_rate: 0.0,
            bearing_deg: None,
            camera_saw,
            laser_saw: false,
            reason: None,
        }
    }

    fn outlived(bearing_deg: f64, contact: Option<Contact>) -> Outlived {
        let approached = Approached {
            seed: 1,
            by: ApproachBy::Person,
            aims: true,
            approach_mps: 1.0,
            start_s: 1.0,
            bearing_deg: Some(bearing_deg),
            latency_s: 0.1,
            camera_height_m: 0.3,
            laser: false,
            faults: Vec::new(),
            time_s: 6.0,
            moved: true,
            reason: Some("follow"),
            contact,
            touched: None,
            room_m: Some(bearing_deg),
            came_near: true,
            stopping_s: contact.is_none().then_some(0.5),
        };
        let suite = "approach".into();
        let pipeline = "config".into();
        Outlived { suite, pipeline, approached, story: Vec::new(), log: None }
    }

    #[test]
    fn contacts_are_counted_by_side_and_by_whether_they_were_seen() {
        let mut all = vec![outlived(0.0, None); 18];
        all.push(outlived(90.0, Some(contact(Touched::Approacher, true))));
        all.push(outlived(91.0, Some(contact(Touched::Thing, true))));
        let table = &tables(&all, Split::Test.seeds(0, 20).unwrap())[0];
        for (row, column, value) in [
            ("all", "contacts", 2.0),
            ("all", "%", 10.0),
            ("all", "by approacher", 1.0),
            ("all", "seen", 1.0),
            ("all", "unseen", 0.0),
            ("all", "least room m", 0.0),
            ("all", "stops", 90.0),
            ("all", "fastest m/s", 0.4),
            ("without laser, left", "contacts", 2.0),
            ("without laser, front", "contacts", 0.0),
        ] {
            assert_eq!(cell_value(table, row, column), value, "{row}: {column}");
        }
        let bound = cell_value(table, "all", "<= %");
        assert!((bound - 28.26).abs() < 0.01, "{bound}");
        assert!(table.rows.iter().all(|row| row.name != "with laser"));
    }

    /// The number in a cell of the table.
    fn cell_value(table: &Table, row: &str, column: &str) -> f64 {
        let row = table.rows.iter().find(|one| one.name == row).expect("a row of this name");
        let column = COLUMNS.iter().position(|name| *name == column).expect("a known column");
        row.cells[column].value.expect("a number")
    }
}
