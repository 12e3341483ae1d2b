//! Report of a benchmark from its results.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use tagalong_app::outcome::Failure;
use tagalong_math::counted;
use tagalong_report::{Benchmark, Outcome, TaskResult, Timings};

use super::moments;
use super::plan::Task;
use super::store::{Store, Stored, StoredTiming};
use super::work::blank;

/// Gathers the results of a plan.
///
/// # Errors
/// If some are missing.
pub fn gather(store: &Store) -> Result<Benchmark, Failure> {
    let plan = store.plan()?;
    let version = plan.first().map_or_else(String::new, |task| task.version.clone());
    let mut all = Vec::new();
    let mut missing = Vec::new();
    for task in &plan {
        match result(store, task) {
            Some(stored) => all.push(stored),
            None => missing.push(task.k.to_string()),
        }
    }
    if missing.is_empty() {
        let moments = moments::gather(&all);
        let tasks = all.into_iter().map(|stored| stored.result).collect();
        return Ok(Benchmark { version, tasks, copies: copies(&plan), moments });
    }
    let count = missing.len();
    let first = &missing[0];
    Err(Failure::failed(format!(
        "{count} of {} tasks have no result, the first is {first}; `tagalong bench run -o {}` \
         runs them",
        plan.len(),
        store.path("").display()
    )))
}

/// Returns the names of logs that go back to one recording.
fn copies(plan: &[Task]) -> Vec<Vec<String>> {
    let mut recordings: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for task in plan {
        let own = task.inputs.get("log").map(String::as_str);
        if let Some(recording) = task.copy_of.as_deref().or(own) {
            recordings.entry(recording).or_default().insert(&task.log_name);
        }
    }
    let several = recordings.into_values().filter(|logs| logs.len() > 1);
    several.map(|logs| logs.into_iter().map(str::to_owned).collect()).collect()
}

fn result(store: &Store, task: &Task) -> Option<Stored> {
    let Some(why) = &task.skip else { return store.result(task) };
    let outcome = Outcome::Skipped { why: why.clone() };
    Some(Stored { result: TaskResult { outcome, ..blank(task) }, ..Stored::default() })
}

/// Returns the times, if those of all tasks were taken.
fn timings(store: &Store, benchmark: &Benchmark) -> Option<Timings> {
    let done = benchmark.tasks.iter().filter(|task| task.outcome == Outcome::Done);
    let all: Option<Vec<(String, StoredTiming)>> =
        done.map(|task| Some((task.hash.clone(), store.timing(&task.hash)?))).collect();
    let all = all?;
    let machine = all.first()?.1.machine.clone();
    // Times of several machines cannot be compared, which the report has to say.
    let exclusive = all.iter().all(|(_, timing)| timing.machine == machine);
    let tasks = all.into_iter().map(|(hash, stored)| (hash, stored.timing)).collect();
    Some(Timings { exclusive, machine, tasks })
}

/// Writes the files of the report; returns the JSON of report.json.
///
/// # Errors
/// A disk that fails.
pub fn write(store: &Store, benchmark: &Benchmark) -> Result<String, Failure> {
    let timings = timings(store, benchmark);
    let json = tagalong_report::json(benchmark).map_err(Failure::failed)?;
    store.put("report.json", json.as_bytes())?;
    store.put("report.csv", tagalong_report::csv(benchmark).as_bytes())?;
    store.put("report.html", tagalong_report::html(benchmark, timings.as_ref()).as_bytes())?;
    if let Some(timings) = &timings {
        let json = serde_json::to_string_pretty(timings).map_err(Failure::failed)? + "\n";
        store.put("timings.json", json.as_bytes())?;
    }
    Ok(json)
}

/// Most skipped tasks that have a line with the reason in a terminal.
const MOST_REASONS: usize = 6;

/// Returns the main figures, for a terminal.
pub fn text(store: &Store, benchmark: &Benchmark) -> String {
    let first = benchmark.tasks.iter().map(|task| task.pipeline.len()).fold(8, usize::max);
    let second = benchmark.tasks.iter().map(|task| task.log.len()).fold(8, usize::max);
    let mut out = format!(
        "{:<first$}  {:<second$}  {:>6}  {:>6}  {:>6}  {:>6}  {:>5}  {:>10}\n",
        "pipeline", "log", "seed", "HOTA", "MOTA", "IDF1", "IDSW", "error m"
    );
    let skipped: Vec<&TaskResult> =
        benchmark.tasks.iter().filter(|task| is_skipped(task)).collect();
    let is_brief = skipped.len() > MOST_REASONS;
    for task in benchmark.tasks.iter().filter(|task| !is_brief || !is_skipped(task)) {
        let _ = write!(out, "{:<first$}  {:<second$}  {:>6}  ", task.pipeline, task.log, task.seed);
        let _ = match &task.outcome {
            Outcome::Done => writeln!(out, "{}", figures(task)),
            Outcome::Failed { why } => writeln!(out, "failed: {}", first_line(why)),
            Outcome::Skipped { why } => writeln!(out, "skipped: {}", first_line(why)),
        };
    }
    if is_brief {
        let pipelines: BTreeSet<&str> = skipped.iter().map(|task| task.pipeline.as_str()).collect();
        let names: Vec<&str> = pipelines.into_iter().collect();
        let _ = writeln!(
            out,
            "skipped {} of {}, with the reasons in report.html: {}",
            skipped.len(),
            counted(benchmark.tasks.len(), "task"),
            names.join(", "),
        );
    }
    for task in &benchmark.tasks {
        if task.image.is_some_and(|scores| scores.has_constant_scores()) {
            let _ = writeln!(
                out,
                "note: {} on {}: all reports have the same score; LAMR and AP mean nothing then",
                task.pipeline, task.log
            );
        }
    }
    for logs in &benchmark.copies {
        let _ = writeln!(out, "note: {}", tagalong_report::copies_note(logs));
    }
    let _ = writeln!(out, "report in {}", store.path("report.html").display());
    out
}

fn is_skipped(task: &TaskResult) -> bool {
    matches!(task.outcome, Outcome::Skipped { .. })
}

fn first_line(text: &str) -> &str {
    text.lines().next().unwrap_or_default()
}

fn figures(task: &TaskResult) -> String {
    let Some(scores) = task.image.or(task.metres) else { return "nothing to score".into() };
    let [hota, mota, idf1, error_m] =
        [scores.hota, scores.mota, scores.idf1, scores.position_error_mean_m]
            .map(|value| value.map_or("-".to_owned(), |value| format!("{value:.3}")));
    format!("{hota:>6}  {mota:>6}  {idf1:>6}  {:>5}  {error_m:>10}", scores.idsw)
}
