use maud::{Markup, html};

use super::{Axis, Scale, px};

const WIDTH: f64 = 120.0;

/// Width of the picture of an interval beside its value.
const INTERVAL_WIDTH: f64 = 48.0;

/// Renders a bar from zero in a cell of a table; `whisker` is a second, larger value. It is hidden
/// from screen readers, because the numbers stand beside it.
pub fn bar(value: f64, whisker: Option<f64>, most: f64) -> Markup {
    let axis = Axis::new(Scale::Linear, [0.0, most], [1.0, WIDTH - 1.0]);
    let Some(end) = axis.at(value) else { return html! {} };
    let far = whisker.and_then(|w| axis.at(w));
    html! {
        svg class="inline" viewBox="0 0 120 14" width="120" height="14" aria-hidden="true" {
            rect class="bar" x="1" y="2" height="10" width=(px((end - 1.0).max(0.0))) {}
            @if let Some(far) = far {
                // A whisker below the end of the bar would have a negative length.
                line class="whisker" x1=(px(end.min(far))) x2=(px(far)) y1="7" y2="7" {}
                line class="whisker" x1=(px(far)) x2=(px(far)) y1="2" y2="12" {}
            }
        }
    }
}

/// Renders an estimate and its interval in a cell of a table, within the range of all.
pub fn interval(estimate: f64, ends: Option<[f64; 2]>, range: [f64; 2]) -> Markup {
    let axis = Axis::new(Scale::Linear, range, [6.0, INTERVAL_WIDTH - 6.0]);
    let Some(at) = axis.at(estimate) else { return html! {} };
    let ends = ends.and_then(|[low, high]| Some([axis.at(low)?, axis.at(high)?]));
    let zero = (range[0] < 0.0 && range[1] > 0.0).then(|| axis.at(0.0)).flatten();
    html! {
        svg class="beside" viewBox="0 0 48 14" width="48" height="14" aria-hidden="true" {
            line class="rail" x1="1" x2="47" y1="7" y2="7" {}
            @if let Some(zero) = zero {
                line class="zero" x1=(px(zero)) x2=(px(zero)) y1="0" y2="14" {}
            }
            @if let Some([low, high]) = ends {
                line class="whisker" x1=(px(low)) x2=(px(high)) y1="7" y2="7" {}
                @for end in [low, high] {
                    line class="whisker" x1=(px(end)) x2=(px(end)) y1="3" y2="11" {}
                }
            }
            circle class="dot" cx=(px(at)) cy="7" r="4.5" {}
        }
    }
}
