use std::collections::BTreeMap;

use serde::Serialize;
use tagalong_core::Funnel;
use tagalong_pipeline::{Fate, FrameReport, Outcome};

/// `report.json`: what a run found, what it dropped and why. Two runs of the
/// same log, config and seed give the same bytes.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// Version of Tagalong.
    pub tagalong: &'static str,
    /// How it ended: `complete`, `stopped by signal 2`, or what failed.
    pub ended: String,
    /// The config.
    pub config: FileFacts,
    /// The seed that was used.
    pub seed: u64,
    /// The log.
    pub log: FileFacts,
    /// Part of the log was lost or could not be used.
    pub data_lost: bool,
    /// What became of the frames.
    pub frames: Frames,
    /// The persons that were confirmed, by number.
    pub persons: BTreeMap<u32, PersonFacts>,
    /// What became of the candidates.
    pub candidates: Candidates,
    /// Which test dropped how many candidates, in the order of the stages.
    pub funnel: Vec<FunnelLine>,
    /// What the reader lost or skipped, by name.
    pub counters: BTreeMap<String, u64>,
    /// What was said once.
    pub notes: Vec<String>,
    /// Consistency of the filter, if it has an innovation.
    pub nis: Option<Nis>,
}

/// A file, without its folder: the report does not depend on where it lay.
#[derive(Clone, Debug, Serialize)]
pub struct FileFacts {
    /// Name of the file.
    pub name: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// Frames by what their stamp led to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Frames {
    /// Frames that the reader delivered.
    pub read: u64,
    /// Frames that the pipeline processed.
    pub processed: u64,
    /// Frames with the stamp of the one before: processed once.
    pub duplicate: u64,
    /// Frames older than the one before: dropped.
    pub out_of_order: u64,
    /// Pauses after which tentative tracks ended.
    pub gaps: u64,
    /// Clock jumps back, after which all tracks ended.
    pub time_jumps_back: u64,
    /// Clock jumps ahead, after which all tracks ended.
    pub time_jumps_ahead: u64,
    /// Frames without odometry near enough.
    pub odometry_stale: u64,
    /// Frames in which at least one confirmed person was seen.
    pub with_person: u64,
}

/// One person.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PersonFacts {
    /// First frame as a confirmed track.
    pub first_frame: u64,
    /// Last frame in which the person was seen.
    pub last_frame: u64,
    /// Frames in which the person was seen.
    pub seen_frames: u64,
}

/// Candidates by their fate.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Candidates {
    /// Given to a track.
    pub matched: u64,
    /// Started a track.
    pub started: u64,
    /// Dropped; the funnel says why.
    pub dropped: u64,
}

/// One line of the funnel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FunnelLine {
    /// The test.
    pub test: &'static str,
    /// Candidates that it dropped.
    pub count: u64,
}

/// Normalised innovation squared: for a consistent filter the mean equals the
/// degrees of freedom.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Nis {
    /// Updates.
    pub updates: u64,
    /// The mean.
    pub mean: f64,
    /// Degrees of freedom, mean.
    pub degrees_of_freedom: f64,
}

/// Sums up frame reports.
#[derive(Default)]
pub struct Tally {
    frames: Frames,
    persons: BTreeMap<u32, PersonFacts>,
    candidates: Candidates,
    funnel: Funnel,
    nis: (u64, f64, f64),
}

impl Tally {
    /// Counts a frame that the reader delivered.
    pub fn read(&mut self, odometry_stale: bool) {
        self.frames.read += 1;
        self.frames.odometry_stale += u64::from(odometry_stale);
    }

    /// Adds what the pipeline said of it.
    pub fn add(&mut self, report: &FrameReport) {
        self.add_outcome(&report.outcome);
        self.funnel.merge(&report.funnel);
        for candidate in &report.candidates {
            match candidate.fate {
                Fate::Matched(_) => self.candidates.matched += 1,
                Fate::Started(_) => self.candidates.started += 1,
                Fate::Dropped(_) => self.candidates.dropped += 1,
            }
        }
        for (_, nis, degrees) in &report.nis {
            let (updates, sum, freedom) = &mut self.nis;
            *updates += 1;
            *sum += nis;
            *freedom += f64::from(*degrees);
        }
        if report.outcome.is_processed() {
            self.add_persons(report);
        }
    }

    fn add_outcome(&mut self, outcome: &Outcome) {
        self.frames.processed += u64::from(outcome.is_processed());
        match outcome {
            Outcome::Duplicate => self.frames.duplicate += 1,
            Outcome::OutOfOrder => self.frames.out_of_order += 1,
            Outcome::Gap { .. } => self.frames.gaps += 1,
            Outcome::ResetBackward { .. } => self.frames.time_jumps_back += 1,
            Outcome::ResetForward { .. } => self.frames.time_jumps_ahead += 1,
            _ => {}
        }
    }

    fn add_persons(&mut self, report: &FrameReport) {
        let mut anybody = false;
        for track in report.tracks.iter().filter(|track| track.confirmed && track.seen) {
            anybody = true;
            let facts = self.persons.entry(track.id.0).or_insert(PersonFacts {
                first_frame: report.index,
                last_frame: report.index,
                seen_frames: 0,
            });
            facts.last_frame = report.index;
            facts.seen_frames += 1;
        }
        self.frames.with_person += u64::from(anybody);
    }

    /// Puts the sums into a report.
    pub fn fill(self, report: &mut RunReport) {
        let lines = self.funnel.entries().iter();
        report.funnel = lines.map(|e| FunnelLine { test: e.test, count: e.count }).collect();
        report.frames = self.frames;
        report.persons = self.persons;
        report.candidates = self.candidates;
        let (updates, sum, freedom) = self.nis;
        report.nis = (updates > 0).then(|| Nis {
            updates,
            mean: sum / updates as f64,
            degrees_of_freedom: freedom / updates as f64,
        });
    }
}

impl RunReport {
    /// As `report.json`.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }
}
