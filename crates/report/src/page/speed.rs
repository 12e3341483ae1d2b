use std::collections::BTreeMap;

use maud::{Markup, html};

use super::headline::place_where;
use super::{Page, cell, column, number, table};
use crate::chart::{Mark, Words, bar, front, key, series_class};
use crate::figures::{ComparisonSpace, MAIN};
use crate::model::{TaskTiming, Timings};

impl Page<'_> {
    pub(super) fn speed(&self) -> Markup {
        let Some(timings) = self.timings else {
            return html! {
                p {
                    @if self.timings_left_out { "The times are left out, because the machine had other work while they were measured. " }
                    @else { "No times were measured. " }
                    "Run the benchmark with " code { "--timing" } " on a machine that does nothing else, to see accuracy against time here."
                }
            };
        };
        html! {
            p { "Times per frame, without reading and decoding, on: " (timings.machine) "." }
            @if let Some(chart) = self.front(timings) { (chart) }
            (self.stages(timings))
        }
    }

    /// Returns the times of the finished tasks of a pipeline.
    fn times<'t>(&self, timings: &'t Timings, pipeline: &str) -> Vec<&'t TaskTiming> {
        self.view.done(pipeline).filter_map(|task| timings.tasks.get(&task.hash)).collect()
    }

    fn front(&self, timings: &Timings) -> Option<Markup> {
        let place = ComparisonSpace::ALL.into_iter().find(|p| {
            self.summary.pipelines.iter().any(|s| s.figures.contains_key(&MAIN.key(*p)))
        })?;
        let pipelines = self.view.pipelines.iter().enumerate();
        let known = pipelines.filter_map(|(series, name)| {
            let accuracy = self.summary.pipeline(name)?.figures.get(&MAIN.key(place))?.mean;
            let ms = mean_of_finite(self.times(timings, name).iter().map(|t| t.frame_ms_p50))?;
            Some((series, (*name).to_owned(), ms, accuracy))
        });
        let known: Vec<_> = known.collect();
        let marks: Vec<Mark<'_>> = known
            .iter()
            .map(|(series, name, ms, accuracy)| Mark {
                name,
                series: *series,
                ms: *ms,
                accuracy: *accuracy,
            })
            .collect();
        if marks.is_empty() {
            return None;
        }
        let words = Words {
            title: "Accuracy against time",
            says: "Each pipeline at its median time per frame and its accuracy; the same figures stand in the tables.",
        };
        let accuracy_name = format!("{} {}", MAIN.name, place_where(place));
        Some(html! {
            figure {
                (front(&marks, &accuracy_name, &words))
                figcaption { "Up and to the left is better. The line joins the pipelines that no other one beats in both." }
            }
        })
    }

    fn stages(&self, timings: &Timings) -> Markup {
        let all: Vec<_> =
            self.view.pipelines.iter().map(|p| (*p, self.times(timings, p))).collect();
        let rows: Vec<_> =
            all.iter().flat_map(|(p, t)| stage_rows(t).into_iter().map(|r| (*p, r))).collect();
        let most = rows.iter().map(|(_, r)| r.p95_ms).filter(|v| v.is_finite()).fold(0.0, f64::max);
        let head = html! {
            (column("Pipeline", None)) (column("Stage", None))
            (column("p50 [ms]", Some("Half of the frames took less"))) (column("p95 [ms]", Some("95 % of the frames took less")))
            (column("p99 [ms]", Some("99 % of the frames took less"))) (column("worst [ms]", Some("The slowest frame of all tasks")))
            th scope="col" class="picture" { "p50 as a bar, p95 as a line" }
        };
        let body = html! {
            @for (pipeline, row) in &rows {
                tr class=(row.class(self.series(pipeline))) data-series=(self.series(pipeline)) {
                    th scope="row" { (key(self.series(pipeline), pipeline)) }
                    td { (row.stage) }
                    (cell(row.p50_ms, &html! { (number(row.p50_ms, 2)) }))
                    (cell(row.p95_ms, &html! { (number(row.p95_ms, 2)) }))
                    (cell(row.p99_ms, &html! { (number(row.p99_ms, 2)) }))
                    (cell(row.max_ms, &html! { (number(row.max_ms, 2)) }))
                    td { (bar(row.p50_ms, Some(row.p95_ms), most)) }
                }
            }
        };
        table(
            "Times of the stages",
            &html! { "Time per frame and stage, mean over the tasks of a pipeline; for the slowest frames the maximum." },
            &head,
            &body,
        )
    }
}

struct StageRow {
    stage: String,
    p50_ms: f64,
    p95_ms: f64,
    p99_ms: f64,
    max_ms: f64,
    is_total: bool,
}

impl StageRow {
    /// Creates a row of the times of one stage in all tasks: p50, p95, p99 and worst, ms.
    fn new(stage: &str, times: &[[f64; 4]], is_total: bool) -> Self {
        let max_ms = times.iter().map(|t| t[3]).fold(f64::NAN, f64::max);
        let [p50_ms, p95_ms, p99_ms] =
            [0, 1, 2].map(|i| mean_of_finite(times.iter().map(|t| t[i])).unwrap_or(f64::NAN));
        Self { stage: stage.to_owned(), p50_ms, p95_ms, p99_ms, max_ms, is_total }
    }

    fn class(&self, series: usize) -> String {
        let total = if self.is_total { "total " } else { "" };
        format!("{total}{}", series_class(series))
    }
}

/// Returns the row of the whole frame, then those of the stages in their order.
fn stage_rows(times: &[&TaskTiming]) -> Vec<StageRow> {
    if !times.iter().any(|t| t.frame_ms_p50.is_finite()) {
        return Vec::new();
    }
    let whole: Vec<[f64; 4]> = times
        .iter()
        .map(|t| [t.frame_ms_p50, t.frame_ms_p95, t.frame_ms_p99, t.frame_ms_max])
        .collect();
    let mut by_stage: BTreeMap<&str, Vec<[f64; 4]>> = BTreeMap::new();
    // The map sorts by name, but the rows keep the order of the pipeline.
    let mut order: Vec<&str> = Vec::new();
    for stage in times.iter().flat_map(|t| &t.stages) {
        if !order.contains(&stage.stage.as_str()) {
            order.push(&stage.stage);
        }
        let of_task = [stage.p50_ms, stage.p95_ms, stage.p99_ms, stage.max_ms];
        by_stage.entry(&stage.stage).or_default().push(of_task);
    }
    let stages = order.into_iter().map(|stage| StageRow::new(stage, &by_stage[stage], false));
    std::iter::once(StageRow::new("whole frame", &whole, true)).chain(stages).collect()
}

/// Returns the mean of the finite values.
fn mean_of_finite(values: impl Iterator<Item = f64>) -> Option<f64> {
    let finite: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    tagalong_math::mean(&finite)
}
