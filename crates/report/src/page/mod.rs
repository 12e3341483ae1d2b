//! HTML page of the report.

mod charts;
mod events;
mod explain;
mod headline;
mod moments;
mod pairs;
mod repairs;
mod speed;
mod tasks;

use maud::{DOCTYPE, Markup, PreEscaped, html};
use tagalong_math::counted;

use crate::chart::minus;
use crate::model::{Benchmark, Moment, Timings};
use crate::summary::{PipelineSummary, Summary};
use crate::view::OrderedBenchmark;

/// Style that all pages share: colours as CSS variables for light and dark mode, fonts, tables.
pub const BASE_STYLE: &str = include_str!("base.css");

// Inlined, so that the page is one file.
const STYLE: &str = concat!(include_str!("base.css"), include_str!("page.css"));
const SCRIPT: &str = include_str!("page.js");

const TITLE: &str = "Tagalong benchmark";

/// Maximum number of pipelines in one chart or image; if there are more, the best ones are shown.
const MOST_DRAWN: usize = 8;

/// Anchors of the sections that consist of a sentence and a folded list; two of them share a row.
const SHORT: [&str; 5] = ["failed", "repairs", "funnel", "tasks", "inputs"];

/// Maximum number of entries of a list that is not folded.
const MOST_UNFOLDED: usize = 6;

/// Data from which the sections are made.
struct Page<'a> {
    view: OrderedBenchmark<'a>,
    summary: Summary,
    /// Moments in which people were missed, as many as the page may hold.
    moments: Vec<&'a Moment>,
    /// Events that the page lists.
    listed: events::Listed,
    /// Times, if the machine was otherwise idle.
    timings: Option<&'a Timings>,
    /// True if there are times but the machine was busy.
    timings_left_out: bool,
}

/// Returns a page that has a link to its element `main` for keyboard users, with the text `skip`.
pub fn document(title: &str, style: &Markup, skip: &str, body: &Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                (style)
            }
            body {
                a class="skip" href="#main" { (skip) }
                (body)
            }
        }
    }
}

/// Returns the report as one HTML page without any reference to another file.
///
/// Times are shown only if [`Timings::exclusive`] is set; without them the page depends on the
/// benchmark only, and not on the order of its tasks.
pub fn html(benchmark: &Benchmark, timings: Option<&Timings>) -> String {
    let mut summary = Summary::new(benchmark);
    let view = OrderedBenchmark::new(benchmark).ranked(&summary);
    summary.pipelines.sort_by_key(|p| view.pipelines.iter().position(|name| *name == p.pipeline));
    let page = Page {
        moments: moments::shown(&benchmark.moments, &view),
        listed: events::Listed::of(&view),
        view,
        summary,
        timings: timings.filter(|t| t.exclusive),
        timings_left_out: timings.is_some_and(|t| !t.exclusive),
    };
    page.whole().into_string()
}

/// Section with its anchor, heading and body.
struct Section {
    anchor: &'static str,
    heading: &'static str,
    body: Markup,
    /// True for a sentence with a folded list, which needs half of the width.
    is_short: bool,
}

impl Page<'_> {
    fn whole(&self) -> Markup {
        let sections = self.sections();
        let style = html! { style { (PreEscaped(STYLE)) } };
        let body = html! {
            header class="top" {
                h1 { (TITLE) }
                p class="facts" { (self.facts()) }
                nav aria-label="Sections" {
                    ul { @for s in &sections { li { a href=(format!("#{}", s.anchor)) { (s.heading) } } } }
                }
            }
            main id="main" tabindex="-1" {
                @for section in &sections {
                    section id=(section.anchor) class=[section.is_short.then_some("small")] aria-labelledby=(format!("h-{}", section.anchor)) {
                        h2 id=(format!("h-{}", section.anchor)) { (section.heading) }
                        (section.body)
                    }
                }
            }
            footer { p { "Made by Tagalong " (self.view.version) "." } }
            script { (PreEscaped(SCRIPT)) }
        };
        document(TITLE, &style, "Skip to the results", &body)
    }

    fn sections(&self) -> Vec<Section> {
        // The plot comes first if there is one; a remark that there is none comes later.
        let (first, later) = match self.timings {
            Some(_) => (Some(self.speed()), None),
            None => (None, Some(self.speed())),
        };
        let results =
            html! { (self.headline()) @if let Some(note) = self.constant_scores() { (note) } };
        let sections = [
            ("speed", "Accuracy and time", first),
            ("results", "Results", Some(results)),
            ("failed", "Failed and skipped", self.failed()),
            ("speed", "Accuracy and time", later),
            ("missed", "Missed people, and why", self.missed()),
            ("pairs", "Pipelines side by side", self.pairs()),
            ("repairs", "Where work pays", self.repairs()),
            ("funnel", "Why candidates were dropped", self.funnels()),
            ("miss-rate", "Miss rate", self.miss_rates()),
            ("floor", "Seen from above", self.plans()),
            ("events", "What happened when", self.events()),
            ("tasks", "All tasks", self.all_tasks()),
            ("inputs", "Versions and hashes", self.inputs()),
            ("reading", "How to read this", Some(self.explain())),
        ];
        let shown = sections.into_iter().filter_map(|(anchor, heading, body)| {
            let is_short = match anchor {
                "speed" => self.timings.is_none(),
                _ => SHORT.contains(&anchor),
            };
            body.map(|body| Section { anchor, heading, body, is_short })
        });
        shown.collect()
    }

    fn facts(&self) -> Markup {
        let mut done = 0;
        let mut failed = 0;
        let mut skipped = 0;
        for pipeline in &self.summary.pipelines {
            done += pipeline.done;
            failed += pipeline.failed;
            skipped += pipeline.skipped;
        }
        html! {
            (counted(self.view.pipelines.len(), "pipeline")) " on "
            (counted(self.view.logs.len(), "log")) ", "
            (counted(self.view.tasks.len(), "task")) ": "
            (done) " done"
            @if failed > 0 { ", " strong class="bad" { (failed) " failed" } }
            @if skipped > 0 { ", " (skipped) " skipped" }
            ". Tagalong " (self.view.version) "."
        }
    }

    /// Returns the pipelines that were run on at least one log, each with its rank.
    fn tried(&self) -> impl Iterator<Item = (usize, &str)> + Clone {
        let ranked = self.view.pipelines.iter().copied().enumerate();
        ranked.filter(|(_, name)| self.summary.pipeline(name).is_none_or(|p| !was_skipped(p)))
    }

    /// Returns the index of a pipeline, for colour, shape and dashes.
    fn series(&self, pipeline: &str) -> usize {
        self.view.pipelines.iter().position(|p| *p == pipeline).unwrap_or(0)
    }
}

/// Returns true for a pipeline that was skipped on each log.
fn was_skipped(summary: &PipelineSummary) -> bool {
    summary.skipped > 0 && summary.done + summary.failed == 0
}

/// Formats a number; a dash if it is not finite.
fn number(value: f64, decimals: usize) -> String {
    if value.is_finite() { minus(&format!("{value:.decimals$}")) } else { "–".to_owned() }
}

/// Formats a difference, always with a sign.
fn signed(value: f64, decimals: usize) -> String {
    let text = number(value, decimals);
    // A difference that rounds to zero has no sign.
    if value > 0.0 && text.chars().any(|c| ('1'..='9').contains(&c)) {
        format!("+{text}")
    } else {
        text
    }
}

/// Renders a column heading by which the table can be sorted.
fn column(name: &str, hint: Option<&str>) -> Markup {
    html! { th scope="col" title=[hint] { (name) } }
}

/// Renders a table that scrolls by itself if it is wider than the page.
fn table(name: &str, caption: &Markup, head: &Markup, body: &Markup) -> Markup {
    html! {
        section class="scroll" tabindex="0" aria-label=(name) {
            table class="sortable" {
                caption { (caption) }
                thead { tr { (head) } }
                tbody { (body) }
            }
        }
    }
}

/// Renders a cell with a number, and the number itself for sorting.
fn cell(value: f64, shown: &Markup) -> Markup {
    html! { td class="number" data-value=[value.is_finite().then_some(value)] { (shown) } }
}

/// Renders an empty cell.
fn no_cell() -> Markup {
    html! { td class="number none" { "–" } }
}

fn optional_cell(value: Option<f64>, decimals: usize) -> Markup {
    value
        .filter(|v| v.is_finite())
        .map_or_else(no_cell, |v| cell(v, &html! { (number(v, decimals)) }))
}
