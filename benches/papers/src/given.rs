//! P2's filter and association alone: given detections on the sequences of MOT15, beside the
//! published results of SORT with the same boxes.

use tagalong_eval::Tally;
use tagalong_report::{Cell, Row, Table};
use tagalong_trials::{Contender, GivenSequence, for_given_boxes};

use crate::findings::Findings;
use crate::lab::{Lab, ReproduceError};

/// Name of the config.
const RECORDED: &str = "recorded";
/// MOTA of SORT, per cent, in the sequences of its validation set (its README); 34.0 in all six
/// together.
const SORT: [(&str, f64); 6] = [
    ("ADL-Rundle-8", 28.6),
    ("ETH-Pedcross2", 45.4),
    ("ETH-Sunnyday", 59.1),
    ("KITTI-17", 60.2),
    ("TUD-Campus", 62.7),
    ("Venice-2", 18.6),
];
const SORT_ALL: f64 = 34.0;
const COLUMNS: [&str; 5] = ["MOTA, %", "IDF1, %", "HOTA, %", "switches", "frames/s"];

/// Results on one sequence.
struct Tracked {
    name: String,
    tally: Tally,
    frames: u64,
    /// Processor time of all steps, ms.
    worked_ms: f64,
}

/// Builds the table.
pub(crate) fn given(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    fn published(name: &str, mota: f64) -> Row {
        let mut cells = vec![Cell::default(); COLUMNS.len()];
        cells[0] = Cell::number(mota, 1);
        Row::published(format!("SORT, {name}"), cells)
    }

    fn mota_of(name: &str) -> Option<f64> {
        SORT.iter().find(|(of, _)| *of == name).map(|(_, mota)| *mota)
    }

    let config = whole_bodies(lab)?;
    let sequences = sequences(lab)?;
    lab.progress.begin(sequences.len(), "sequences of MOT15");
    let mut tracked = Vec::new();
    for given in &sequences {
        tracked.push(Tracked::new(given, lab, &config)?);
        lab.progress.step();
    }
    let mut rows = Vec::new();
    for one in &tracked {
        rows.extend(mota_of(&one.name).map(|mota| published(&one.name, mota)));
        rows.push(row(&one.name, &[one]));
    }
    let six: Vec<&Tracked> = tracked.iter().filter(|one| mota_of(&one.name).is_some()).collect();
    rows.push(published("these six", SORT_ALL));
    rows.push(row("these six", &six));
    rows.push(row("all eleven", &tracked.iter().collect::<Vec<_>>()));
    // Without the data the published rows would stand alone.
    if tracked.is_empty() {
        rows.clear();
    }
    let notes = vec![
        "`configs/recorded.toml` with the detections that SORT was published with: whole \
         bodies, IoU 0.5, the rules of MOT15."
            .into(),
        "Frames a second of the processor's time on one core: the steps of the pipeline \
         (boxes to detections, prediction, association, update, life cycle). The file of boxes \
         is read before, and there are no images."
            .into(),
    ];
    let title = "Given boxes, MOT15 (beside SORT, ICIP 2016)".into();
    Ok(Table { title, columns: COLUMNS.map(String::from).to_vec(), rows, notes }.into())
}

fn row(name: &str, all: &[&Tracked]) -> Row {
    fn percent(value: Option<f64>) -> Cell {
        Cell::number(value.unwrap_or(f64::NAN), 3).percent()
    }

    let tally = Tally::combine(all.iter().map(|one| &one.tally));
    let scores = tally.scores();
    let frames: f64 = all.iter().map(|one| one.frames as f64).sum();
    let worked_ms: f64 = all.iter().map(|one| one.worked_ms).sum();
    let mut cells = [scores.mota, scores.idf1, scores.hota].map(percent).to_vec();
    cells.push(Cell::number(scores.idsw as f64, 0));
    cells.push(Cell::number(1e3 * frames / worked_ms, 0));
    Row::ours(format!("{RECORDED}, {name}"), cells)
}

/// Returns the config for boxes of whole bodies that come with the frames.
fn whole_bodies(lab: &Lab<'_>) -> Result<Contender, ReproduceError> {
    let shipped = lab.contender(RECORDED)?;
    let resolved = shipped.pipeline(lab.registry, 1)?.resolved();
    Ok(Contender { config: for_given_boxes(&resolved, lab.registry)?, ..shipped })
}

/// Returns the available sequences of MOT15, in the order of their names.
fn sequences(lab: &Lab<'_>) -> Result<Vec<GivenSequence>, ReproduceError> {
    let Some(root) = lab.data.as_ref().map(|data| data.join("mot")) else { return Ok(Vec::new()) };
    let truth = root.join("gt/MOT15-train");
    if !truth.is_dir() {
        return Ok(Vec::new());
    }
    Ok(GivenSequence::read_all(&truth, Some(&root.join("sort-detections")))?)
}

impl Tracked {
    fn new(
        given: &GivenSequence,
        lab: &Lab<'_>,
        config: &Contender,
    ) -> Result<Self, ReproduceError> {
        let tracks = given.track(config, lab.registry)?;
        Ok(Self {
            name: given.info.name.clone(),
            tally: given.tally(&tracks)?,
            frames: given.len() as u64,
            worked_ms: tracks.worked_ms,
        })
    }
}
