use std::collections::BTreeSet;

use maud::{Markup, html};

use super::Page;
use super::headline::figure_name;
use crate::figures::{ComparisonSpace, Figure};

impl Page<'_> {
    pub(super) fn explain(&self) -> Markup {
        html! {
            details class="print" { summary { "The figures, each in one sentence" } dl { (figures()) } }
            div class="columns" {
                div {
                    h3 { "What the intervals mean" }
                    p {
                        "A figure is computed for each log, as the mean over the seeds, and then averaged over logs: each log counts once, regardless of its length. "
                        "Its 95 % interval is Student's, over logs rather than frames, because frames of one recording resemble each other. "
                        "A mean of one log has none, and neither has a mean of equal values: they do not show how much other logs "
                        "differ. Two kinds of intervals say next to nothing and are in report.json only: those of two logs, and, for figures between "
                        "two fixed ends, such as HOTA from 0 to 1, those that leave out less than a twentieth of the range at each end. "
                        "No interval covers kinds of places that no log shows. Differences between two pipelines are computed in pairs, log by log. "
                        "Rates of people found have Wilson intervals, widened by the differences between logs."
                    }
                }
                div {
                    h3 { "What is left out" }
                    p {
                        "People and boxes marked as ignored in the truth count neither for nor against a pipeline. Failed and skipped tasks are in no mean. "
                        "On a log without people only false positives have a meaning; the other figures are absent there."
                    }
                }
                div {
                    h3 { "Where it comes from" }
                    p {
                        "HOTA, CLEAR (MOTA) and identity (IDF1) figures follow TrackEval, the log-average miss rate follows the Caltech protocol, "
                        "with matches at a similarity of 0.5. docs/reference/figures.md of the repository defines each figure. report.json and report.csv beside this page hold the same results for programs."
                    }
                }
            }
        }
    }
}

fn figures() -> Markup {
    let mut known = BTreeSet::new();
    let all = ComparisonSpace::ALL
        .into_iter()
        .flat_map(Figure::at)
        // Figures that occur in both spaces are explained once.
        .filter(|f| known.insert(f.name))
        .collect::<Vec<_>>();
    html! {
        dt { "Done" }
        dd { "Tasks that were completed, of those planned." }
        dt { "People found" }
        dd { "People of the truth with a track on them in at least one frame, of all people." }
        @for figure in all {
            dt { (figure_name(figure)) " " span class="ends" { (if figure.higher_is_better { "higher is better" } else { "lower is better" }) } }
            dd { (figure.meaning) }
        }
        dt { "NIS" }
        dd {
            "Normalised innovation squared of the filter. Above its bounds the filter is overconfident, below them underconfident."
        }
    }
}
