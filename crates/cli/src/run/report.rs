use std::collections::BTreeMap;

use serde::Serialize;
use tagalong_app::lacking::LackingFrames;
use tagalong_core::Funnel;
use tagalong_log::InputAccount;
use tagalong_pipeline::{Fate, FrameReport, Outcome};

/// `report.json`: results of a run, and its dropped candidates with the reasons. Two runs of the
/// same log, config and seed give the same bytes.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunReport {
    /// Version of Tagalong.
    pub tagalong: &'static str,
    /// End of the run: `complete`, `stopped by signal 2`, or the error.
    pub ended: String,
    /// File of the config.
    pub config: FileFacts,
    /// Seed that was used.
    pub seed: u64,
    /// File of the log.
    pub log: FileFacts,
    /// True if part of the log was lost or could not be used.
    pub data_lost: bool,
    /// Frames by their outcome.
    pub frames: Frames,
    /// Frames that lack a required input, by plugin and input.
    pub lacking: Vec<LackingFrames>,
    /// Persons that were confirmed, by number.
    pub persons: BTreeMap<u32, PersonFacts>,
    /// Candidates by their fate.
    pub candidates: Candidates,
    /// Number of candidates that each test dropped, in the order of the stages.
    pub funnel: Vec<FunnelLine>,
    /// Number of lost or skipped items of the reader, by name.
    pub counters: BTreeMap<String, u64>,
    /// Use of each image, scan, detection and odometry topic, with the reasons for those not used.
    pub inputs: InputAccount,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// Consistency of the filter, if it has an innovation.
    pub nis: Option<Nis>,
}

/// File, without its folder: the report does not depend on its place.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FileFacts {
    /// Name of the file.
    pub name: String,
    /// SHA-256 of its bytes.
    pub sha256: String,
}

/// Frames by the outcome of their stamp.
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
    /// Frames without an input that a plugin requires: left out.
    pub lacking: u64,
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

/// Facts about one person.
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
    /// Name of the test.
    pub test: &'static str,
    /// Number of candidates that it dropped.
    pub count: u64,
}

/// Normalised innovation squared: for a consistent filter the mean equals the degrees of freedom.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Nis {
    /// Number of updates.
    pub updates: u64,
    /// Mean of the values.
    pub mean: f64,
    /// Mean of the degrees of freedom.
    pub degrees_of_freedom: f64,
}

/// Sums over the frame reports.
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

    /// Adds the pipeline's report of it.
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
