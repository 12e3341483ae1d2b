use maud::{Markup, html};
use tagalong_math::{counted, draws_needed};

use super::pairs::p_text;
use super::{Page, cell, column, no_cell, number, table, was_skipped};
use crate::chart::{interval, key, series_class};
use crate::figures::{ComparisonSpace, Figure, MAIN};
use crate::model::copies_note;
use crate::summary::{Estimate, PairSummary, PipelineSummary, per_log};

impl Page<'_> {
    pub(super) fn headline(&self) -> Markup {
        if self.view.tasks.is_empty() {
            return html! { p { "This benchmark has no tasks yet." } };
        }
        let shown: Vec<ComparisonSpace> =
            ComparisonSpace::ALL.into_iter().filter(|p| self.has(*p)).collect();
        let skipped = self.summary.pipelines.iter().filter(|p| was_skipped(p)).count();
        html! {
            @if let Some(verdict) = self.verdict() { p class="verdict" { (verdict) } }
            @if shown.is_empty() { p { "No task has been compared with a truth, so there are no figures." } }
            @for note in self.view.notes { p class="bad" { "Note: " (note) @if !note.ends_with('?') { "." } } }
            @for logs in self.view.copies { p class="bad" { (copies_note(logs)) "." } }
            @if skipped > 0 {
                p {
                    (counted(skipped, "pipeline")) " that no log suits " (if skipped == 1 { "is" } else { "are" })
                    " left out: " a href="#failed" { "the reasons" } "."
                }
            }
            @for place in shown {
                h3 { (place_name(place)) }
                (self.headline_table(place))
                (self.log_table(place))
            }
        }
    }

    fn has(&self, place: ComparisonSpace) -> bool {
        self.view.tasks.iter().any(|task| place.scores(task).is_some())
    }

    /// Names the pipeline with the best main figure, and states whether the difference is
    /// significant.
    fn verdict(&self) -> Option<Markup> {
        let place = ComparisonSpace::ALL.into_iter().find(|p| self.ranked(*p).len() > 1)?;
        let ranked = self.ranked(place);
        let first = ranked.first()?;
        let second = ranked.get(1)?;
        let key = MAIN.key(place);
        let names = [&first.0.pipeline, &second.0.pipeline];
        let pair = self
            .summary
            .pairs
            .iter()
            .find(|p| p.figure == key && names.contains(&&p.a) && names.contains(&&p.b));
        let left_out = self
            .summary
            .pipelines
            .iter()
            .any(|p| p.figures.get(&key).is_some_and(|e| e.logs < first.1.logs));
        Some(html! {
            @if left_out { "Of the pipelines with " (counted(first.1.logs, "log")) ", " }
            strong { (first.0.pipeline) } " has the highest " (MAIN.name) " " (place_where(place)) ", "
            (number(first.1.mean, 3)) ", then " strong { (second.0.pipeline) } " with "
            (number(second.1.mean, 3)) ". "
            @if let Some(pair) = pair.filter(|pair| pair.is_clear()) {
                "The difference is clear (" (p_of(pair)) ")."
            } @else if let Some(pair) = pair {
                "These logs do not tell the two apart (" (p_of(pair)) ", "
                (counted(pair.logs, "log")) " in common)."
                @if let Some(why) = self.too_few_logs(pair) { " " (why) "." }
            } @else { "No log in common tells the two apart." }
            @if let Some(why) = self.why_of_pair(&first.0.pipeline, &second.0.pipeline) { " " (why) "." }
        })
    }

    /// Returns a remark that a pair has too few common logs for a significant difference, if so.
    fn too_few_logs(&self, pair: &PairSummary) -> Option<String> {
        let pairs = self.summary.pairs_by(&pair.figure);
        let needed = draws_needed(pairs);
        ((pair.logs as usize) < needed).then(|| {
            format!(
                "With {} and {} no difference can be clear: {needed} logs are needed",
                counted(pair.logs, "log"),
                counted(pairs, "pair")
            )
        })
    }

    /// Returns the pipelines with the most logs, best first.
    fn ranked(&self, place: ComparisonSpace) -> Vec<(&PipelineSummary, Estimate)> {
        let key = MAIN.key(place);
        let pipelines = self.summary.pipelines.iter();
        let mut all: Vec<(&PipelineSummary, Estimate)> =
            pipelines.filter_map(|p| Some((p, *p.figures.get(&key)?))).collect();
        // A mean over fewer logs, which may be the easier ones, is not comparable.
        let most = all.iter().map(|(_, e)| e.logs).max().unwrap_or(0);
        all.retain(|(_, e)| e.logs == most);
        all.sort_by(|a, b| b.1.mean.total_cmp(&a.1.mean));
        all
    }

    fn headline_table(&self, place: ComparisonSpace) -> Markup {
        let figures: Vec<&Figure> = Figure::at(place).filter(|f| self.is_known(f, place)).collect();
        let most = self.summary.pipelines.iter().map(|p| p.done).max().unwrap_or(0);
        let most_logs = self.summary.pipelines.iter().map(|p| logs_of(p, place)).max().unwrap_or(0);
        let head = html! {
            (column("Pipeline", None))
            (column("Done", Some("Tasks that were completed, of those planned")))
            @if place == ComparisonSpace::Image { (column("People found", Some("People found in at least one frame, with 95 % interval"))) }
            @for figure in &figures { (figure_head(figure)) }
        };
        let body = html! {
            @for summary in self.summary.pipelines.iter().filter(|p| !was_skipped(p)) {
                tr.(series_class(self.series(&summary.pipeline))) data-series=(self.series(&summary.pipeline)) {
                    th scope="row" { (key(self.series(&summary.pipeline), &summary.pipeline)) }
                    (done_cell(summary, most, [logs_of(summary, place), most_logs]))
                    @if place == ComparisonSpace::Image { (people_cell(summary)) }
                    @for figure in &figures { (self.figure_cell(summary, figure, place)) }
                }
            }
        };
        let caption = html! {
            "Means over logs, " (place_where(place))
            @if self.view.logs.len() as u64 >= LEAST_LOGS { ", below each its 95\u{a0}% interval" }
            ". "
            span class="best" { "★ best" } " of the pipelines with the most logs."
        };
        table(&format!("Results {}", place_where(place)), &caption, &head, &body)
    }

    fn is_known(&self, figure: &Figure, place: ComparisonSpace) -> bool {
        let key = figure.key(place);
        self.summary.pipelines.iter().any(|p| p.figures.contains_key(&key))
    }

    fn figure_cell(
        &self,
        summary: &PipelineSummary,
        figure: &Figure,
        place: ComparisonSpace,
    ) -> Markup {
        let key = figure.key(place);
        let Some(estimate) = summary.figures.get(&key) else { return no_cell() };
        let all: Vec<&Estimate> =
            self.summary.pipelines.iter().filter_map(|p| p.figures.get(&key)).collect();
        // The column "Done" shows that a pipeline has fewer logs than others, once for all figures.
        let is_of_fewer = estimate.logs < logs_of(summary, place);
        // One picture per row is enough, for the figure that ranks the pipelines.
        let picture = (figure.name == MAIN.name)
            .then(|| interval(estimate.mean, shown_interval(estimate), range(&all)));
        cell(
            estimate.mean,
            &html! {
                (starred(estimate.mean, figure.decimals, estimate.best))
                @if is_of_fewer { " " span class="fewer" { (counted(estimate.logs, "log")) } }
                @if let Some(picture) = picture { (picture) }
                @if let Some(ends) = shown_interval(estimate).filter(|ends| informs(ends, figure.range)) {
                    " " (labelled_ends(ends, figure.decimals))
                }
            },
        )
    }

    /// Renders the main figure of each pipeline on each log.
    fn log_table(&self, place: ComparisonSpace) -> Markup {
        let columns: Vec<_> =
            self.tried().map(|(rank, p)| (rank, p, per_log(&self.view, p, MAIN, place))).collect();
        let logs = self
            .view
            .logs
            .iter()
            .filter(|log| columns.iter().any(|(_, _, v)| v.contains_key(*log)));
        let head = html! {
            (column("Log", None))
            @for (rank, name, _) in &columns { (self.column_of(*rank, name)) }
        };
        let body = html! {
            @for log in logs {
                @let known = columns.iter().filter_map(|(_, _, values)| values.get(log).copied());
                @let best = known.fold(f64::NEG_INFINITY, f64::max);
                tr {
                    th scope="row" { (log) }
                    @for (_, _, values) in &columns { (log_cell(values.get(log).copied(), best, columns.len())) }
                }
            }
        };
        let name = format!("{} of each log {}", MAIN.name, place_where(place));
        html! {
            details class="print" {
                summary { (name) }
                (table(&name, &html! { (name) ", mean over seeds." }, &head, &body))
            }
        }
    }
}

fn log_cell(value: Option<f64>, best: f64, columns: usize) -> Markup {
    let Some(value) = value else { return no_cell() };
    // In a single column nothing is best, and a pipeline without a match is never best.
    let best = columns > 1 && value > 0.0 && !MAIN.better_as_printed(best, value);
    cell(value, &starred(value, MAIN.decimals, best))
}

/// Renders a value, with a star if it is the best one.
fn starred(value: f64, decimals: usize, is_best: bool) -> Markup {
    html! {
        span class=(if is_best { "value best" } else { "value" }) {
            @if is_best { "★ " } (number(value, decimals)) @if is_best { span class="unseen" { " best" } }
        }
    }
}

fn figure_head(figure: &Figure) -> Markup {
    let arrow = if figure.higher_is_better { "↑" } else { "↓" };
    let way = if figure.higher_is_better { "higher is better" } else { "lower is better" };
    html! {
        th scope="col" title=(format!("{} ({way})", short_title(figure.meaning))) {
            (figure_name(figure)) " " span aria-hidden="true" { (arrow) }
            span class="unseen" { " " (way) }
        }
    }
}

/// Returns the first clause, because hints should be short.
fn short_title(meaning: &str) -> &str {
    meaning.split(['.', ';', ',']).next().unwrap_or(meaning)
}

/// Returns the heading of a figure: short, with its unit.
pub(super) fn figure_name(figure: &Figure) -> String {
    let name = match figure.name {
        "inherited_ids" => "Inherited IDs",
        "fp_per_frame" => "FP / frame",
        "time_to_confirm_mean_s" => "To confirm",
        "wrong_person_s" => "Wrong person",
        "position_error_mean_m" => "Position error",
        name => name,
    };
    if figure.unit.is_empty() { name.to_owned() } else { format!("{name} [{}]", figure.unit) }
}

/// Returns the number of logs of the main figure.
fn logs_of(summary: &PipelineSummary, place: ComparisonSpace) -> u64 {
    summary.figures.get(&MAIN.key(place)).map_or(0, |estimate| estimate.logs)
}

fn done_cell(summary: &PipelineSummary, most: u64, [logs, most_logs]: [u64; 2]) -> Markup {
    let planned = summary.done + summary.failed + summary.skipped;
    let class = if summary.done < most || summary.failed > 0 { "number fewer" } else { "number" };
    html! {
        td class=(class) data-value=(summary.done) {
            (summary.done) " / " (planned)
            @if logs < most_logs && logs != summary.done { " " span class="fewer" { (counted(logs, "log")) } }
        }
    }
}

fn people_cell(summary: &PipelineSummary) -> Markup {
    let Some(found) = summary.people_found else { return no_cell() };
    let count = summary.people_found_count().unwrap_or_default();
    cell(
        found.estimate,
        &html! {
            span class="value" { (count) " of " (summary.people) }
            @if let Some(ends) = found.ends().filter(|ends| informs(ends, SHARE)) { " " (labelled_ends(ends, 2)) }
        },
    )
}

/// Range of a fraction.
const SHARE: [f64; 2] = [0.0, 1.0];
/// Minimum part of the range of a figure that an interval must exclude at one end to be worth
/// showing in a cell.
const LEAST_INFORMATION: f64 = 0.05;

/// Minimum number of logs for which the interval of a mean is shown: that of two logs is 25 times
/// as wide as its standard error, and hides the figures beside it.
const LEAST_LOGS: u64 = 3;

/// Returns the interval of a mean over enough logs.
fn shown_interval(estimate: &Estimate) -> Option<[f64; 2]> {
    estimate.interval.filter(|_| estimate.logs >= LEAST_LOGS)
}

/// Returns false for an interval that covers nearly all possible values of the figure. If the range
/// has no end, as for a count, it always excludes some.
fn informs(ends: &[f64; 2], [least, most]: [f64; 2]) -> bool {
    let least_part = LEAST_INFORMATION * (most - least);
    !least_part.is_finite() || ends[0] > least + least_part || ends[1] < most - least_part
}

/// Renders the ends of an interval below the value of a cell.
fn labelled_ends(ends: [f64; 2], decimals: usize) -> Markup {
    html! { span class="ends" { span class="level" { "95\u{a0}%: " } (span_of(ends, decimals)) } }
}

pub(super) fn ends_of([low, high]: [f64; 2], decimals: usize) -> Markup {
    html! { span class="ends" { (span_of([low, high], decimals)) } }
}

/// Formats two ends as one text; a dash beside a negative number would look like a sign.
pub(super) fn span_of([low, high]: [f64; 2], decimals: usize) -> String {
    let between = if low < 0.0 || high < 0.0 { " to " } else { "–" };
    format!("{}{between}{}", number(low, decimals), number(high, decimals))
}

/// Returns both p-values of a pair if they differ, as in the table of pairs.
fn p_of(pair: &PairSummary) -> String {
    let [alone, corrected] = [pair.p_value, pair.p_corrected].map(p_equals);
    if alone == corrected {
        format!("p {alone}")
    } else {
        format!("p {alone} for this pair alone, p {corrected} corrected for all pairs")
    }
}

fn p_equals(p: f64) -> String {
    let text = p_text(p);
    if text.starts_with('<') { text } else { format!("= {text}") }
}

/// Returns the range from the lowest to the highest end of all intervals, including zero.
fn range(all: &[&Estimate]) -> [f64; 2] {
    let ends = all
        .iter()
        .flat_map(|e| shown_interval(e).unwrap_or([e.mean, e.mean]).into_iter().chain([e.mean]));
    ends.fold([0.0, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)])
}

pub(super) const fn place_name(place: ComparisonSpace) -> &'static str {
    match place {
        ComparisonSpace::Image => "In the image (overlap of boxes)",
        ComparisonSpace::Floor => "On the floor (metres)",
    }
}

pub(super) const fn place_where(place: ComparisonSpace) -> &'static str {
    match place {
        ComparisonSpace::Image => "in the image",
        ComparisonSpace::Floor => "on the floor",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_pipeline_with_a_match_is_the_best_on_a_log() {
        for (value, best, columns, is_best, why) in [
            (0.0, 0.0, 3, false, "no pipeline has a match"),
            (0.001, 0.0, 3, true, "the best"),
            (0.8151, 0.8154, 3, true, "both are printed as 0.815"),
            (0.814, 0.8154, 3, false, "another is better"),
            (0.5, 0.0, 1, false, "no rival"),
        ] {
            let cell = log_cell(Some(value), best, columns).into_string();
            assert_eq!(cell.contains('★'), is_best, "{why}");
        }
    }

    #[test]
    fn an_interval_of_nearly_all_values_is_left_out_of_a_cell_and_that_of_a_count_is_not() {
        assert!(!informs(&[0.02, 0.99], SHARE));
        assert!(informs(&[0.02, 0.9], SHARE) && informs(&[0.2, 1.0], SHARE));
        assert!(informs(&[0.0, 3.2], [0.0, f64::INFINITY]), "ID switches");
    }
}
