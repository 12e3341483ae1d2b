use maud::{Markup, html};

use super::{Axis, Plot, Scale, Words, axes, hint, mark, picture, points, px, series_class};

/// A pipeline in the plane of accuracy and time.
#[derive(Clone, Debug)]
pub struct Mark<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its number among the pipelines, for colour and shape.
    pub series: usize,
    /// Milliseconds per frame; less is better.
    pub ms: f64,
    /// Accuracy; more is better.
    pub accuracy: f64,
}

const SIZE: (f64, f64) = (760.0, 360.0);
const PLOT: Plot = Plot { left: 62.0, right: 740.0, top: 14.0, bottom: 308.0 };

/// Accuracy over time, and the line of those that no other beats in both.
pub fn front(marks: &[Mark<'_>], accuracy_name: &str, words: &Words<'_>) -> Markup {
    let x = Axis::around(Scale::Log, marks.iter().map(|m| m.ms), [PLOT.left, PLOT.right]);
    let accuracies = marks.iter().map(|m| m.accuracy);
    let y = Axis::around(Scale::Linear, accuracies, [PLOT.bottom, PLOT.top]);
    let place = |m: &Mark<'_>| Some((x.at(m.ms)?, y.at(m.accuracy)?));
    let stairs = stairs(&unbeaten(marks), place);
    let body = html! {
        (axes(PLOT, &x, &y, ["milliseconds per frame (median, log scale)", accuracy_name]))
        @if stairs.len() > 1 { polyline class="front" points=(points(stairs)) {} }
        @for m in marks {
            @if let Some(at) = place(m) {
                g.(series_class(m.series)) data-series=(m.series) {
                    (mark(m.series, at, 6.0))
                    (label(m.name, at))
                    (hint(&format!("{}: {:.3} at {:.2} ms", m.name, m.accuracy, m.ms)))
                }
            }
        }
    };
    picture(words, SIZE, &body)
}

/// The name beside a mark, on the side with more room.
fn label(name: &str, (x, y): (f64, f64)) -> Markup {
    let left = x > 0.5 * (PLOT.left + PLOT.right);
    let (dx, anchor) = if left { (-11.0, "end") } else { (11.0, "start") };
    html! { text class="label" x=(px(x + dx)) y=(px(y + 4.0)) text-anchor=(anchor) { (name) } }
}

/// Those that no other beats in both, fastest first.
fn unbeaten<'a, 'b>(marks: &'b [Mark<'a>]) -> Vec<&'b Mark<'a>> {
    let mut sorted: Vec<&Mark<'_>> =
        marks.iter().filter(|m| m.ms.is_finite() && m.accuracy.is_finite()).collect();
    sorted.sort_by(|a, b| a.ms.total_cmp(&b.ms).then(b.accuracy.total_cmp(&a.accuracy)));
    let mut best = f64::NEG_INFINITY;
    sorted.retain(|m| {
        m.accuracy > best && {
            best = m.accuracy;
            true
        }
    });
    sorted
}

/// What can be had at each time: it stays level until the next one is in reach.
fn stairs(front: &[&Mark<'_>], place: impl Fn(&Mark<'_>) -> Option<(f64, f64)>) -> Vec<(f64, f64)> {
    let mut line: Vec<(f64, f64)> = Vec::new();
    for at in front.iter().filter_map(|m| place(m)) {
        line.extend(line.last().map(|&(_, y)| (at.0, y)));
        line.push(at);
    }
    line.extend(line.last().map(|&(_, y)| (PLOT.right, y)));
    line
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_front_is_what_nobody_beats(values in prop::collection::vec((1u8..9, 0u8..9), 0..9)) {
            let marks: Vec<Mark<'_>> = values.iter().enumerate().map(|(series, &(ms, accuracy))| {
                Mark { name: "", series, ms: ms.into(), accuracy: accuracy.into() }
            }).collect();
            let beats = |a: &Mark<'_>, b: &Mark<'_>| a.ms <= b.ms && a.accuracy >= b.accuracy
                && (a.ms, a.accuracy) != (b.ms, b.accuracy);
            let mut slow: Vec<_> = marks.iter()
                .filter(|m| !marks.iter().any(|other| beats(other, m)))
                .map(|m| (m.ms as u8, m.accuracy as u8)).collect();
            slow.sort_unstable();
            slow.dedup();
            let fast: Vec<_> =
                unbeaten(&marks).iter().map(|m| (m.ms as u8, m.accuracy as u8)).collect();
            prop_assert_eq!(fast, slow);
        }
    }
}
