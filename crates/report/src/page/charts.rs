use std::collections::BTreeMap;

use maud::{Markup, html};
use tagalong_math::counted;

use super::{MOST_DRAWN, Page, cell, column, number, table};
use crate::chart::{Curve, Extent, Words, bar, key, miss_rate, plan, series_class};
use crate::figures::FEW_SCORES;
use crate::model::TaskResult;

/// Maximum number of plans that are unfolded, in whole logs with a truth; more would make the page
/// too long.
const OPEN_PLANS: usize = 4;

/// Maximum number of miss-rate charts that are not folded.
const OPEN_CHARTS: usize = 4;

impl Page<'_> {
    pub(super) fn miss_rates(&self) -> Option<Markup> {
        let charts: Vec<Markup> =
            self.view.logs.iter().filter_map(|log| self.miss_rate(log)).collect();
        (!charts.is_empty()).then(|| html! {
            p {
                "Miss rate against false positives per image while the score threshold falls. Lower is better. "
                "LAMR is the geometric mean of the curve at nine points in the shaded band."
                " A pipeline with fewer than " (FEW_SCORES) " different scores on a log has no line there."
                (self.of_the_best())
            }
            p class="legend" {
                @for (series, name) in self.view.pipelines.iter().take(MOST_DRAWN).enumerate() { (key(series, name)) " " }
            }
            @let (open, folded) = charts.split_at(charts.len().min(OPEN_CHARTS));
            div class="charts" { @for chart in open { (chart) } }
            @if !folded.is_empty() {
                details class="print" {
                    summary { "Miss rate on " (counted(folded.len(), "more log")) }
                    div class="charts" { @for chart in folded { (chart) } }
                }
            }
        })
    }

    fn miss_rate(&self, log: &str) -> Option<Markup> {
        let tasks = self.drawn(log).filter(|t| t.lamr_curve.len() as u64 >= FEW_SCORES);
        let curves: Vec<Curve<'_>> = tasks
            .map(|t| Curve {
                name: &t.pipeline,
                series: self.series(&t.pipeline),
                points: &t.lamr_curve,
            })
            .collect();
        let title = format!("Miss rate on {log}");
        let words = Words {
            title: &title,
            says: "One line per pipeline; LAMR in the tables is their average.",
        };
        (!curves.is_empty()).then(|| {
            html! {
                figure { (miss_rate(&curves, &words)) figcaption { (log) } }
            }
        })
    }

    /// Returns the tasks of a log that represent their pipelines.
    fn drawn(&self, log: &str) -> impl Iterator<Item = &TaskResult> {
        let best = self.view.pipelines.iter().take(MOST_DRAWN);
        best.filter_map(move |p| self.view.drawn(p, log))
    }

    /// Returns a remark that a chart shows only the best pipelines, if it does.
    fn of_the_best(&self) -> Markup {
        html! {
            @if self.view.pipelines.len() > MOST_DRAWN { " The " (MOST_DRAWN) " best pipelines are shown." }
        }
    }

    pub(super) fn plans(&self) -> Option<Markup> {
        let mut logs: Vec<Markup> = Vec::new();
        let mut drawn = 0;
        for log in &self.view.logs {
            let has_truth = self.drawn(log).any(|task| !task.truth.is_empty());
            if has_truth {
                drawn += self.drawn(log).count();
            }
            logs.extend(self.plans_of(log, has_truth && drawn <= OPEN_PLANS));
        }
        (!logs.is_empty()).then(|| html! {
            p {
                "Where people were (wide and pale) and where the tracks put them (thin, with the ID at the end), "
                "in the odometry frame. A change of line along one person is an ID switch."
                (self.of_the_best())
            }
            div class="folds" { @for log in &logs { (log) } }
        })
    }

    fn plans_of(&self, log: &str, is_open: bool) -> Option<Markup> {
        let tasks: Vec<&TaskResult> = self.drawn(log).collect();
        // One extent for all pipelines, so that their plans can be compared at a glance.
        let extent = Extent::around(tasks.iter().flat_map(|t| t.truth.iter().chain(&t.tracks)))?;
        Some(html! {
            details class="print" open[is_open] {
                summary { (log) }
                div class="charts plans" { @for task in &tasks { (plan_of(task, extent, self.series(&task.pipeline))) } }
            }
        })
    }

    pub(super) fn funnels(&self) -> Option<Markup> {
        let tables: Vec<Markup> =
            self.view.pipelines.iter().filter_map(|p| self.funnel(p)).collect();
        (!tables.is_empty()).then(|| html! {
            p { "The tests in their order, and how many candidates each one dropped, over all logs. If a person is never found, look here first." }
            details class="print" { summary { "Tests of each pipeline" } div class="funnels" { @for table in &tables { (table) } } }
        })
    }

    fn funnel(&self, pipeline: &str) -> Option<Markup> {
        // The order of the first occurrence is that of the stages; the map sorts by name.
        let mut order: Vec<&str> = Vec::new();
        let mut counts: BTreeMap<&str, u64> = BTreeMap::new();
        for dropped in self.view.done(pipeline).flat_map(|t| &t.funnel) {
            if !counts.contains_key(dropped.test.as_str()) {
                order.push(&dropped.test);
            }
            *counts.entry(&dropped.test).or_default() += dropped.count;
        }
        let most = *counts.values().max()? as f64;
        // At least 1, because it may be that no candidate was dropped.
        let all = counts.values().sum::<u64>().max(1) as f64;
        let head = html! { (column("Test", None)) (column("Dropped", None)) (column("Share", None)) th scope="col" class="picture" { "Dropped, as a bar" } };
        let body = html! {
            @for test in &order {
                @let count = counts[test] as f64;
                tr.(series_class(self.series(pipeline))) {
                    th scope="row" { (test) }
                    (cell(count, &html! { (thousands(counts[test])) }))
                    (cell(count / all, &html! { (number(100.0 * count / all, 1)) " %" }))
                    td { (bar(count, None, most)) }
                }
            }
        };
        Some(table(
            &format!("Funnel of {pipeline}"),
            &key(self.series(pipeline), pipeline),
            &head,
            &body,
        ))
    }
}

fn plan_of(task: &TaskResult, extent: Extent, series: usize) -> Markup {
    let title = format!("{} on {} from above", task.pipeline, task.log);
    let says = match task.truth.len() {
        1 => format!("{} and 1 person.", counted(task.tracks.len(), "track")),
        people => format!("{} and {people} people.", counted(task.tracks.len(), "track")),
    };
    html! {
        figure {
            (plan(&task.truth, &task.tracks, extent, &Words { title: &title, says: &says }))
            figcaption { (key(series, &task.pipeline)) ", seed " (task.seed) ": " (says) }
        }
    }
}

/// Formats digits in groups of three, separated by thin spaces.
fn thousands(count: u64) -> String {
    let digits = count.to_string();
    let mut out = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}
