//! Recognition of people by the appearance that the target lock remembers, after pauses in annotated logs of
//! real rooms.

mod sightings;
mod ways;

use std::collections::{BTreeMap, BTreeSet};

use tagalong_report::{Cell, Row, Table};

use self::sightings::Sighting;
use self::ways::{Known, Way};
use crate::findings::{Experiment, Findings, System};
use crate::lab::{Lab, ReproduceError};

/// The target lock's memory of appearances.
pub const SYSTEM: System = System {
    name: "recognition",
    about: "people who come back, by the appearance that the target lock remembers",
    experiments: &[
        Experiment { name: "pauses", about: "real logs, after pauses of 1 to 10 s", run: pauses },
        Experiment {
            name: "learnt",
            about: "beside two classifiers that learn the person, each chosen on other rooms",
            run: learnt,
        },
    ],
};

/// Annotated logs, with their rooms.
const LOGS: [(&str, &str); 5] = [
    ("um", "A"),
    ("filinha", "A"),
    ("lab2-camera1", "B"),
    ("lab2-camera2", "B"),
    ("corredor1-camera1", "C"),
];
/// Pauses in which nothing is learnt, s. The logs take 10 to 36 s.
const PAUSES_S: [f64; 3] = [1.0, 3.0, 10.0];
/// Pauses of the table of classifiers, s: after longer ones hardly anybody comes back.
const SHORT_S: [f64; 2] = [1.0, 3.0];
/// Fewest sightings of a person that is known.
const LEAST: usize = 3;

/// Sighting of a person after a pause.
struct Return {
    person: i64,
    /// Time since the last moment of learning, s.
    pause_s: f64,
    /// Index of that moment.
    moment: usize,
    /// Sighting of the person, ...
    seen: usize,
    /// ... and those of all people in the same image, with it.
    beside: Vec<usize>,
}

/// Sightings of a log, and what is known at each of its moments.
struct Log {
    name: &'static str,
    room: &'static str,
    seen: Vec<Sighting>,
    /// People known at each image with people, with the number of sightings until then.
    moments: Vec<Vec<Known>>,
    /// Last sightings of these moments.
    ends: Vec<usize>,
}

/// Answers about the returns of one person: right ones and all.
type Answers = BTreeMap<i64, [u64; 2]>;

/// Answers in a log.
#[derive(Default)]
struct Answered {
    /// Choice of the person among all people known by then.
    who: Answers,
    /// Choice of the person among the people in the image.
    which: Answers,
    pauses_s: Vec<f64>,
    /// Number of people to choose from, for each answer to `who`.
    known: Vec<f64>,
}

impl Log {
    fn read(lab: &Lab<'_>) -> Result<Vec<Self>, ReproduceError> {
        let Some(folder) = lab.data.as_ref().map(|data| data.join("logs")) else {
            return Ok(Vec::new());
        };
        lab.progress.begin(LOGS.len(), "logs");
        let mut all = Vec::new();
        for (name, room) in LOGS {
            if let Some(seen) = sightings::read(&folder, name)? {
                all.push(Self::new(name, room, seen));
            }
            lab.progress.step();
        }
        Ok(all)
    }

    fn new(name: &'static str, room: &'static str, seen: Vec<Sighting>) -> Self {
        let mut moments = Vec::new();
        let mut ends = Vec::new();
        for (at, sighting) in seen.iter().enumerate() {
            if seen.get(at + 1).is_some_and(|next| next.frame == sighting.frame) {
                continue;
            }
            let until = &seen[..=at];
            let people: BTreeSet<i64> = until.iter().map(|sighting| sighting.person).collect();
            let known = people.into_iter().filter(|person| {
                until.iter().filter(|sighting| sighting.person == *person).count() >= LEAST
            });
            moments.push(known.map(|person| Known::new(person, until)).collect());
            ends.push(at);
        }
        Self { name, room, seen, moments, ends }
    }

    /// Returns the next sighting after a pause of every known person, from each moment in which that
    /// person is in the image.
    fn returns(&self, pause_s: f64) -> Vec<Return> {
        let mut all = Vec::new();
        for (moment, known) in self.moments.iter().enumerate() {
            let end = self.ends[moment];
            let Sighting { frame, at_s, .. } = self.seen[end];
            for Known { person, .. } in known {
                let is_there = self.seen[..=end]
                    .iter()
                    .any(|sighting| sighting.frame == frame && sighting.person == *person);
                let again = self.seen.iter().position(|sighting| {
                    sighting.person == *person && sighting.at_s >= at_s + pause_s
                });
                let Some(seen) = again.filter(|_| is_there) else { continue };
                let image = self.seen[seen].frame;
                let beside = (0..self.seen.len()).filter(|at| self.seen[*at].frame == image);
                let pause_s = self.seen[seen].at_s - at_s;
                let beside = beside.collect();
                all.push(Return { person: *person, pause_s, moment, seen, beside });
            }
        }
        all
    }

    fn answer(&self, returns: &[Return], way: Way) -> Answered {
        let mut answered = Answered::default();
        for back in returns {
            let known = &self.moments[back.moment];
            answered.pauses_s.push(back.pause_s);
            if known.len() > 1 {
                let looks = &self.seen[back.seen].looks;
                let odds = known.iter().map(|known| known.log_odds(way, &[looks])[0]);
                let is_right = most(odds).is_some_and(|at| known[at].person == back.person);
                count(&mut answered.who, back.person, is_right);
                answered.known.push(known.len() as f64);
            }
            let of_person = known.iter().find(|known| known.person == back.person);
            if let (Some(of_person), true) = (of_person, back.beside.len() > 1) {
                let looks: Vec<_> = back.beside.iter().map(|at| &self.seen[*at].looks).collect();
                let odds = of_person.log_odds(way, &looks);
                let is_right =
                    most(odds.into_iter()).is_some_and(|at| back.beside[at] == back.seen);
                count(&mut answered.which, back.person, is_right);
            }
        }
        answered
    }
}

/// Returns the index of the largest value.
fn most(values: impl Iterator<Item = f64>) -> Option<usize> {
    values.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(at, _)| at)
}

fn count(answers: &mut Answers, person: i64, is_right: bool) {
    let [right, of] = answers.entry(person).or_default();
    *right += u64::from(is_right);
    *of += 1;
}

/// Returns the share of right answers; `None` without any.
fn share(answers: &Answers) -> Option<f64> {
    let [right, of] = answers.values().fold([0, 0], |sum, one| [sum[0] + one[0], sum[1] + one[1]]);
    (of > 0).then(|| right as f64 / of as f64)
}

impl Answered {
    /// Returns true if there was anybody to be taken for somebody else.
    fn is_asked(&self) -> bool {
        !self.who.is_empty() || !self.which.is_empty()
    }

    fn cells(&self) -> Vec<Cell> {
        fn total(answers: &Answers) -> Cell {
            let count: u64 = answers.values().map(|[_, of]| of).sum();
            Cell::number(count as f64, 0)
        }

        fn rate(answers: &Answers) -> Cell {
            // The frames of one person are not independent.
            let clusters: Vec<[u64; 2]> = answers.values().copied().collect();
            Cell::clustered(&clusters, 1).within(0.0, 100.0)
        }

        fn plain(values: &[f64], digits: usize) -> Cell {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            Cell::number(mean, digits)
        }

        vec![
            plain(&self.pauses_s, 1),
            total(&self.who),
            plain(&self.known, 1),
            rate(&self.who),
            total(&self.which),
            rate(&self.which),
        ]
    }
}

const COLUMNS: [&str; 6] =
    ["pause s", "returns", "known people", "rank-1 %", "beside others", "the right one %"];

fn table(title: &str, rows: Vec<Row>) -> Table {
    let notes = vec![
        "Of every person that was seen three times: all sightings until a moment are learnt, and the \
         next sighting after the pause is asked for, from each moment at which the person is in the \
         image. In between the person may have been in the image: what is there is not learnt. \
         Annotated heads stand for detections."
            .into(),
        "Rank-1: of all people known by then, the one whose memory has the largest log-odds, with all \
         others as its rivals, is right. The right one: of all people in the image, the one with the \
         largest log-odds by the memory of the person is right."
            .into(),
        "Intervals: 95 %, with the spread between people.".into(),
    ];
    let columns = COLUMNS.map(String::from).to_vec();
    Table { title: title.into(), columns, rows, notes }
}

fn pauses(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    let mut rows = Vec::new();
    for log in Log::read(lab)? {
        for pause_s in PAUSES_S {
            let returns = log.returns(pause_s);
            let answered = log.answer(&returns, Way::Fixed);
            if answered.is_asked() {
                let name = format!("{}, after {pause_s} s", log.name);
                rows.push(Row::ours(name, answered.cells()));
            }
        }
    }
    Ok(table("People who come back: the fixed weights of the lock", rows).into())
}

/// A kind of classifier with the settings to choose from.
struct Kind {
    name: &'static str,
    ways: Vec<Way>,
}

fn kinds() -> Vec<Kind> {
    let mut ridges = Vec::new();
    for decay in [2.0, 6.0] {
        for lambda in [0.1, 0.5, 2.0] {
            for weight in [2.0, 5.0, 20.0] {
                ridges.push(Way::Ridge { decay, lambda, weight });
            }
        }
    }
    let metrics = [5.0, 20.0, 80.0].map(|prior| Way::Metric { prior }).to_vec();
    vec![
        Kind { name: "fixed weights", ways: vec![Way::Fixed] },
        Kind { name: "ridge regression", ways: ridges },
        Kind { name: "learnt metric", ways: metrics },
    ]
}

/// Answers of all settings of a kind in a log.
struct Tried<'a> {
    log: &'a Log,
    pause_s: f64,
    answered: Vec<Answered>,
}

/// Returns the index of the setting with the best mean over the rooms that count; of equal ones the
/// first.
fn best(tried: &[Tried<'_>], counts: impl Fn(&str) -> bool) -> Option<usize> {
    let settings = tried.first()?.answered.len();
    let mut chosen: Option<(f64, usize)> = None;
    for setting in 0..settings {
        let mut rooms: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        for Tried { log, answered, .. } in tried.iter().filter(|tried| counts(tried.log.room)) {
            let Answered { who, which, .. } = &answered[setting];
            rooms.entry(log.room).or_default().extend([share(who), share(which)].iter().flatten());
        }
        let means = rooms.values().filter(|values| !values.is_empty());
        let means: Vec<f64> =
            means.map(|values| values.iter().sum::<f64>() / values.len() as f64).collect();
        let mean = means.iter().sum::<f64>() / means.len().max(1) as f64;
        if chosen.is_none_or(|(most, _)| mean > most) {
            chosen = Some((mean, setting));
        }
    }
    chosen.map(|(_, setting)| setting)
}

/// Returns the log and the pause of a row.
fn asked_of(row: &Row) -> String {
    row.name.split(':').next().unwrap_or_default().to_owned()
}

fn learnt(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    let logs = Log::read(lab)?;
    let mut rows = Vec::new();
    let mut notes = Vec::new();
    for kind in kinds() {
        lab.progress.begin(logs.len(), kind.name);
        let mut tried = Vec::new();
        for log in &logs {
            for pause_s in SHORT_S {
                let returns = log.returns(pause_s);
                let answered = kind.ways.iter().map(|way| log.answer(&returns, *way)).collect();
                tried.push(Tried { log, pause_s, answered });
            }
            lab.progress.step();
        }
        let of_all = best(&tried, |_| true);
        for one in &tried {
            let Some(chosen) = best(&tried, |room| room != one.log.room) else { continue };
            let answered = &one.answered[chosen];
            if !answered.is_asked() {
                continue;
            }
            let Tried { log, pause_s, .. } = one;
            let name = format!("{}, after {pause_s} s: {}", log.name, kind.name);
            rows.push(Row::ours(&name, answered.cells()));
            if let Some(of_all) = of_all.filter(|_| kind.ways.len() > 1) {
                let cells = one.answered[of_all].cells();
                rows.push(Row::ours(format!("{name}, chosen on all rooms"), cells));
                let note = format!("without room {}: {:?}", log.room, kind.ways[chosen]);
                if !notes.contains(&note) {
                    notes.push(note);
                }
            }
        }
    }
    let mut names = Vec::new();
    for row in &rows {
        if !names.contains(&asked_of(row)) {
            names.push(asked_of(row));
        }
    }
    rows.sort_by_key(|row| names.iter().position(|name| *name == asked_of(row)));
    let mut table = table("People who come back: classifiers beside the fixed weights", rows);
    table.notes.push(
        "Ridge regression: the kept appearances of the person (24 that differ, and the last 8) are +1, \
         those of all others -1; the kernel falls with the squared distances and with the difference \
         in height; its answer is added to the log-odds of the fixed weights. Learnt metric: neutral \
         differences and weights of the lock by the spread of the differences within the person and to \
         others. Settings are the best of other rooms, by the mean of both shares."
            .into(),
    );
    table.notes.push(format!("Settings chosen: {}.", notes.join("; ")));
    Ok(table.into())
}

#[cfg(test)]
mod tests {
    use tagalong_vision::Appearance;

    use super::*;

    /// Two people in one image a second, the first in colour `first` from image 8 on.
    fn log(room: &'static str, first: usize) -> Log {
        let mut seen = Vec::new();
        for frame in 0..12 {
            let colours = [if frame < 8 { 1 } else { first }, 2];
            for (person, colour) in (1..).zip(colours) {
                let looks = Appearance::in_one_colour(1.6, Some(colour));
                seen.push(Sighting { frame, at_s: frame as f64, person, looks });
            }
        }
        Log::new("log", room, seen)
    }

    #[test]
    fn returns_begin_where_people_are_known_and_end_with_the_log() {
        let returns = log("A", 1).returns(2.5);
        // Known from image 2 on; the last image that is asked for is number 11.
        let moments: BTreeSet<usize> = returns.iter().map(|back| back.moment).collect();
        assert_eq!(moments, (2..=8).collect());
        assert_eq!(returns.len(), 14, "two people at each");
        assert!(returns.iter().all(|back| back.pause_s == 3.0 && back.beside.len() == 2));
    }

    #[test]
    fn who_wears_the_same_is_recognised_and_who_wears_what_another_wore_is_not() {
        fn answered(first: usize) -> Answered {
            let log = log("A", first);
            log.answer(&log.returns(3.0), Way::Fixed)
        }

        let same = answered(1);
        assert_eq!([share(&same.who), share(&same.which)], [Some(1.0); 2]);
        // Of seven returns of each, four of the first are in the clothes of the second.
        let other = answered(2);
        assert_eq!(other.who, BTreeMap::from([(1, [3, 7]), (2, [7, 7])]));
    }

    #[test]
    fn a_setting_is_chosen_on_other_rooms() {
        fn tried(log: &Log, right: [u64; 2]) -> Tried<'_> {
            let answered = right.map(|right| Answered {
                who: BTreeMap::from([(1, [right, 4])]),
                ..Answered::default()
            });
            Tried { log, pause_s: 1.0, answered: answered.into() }
        }

        let logs = [log("A", 1), log("B", 2)];
        let tried = [tried(&logs[0], [4, 1]), tried(&logs[1], [1, 3])];
        assert_eq!(best(&tried, |room| room != "A"), Some(1));
        assert_eq!(best(&tried, |room| room != "B"), Some(0));
        assert_eq!(best(&tried, |_| true), Some(0), "a mean of 0.625, not 0.5");
    }

    #[test]
    fn tables_have_a_cell_for_each_column() {
        let log = log("A", 1);
        let cells = log.answer(&log.returns(1.0), Way::Fixed).cells();
        assert_eq!(cells.len(), COLUMNS.len());
        assert_eq!(cells[3].value, Some(100.0));
    }
}
