//! Comparison of pipelines with the last one that was named, in the left-out rooms.

use crate::tuning::Figures;
use serde::Serialize;
use tagalong_math::{Gain, paired_gain};
use tagalong_report::{Cell, Row, Table};

use super::report::Fitted;

/// Figure that is compared.
struct Compared {
    /// Title of its column.
    title: &'static str,
    /// True if single frames do not count for it.
    is_over_time: bool,
    /// Digits of its value and of a difference of it.
    digits: [usize; 2],
    read: fn(&Figures) -> f64,
}

const RATE: Compared = Compared { title: "", is_over_time: true, digits: [3, 3], read: |_| 0.0 };

const COMPARED: [Compared; 7] = [
    Compared { title: "HOTA", read: |figures| figures.hota, ..RATE },
    Compared { title: "AssA", read: |figures| figures.ass_a, ..RATE },
    Compared { title: "IDF1", read: |figures| figures.idf1, ..RATE },
    Compared {
        title: "inherited",
        digits: [0, 1],
        read: |figures| figures.inherited as f64,
        ..RATE
    },
    Compared { title: "MOTA", read: |figures| figures.mota, ..RATE },
    Compared { title: "false", is_over_time: false, read: |figures| figures.false_a_frame, ..RATE },
    Compared { title: "recall", is_over_time: false, read: |figures| figures.recall, ..RATE },
];

/// Differences between a pipeline and the baseline over the rooms that both can read.
#[derive(Serialize)]
pub struct Pair {
    pipeline: String,
    baseline: String,
    rooms: usize,
    /// In the order of [`COMPARED`]; `None` if there is no such room.
    gains: Vec<Option<Gain>>,
}

/// Compares all pipelines with the last one.
pub fn pairs(pipelines: &[Fitted]) -> Vec<Pair> {
    let Some((baseline, others)) = pipelines.split_last() else { return Vec::new() };
    others.iter().map(|other| Pair::new(other, baseline)).collect()
}

impl Pair {
    fn new(pipeline: &Fitted, baseline: &Fitted) -> Self {
        let mut both: Vec<(bool, [Figures; 2])> = Vec::new();
        for room in &pipeline.rooms {
            let other = baseline.rooms.iter().find(|other| other.room == room.room);
            both.extend(other.map(|other| (room.single_frames, [other.without, room.without])));
        }
        let gains = COMPARED.iter().map(|compared| {
            let mut a = Vec::new();
            let mut b = Vec::new();
            for (single_frames, [other, own]) in &both {
                if !(*single_frames && compared.is_over_time) {
                    a.push((compared.read)(other));
                    b.push((compared.read)(own));
                }
            }
            paired_gain(&a, &b)
        });
        Self {
            pipeline: pipeline.name.clone(),
            baseline: baseline.name.clone(),
            rooms: both.len(),
            gains: gains.collect(),
        }
    }
}

/// Returns the table of the differences, if there are any.
pub fn differences(pairs: &[Pair]) -> Option<Table> {
    let baseline = &pairs.first()?.baseline;
    let rows = pairs.iter().map(|pair| {
        let rooms = Cell::number(pair.rooms as f64, 0);
        let gains = pair.gains.iter().zip(&COMPARED).map(|(gain, compared)| {
            Cell::estimate(gain.map(|of| of.difference), compared.digits[1])
        });
        Row::ours(&pair.pipeline, std::iter::once(rooms).chain(gains).collect())
    });
    let titles = COMPARED.iter().map(|compared| compared.title);
    Some(Table {
        title: format!("Difference to {baseline}, each without the room that is scored"),
        columns: std::iter::once("rooms").chain(titles).map(String::from).collect(),
        rows: rows.collect(),
        notes: vec![
            "Means of the differences w/o, paired by room, all of the same weight, with Student's \
             intervals of 95 % over rooms; fewer than six rooms are never called clear. Rooms of \
             single frames have no say in HOTA, AssA, IDF1, MOTA and inherited IDs."
                .to_owned(),
        ],
    })
}

/// Returns the table of each log, with the pipelines side by side.
pub fn by_log(pipelines: &[Fitted]) -> Table {
    let rows = pipelines.iter().flat_map(|pipeline| {
        let logs = pipeline.rooms.iter().flat_map(|room| &room.logs);
        logs.map(|log| (log.log.as_str(), row(&format!("{}: {}", log.log, pipeline.name), log)))
    });
    let mut rows: Vec<(&str, Row)> = rows.collect();
    rows.sort_by_key(|(log, _)| *log);
    let two = COMPARED.iter().flat_map(|of| [format!("{} w/o", of.title), "as is".into()]);
    Table {
        title: "Log by log".into(),
        columns: two.chain(["off m w/o".into()]).collect(),
        rows: rows.into_iter().map(|(_, row)| row).collect(),
        notes: vec![
            "w/o: without the room of the log, its other logs included; inherited: IDs that another \
             person had last."
                .to_owned(),
        ],
    }
}

fn row(name: &str, log: &super::report::InLog) -> Row {
    let cells = COMPARED.iter().flat_map(|of| {
        [&log.without, &log.shipped].map(|log| Cell::number((of.read)(log), of.digits[0]))
    });
    let off = log.without.position_error_m.map_or_else(Cell::default, |off| Cell::number(off, 3));
    Row::ours(name, cells.chain([off]).collect())
}

#[cfg(test)]
mod tests {
    use super::super::report::testing::{fitted, room};
    use super::*;

    /// Better by 0.2 in two rooms, and worse by 0.4 in single frames.
    #[test]
    fn single_frames_have_no_say_in_what_is_tracked() {
        let mut own =
            vec![room("A", false, 9, 0.8), room("B", false, 9, 0.6), room("D", true, 9, 0.1)];
        own[0].without.inherited = 1;
        own[2].without.inherited = 9;
        let base =
            vec![room("A", false, 9, 0.6), room("B", false, 9, 0.4), room("D", true, 9, 0.5)];
        let pair = &pairs(&[fitted("own", own), fitted("base", base)])[0];
        let gains: Vec<f64> =
            pair.gains.iter().map(|gain| gain.unwrap().difference.estimate).collect();
        for (gain, expected) in gains.iter().zip([0.2, 0.2, 0.2, 0.5, 0.2, 0.0, 0.0]) {
            assert!((gain - expected).abs() < 1e-12, "{gains:?}");
        }
        assert_eq!(pair.rooms, 3);
    }
}
