use std::collections::BTreeSet;

use maud::{Markup, html};

use super::Page;
use super::headline::figure_name;
use crate::figures::{ComparisonSpace, Figure};

impl Page<'_> {
    pub(super) fn explain(&self) -> Markup {
        html! {
            details class="print" { summary { "Each figure in a sentence" } dl { (figures()) } }
            div class="columns" {
                div {
                    h3 { "What the intervals mean" }
                    p {
                        "A figure is formed per log, over the seeds first, and then averaged over logs: each log counts once, however long it is. "
                        "Its 95 % interval is Student's, over logs, not frames, because frames of one recording resemble each other. "
                        "A mean of one log has none, and neither has one of logs that all show the same value: they do not tell how much others "
                        "differ. Two kinds of intervals say next to nothing and are in report.json alone: those of two logs, and, of figures between "
                        "two fixed ends, as HOTA from 0 to 1, those that leave out less than a twentieth of the values at each end. "
                        "No interval knows places of a kind that no log shows. Differences between two pipelines are formed in pairs, log by log. "
                        "Rates of people found have Wilson intervals, widened by what the logs differ in."
                    }
                }
                div {
                    h3 { "What is left out" }
                    p {
                        "People and boxes marked as ignored in the truth count neither for nor against a pipeline. Failed and skipped tasks enter no mean. "
                        "On a log without people only false reports have a meaning; the other figures are absent there."
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
        dd { "Tasks that ran to their end, of those planned." }
        dt { "People found" }
        dd { "People of the truth with a track on them in at least one frame, of all people." }
        @for figure in all {
            dt { (figure_name(figure)) " " span class="ends" { (if figure.higher_is_better { "higher is better" } else { "lower is better" }) } }
            dd { (figure.meaning) }
        }
        dt { "NIS" }
        dd {
            "Squares of a filter's surprises over their own variance. Above its bounds the filter is too sure of itself, "
            "below them too timid."
        }
    }
}
