//! Runs tasks. Tasks that see the same frames share one pass over their log.

use std::collections::{BTreeMap, VecDeque};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressStyle};
use tagalong_app::lacking::Lacking;
use tagalong_app::missed::{Depths, Rules, Witness};
use tagalong_app::outcome::{Failure, say};
use tagalong_app::progress::Forecast;
use tagalong_app::remedies::Remedies;
use tagalong_app::scoring::{Shot, Shots, TruthFile, TruthOptions, truth_notes};
use tagalong_app::signals::Signals;
use tagalong_app::unable::unable;
use tagalong_config::Registry;
use tagalong_log::{FrameSource, Input, Inputs, LogFrame};
use tagalong_pipeline::{FrameReport, Pipeline};
use tagalong_report::{Outcome, TaskResult};

use super::args::{RunArgs, Shard};
use super::foreign::{self, is_foreign};
use super::pictures::Wanted;
use super::plan::{PlannedConfig, Task, reread, version};
use super::store::{Store, Stored, StoredTiming};
use super::watch::{Watch, repaired};

/// Summary of the tasks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Tasks that were requested and can run.
    pub asked: usize,
    /// Tasks among these that had no result before.
    pub ran: usize,
    /// Tasks that have a result now.
    pub done: usize,
    /// Tasks that failed, according to their results.
    pub failed: usize,
    /// True if part of some log was lost.
    pub lost: bool,
    /// Signal that requested a stop.
    pub signal: Option<u8>,
}

/// Task with its config.
struct Ready {
    task: Task,
    config: PlannedConfig,
}

/// Tasks that share a pass over a log.
type Group = Vec<Ready>;

/// Runs the tasks that have no result yet.
///
/// # Errors
/// A plan of another program, a task that is not in it, a failure of the disk. A pipeline that
/// fails is not an error: its result states it.
pub fn work(args: &RunArgs, store: &Store, registry: &Registry) -> Result<Tally, Failure> {
    let signals = Signals::listen()?;
    let asked = asked(args, store)?;
    let pending: Vec<Task> =
        asked.iter().filter(|task| is_due(args, store, task)).cloned().collect();
    let ran = pending.len();
    let jobs = jobs(args);
    let (foreign, pending): (Vec<Task>, Vec<Task>) = pending.into_iter().partition(is_foreign);
    let groups = groups(pending, registry, args.timing, jobs)?;
    let bar = bar(ran);
    let forecast = Forecast::new(ran, "tasks");
    let signals_of = &signals;
    let timing = args.timing;
    let desk =
        Desk { store, registry, signals: signals_of, bar: &bar, forecast: &forecast, timing };
    run_all(groups, jobs, &desk)?;
    foreign::score_all(&foreign, store, &signals, |count| desk.count(count))?;
    bar.finish_and_clear();
    let mut tally =
        Tally { asked: asked.len(), ran, signal: signals.received(), ..Tally::default() };
    for stored in asked.iter().filter_map(|task| store.result(task)) {
        tally.done += 1;
        tally.failed += usize::from(matches!(stored.result.outcome, Outcome::Failed { .. }));
        tally.lost |= stored.result.data_lost;
    }
    Ok(tally)
}

fn jobs(args: &RunArgs) -> usize {
    if args.timing && args.jobs > 1 {
        say("note: --timing runs one task at a time; --jobs is ignored");
    }
    if args.timing { 1 } else { usize::from(args.jobs) }
}

/// Returns the tasks that were requested and can run.
fn asked(args: &RunArgs, store: &Store) -> Result<Vec<Task>, Failure> {
    let mut tasks = store.plan()?;
    // Another program may give other results for the hashes of this plan.
    let program = version()?;
    if let Some(task) = tasks.iter().find(|task| task.version != program) {
        let planned = &task.version;
        return Err(Failure::usage(format!(
            "the plan was made by program {planned}, but this is {program}; plan again"
        )));
    }
    if let Some(wanted) = &args.task {
        let count = tasks.len();
        tasks.retain(|task| task.k.to_string() == *wanted || task.hash == *wanted);
        if tasks.is_empty() {
            return Err(Failure::usage(format!(
                "no task `{wanted}`; the plan has the numbers 1 to {count}, and their hashes"
            )));
        }
    }
    if let Some(shard) = args.shard {
        keep_shard(&mut tasks, shard);
    }
    tasks.retain(|task| task.skip.is_none());
    Ok(tasks)
}

/// Keeps the tasks of a shard. Those of one log stay together, because they share its images.
fn keep_shard(tasks: &mut Vec<Task>, shard: Shard) {
    let mut numbers = BTreeMap::new();
    tasks.retain(|task| {
        let next = numbers.len();
        shard.has(*numbers.entry(task.log.clone()).or_insert(next))
    });
}

fn is_due(args: &RunArgs, store: &Store, task: &Task) -> bool {
    let Some(Stored { result, .. }) = store.result(task) else { return true };
    args.retry_failed && matches!(result.outcome, Outcome::Failed { .. })
        || args.timing && !is_foreign(task) && store.timing(&task.hash).is_none()
}

/// Groups the tasks that see the same frames: of one log, read the same way. Tasks with other
/// inputs are kept apart, because otherwise a result would depend on the other tasks of its group.
fn groups(
    tasks: Vec<Task>,
    registry: &Registry,
    alone: bool,
    jobs: usize,
) -> Result<VecDeque<Group>, Failure> {
    let mut groups: BTreeMap<String, Group> = BTreeMap::new();
    for task in tasks {
        let config = reread(&task, registry)?;
        let outer = &config.outer;
        let mut key = format!("{:?}", (&task.log, &outer.input, &outer.limits, config.inputs));
        // When times are measured, each task has the machine to itself.
        if alone {
            key += &task.hash;
        }
        groups.entry(key).or_default().push(Ready { task, config });
    }
    Ok(spread(groups.into_values().collect(), jobs))
}

/// Halves the largest groups until there is one for every job.
pub fn spread<T>(mut groups: Vec<Vec<T>>, jobs: usize) -> VecDeque<Vec<T>> {
    while groups.len() < jobs {
        let Some(largest) = groups.iter_mut().max_by_key(|group| group.len()) else { break };
        if largest.len() < 2 {
            break;
        }
        let half = largest.split_off(largest.len() / 2);
        groups.push(half);
    }
    groups.into()
}

/// Returns a progress bar for tasks, visible on a terminal.
pub fn bar(tasks: usize) -> ProgressBar {
    let bar = ProgressBar::new(tasks as u64);
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {pos}/{len} tasks {msg} {eta}") {
        bar.set_style(style);
    }
    bar
}

/// State that all jobs share.
struct Desk<'a> {
    store: &'a Store,
    registry: &'a Registry,
    signals: &'a Signals,
    bar: &'a ProgressBar,
    forecast: &'a Forecast,
    timing: bool,
}

fn run_all(groups: VecDeque<Group>, jobs: usize, desk: &Desk<'_>) -> Result<(), Failure> {
    let trouble = Mutex::new(None);
    work_through(groups, jobs, |group| {
        if desk.signals.received().is_some() {
            return ControlFlow::Break(());
        }
        let Err(failure) = desk.run(group) else { return ControlFlow::Continue(()) };
        // The failure of the disk affects every job, so the others end as well.
        *trouble.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
        ControlFlow::Break(())
    });
    trouble.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
}

/// Takes items out of a queue, with this number of threads, until it is empty or one of them breaks
/// off.
pub fn work_through<T: Send>(
    queue: VecDeque<T>,
    jobs: usize,
    step: impl Fn(T) -> ControlFlow<()> + Sync,
) {
    let queue = Mutex::new(queue);
    std::thread::scope(|scope| {
        // One job fewer, because the calling thread works as well.
        for _ in 1..jobs {
            // If a thread cannot be started, the running ones do its work.
            let _ = std::thread::Builder::new().spawn_scoped(scope, || empty_queue(&queue, &step));
        }
        empty_queue(&queue, &step);
    });
}

/// Does the next step until the queue is empty; a step can empty it.
fn empty_queue<T>(queue: &Mutex<VecDeque<T>>, step: &impl Fn(T) -> ControlFlow<()>) {
    loop {
        let Some(item) = queue.lock().unwrap_or_else(PoisonError::into_inner).pop_front() else {
            return;
        };
        if step(item).is_break() {
            queue.lock().unwrap_or_else(PoisonError::into_inner).clear();
        }
    }
}

impl Desk<'_> {
    /// Runs a group and stores its results. A log that cannot be read fails only its own tasks.
    fn run(&self, group: Group) -> Result<(), Failure> {
        self.bar.set_message(group[0].task.log_name.clone());
        // A panic while reading or scoring fails this group only.
        let done = catch_unwind(AssertUnwindSafe(|| self.results(&group)));
        let all = match done {
            Ok(Ok(Some(all))) => all,
            Ok(Ok(None)) => return Ok(()),
            Ok(Err(why)) => group.iter().map(|ready| failed(&ready.task, &why)).collect(),
            Err(_) => {
                let why = "internal error while the log was read or scored; please report it";
                group.iter().map(|ready| failed(&ready.task, why)).collect()
            }
        };
        for (ready, (stored, timing)) in group.iter().zip(all) {
            self.store.put_result(&ready.task.hash, &stored)?;
            if let (true, Some(timing)) = (self.timing, timing) {
                self.store.put_timing(&ready.task.hash, &timing)?;
            }
        }
        self.count(group.len());
        Ok(())
    }

    /// Counts the tasks of a group as done; they end together.
    fn count(&self, done: usize) {
        self.bar.inc(done as u64);
        self.forecast.advance_by(done);
    }

    /// Returns the results of a group, in order; `None` after a stop signal.
    fn results(&self, group: &Group) -> Result<Option<Vec<Kept>>, String> {
        let first = &group[0].task;
        let truth = truth_of(first).map_err(|failure| failure.message)?;
        let mut source = open(&group[0], group[0].config.inputs)?;
        let lanes = group.iter().map(|ready| {
            Lane::new(|| {
                let built = ready.config.file.pipeline(self.registry, Some(ready.task.seed))?;
                Ok(built.0)
            })
        });
        let mut lanes: Vec<Lane> = lanes.collect();
        let mut witnesses = vec![Witness::default(); lanes.len()];
        let mut shots = Shots::default();
        while let Some(item) = source.next_frame() {
            if self.signals.received().is_some() {
                return Ok(None);
            }
            shots.push(Shot::of(&item));
            let depths = Depths::of_frame(&item.frame);
            for (lane, witness) in lanes.iter_mut().zip(&mut witnesses) {
                let report = lane.step(&item).filter(|report| report.outcome.is_processed());
                if let Some(report) = report {
                    witness.take(&item, &report, depths.clone());
                }
            }
        }
        let lost = source.data_lost();
        let notes = notes_on(first, &truth, &shots);
        let remedies = Remedies::new(self.registry);
        let mut stored = Vec::new();
        let mut timings = Vec::new();
        for ((ready, lane), witness) in group.iter().zip(lanes).zip(witnesses) {
            let told = (&witness, &remedies);
            let warnings = lane.lacking.warnings();
            let (result, timing) = lane.finish(&ready.task, &truth, &shots, lost, told);
            let mut notes = notes.clone();
            notes.extend(
                warnings.iter().map(|warning| format!("{}: {warning}", ready.task.pipeline)),
            );
            stored.push(Stored { notes, ..result });
            timings.push(timing);
        }
        illustrate(&group[0], &mut stored)?;
        Ok(Some(stored.into_iter().zip(timings).collect()))
    }
}

/// Reads the truth of a task.
///
/// # Errors
/// A file that cannot be read.
pub fn truth_of(task: &Task) -> Result<TruthFile, Failure> {
    let options = TruthOptions {
        upper_body: task.whole_bodies,
        drops_doubled_ids: task.drops_doubled_ids,
        ..TruthOptions::default()
    };
    Ok(TruthFile::read(&task.truth, options)?.without_judging(&task.unjudged))
}

/// Returns the notes on the truth of a log, without its folder, so that results are the same
/// everywhere.
pub fn notes_on(task: &Task, truth: &TruthFile, shots: &Shots) -> Vec<String> {
    let path = task.truth.display().to_string();
    let name = task.truth.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let log = task.log.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut notes = truth_notes(&task.truth, truth, Some(&log), shots);
    notes.extend(truth.notes.iter().map(|note| note.replace(&path, &name)));
    notes
}

/// Result, and the times if the task succeeded.
pub type Kept = (Stored, Option<StoredTiming>);

fn open(ready: &Ready, inputs: Inputs) -> Result<FrameSource, String> {
    let outer = &ready.config.outer;
    let source = FrameSource::open(&ready.task.log, &outer.input, &outer.limits, inputs)
        .map_err(|error| error.to_string())?;
    // The hash of the task covers the log, so a changed log must not be scored under it.
    if ready.task.inputs.get("log") != Some(&source.facts().sha256) {
        return Err("the log changed since the task was planned; plan again".into());
    }
    Ok(source)
}

/// One pipeline while it processes the frames.
pub struct Lane {
    /// The pipeline, or the error that ended it.
    pub pipeline: Result<Pipeline, String>,
    /// Its reports so far.
    pub watch: Watch,
    /// Frames that it left out for want of an input.
    pub lacking: Lacking,
}

impl Lane {
    /// Creates a lane for the pipeline that `build` returns.
    pub fn new(build: impl FnOnce() -> Result<Pipeline, Failure>) -> Self {
        let pipeline = match catch_unwind(AssertUnwindSafe(build)) {
            Ok(Ok(pipeline)) => Ok(pipeline),
            Ok(Err(failure)) => Err(failure.message),
            Err(_) => Err("a plugin panicked while the pipeline was built".into()),
        };
        Self { pipeline, watch: Watch::default(), lacking: Lacking::default() }
    }

    /// Passes the next frame to the pipeline, and returns its report; `None` for a frame that lacks an
    /// input. A pipeline that failed gets no more frames.
    pub fn step(&mut self, item: &LogFrame) -> Option<FrameReport> {
        let pipeline = self.pipeline.as_mut().ok()?;
        match self.lacking.step(pipeline, &item.frame) {
            Ok(report) => {
                if let Some(report) = &report {
                    self.watch.take(item, report);
                }
                report
            }
            Err(error) => {
                self.pipeline = Err(error.to_string());
                None
            }
        }
    }

    /// Returns the error that ended the pipeline, or that no frame had its inputs.
    pub fn failure(&self) -> Option<String> {
        let lacking = self.lacking.failure().map(ToString::to_string);
        self.pipeline.as_ref().err().cloned().or(lacking)
    }

    fn finish(
        self,
        task: &Task,
        truth: &TruthFile,
        shots: &Shots,
        lost: bool,
        (witness, remedies): (&Witness, &Remedies),
    ) -> Kept {
        let pipeline = match (&self.pipeline, self.failure()) {
            (Ok(pipeline), None) => pipeline,
            (_, why) => return failed(task, &why.unwrap_or_default()),
        };
        let rules = Rules { remedies, config: pipeline.config().values() };
        let hash = task.hash.clone();
        let timing = self.watch.timing();
        let timing = StoredTiming { hash, machine: machine(), timing };
        let blank = TaskResult { data_lost: lost, ..blank(task) };
        let scored = self.watch.score(truth, shots, blank, Some((witness, rules)));
        let scored = scored.and_then(|(result, recording)| {
            let repairs = repaired(&recording.sequence, truth)?;
            Ok((TaskResult { repairs, ..result }, recording))
        });
        match scored {
            Ok((result, recording)) => {
                let tests = result.funnel.iter().map(|dropped| dropped.test.as_str());
                let has_people = !result.tracks.is_empty();
                if let Some(why) = unable(&task.pipeline, tests, has_people, remedies) {
                    return without_figures(task, Outcome::Skipped { why });
                }
                let deciding = deciding(rules, &result);
                let result = TaskResult { deciding, ..result };
                let stored = Stored { result, recording: Some(recording), ..Stored::default() };
                (stored, Some(timing))
            }
            Err(why) => failed(task, &why),
        }
    }
}

/// Returns the result of a task before it runs.
pub fn blank(task: &Task) -> TaskResult {
    TaskResult {
        pipeline: task.pipeline.clone(),
        log: task.log_name.clone(),
        seed: task.seed,
        hash: task.hash.clone(),
        inputs: task.inputs.clone(),
        ..TaskResult::default()
    }
}

/// Returns the result of a task that failed.
pub fn failed(task: &Task, why: &str) -> Kept {
    without_figures(task, Outcome::Failed { why: why.to_owned() })
}

fn without_figures(task: &Task, outcome: Outcome) -> Kept {
    let result = TaskResult { outcome, ..blank(task) };
    (Stored { result, ..Stored::default() }, None)
}

/// Returns the lines of the config that set the tests that dropped missed people.
fn deciding(rules: Rules<'_>, result: &TaskResult) -> BTreeMap<String, Vec<String>> {
    let Rules { remedies, config } = rules;
    let mut deciding = BTreeMap::new();
    for test in result.missed.iter().filter_map(|missed| missed.test.as_ref()) {
        if let Some(remedy) = remedies.of_config(test, config) {
            deciding.entry(test.clone()).or_insert_with(|| remedy.lines(config));
        }
    }
    deciding
}

/// Reads the log once more for the pictures of the events.
// A second pass, because the important events are known only after the scoring.
fn illustrate(ready: &Ready, stored: &mut [Stored]) -> Result<(), String> {
    let wanted = Wanted::of(stored);
    let Some(last) = wanted.last() else { return Ok(()) };
    let mut source = open(ready, ready.config.inputs.accept(Input::Colour))?;
    while let Some(item) = source.next_frame() {
        if item.frame.index > last {
            break;
        }
        wanted.cut(item.frame.index, &item.frame.images(), stored);
    }
    Ok(())
}

/// Returns a description of the processor.
fn machine() -> String {
    let about = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = about.lines().find_map(|line| line.strip_prefix("model name"));
    let processor = line.map_or("processor not known", |l| l.trim_start_matches([' ', '\t', ':']));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{processor}, {threads} threads, {}", std::env::consts::OS)
}
