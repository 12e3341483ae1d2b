//! P2's filter and association alone: given detections on the sequences of MOT15, beside the
//! published results of SORT with the same boxes.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use cpu_time::ThreadTime;
use tagalong_core::{EgoMotion, Frame, Images, Stamp};
use tagalong_eval::formats::mot::{Rules, SequenceInfo, parse_info, parse_truth};
use tagalong_eval::formats::{FormatError, Timeline};
use tagalong_eval::{Comparison, Region, Report, Sequence, SetDistance, Similarity, Tally};
use tagalong_geometry::{Camera, Distortion, Pinhole};
use tagalong_pipeline::FrameReport;
use tagalong_trials::Contender;

use crate::lab::read;
use crate::{Cell, Findings, Lab, ReproduceError, Row, Table};

/// Name of the config.
const RECORDED: &str = "recorded";
/// Place in the config where the settings of the detector begin ...
const DETECTOR: &str = "config = { ";
/// ... and the setting that is inserted there, after the path: the boxes are of whole bodies.
const BODY: &str = "body = \"full-box\"";
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

/// A sequence: the annotated people, and the given boxes.
struct GivenSequence {
    info: SequenceInfo,
    truth: String,
    detections: PathBuf,
}

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
    let config = lab.contender(RECORDED)?;
    let sequences = sequences(lab)?;
    lab.progress.begin(sequences.len(), "sequences of MOT15");
    let track = |given: &GivenSequence| {
        let tracked = given.track(lab, &config);
        lab.progress.step();
        tracked
    };
    let tracked = sequences.iter().map(track).collect::<Result<Vec<Tracked>, _>>()?;
    let published = |name: &str, mota: f64| {
        let mut cells = vec![Cell::default(); COLUMNS.len()];
        cells[0] = Cell::number(mota, 1);
        Row::published(format!("SORT, {name}"), cells)
    };
    let mota_of = |name: &str| SORT.iter().find(|(of, _)| *of == name).map(|(_, mota)| *mota);
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
    let tally = Tally::combine(all.iter().map(|one| &one.tally));
    let scores = tally.scores();
    let percent = |value: Option<f64>| Cell::number(value.unwrap_or(f64::NAN), 3).percent();
    let frames: f64 = all.iter().map(|one| one.frames as f64).sum();
    let worked_ms: f64 = all.iter().map(|one| one.worked_ms).sum();
    let mut cells = [scores.mota, scores.idf1, scores.hota].map(percent).to_vec();
    cells.push(Cell::number(scores.idsw as f64, 0));
    cells.push(Cell::number(1e3 * frames / worked_ms, 0));
    Row::ours(format!("{RECORDED}, {name}"), cells)
}

/// Returns the available sequences of MOT15, in the order of their names.
fn sequences(lab: &Lab<'_>) -> Result<Vec<GivenSequence>, ReproduceError> {
    let Some(root) = lab.data.as_ref().map(|data| data.join("mot")) else { return Ok(Vec::new()) };
    let Ok(entries) = fs::read_dir(root.join("gt/MOT15-train")) else { return Ok(Vec::new()) };
    let mut folders: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    folders.sort();
    folders.iter().map(|folder| GivenSequence::read(&root, folder)).collect()
}

fn other(error: impl ToString) -> ReproduceError {
    ReproduceError::Other(error.to_string())
}

impl GivenSequence {
    fn read(root: &Path, folder: &Path) -> Result<Self, ReproduceError> {
        let path = folder.join("seqinfo.ini");
        let info = parse_info(&read(&path)?, &path.display().to_string()).map_err(other)?;
        let detections = root.join("sort-detections").join(&info.name).join("det.txt");
        // Made absolute, because the pipeline resolves paths against the folder of the config.
        let detections = fs::canonicalize(&detections).unwrap_or(detections);
        Ok(Self { truth: read(&folder.join("gt/gt.txt"))?, detections, info })
    }

    fn track(&self, lab: &Lab<'_>, config: &Contender) -> Result<Tracked, ReproduceError> {
        let with = format!("{DETECTOR}path = {:?}, {BODY}, ", self.detections);
        let text = config.config.replacen(DETECTOR, &with, 1);
        let config = Contender { config: text, ..config.clone() };
        let mut pipeline = config.pipeline(lab.registry, 1)?;
        let (mut reports, mut worked_ms) = (Vec::new(), 0.0);
        for frame in self.frames() {
            // Time of this thread alone, so that other load on the machine does not count.
            let before = ThreadTime::now();
            reports.push(pipeline.step(&frame).map_err(other)?);
            worked_ms += 1e3 * before.elapsed().as_secs_f64();
        }
        let comparison = Comparison::from(Similarity::Iou);
        let sequence = self.against_truth(&reports).map_err(other)?;
        let tally = Tally::measure(&sequence, &comparison, &SetDistance::default());
        Ok(Tracked {
            name: self.info.name.clone(),
            tally: tally.map_err(other)?,
            frames: reports.len() as u64,
            worked_ms,
        })
    }

    /// Returns frames with a stamp each and without images, and a camera with the size of the
    /// images (a field of view of 53 degrees, at breast height).
    fn frames(&self) -> impl Iterator<Item = Frame> + use<> {
        let (width, height) = (self.info.width as usize, self.info.height as usize);
        let lens = Pinhole {
            fx: width as f64,
            fy: width as f64,
            cx: 0.5 * width as f64,
            cy: 0.5 * height as f64,
            distortion: Distortion::None,
        };
        let camera = Arc::new(Camera::mounted(lens, width, height, 1.2, 0.0, 0.0));
        let (dt, length) = (1.0 / self.info.rate_hz, u64::from(self.info.length));
        (1..=length).map(move |index| {
            let stamp = Stamp::default().plus_seconds(index as f64 * dt);
            Frame::new(index, stamp, Arc::clone(&camera), EgoMotion::at_rest(dt), Images::default())
        })
    }

    /// Returns truth and reported boxes side by side; predicted boxes do not count, as with SORT.
    fn against_truth(&self, reports: &[FrameReport]) -> Result<Sequence, FormatError> {
        let mut timeline = Timeline::new();
        let truth = parse_truth(&self.truth, "gt.txt", Rules::Mot15)?;
        timeline.add_truths(truth.iter().map(|row| row.truth(Rules::Mot15)));
        for report in reports {
            let seen = report.tracks.iter().filter(|t| t.confirmed && t.seen);
            timeline.frame(report.index as u32).reports.extend(seen.map(|track| {
                let r = track.estimate.region;
                let region = Some(Region::new(r.x, r.y, r.width, r.height));
                Report { id: i64::from(track.id.0), region, floor_m: None, score: track.score }
            }));
        }
        let SequenceInfo { name, length, rate_hz, .. } = &self.info;
        Ok(timeline.into_sequence(name, 1, *length, *rate_hz).0)
    }
}
