//! Experiments on annotated logs of real people, beside those on simulated scenes.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use cpu_time::ThreadTime;
use tagalong_eval::formats::people;
use tagalong_eval::{Comparison, Frame, Sequence, SetDistance, Similarity, Tally, Truth};
use tagalong_log::{FrameSource, InputSettings, Limits};
use tagalong_pipeline::{FrameReport, Pipeline};
use tagalong_trials::{Contender, Judge};

use crate::lab::{Lab, ReproduceError, read};

/// Suffix of truth files, after the name of their log.
const TRUTH: &str = ".people.csv";

/// Results of one contender on a log.
pub(crate) struct Recorded {
    /// Reports of the frames that the log delivered.
    pub(crate) reports: Vec<FrameReport>,
    /// Match of its boxes with those of the people.
    pub(crate) tally: Tally,
    /// Processor time, reading not included, ms.
    pub(crate) worked_ms: f64,
}

/// Runs all contenders on each annotated log of colour and depth images, and returns for each
/// contender the results on each log. Without real data there are no logs. A contender receives the
/// images that it declares.
pub(crate) fn recorded(
    lab: &Lab<'_>,
    contenders: &[Contender],
    judge: &Judge,
) -> Result<Vec<Vec<Recorded>>, ReproduceError> {
    let logs = logs(lab)?;
    lab.progress.begin(logs.len() * contenders.len(), "annotated logs");
    let mut recorded = Vec::new();
    for contender in contenders {
        let mut on_logs = Vec::new();
        for log in &logs {
            on_logs.push(log.take(lab, contender, judge)?);
            lab.progress.step();
        }
        recorded.push(on_logs);
    }
    Ok(recorded)
}

/// A log with its annotated people by frame.
struct Log {
    name: String,
    path: PathBuf,
    people: BTreeMap<u32, Vec<Truth>>,
}

/// Returns the annotated logs in the order of their names.
fn logs(lab: &Lab<'_>) -> Result<Vec<Log>, ReproduceError> {
    fn name(path: PathBuf) -> Option<String> {
        path.file_name()?.to_str()?.strip_suffix(TRUTH).map(String::from)
    }

    let Some(data) = &lab.data else { return Ok(Vec::new()) };
    let Ok(entries) = fs::read_dir(data.join("logs")) else { return Ok(Vec::new()) };
    let files = entries.flatten().map(|entry| entry.path());
    let mut names: Vec<String> = files.filter_map(name).collect();
    names.sort();
    names.into_iter().map(|name| Log::read(data.join("logs"), name)).collect()
}

impl Log {
    fn read(folder: PathBuf, name: String) -> Result<Self, ReproduceError> {
        let path = folder.join(format!("{name}{TRUTH}"));
        let rows = people::parse(&read(&path)?, &path.display().to_string());
        let mut people: BTreeMap<u32, Vec<Truth>> = BTreeMap::new();
        for row in rows.map_err(ReproduceError::other)? {
            let (frame, truth) = row.truth(|_| None);
            people.entry(frame).or_default().push(truth);
        }
        Ok(Self { path: folder.join(format!("{name}.mcap")), name, people })
    }

    fn take(
        &self,
        lab: &Lab<'_>,
        contender: &Contender,
        judge: &Judge,
    ) -> Result<Recorded, ReproduceError> {
        let mut pipeline: Pipeline = contender.pipeline(lab.registry, 1)?;
        let input = InputSettings::default();
        let limits = Limits::default();
        let mut source = FrameSource::open(&self.path, &input, &limits, pipeline.inputs())
            .map_err(|error| ReproduceError::of(&self.name, error))?;
        let mut reports = Vec::new();
        let mut frames = BTreeMap::new();
        let mut worked_ms = 0.0;
        while let Some(item) = source.next_frame() {
            let camera = &item.frame.camera;
            let size = (camera.width, camera.height);
            // Reading the log is not part of the measured time.
            let before = ThreadTime::now();
            let report = pipeline
                .step(&item.frame)
                .map_err(|error| ReproduceError::of(&self.name, error))?;
            worked_ms += 1e3 * before.elapsed().as_secs_f64();
            let number = u32::try_from(item.frame.index).unwrap_or(u32::MAX);
            frames.insert(
                number,
                self.frame(number, item.frame.stamp.nanos(), || judge.reports(&report, size)),
            );
            reports.push(report);
        }
        let tally = self.tally(frames)?;
        Ok(Recorded { reports, tally, worked_ms })
    }

    fn frame(
        &self,
        number: u32,
        stamp_ns: u64,
        reports: impl FnOnce() -> Vec<tagalong_eval::Report>,
    ) -> Frame {
        let truths = self.people.get(&number).cloned().unwrap_or_default();
        Frame { stamp_ns: stamp_ns as i64, truths, reports: reports(), ignore_regions: Vec::new() }
    }

    /// Tallies the frames; people in a frame that the log does not deliver count as missed.
    fn tally(&self, mut frames: BTreeMap<u32, Frame>) -> Result<Tally, ReproduceError> {
        for number in self.people.keys() {
            frames.entry(*number).or_insert_with(|| self.frame(*number, 0, Vec::new));
        }
        let frames = frames.into_values().collect();
        let sequence = Sequence { name: self.name.clone(), frames };
        let comparison = Comparison::from(Similarity::Iou);
        Tally::measure(&sequence, &comparison, &SetDistance::default())
            .map_err(ReproduceError::other)
    }
}
