use std::collections::{BTreeMap, BTreeSet};

use maud::{Markup, html};
use tagalong_math::counted;

use super::events::is_base64;
use super::{MOST_DRAWN, MOST_UNFOLDED, Page, cell, column, no_cell, number, table};
use crate::chart::{key, px, series_class};
use crate::model::{MissedPerson, Moment, TaskResult};
use crate::view::OrderedBenchmark;

/// Maximum size of all images of the page together, bytes of base64.
const MOST_BYTES: usize = 1_800_000;

/// Maximum number of moments on the page.
const MOST_MOMENTS: usize = 24;

/// Overlap from which on a track matches a person, as in the figures.
const SAME_IOU: f64 = 0.5;

/// Name of the row of people without a recorded candidate.
pub(super) const NO_CANDIDATE: &str = "no candidate";

/// Box in pixels: left, top, width, height.
type Box = [f64; 4];

/// Returns the moments that the page has room for; the most important come first.
pub(super) fn shown<'a>(all: &'a [Moment], view: &OrderedBenchmark<'_>) -> Vec<&'a Moment> {
    let mut bytes = 0;
    let usable = all.iter().filter(|m| is_base64(&m.image_jpeg_base64) && m.size[0] > 0);
    let mut kept: Vec<&Moment> = usable
        .take_while(|moment| {
            bytes += moment.image_jpeg_base64.len();
            bytes <= MOST_BYTES
        })
        .take(MOST_MOMENTS)
        .collect();
    kept.sort_by_key(|moment| (view.logs.iter().position(|log| *log == moment.log), moment.frame));
    kept
}

impl Page<'_> {
    pub(super) fn missed(&self) -> Option<Markup> {
        let any = self.view.tasks.iter().any(|task| !task.missed.is_empty());
        any.then(|| {
            html! {
                p {
                    "Each frame in which an annotated person has no reported track, by the test that dropped the candidate "
                    "at that person: the last one that a candidate reached. A predicted "
                    "track is not reported. " em { (NO_CANDIDATE) } ": no detector proposed a candidate there."
                }
                details class="print" { summary { "Missed people by cause" } (self.missed_by_test()) }
                @if !self.moments.is_empty() {
                    p {
                        "Frames in the middle of the longest misses: the people white and dashed, in colour the "
                        "tracks of each pipeline" @if self.view.pipelines.len() > MOST_DRAWN { " (of the " (MOST_DRAWN) " best)" }
                        ", and thin and dashed the dropped candidates."
                    }
                }
                (self.moments())
            }
        })
    }

    /// Renders the moments; if there are many, those of each log are folded together.
    fn moments(&self) -> Markup {
        if self.moments.len() <= MOST_UNFOLDED {
            return html! { @for moment in &self.moments { (self.moment(moment)) } };
        }
        html! {
            div class="folds" {
                // They are sorted by log.
                @for of_log in self.moments.chunk_by(|a, b| a.log == b.log) {
                    details class="group" {
                        summary { (of_log[0].log) span class="aside" { (counted(of_log.len(), "moment")) } }
                        @for moment in of_log { (self.moment(moment)) }
                    }
                }
            }
        }
    }

    /// Renders the number of missed people in frames, by test and pipeline.
    fn missed_by_test(&self) -> Markup {
        let mut counts: BTreeMap<&str, BTreeMap<&str, u64>> = BTreeMap::new();
        for task in &self.view.tasks {
            for missed in &task.missed {
                let test = missed.name().unwrap_or(NO_CANDIDATE);
                *counts.entry(test).or_default().entry(&task.pipeline).or_default() += 1;
            }
        }
        let mut tests: Vec<(&str, BTreeMap<&str, u64>)> = counts.into_iter().collect();
        // The test with the most misses comes first.
        tests.sort_by_key(|(test, of)| (std::cmp::Reverse(of.values().sum::<u64>()), *test));
        let head = html! {
            (column("Cause", None)) (column("Why", Some("With the settings of the first pipeline in which the cause occurs")))
            @for (rank, p) in self.tried() { (self.column_of(rank, p)) }
        };
        let body = html! {
            @for (test, of) in &tests {
                tr {
                    th scope="row" { (test) }
                    td { (self.deciding_anywhere(test)) }
                    @for (_, p) in self.tried() {
                        @if let Some(count) = of.get(p) { (cell(*count as f64, &html! { (count) })) } @else { (no_cell()) }
                    }
                }
            }
        };
        let caption =
            html! { "Missed people, each counted in each frame, over all logs and seeds." };
        table("Missed people by cause", &caption, &head, &body)
    }

    /// Renders the heading of a pipeline: its name, or its rank if there are many columns.
    pub(super) fn column_of(&self, rank: usize, pipeline: &str) -> Markup {
        if self.view.pipelines.len() <= MOST_DRAWN {
            return column(pipeline, None);
        }
        html! {
            th scope="col" title=(pipeline) { (rank + 1) span class="unseen" { " " (pipeline) } }
        }
    }

    fn deciding_anywhere(&self, test: &str) -> Markup {
        let tasks = self.view.pipelines.iter().flat_map(|p| self.view.done(p));
        let mut told = tasks.filter_map(|task| Some((&task.pipeline, task.reasons.get(test)?)));
        let Some((pipeline, why)) = told.next() else { return html! {} };
        // The counts of a row are those of pipelines with other settings, too.
        let is_of_all = told.all(|(_, other)| other == why);
        html! { span class="why" { @if !is_of_all { (pipeline) ": " } (why) } }
    }

    fn moment(&self, moment: &Moment) -> Markup {
        let missed = self.missed_at(moment);
        let people: BTreeSet<i64> = missed.iter().map(|(_, missed)| missed.person).collect();
        let by: BTreeSet<&str> = missed.iter().map(|(task, _)| task.pipeline.as_str()).collect();
        let names: Vec<String> = people.iter().map(ToString::to_string).collect();
        html! {
            details class="moment" {
                summary {
                    (moment.log) ", frame " (moment.frame) " at " (number(moment.t_s, 2)) "\u{a0}s"
                    span class="aside" {
                        @if names.len() == 1 { "person " } @else { "people " } (names.join(", ")) " missed by " (counted(by.len(), "pipeline"))
                    }
                }
                div class="moment-body" {
                    (self.picture(moment, &missed))
                    (self.moment_table(moment, &missed, &people))
                }
            }
        }
    }

    /// Returns the missed people of the moment with their tasks, best pipelines first.
    fn missed_at(&self, moment: &Moment) -> Vec<(&TaskResult, &MissedPerson)> {
        let tasks = self.view.pipelines.iter().filter_map(|p| self.view.drawn(p, &moment.log));
        let missed = tasks.flat_map(|task| task.missed.iter().map(move |missed| (task, missed)));
        missed.filter(|(_, missed)| missed.frame == moment.frame).collect()
    }

    fn picture(&self, moment: &Moment, missed: &[(&TaskResult, &MissedPerson)]) -> Markup {
        let [width, height] = moment.size;
        let drawn = self.view.pipelines.iter().take(MOST_DRAWN).enumerate();
        let tracks = drawn.flat_map(|(series, name)| {
            moment.tracks.get(*name).into_iter().flatten().map(move |(_, b)| (series, b))
        });
        let dropped = missed.iter().filter_map(|(task, missed)| {
            let series = self.series(&task.pipeline);
            (series < MOST_DRAWN).then_some((series, missed.box_px.as_ref()?))
        });
        let title = format!("{}, frame {}", moment.log, moment.frame);
        let line = f64::from(width) / 320.0;
        html! {
            svg class="scene" role="img" viewBox=(format!("0 0 {width} {height}")) {
                title { (title) }
                image href=(format!("data:image/jpeg;base64,{}", moment.image_jpeg_base64)) width=(width) height=(height) {}
                @for (id, b) in &moment.people {
                    (outline(b, "scene-person", 1.5 * line))
                    text class="scene-name" x=(px(b[0] + 2.0 * line)) y=(px(b[1] + 10.0 * line)) style=(format!("font-size:{}px", px(10.0 * line))) { (id) }
                }
                @for (series, b) in dropped { (outline(b, &format!("scene-dropped {}", series_class(series)), line)) }
                @for (series, b) in tracks { (outline(b, &format!("scene-track {}", series_class(series)), 1.5 * line)) }
            }
        }
    }

    fn moment_table(
        &self,
        moment: &Moment,
        missed: &[(&TaskResult, &MissedPerson)],
        people: &BTreeSet<i64>,
    ) -> Markup {
        let head = html! {
            (column("Pipeline", None))
            @for id in people { (column(&format!("Person {id}"), None)) }
        };
        let body = html! {
            @for p in self.view.pipelines.iter().filter(|p| self.view.drawn(p, &moment.log).is_some()) {
                tr {
                    th scope="row" { (key(self.series(p), p)) }
                    @for id in people { td { (fate_of(moment, missed, p, *id)) } }
                }
            }
        };
        let name = format!("Pipelines on {} in frame {}", moment.log, moment.frame);
        table(&name, &html! { "✕ missed, with the cause; ● found." }, &head, &body)
    }
}

/// Renders whether a pipeline missed a person and why, or with which track it matched the person.
fn fate_of(
    moment: &Moment,
    missed: &[(&TaskResult, &MissedPerson)],
    pipeline: &str,
    id: i64,
) -> Markup {
    let miss = missed.iter().find(|(t, m)| t.pipeline == pipeline && m.person == id);
    match miss {
        Some((task, miss)) => html! {
            strong class="bad" { "✕ " (miss.name().unwrap_or(NO_CANDIDATE)) }
            @if let Some(why) = miss.cause.and_then(|cause| task.causes.get(cause)) {
                span class="why line" {
                    @for (at, part) in parts_of(why).iter().enumerate() { @if at > 0 { wbr; } (part) }
                }
            }
        },
        None => match track_on(moment, pipeline, id) {
            Some(track) => html! { "● track " (track) },
            None => html! { "●" },
        },
    }
}

/// Splits a sentence after the dots within the path of a setting, where a narrow column may break it.
fn parts_of(why: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let mut from = 0;
    for (dot, _) in why.match_indices('.') {
        if why[dot + 1..].starts_with(char::is_alphabetic) {
            parts.push(&why[from..=dot]);
            from = dot + 1;
        }
    }
    parts.push(&why[from..]);
    parts
}

fn outline([x, y, width, height]: &Box, class: &str, stroke: f64) -> Markup {
    html! {
        rect class=(class) x=(px(*x)) y=(px(*y)) width=(px(*width)) height=(px(*height)) stroke-width=(px(stroke)) {}
    }
}

/// Returns the ID of the pipeline's track that matches a person at that moment.
fn track_on(moment: &Moment, pipeline: &str, person: i64) -> Option<i64> {
    let (_, at) = moment.people.iter().find(|(id, _)| *id == person)?;
    let tracks = moment.tracks.get(pipeline)?.iter();
    let overlaps = tracks.map(|(id, b)| (overlap(at, b), *id));
    let (best, id) = overlaps.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best >= SAME_IOU).then_some(id)
}

/// Returns the intersection over union of two boxes.
fn overlap(a: &Box, b: &Box) -> f64 {
    let [width, height] = [0, 1].map(|axis| {
        let end = (a[axis] + a[axis + 2]).min(b[axis] + b[axis + 2]);
        (end - a[axis].max(b[axis])).max(0.0)
    });
    let both = width * height;
    let union = a[2] * a[3] + b[2] * b[3] - both;
    if union > 0.0 { both / union } else { 0.0 }
}
