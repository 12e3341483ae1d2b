use maud::{Markup, html};
use tagalong_eval::{Repair, Repaired};

use super::{Page, cell, column, no_cell, optional_cell, signed, table};
use crate::chart::key;
use crate::model::TaskResult;

/// Maximum number of rows that are not folded.
const MOST_OPEN: usize = 6;

impl Page<'_> {
    /// Renders the HOTA of each task, and the gain from repairing each kind of error alone.
    pub(super) fn repairs(&self) -> Option<Markup> {
        let tasks = self.view.tasks.iter().copied();
        let tasks: Vec<&TaskResult> = tasks.filter(|task| !task.repairs.is_empty()).collect();
        if tasks.is_empty() {
            return None;
        }
        let head = html! {
            (column("Pipeline", None)) (column("Log", None)) (column("HOTA", None))
            @for repair in Repair::ALL { (column(repair.describe(), None)) }
        };
        let body = html! { @for task in &tasks { (self.repair_row(task)) } };
        let caption = html! {
            "HOTA as measured, and its gain if one kind of error alone were corrected from the truth; the largest gain in bold."
        };
        Some(html! {
            p { "The largest gain of a row shows the kind of error to work on: identities, false tracks, misses, or positions of the boxes." }
            details class="print" open[tasks.len() <= MOST_OPEN] {
                summary { "One row per pipeline, log and seed" }
                (table("Gain by repairs", &caption, &head, &body))
            }
        })
    }

    fn repair_row(&self, task: &TaskResult) -> Markup {
        let hota = task.image.or(task.metres).and_then(|scores| scores.hota);
        let largest = task.repairs.iter().filter_map(|row| gain_of(row, hota)).fold(0.0, f64::max);
        html! {
            tr {
                th scope="row" { (key(self.series(&task.pipeline), &task.pipeline)) }
                td class="log" { (task.log) }
                (optional_cell(hota, 3))
                @for repair in Repair::ALL {
                    @let row = task.repairs.iter().find(|row| row.repair == repair);
                    @match row.and_then(|row| gain_of(row, hota)) {
                        Some(gain) if gain > 0.0 && gain == largest => {
                            (cell(gain, &html! { strong { (signed(gain, 3)) } }))
                        }
                        Some(gain) => (cell(gain, &html! { (signed(gain, 3)) })),
                        None => (no_cell()),
                    }
                }
            }
        }
    }
}

/// Returns the gain in HOTA from a repair.
fn gain_of(row: &Repaired, hota: Option<f64>) -> Option<f64> {
    Some(row.hota? - hota?)
}
