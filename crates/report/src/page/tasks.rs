use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, html};
use tagalong_math::counted;

use super::headline::span_of;
use super::{MOST_UNFOLDED, Page, cell, column, no_cell, number, optional_cell, table};
use crate::chart::key;
use crate::figures::{ComparisonSpace, FEW_SCORES, has_few_scores, lamr_of_enough_scores};
use crate::model::{Outcome, TaskResult};

/// Name of an outcome that is an error, not a choice.
const FAILED: &str = "failed";

/// Returns tasks by outcome and reason, because one reason may skip a pipeline on many logs.
fn by_reason<'a>(
    tasks: &[(&'a TaskResult, (&'a str, &'a str))],
) -> BTreeMap<(&'a str, &'a str), Vec<&'a TaskResult>> {
    let mut reasons: BTreeMap<(&str, &str), Vec<&TaskResult>> = BTreeMap::new();
    for (task, reason) in tasks {
        reasons.entry(*reason).or_default().push(*task);
    }
    reasons
}

/// Returns the distinct names in tasks, in alphabetical order.
fn names<'a>(tasks: &[&'a TaskResult], name: fn(&TaskResult) -> &String) -> BTreeSet<&'a str> {
    tasks.iter().copied().map(|task| name(task).as_str()).collect()
}

impl Page<'_> {
    pub(super) fn failed(&self) -> Option<Markup> {
        let not_done: Vec<_> =
            self.view.tasks.iter().filter_map(|t| Some((*t, reason(&t.outcome)?))).collect();
        let lost: Vec<&TaskResult> =
            self.view.tasks.iter().copied().filter(|t| t.data_lost).collect();
        // Failures must be visible; of tasks that are skipped because no log fits there may be
        // hundreds.
        let is_open = not_done.len() <= MOST_UNFOLDED
            || not_done.iter().any(|(_, (outcome, _))| *outcome == FAILED);
        let head = html! { (column("Pipelines", None)) (column("Logs", None)) (column("Tasks", None)) (column("Outcome", None)) (column("Why", None)) };
        let body = html! {
            @for ((outcome, why), tasks) in &by_reason(&not_done) {
                tr {
                    th scope="row" { @for name in names(tasks, |task| &task.pipeline) { (key(self.series(name), name)) " " } }
                    td class="log" { (names(tasks, |task| &task.log).into_iter().collect::<Vec<_>>().join(", ")) }
                    (cell(tasks.len() as f64, &html! { (tasks.len()) }))
                    td { @if *outcome == FAILED { strong class="bad" { "✕ failed" } } @else { (outcome) } }
                    td class="why" { (why) }
                }
            }
        };
        (!not_done.is_empty() || !lost.is_empty()).then(|| html! {
            p { "None of these is in a mean. A pipeline with fewer logs than another is marked, and is never called the best." }
            @if !not_done.is_empty() {
                details class="print" open[is_open] {
                    summary { (counted(not_done.len(), "task")) }
                    (table("Failed and skipped tasks", &html! { "Tasks without a result." }, &head, &body))
                }
            }
            @if !lost.is_empty() {
                p { "Part of the log was lost or unusable in: " @for (i, t) in lost.iter().enumerate() { @if i > 0 { ", " } (t.pipeline) " on " (t.log) } ". These count." }
            }
        })
    }

    /// Names the tasks whose LAMR has no meaning because all scores, or nearly all, are equal.
    pub(super) fn constant_scores(&self) -> Option<Markup> {
        let constant: Vec<&TaskResult> = self
            .view
            .tasks
            .iter()
            .copied()
            .filter(|task| {
                task.image.is_some_and(|scores| scores.reports > 1 && has_few_scores(&scores))
            })
            .collect();
        (!constant.is_empty()).then(|| html! {
            details class="print" open[constant.len() <= MOST_UNFOLDED] {
                summary { "LAMR and AP mean nothing in " (counted(constant.len(), "task")) }
                p {
                    "Where the reports have fewer than " (FEW_SCORES) " different scores, no \
                     threshold separates reliable reports from unreliable ones; LAMR is left out: "
                    @for (i, t) in constant.iter().enumerate() { @if i > 0 { ", " } (t.pipeline) " on " (t.log) } "."
                }
            }
        })
    }

    pub(super) fn all_tasks(&self) -> Option<Markup> {
        if self.view.tasks.is_empty() {
            return None;
        }
        let body = html! { @for task in &self.view.tasks { (self.task_row(task)) } };
        let caption = html! { "In the image if boxes are known, otherwise on the floor. report.csv has every figure of both." };
        Some(html! {
            details class="print" {
                summary { "One row per pipeline, log and seed" }
                (table("Every task in one row", &caption, &task_head(), &body))
            }
        })
    }

    fn task_row(&self, task: &TaskResult) -> Markup {
        let scores = ComparisonSpace::ALL.iter().find_map(|p| p.scores(task));
        let floor = task.metres.as_ref();
        html! {
            tr data-series=(self.series(&task.pipeline)) {
                th scope="row" { (key(self.series(&task.pipeline), &task.pipeline)) }
                td class="log" { (task.log) }
                (cell(task.seed as f64, &html! { (task.seed) }))
                td { (reason(&task.outcome).map_or("done", |(outcome, _)| outcome)) }
                (cell(task.frames as f64, &html! { (task.frames) }))
                (cell(task.duration_s, &html! { (number(task.duration_s, 1)) }))
                @for value in [scores.and_then(|s| s.hota), scores.and_then(|s| s.ass_a), scores.and_then(|s| s.mota), scores.and_then(|s| s.idf1), scores.and_then(lamr_of_enough_scores)] {
                    (optional_cell(value, 3))
                }
                @for count in [scores.map(|s| s.tp), scores.map(|s| s.fp), scores.map(|s| s.fn_), scores.map(|s| s.idsw), scores.map(|s| s.inherited_ids), scores.map(|s| s.frag)] {
                    (optional_cell(count.map(|c| c as f64), 0))
                }
                @if let Some(s) = scores { td class="number" { (s.mt) " / " (s.pt) " / " (s.ml) } } @else { (no_cell()) }
                (optional_cell(floor.and_then(|s| s.position_error_mean_m), 3))
                (nis_cell(task))
            }
        }
    }

    pub(super) fn inputs(&self) -> Option<Markup> {
        if self.view.tasks.is_empty() {
            return None;
        }
        let names: BTreeSet<&str> =
            self.view.tasks.iter().flat_map(|t| t.inputs.keys()).map(String::as_str).collect();
        let head = html! {
            (column("Pipeline", None)) (column("Log", None)) (column("Seed", None)) (column("Task", None))
            @for name in &names { (column(name, None)) }
        };
        let body = html! {
            @for task in &self.view.tasks {
                tr {
                    th scope="row" { (task.pipeline) }
                    td class="log" { (task.log) }
                    (cell(task.seed as f64, &html! { (task.seed) }))
                    td { (hash(&task.hash)) }
                    @for name in &names { td { @if let Some(value) = task.inputs.get(*name) { (hash(value)) } @else { "–" } } }
                }
            }
        };
        let caption =
            html! { "The first digits of each SHA-256; the full ones are in report.json." };
        Some(html! {
            p { "Tagalong " (self.view.version) ". A task with the same hash has the same result, to the byte." }
            details { summary { "Hashes of tasks and inputs" } (table("Hashes", &caption, &head, &body)) }
        })
    }
}

/// Returns the outcome and the reason of a task that did not finish.
fn reason(outcome: &Outcome) -> Option<(&'static str, &str)> {
    match outcome {
        Outcome::Done => None,
        Outcome::Failed { why } => Some((FAILED, why)),
        Outcome::Skipped { why } => Some(("skipped", why)),
    }
}

fn task_head() -> Markup {
    let plain = [
        "Pipeline",
        "Log",
        "Seed",
        "Outcome",
        "Frames",
        "Length [s]",
        "HOTA",
        "AssA",
        "MOTA",
        "IDF1",
        "LAMR",
        "TP",
        "FP",
        "FN",
        "IDSW",
        "Inherited",
        "Frag",
    ];
    html! {
        @for name in plain { (column(name, None)) }
        (column("MT / PT / ML", Some("People mostly tracked, partly tracked and mostly lost")))
        (column("Error [m]", Some("Mean position error on the floor")))
        (column("NIS", Some("Mean, its bounds, and what they say about the filter")))
    }
}

fn nis_cell(task: &TaskResult) -> Markup {
    let Some(nis) = task.nis.filter(|n| n.mean.is_finite()) else { return no_cell() };
    let verdict = match (nis.mean < nis.lower, nis.mean > nis.upper) {
        (true, _) => "too timid",
        (_, true) => "too sure",
        _ => "honest",
    };
    cell(
        nis.mean,
        &html! {
            (number(nis.mean, 2)) " " span class="ends" { (span_of([nis.lower, nis.upper], 2)) ", " (verdict) }
        },
    )
}

fn hash(text: &str) -> Markup {
    html! { code { (text.chars().take(12).collect::<String>()) } }
}
