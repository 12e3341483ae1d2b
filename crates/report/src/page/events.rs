use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, html};
use tagalong_math::counted;

use super::{MOST_UNFOLDED, Page, cell, column, number, optional_cell, table};
use crate::chart::key;
use crate::model::{EventRow, TaskResult};
use crate::view::OrderedBenchmark;

/// Maximum number of rows of events on the page.
const MOST_ROWS: usize = 3000;

/// Maximum size of the pictures of events on the page, bytes of base64.
const MOST_PICTURES: usize = 800_000;

/// Tasks whose events the page lists and shows, by their indices.
#[derive(Default)]
pub(super) struct Listed {
    rows: BTreeSet<usize>,
    pictures: BTreeSet<usize>,
}

impl Listed {
    /// Chooses as many tasks as the page has room for, those of the best pipelines first.
    pub(super) fn of(view: &OrderedBenchmark<'_>) -> Self {
        let mut listed = Self::default();
        let mut rows = 0;
        let mut bytes = 0;
        for pipeline in &view.pipelines {
            let tasks = view.tasks.iter().enumerate().filter(|(_, t)| t.pipeline == *pipeline);
            for (number, task) in tasks.filter(|(_, t)| !t.events.is_empty()) {
                rows += task.events.len();
                bytes += task.events.iter().map(picture_bytes).sum::<usize>();
                if rows <= MOST_ROWS {
                    listed.rows.insert(number);
                }
                if bytes <= MOST_PICTURES {
                    listed.pictures.insert(number);
                }
            }
        }
        listed
    }

    /// Returns true if the events of a task have rows.
    pub(super) fn has_rows(&self, task: usize) -> bool {
        self.rows.contains(&task)
    }
}

fn picture_bytes(event: &EventRow) -> usize {
    event.picture_png_base64.as_ref().map_or(0, String::len)
}

impl Page<'_> {
    pub(super) fn events(&self) -> Option<Markup> {
        let tasks: Vec<&TaskResult> =
            self.view.tasks.iter().copied().filter(|t| !t.events.is_empty()).collect();
        // The index is that among all tasks, as in the links from the pairs.
        let numbered = self.view.tasks.iter().enumerate();
        let numbered = numbered.filter(|(number, _)| self.listed.has_rows(*number));
        let more = tasks.len() - numbered.clone().count();
        (!tasks.is_empty()).then(|| {
            html! {
                (self.event_counts(&tasks))
                div class="filters" hidden { span class="unseen" { "Show kinds of events" } }
                @if numbered.clone().count() <= MOST_UNFOLDED {
                    @for (number, task) in numbered { (self.events_of(number, task)) }
                } @else {
                    div class="folds" {
                        @for pipeline in &self.view.pipelines {
                            @let of_pipeline = numbered.clone().filter(|(_, task)| task.pipeline == *pipeline);
                            (self.events_of_pipeline(pipeline, of_pipeline.collect()))
                        }
                    }
                }
                @if more > 0 { p { "The events of " (counted(more, "task")) " of the last pipelines are in report.json." } }
            }
        })
    }

    /// Renders the events of the tasks of a pipeline, folded together.
    fn events_of_pipeline(&self, pipeline: &str, tasks: Vec<(usize, &&TaskResult)>) -> Markup {
        if tasks.is_empty() {
            return html! {};
        }
        let count: usize = tasks.iter().map(|(_, task)| task.events.len()).sum();
        html! {
            details class="group" {
                summary {
                    (key(self.series(pipeline), pipeline))
                    span class="aside" { (counted(count, "event")) " in " (counted(tasks.len(), "task")) }
                }
                @for (number, task) in tasks { (self.events_of(number, task)) }
            }
        }
    }

    /// Renders the number of events of each kind and pipeline.
    fn event_counts(&self, tasks: &[&TaskResult]) -> Markup {
        let mut counts: BTreeMap<&str, BTreeMap<&str, u64>> = BTreeMap::new();
        for task in tasks {
            for event in &task.events {
                *counts.entry(&event.kind).or_default().entry(&task.pipeline).or_default() += 1;
            }
        }
        let head = html! { (column("Kind", None)) @for (rank, p) in self.tried() { (self.column_of(rank, p)) } };
        let body = html! {
            @for (name, of) in &counts {
                tr {
                    th scope="row" { (kind(name)) }
                    @for (_, p) in self.tried() { (cell(of.get(p).copied().unwrap_or(0) as f64, &html! { (of.get(p).copied().unwrap_or(0)) })) }
                }
            }
        };
        let caption = html! { "Events by kind and pipeline, over all tasks. A miss is one period without a reported track, of any number of frames." };
        let name = "Events by kind";
        html! {
            details class="print" open[self.view.pipelines.len() <= MOST_UNFOLDED] {
                summary { (name) }
                (table(name, &caption, &head, &body))
            }
        }
    }

    fn events_of(&self, number: usize, task: &TaskResult) -> Markup {
        let name = format!("Events of {} on {}, seed {}", task.pipeline, task.log, task.seed);
        let head = html! {
            (column("Time [s]", None)) (column("Frame", None)) (column("Kind", None))
            (column("Person", None)) (column("Track", None)) (column("What", None))
        };
        let mut events: Vec<(usize, &EventRow)> = task.events.iter().enumerate().collect();
        events.sort_by(|a, b| a.1.t_s.total_cmp(&b.1.t_s));
        let body = html! { @for (index, event) in events { (row(event, &event_id(number, index), self.listed.pictures.contains(&number))) } };
        let caption =
            html! { "In order of time, which is counted from the first frame of the log." };
        html! {
            details class="events" {
                summary {
                    (key(self.series(&task.pipeline), &task.pipeline)) " on " (task.log) ", seed " (task.seed)
                    span class="aside" { (counted(task.events.len(), "event")) }
                }
                (table(&name, &caption, &head, &body))
            }
        }
    }
}

/// Returns the anchor of an event, by the indices of its task and of itself.
pub(super) fn event_id(task: usize, event: usize) -> String {
    format!("event-{task}-{event}")
}

fn row(event: &EventRow, id: &str, is_shown: bool) -> Markup {
    html! {
        tr id=(id) data-kind=(event.kind) {
            (cell(event.t_s, &html! { (number(event.t_s, 2)) }))
            (cell(event.frame as f64, &html! { (event.frame) }))
            td { (kind(&event.kind)) }
            (optional_cell(event.person.map(|id| id as f64), 0))
            (optional_cell(event.track.map(|id| id as f64), 0))
            td { @if is_shown { (picture(event)) } (event.text) }
        }
    }
}

/// Renders a kind of event with its own sign, because colour alone is not enough.
pub(super) fn kind(kind: &str) -> Markup {
    let (sign, name) = match kind {
        "miss" => ("○", "miss"),
        "found" => ("●", "found"),
        "switch" => ("⇄", "ID switch"),
        "wrong-person" => ("✕", "wrong person"),
        "false-track" => ("△", "false track"),
        other => ("·", other),
    };
    let class = if kind == "found" { "kind" } else { "kind bad" };
    html! { span class=(class) { span aria-hidden="true" { (sign) " " } (name) } }
}

/// Renders the picture of an event; data that is not base64 is left out.
pub(super) fn picture(event: &EventRow) -> Markup {
    // Other data is no picture, and the page would show a broken one.
    let data = event.picture_png_base64.as_deref().filter(|data| is_base64(data));
    html! {
        @if let Some(data) = data {
            img src=(format!("data:image/png;base64,{data}")) loading="lazy"
                alt=(format!("The place in frame {}", event.frame));
        }
    }
}

pub(super) fn is_base64(data: &str) -> bool {
    !data.is_empty()
        && data.len().is_multiple_of(4)
        && data
            .trim_end_matches('=')
            .bytes()
            .all(|b| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'/'))
}
