use std::collections::BTreeMap;

use maud::{Markup, html};
use tagalong_math::{counted, draws_needed};

use super::events::{event_id, kind};
use super::headline::{ends_of, place_where};
use super::moments::NO_CANDIDATE;
use super::{MOST_UNFOLDED, Page, cell, column, no_cell, number, signed, table};
use crate::chart::key;
use crate::compare::{Difference, SAME_EVENT_S, compare_in};
use crate::figures::{ComparisonSpace, Figure, MAIN};
use crate::summary::PairSummary;

/// Maximum number of differences that are listed for all pairs together; the rest is counted.
const MOST_LISTED: usize = 1200;

/// A kind of error in which two pipelines can differ.
struct ErrorKind {
    /// Key of its figure in the summary.
    figure: &'static str,
    /// Minimum difference of the means over logs that is mentioned.
    least: f64,
    decimals: usize,
    /// Words for the pipeline with more of these errors, before and after the number.
    words: [&'static str; 2],
    /// True for errors of identity, of which only the first is mentioned: a track that moves to
    /// another person is worse than a new ID for the same one.
    is_of_identity: bool,
}

/// Cause of misses.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Costly<'a> {
    name: &'a str,
    /// True for a test that dropped the candidate.
    is_test: bool,
}

/// Errors other than misses, which are listed by test.
const ERROR_KINDS: [ErrorKind; 3] = [
    ErrorKind {
        figure: "image.fp_per_frame",
        least: 0.02,
        decimals: 2,
        words: ["reports", "false people per frame"],
        is_of_identity: false,
    },
    ErrorKind {
        figure: "image.wrong_person_s",
        least: 0.5,
        decimals: 1,
        words: ["follows the wrong person for", "s per log"],
        is_of_identity: true,
    },
    ErrorKind {
        figure: "image.IDSW",
        least: 0.5,
        decimals: 1,
        words: ["switches IDs", "times per log"],
        is_of_identity: true,
    },
];

/// Maximum number of pipelines for which every pair is described; with more, the best one is
/// compared with each other one.
const ALL_PAIRS_OF: usize = 4;

/// Maximum number of pairs that are described.
const MOST_PAIRS: usize = 10;

impl Page<'_> {
    pub(super) fn pairs(&self) -> Option<Markup> {
        if self.view.pipelines.len() < 2 {
            return None;
        }
        Some(html! {
            p {
                "Each pair is compared on the logs that both finished, log by log, so that a hard log counts "
                "the same for both. p is that of the exact sign-flip permutation test over logs. "
                strong { "Clear" } " means p below 0.05"
                @if self.view.pipelines.len() > 2 {
                    " after Holm's correction for all pairs that are compared by the same figure: "
                    "without it, one of twenty pairs would be below 0.05 by chance"
                }
                @if let Some((pairs, needed)) = self.logs_needed() {
                    ". With " (counted(pairs, "pair")) " that takes " (needed) " logs at least"
                }
                ". The interval is Student's, for one pair alone, and separate from that test: it can exclude 0 beside "
                "\"not clear\". The figures are not corrected for each other: choose the one that matters before looking."
            }
            @if self.view.pipelines.len() > 2 { (self.matrix()) }
            @let pairs = self.described_pairs();
            @let (open, folded) = pairs.split_at(pairs.len().min(MOST_UNFOLDED));
            (self.pairs_of(open, pairs.len()))
            @if !folded.is_empty() {
                details class="print" {
                    summary { (counted(folded.len(), "more pair")) }
                    (self.pairs_of(folded, pairs.len()))
                }
            }
            @if self.tried().count() > ALL_PAIRS_OF {
                p { "The text compares the best pipeline with the next ones; all pairs are in report.json." }
            }
        })
    }

    /// Returns the number of pairs that are compared by the main figure, and the minimum number of
    /// logs for a significant difference among them.
    fn logs_needed(&self) -> Option<(usize, usize)> {
        let shown = ComparisonSpace::ALL.into_iter();
        let mut counts = shown.map(|place| self.summary.pairs_by(&MAIN.key(place)));
        let pairs = counts.find(|pairs| *pairs > 0)?;
        Some((pairs, draws_needed(pairs)))
    }

    /// Describes in one line how a pair differs: people found, the test that costs the worse one
    /// most, and other errors.
    pub(super) fn why_of_pair(&self, a: &str, b: &str) -> Option<String> {
        let [mut better, mut worse] = [a, b].map(|name| {
            let found = self.summary.pipeline(name).and_then(|it| it.people_found_count());
            (self.misses_by_test(name), found, name)
        });
        let worse_by_misses = worse.0.values().sum::<u64>() < better.0.values().sum::<u64>();
        if worse.1 > better.1 || (worse.1 == better.1 && worse_by_misses) {
            std::mem::swap(&mut better, &mut worse);
        }
        let people = self.summary.pipeline(worse.2)?.people;
        let mut line = if better.1? == worse.1? {
            format!("Both found {} of {people} people", better.1?)
        } else {
            format!("{} found {} of {people} people, {} {}", better.2, better.1?, worse.2, worse.1?)
        };
        let all: u64 = worse.0.values().sum();
        let costly = worse.0.iter().max_by_key(|(test, count)| (**count, std::cmp::Reverse(*test)));
        if let Some((Costly { name, is_test }, count)) = costly {
            let misses = format!("{count} of the {all} misses of {}, counted by frame,", worse.2);
            let why = match *name {
                NO_CANDIDATE => format!("{misses} had no candidate"),
                name if *is_test => {
                    format!("in {misses} the test \"{name}\" dropped the candidate")
                }
                name => format!("the cause of {misses} was \"{name}\""),
            };
            line += &format!("; {why}");
        }
        let mut has_identity = false;
        for kind in &ERROR_KINDS {
            if kind.is_of_identity && has_identity {
                continue;
            }
            if let Some(difference) = self.errors_of_pair(kind, better.2, worse.2) {
                line += &format!("; {difference}");
                has_identity |= kind.is_of_identity;
            }
        }
        Some(line)
    }

    /// Describes how often two pipelines make an error, the worse one first, if they differ.
    fn errors_of_pair(&self, kind: &ErrorKind, a: &str, b: &str) -> Option<String> {
        let a = (self.mean_of(kind.figure, a)?, a);
        let b = (self.mean_of(kind.figure, b)?, b);
        let (more, fewer) = if a.0 > b.0 { (a, b) } else { (b, a) };
        let [does, how_often] = kind.words;
        (more.0 - fewer.0 >= kind.least).then(|| {
            let [many, few] = [more.0, fewer.0].map(|mean| number(mean, kind.decimals));
            format!("{} {does} {many} {how_often}, {} {few}", more.1, fewer.1)
        })
    }

    fn mean_of(&self, figure: &str, pipeline: &str) -> Option<f64> {
        Some(self.summary.pipeline(pipeline)?.figures.get(figure)?.mean)
    }

    /// Returns a pipeline's number of missed people by cause, summed over frames, in the runs that
    /// are shown.
    fn misses_by_test(&self, pipeline: &str) -> BTreeMap<Costly<'_>, u64> {
        let mut counts = BTreeMap::new();
        for task in self.view.logs.iter().filter_map(|log| self.view.drawn(pipeline, log)) {
            for missed in &task.missed {
                let name = missed.name().unwrap_or(NO_CANDIDATE);
                let cause = Costly { name, is_test: missed.test.is_some() };
                *counts.entry(cause).or_default() += 1;
            }
        }
        counts
    }

    /// Returns the pairs that are described, ordered by name.
    fn described_pairs(&self) -> Vec<(&str, &str)> {
        let names: Vec<&str> = self.tried().map(|(_, name)| name).collect();
        let names = &names;
        // With many pipelines only the first one is compared with each other one.
        let firsts = if names.len() > ALL_PAIRS_OF { 1 } else { names.len() };
        let pairs = (0..firsts).flat_map(|i| names[i + 1..].iter().map(move |b| (names[i], *b)));
        pairs.map(|(a, b)| (a.min(b), a.max(b))).take(MOST_PAIRS).collect()
    }

    /// Renders the gain of each pipeline over each other one in the main figure.
    fn matrix(&self) -> Markup {
        let shown = ComparisonSpace::ALL.into_iter();
        let place = shown
            .into_iter()
            .find(|place| self.summary.pairs.iter().any(|pair| pair.figure == MAIN.key(*place)));
        let Some(place) = place else { return html! {} };
        let names = self.tried();
        let head = html! {
            (column("Pipeline", None))
            @for (rank, name) in names.clone() { (self.column_of(rank, name)) }
        };
        let body = html! {
            @for (rank, row) in names.clone() {
                tr {
                    th scope="row" { (rank + 1) " " (key(rank, row)) }
                    @for (_, other) in names.clone() { (self.gain_cell(row, other, place)) }
                }
            }
        };
        let caption = html! {
            (MAIN.name) " " (place_where(place)) ": the pipeline of the row minus that of the column, over the logs in common, "
            "best pipeline first. Bold with an arrow: clear."
        };
        let name = "Each pipeline against each other";
        html! {
            details class="print" open[names.count() <= MOST_UNFOLDED] {
                summary { (name) }
                div class="matrix" { (table(name, &caption, &head, &body)) }
            }
        }
    }

    fn gain_cell(&self, row: &str, other: &str, place: ComparisonSpace) -> Markup {
        let a = row.min(other);
        let b = row.max(other);
        let figure = MAIN.key(place);
        let pair = self.summary.pairs.iter().find(|p| p.a == a && p.b == b && p.figure == figure);
        let Some(pair) = pair.filter(|_| row != other) else { return no_cell() };
        // A pair holds the difference `b - a`.
        let gain = if row == b { pair.difference } else { -pair.difference };
        let shown = signed(gain, MAIN.decimals);
        cell(
            gain,
            &match (pair.is_clear(), gain > 0.0) {
                (false, _) => html! { (shown) },
                (true, true) => {
                    html! { span class="clear-win" { "▲ " (shown) span class="unseen" { " clear" } } }
                }
                (true, false) => {
                    html! { span class="clear-loss" { "▼ " (shown) span class="unseen" { " clear" } } }
                }
            },
        )
    }

    /// Renders some of `count` pairs side by side.
    fn pairs_of(&self, pairs: &[(&str, &str)], count: usize) -> Markup {
        html! { div class="folds wide" { @for (a, b) in pairs { (self.pair(a, b, MOST_LISTED / count)) } } }
    }

    fn pair(&self, a: &str, b: &str, most: usize) -> Markup {
        let rows: Vec<&PairSummary> =
            self.summary.pairs.iter().filter(|p| p.a == a && p.b == b).collect();
        let clear = rows.iter().filter(|p| p.is_clear()).count();
        let differences = compare_in(&self.view, a, b);
        html! {
            div class="pair" {
                @if let Some(why) = self.why_of_pair(a, b) { p class="pair-why" { (why) "." } }
                details class="print" {
                    summary {
                        (key(self.series(a), a)) " against " (key(self.series(b), b))
                        span class="aside" {
                            @if rows.is_empty() { "no log in common" }
                            @else { (clear) " of " (counted(rows.len(), "figure")) " clear, " (counted(differences.len(), "event")) " differ" }
                        }
                    }
                    @if !rows.is_empty() { (gain_table(a, b, &rows)) }
                    (self.differences(a, b, &differences, most))
                }
            }
        }
    }

    fn differences(&self, a: &str, b: &str, all: &[Difference<'_>], most: usize) -> Markup {
        if all.is_empty() {
            return html! { p { "No event happened to one of them only." } };
        }
        let name = format!("Where {a} and {b} differ");
        let head = html! {
            (column("Log", None)) (column("Seed", None)) (column("Time [s]", None)) (column("Frame", None))
            (column("Only with", None)) (column("Kind", None)) (column("What", None))
        };
        let body = html! {
            @for d in all.iter().take(most) {
                tr data-kind=(d.event.kind) {
                    th scope="row" { (d.log) }
                    (cell(d.seed as f64, &html! { (d.seed) }))
                    (cell(d.event.t_s, &html! { (number(d.event.t_s, 2)) }))
                    (cell(d.event.frame as f64, &self.link(d)))
                    td { (key(self.series(d.pipeline), d.pipeline)) }
                    td { (kind(&d.event.kind)) }
                    td { (d.event.text) }
                }
            }
        };
        let caption = html! {
            "Events that happened to one of them only, in order of time. Events of one kind and person within "
            (number(SAME_EVENT_S, 1)) " s of each other count as the same."
            @if all.len() > most { " The first " (most) " of " (all.len()) "." }
        };
        table(&name, &caption, &head, &body)
    }

    /// Renders the frame of an event, as a link to its row and picture.
    fn link(&self, d: &Difference<'_>) -> Markup {
        let listed = self.view.tasks.iter().enumerate();
        let mut listed = listed.filter(|(task, _)| self.listed.has_rows(*task));
        let found = listed.find_map(|(task, of)| {
            // Events have no ID of their own, but the difference refers to the event itself.
            let index = of.events.iter().position(|event| std::ptr::eq(event, d.event))?;
            Some(event_id(task, index))
        });
        html! {
            @if let Some(id) = found { a href=(format!("#{id}")) { (d.event.frame) } }
            @else { (d.event.frame) }
        }
    }
}

fn gain_table(a: &str, b: &str, rows: &[&PairSummary]) -> Markup {
    let head = html! {
        (column("Figure", None)) (column("Where", None)) (column("Logs", None))
        (column(&format!("{b} less {a}"), None)) (column("95 % interval", None))
        (column("p", Some("Probability of such a difference by chance, one pair alone")))
        (column("p, all pairs", Some("Corrected for all pairs that are compared by this figure (Holm)")))
        (column("Better", None))
    };
    let body = html! {
        @for place in ComparisonSpace::ALL {
            @for figure in Figure::at(place) {
                @let key = figure.key(place);
                @if let Some(row) = rows.iter().find(|r| r.figure == key) { (gain_row(row, figure, place)) }
            }
        }
    };
    table(
        &format!("Figures of {a} and {b}"),
        &html! { "Mean differences over the logs in common." },
        &head,
        &body,
    )
}

fn gain_row(row: &PairSummary, figure: &Figure, place: ComparisonSpace) -> Markup {
    // The difference is `b - a`, so a value that is better than 0 favours `b`.
    let winner = if figure.better(row.difference, 0.0) { &row.b } else { &row.a };
    let better = match (row.difference == 0.0, row.is_clear()) {
        (true, _) => html! { "equal" },
        (false, true) => html! { strong { (winner) } ", clear" },
        (false, false) => html! { (winner) ", not clear" },
    };
    html! {
        tr {
            th scope="row" { (super::headline::figure_name(figure)) }
            td { (place_where(place)) }
            (cell(row.logs as f64, &html! { (row.logs) }))
            (cell(row.difference, &html! { (signed(row.difference, figure.decimals)) }))
            @if let Some(ends) = row.interval { (cell(ends[0], &ends_of(ends, figure.decimals))) } @else { (no_cell()) }
            @for p in [row.p_value, row.p_corrected] { (cell(p, &html! { (p_text(p)) })) }
            td { (better) }
        }
    }
}

pub(super) fn p_text(p: f64) -> String {
    if p < 0.001 { "< 0.001".to_owned() } else { number(p, 3) }
}
