//! Report of a benchmark from its results.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

use tagalong_app::outcome::Failure;
use tagalong_app::scoring::match_note;
use tagalong_math::counted;
use tagalong_report::{Benchmark, Outcome, TaskResult, Timings};

use super::plan::Task;
use super::store::{Store, Stored, StoredTiming};
use super::work::blank;
use super::{closing, foreign, made_with, moments};

/// Collects the results of a plan.
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
            Some(stored) => all.push(closing::with_facts(task, stored)),
            None => missing.push(task.k.to_string()),
        }
    }
    if missing.is_empty() {
        let moments = moments::gather(&all);
        let notes = notes(&plan, &all);
        let tasks = all.into_iter().map(|stored| stored.result).collect();
        return Ok(Benchmark { version, tasks, copies: copies(&plan), notes, moments });
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

/// People, matches and reports of all pipelines on one log.
#[derive(Default)]
struct Matched {
    people: u64,
    matches: u64,
    reports: u64,
}

/// Returns the notes on the truth of each log, and on logs with which pipelines were made, each
/// once.
fn notes(plan: &[Task], all: &[Stored]) -> Vec<String> {
    let mut notes: Vec<String> = Vec::new();
    let mut logs: BTreeMap<&Path, Matched> = BTreeMap::new();
    for (task, stored) in plan.iter().zip(all) {
        for note in &stored.notes {
            if !notes.contains(note) {
                notes.push(note.clone());
            }
        }
        let Some(scores) = stored.result.image.or(stored.result.metres) else { continue };
        let log = logs.entry(&task.truth).or_default();
        log.people += scores.truths;
        log.matches += scores.tp;
        log.reports += scores.reports;
    }
    for (truth, log) in logs {
        notes.extend(match_note(truth, log.people, log.matches, log.reports));
    }
    let done = plan.iter().zip(all).filter(|(_, stored)| stored.result.outcome == Outcome::Done);
    notes.extend(made_with::notes(done.map(|(task, _)| task)));
    notes.extend(closing::notes(plan, all));
    notes
}

/// Returns the groups of logs that come from one recording.
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

/// Returns the times, if they were measured for all tasks.
fn timings(store: &Store, benchmark: &Benchmark) -> Option<Timings> {
    let own = benchmark.tasks.iter().filter(|task| !task.inputs.contains_key(foreign::TRACKS));
    let done = own.filter(|task| task.outcome == Outcome::Done);
    let all: Option<Vec<(String, StoredTiming)>> =
        done.map(|task| Some((task.hash.clone(), store.timing(&task.hash)?))).collect();
    let all = all?;
    let machine = all.first()?.1.machine.clone();
    // Times of several machines cannot be compared; the report states this.
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

/// Maximum number of skipped tasks that get a line with the reason in a terminal.
const MOST_REASONS: usize = 6;

/// Returns the main figures, for a terminal.
pub fn text(store: &Store, benchmark: &Benchmark) -> String {
    let mut out = tables(&benchmark.tasks);
    let skipped: Vec<&TaskResult> =
        benchmark.tasks.iter().filter(|task| is_skipped(task)).collect();
    if skipped.len() > MOST_REASONS {
        let pipelines: BTreeSet<&str> = skipped.iter().map(|task| task.pipeline.as_str()).collect();
        let names: Vec<&str> = pipelines.into_iter().collect();
        let _ = writeln!(
            out,
            "skipped {} of {}, with the reasons in report.html: {}",
            skipped.len(),
            counted(benchmark.tasks.len(), "task"),
            names.join(", "),
        );
    } else {
        out += &closing::skipped(&benchmark.tasks);
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
    for note in &benchmark.notes {
        let _ = writeln!(out, "note: {note}");
    }
    for logs in &benchmark.copies {
        let _ = writeln!(out, "note: {}", tagalong_report::copies_note(logs));
    }
    out += &closing::ranking(benchmark);
    let _ = writeln!(out, "report in {}", store.path("report.html").display());
    out
}

/// Returns the table of the figures in the image, and that of the logs whose truth has only
/// positions.
fn tables(tasks: &[TaskResult]) -> String {
    let is_brief = tasks.iter().filter(|task| is_skipped(task)).count() > MOST_REASONS;
    let shown = tasks.iter().filter(|task| !is_brief || !is_skipped(task));
    let (floor, image): (Vec<&TaskResult>, Vec<&TaskResult>) =
        shown.partition(|task| task.image.is_none() && task.metres.is_some());
    let mut out = String::new();
    for (title, tasks) in [
        ("in the image; `error m` on the floor:", image),
        ("on the floor, as the truth has no boxes:", floor),
    ] {
        if !tasks.is_empty() {
            let _ = writeln!(out, "{title}");
            out += &table(&tasks);
        }
    }
    out
}

/// Returns the table of some tasks.
fn table(tasks: &[&TaskResult]) -> String {
    let first = tasks.iter().map(|task| task.pipeline.len()).fold(8, usize::max);
    let second = tasks.iter().map(|task| task.log.len()).fold(8, usize::max);
    let mut out = format!(
        "{:<first$}  {:<second$}  {:>6}  {:>6}  {:>6}  {:>6}  {:>6}  {:>5}  {:>9}  {:>14}  {:>10}\n",
        "pipeline",
        "log",
        "seed",
        "HOTA",
        "AssA",
        "MOTA",
        "IDF1",
        "IDSW",
        "inherited",
        "wrong person s",
        "error m"
    );
    for task in tasks {
        let _ = write!(out, "{:<first$}  {:<second$}  {:>6}  ", task.pipeline, task.log, task.seed);
        let _ = match &task.outcome {
            Outcome::Done => writeln!(out, "{}", figures(task)),
            Outcome::Failed { why } => writeln!(out, "failed: {}", first_line(why)),
            Outcome::Skipped { .. } => writeln!(out, "skipped"),
        };
    }
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
    let figures =
        [scores.hota, scores.ass_a, scores.mota, scores.idf1, scores.position_error_mean_m];
    let [hota, ass_a, mota, idf1, error_m] =
        figures.map(|value| value.map_or("-".to_owned(), |value| format!("{value:.3}")));
    format!(
        "{hota:>6}  {ass_a:>6}  {mota:>6}  {idf1:>6}  {:>5}  {:>9}  {:>14.2}  {error_m:>10}",
        scores.idsw, scores.inherited_ids, scores.wrong_person_s
    )
}

#[cfg(test)]
mod tests {
    use tagalong_eval::Scores;

    use super::super::plan::planned_for_tests;
    use super::*;

    fn task(pipeline: &str, log: &str) -> TaskResult {
        TaskResult { pipeline: pipeline.into(), log: log.into(), ..TaskResult::default() }
    }

    #[test]
    fn figures_in_the_image_and_on_the_floor_are_told_apart() {
        let scores = Scores {
            hota: Some(0.5),
            ass_a: Some(0.25),
            idsw: 1,
            inherited_ids: 3,
            wrong_person_s: 5.125,
            ..Scores::default()
        };
        let image = TaskResult { image: Some(scores), metres: Some(scores), ..task("a", "hall") };
        let floor = TaskResult { metres: Some(scores), ..task("a", "laser") };
        let text = tables(&[floor, image.clone()]);
        let lines: Vec<&str> = text.lines().collect();
        let [image_title, head, hall, floor_title, _, laser] = lines[..] else { panic!("{text}") };
        assert!(image_title.starts_with("in the image") && hall.contains("hall"), "{text}");
        assert!(floor_title.starts_with("on the floor") && laser.contains("laser"), "{text}");
        assert!(head.contains("wrong person s"), "{head}");
        let cells: Vec<&str> = hall.split_whitespace().collect();
        let shown = ["a", "hall", "0", "0.500", "0.250", "-", "-", "1", "3", "5.12", "-"];
        assert_eq!(cells, shown);
        let titles: Vec<&str> = head.split_whitespace().collect();
        assert_eq!(titles[3..9], ["HOTA", "AssA", "MOTA", "IDF1", "IDSW", "inherited"]);
        assert!(!tables(&[image]).contains("on the floor, as"));
    }

    #[test]
    fn nothing_that_matches_on_a_log_is_asked_about_once_for_all_pipelines() {
        let plan: Vec<Task> = ["a", "b"].map(planned_for_tests).to_vec();
        let asked = "hall.people.csv: nothing matches: is it the truth of another log?";
        assert_eq!(notes(&plan, &[0, 0].map(stored)), ["hall.people.csv: odd", asked]);
        // A pipeline may be bad, where another one finds the people.
        assert_eq!(notes(&plan, &[0, 28].map(stored)), ["hall.people.csv: odd"]);
    }

    /// Returns the result of a task in which so many people match.
    fn stored(tp: u64) -> Stored {
        let scores = Scores { truths: 30, reports: 20, tp, ..Scores::default() };
        let result = TaskResult { image: Some(scores), ..task("a", "hall") };
        Stored { result, notes: vec!["hall.people.csv: odd".into()], ..Stored::default() }
    }
}
