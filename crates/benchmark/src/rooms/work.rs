//! Runs all settings of all pipelines on all logs. Runs that see the same frames process a log side
//! by side and share their detections.

use std::collections::{BTreeMap, VecDeque};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::tuning::Figures;
use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use tagalong_app::outcome::Failure;
use tagalong_app::scoring::{Shot, Shots, TruthFile, TruthOptions};
use tagalong_app::signals::Signals;
use tagalong_config::Registry;
use tagalong_math::counted;
use tagalong_report::TaskResult;

use super::contest::{Contestant, Location, Variant};
use crate::plan::{self, Annotated, version};
use crate::store::Store;
use crate::work::{Lane, bar, spread, work_through};

/// Maximum number of pipelines side by side; a signal loses at most one pass of these per job.
const LANES: usize = 48;

/// A setting of a contestant on a log, by their indices in the lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Run {
    pub contestant: usize,
    pub setting: usize,
    pub log: usize,
    /// True with models that were trained without the room.
    pub unseen: bool,
}

/// Stored result of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RoomResult {
    /// Figures of the run.
    pub figures: Figures,
    /// True if part of the log was lost.
    pub data_lost: bool,
}

/// Contents of a result file.
#[derive(Serialize, Deserialize)]
struct StoredRoom {
    /// Hash of the run, as in the name of the file.
    hash: String,
    #[serde(flatten)]
    result: RoomResult,
}

/// Summary of the runs.
#[derive(Clone, Copy, Debug, Default)]
pub struct RunSummary {
    pub asked: usize,
    /// Runs that had no result before.
    pub ran: usize,
    /// Runs that have a result now.
    pub done: usize,
    pub lost: bool,
    pub signal: Option<u8>,
}

/// State that all jobs share.
pub struct Desk<'a> {
    store: &'a Store,
    registry: &'a Registry,
    contestants: &'a [Contestant],
    /// Logs with their rooms.
    logs: Vec<(&'a str, &'a Annotated)>,
    version: String,
    /// Reasons why a contestant cannot run on a log.
    skips: BTreeMap<(usize, usize), String>,
}

impl<'a> Desk<'a> {
    /// Tries every pipeline on every log.
    ///
    /// # Errors
    /// A log that cannot be read.
    pub fn new(
        store: &'a Store,
        registry: &'a Registry,
        contestants: &'a [Contestant],
        locations: &'a [Location],
    ) -> Result<Self, Failure> {
        let logs: Vec<(&str, &Annotated)> = locations
            .iter()
            .flat_map(|room| room.logs.iter().map(|log| (room.name.as_str(), log)))
            .collect();
        let mut skips = BTreeMap::new();
        let mut tried = BTreeMap::new();
        for (contestant, about) in contestants.iter().enumerate() {
            for (log, (_, annotated)) in logs.iter().enumerate() {
                let key = (log, about.config.reading());
                let why = match tried.get(&key) {
                    Some(known) => Option::clone(known),
                    None => plan::why_not(&about.config, annotated)?,
                };
                tried.insert(key, why.clone());
                skips.extend(why.map(|why| ((contestant, log), why)));
            }
        }
        Ok(Self { store, registry, contestants, logs, version: version()?, skips })
    }

    /// Returns the reason why a contestant cannot run on a log, if there is one.
    pub fn skip(&self, contestant: usize, log: usize) -> Option<&str> {
        self.skips.get(&(contestant, log)).map(String::as_str)
    }

    /// Returns the config of a run.
    fn variant(&self, run: Run) -> &Variant {
        let setting = &self.contestants[run.contestant].settings[run.setting];
        setting.variant(self.logs[run.log].0, run.unseen)
    }

    /// Returns the result of a run, if it exists and contains the hash of this run.
    pub fn result(&self, run: Run) -> Option<RoomResult> {
        let hash = self.hash(run);
        let stored: StoredRoom = self.store.get(&room_name(&hash))?;
        (stored.hash == hash).then_some(stored.result)
    }

    fn hash(&self, run: Run) -> String {
        self.variant(run).run_hash(self.logs[run.log].1, &self.version)
    }

    /// Does the runs that have no result yet.
    ///
    /// # Errors
    /// Runs that fail, after all others are done; a failure of the disk, at once.
    pub fn work(&self, jobs: usize) -> Result<RunSummary, Failure> {
        let signals = Signals::listen()?;
        let asked = self.runs();
        let due: Vec<Run> =
            asked.iter().copied().filter(|run| self.result(*run).is_none()).collect();
        let bar = bar(due.len());
        let ran = due.len();
        let shift = Shift {
            desk: self,
            signals: &signals,
            bar: &bar,
            stop: AtomicBool::new(false),
            failed: Mutex::default(),
        };
        shift.run_all(self.passes(due, jobs), jobs);
        bar.finish_and_clear();
        shift.verdict()?;
        let mut done = 0;
        let mut lost = false;
        for result in asked.iter().filter_map(|run| self.result(*run)) {
            done += 1;
            lost |= result.data_lost;
        }
        Ok(RunSummary { asked: asked.len(), ran, done, lost, signal: signals.received() })
    }

    fn runs(&self) -> Vec<Run> {
        let mut runs = Vec::new();
        for (log, (room, _)) in self.logs.iter().enumerate() {
            for (contestant, about) in self.contestants.iter().enumerate() {
                if self.skip(contestant, log).is_some() {
                    continue;
                }
                for (setting, values) in about.settings.iter().enumerate() {
                    runs.push(Run { contestant, setting, log, unseen: false });
                    // If a setting cannot be chosen, it is scored only as shipped.
                    if setting < about.candidates && values.has_seen(room) {
                        runs.push(Run { contestant, setting, log, unseen: true });
                    }
                }
            }
        }
        runs
    }

    /// Groups the runs that see the same frames: of one log, read the same way.
    fn passes(&self, due: Vec<Run>, jobs: usize) -> VecDeque<Vec<Run>> {
        let mut groups: BTreeMap<(usize, String), Vec<Run>> = BTreeMap::new();
        for run in due {
            let reading = self.contestants[run.contestant].config.reading();
            groups.entry((run.log, reading)).or_default().push(run);
        }
        let passes = groups.values().flat_map(|group| group.chunks(LANES)).map(<[Run]>::to_vec);
        spread(passes.collect(), jobs)
    }
}

/// Running jobs.
struct Shift<'a> {
    desk: &'a Desk<'a>,
    signals: &'a Signals,
    bar: &'a ProgressBar,
    /// Set when it is useless to continue.
    stop: AtomicBool,
    /// Errors by run, so that the same one is reported first for any number of jobs.
    failed: Mutex<BTreeMap<Run, String>>,
}

impl Shift<'_> {
    fn run_all(&self, passes: VecDeque<Vec<Run>>, jobs: usize) {
        work_through(passes, jobs, |pass| {
            if self.has_to_stop() {
                return ControlFlow::Break(());
            }
            if let Err(failure) = self.pass(&pass) {
                pass.iter().for_each(|run| self.fail(*run, failure.message.clone()));
            }
            ControlFlow::Continue(())
        });
    }

    fn has_to_stop(&self) -> bool {
        self.signals.received().is_some() || self.stop.load(Ordering::Relaxed)
    }

    fn fail(&self, run: Run, why: String) {
        self.failed.lock().unwrap_or_else(PoisonError::into_inner).entry(run).or_insert(why);
    }

    /// Processes a log once, with all pipelines of the pass. A failed pipeline does not affect the
    /// others.
    fn pass(&self, pass: &[Run]) -> Result<(), Failure> {
        let Some(first) = pass.first() else { return Ok(()) };
        let Desk { contestants, logs, .. } = &self.desk;
        let (_, log) = logs[first.log];
        self.bar.set_message(log.name.clone());
        let options = TruthOptions { upper_body: log.whole_bodies, ..TruthOptions::default() };
        let truth = TruthFile::read(&log.truth, options)?.without_judging(&log.unjudged);
        let mut source = contestants[first.contestant].config.open(&log.log)?;
        let mut lanes: Vec<Lane> =
            pass.iter().map(|run| Lane::new(|| self.pipeline(*run))).collect();
        let mut shots = Shots::default();
        while let Some(item) = source.next_frame() {
            // Partial results are discarded, so that a stored result always covers a whole log.
            if self.has_to_stop() {
                return Ok(());
            }
            shots.push(Shot::of(&item));
            for lane in &mut lanes {
                lane.step(&item);
            }
        }
        let data_lost = source.data_lost();
        for (run, lane) in pass.iter().zip(lanes) {
            match figures(lane, log, &truth, &shots) {
                Ok(figures) => self.keep(*run, RoomResult { figures, data_lost })?,
                Err(why) => self.fail(*run, why),
            }
            self.bar.inc(1);
        }
        Ok(())
    }

    fn pipeline(&self, run: Run) -> Result<tagalong_pipeline::Pipeline, Failure> {
        let file = &self.desk.variant(run).file;
        let (mut pipeline, _) = file.pipeline(self.desk.registry, None)?;
        // The settings of a pass mostly differ in stages after the detectors, so detections can be
        // shared.
        pipeline.share_findings();
        Ok(pipeline)
    }

    /// Stores a result. A failure of the disk stops all jobs, because it would affect every run.
    fn keep(&self, run: Run, result: RoomResult) -> Result<(), Failure> {
        let stored = StoredRoom { hash: self.desk.hash(run), result };
        let json = serde_json::to_vec(&stored).map_err(Failure::failed)?;
        let kept = self.desk.store.put(&room_name(&stored.hash), &json);
        kept.inspect_err(|_| self.stop.store(true, Ordering::Relaxed))
    }

    /// Returns the error of the first run that failed.
    fn verdict(&self) -> Result<(), Failure> {
        let failed = self.failed.lock().unwrap_or_else(PoisonError::into_inner);
        let Some((run, why)) = failed.first_key_value() else { return Ok(()) };
        let contestant = &self.desk.contestants[run.contestant];
        Err(Failure::failed(format!(
            "{} failed; the first is {} on {}, with {}: {why}",
            counted(failed.len(), "run"),
            contestant.name(),
            self.desk.logs[run.log].1.name,
            contestant.words(run.setting)
        )))
    }
}

fn room_name(hash: &str) -> String {
    format!("rooms/{hash}.json")
}

/// Returns the figures of boxes if the truth has them, otherwise those of positions.
fn figures(
    lane: Lane,
    log: &Annotated,
    truth: &TruthFile,
    shots: &Shots,
) -> Result<Figures, String> {
    if let Some(why) = lane.failure() {
        return Err(why);
    }
    let blank = TaskResult { log: log.name.clone(), ..TaskResult::default() };
    let (result, _) = lane.watch.score(truth, shots, blank, None)?;
    let scores = result.image.or(result.metres).ok_or("its truth cannot be compared")?;
    Figures::of(&scores).ok_or_else(|| "its truth has no people".to_owned())
}
