use maud::{Markup, html};

use super::{Axis, Plot, Scale, Words, axes, hint, mark, picture, points, px, series_class};

/// Pipeline in the plane of accuracy and time.
#[derive(Clone, Debug)]
pub struct Mark<'a> {
    /// Name of the pipeline.
    pub name: &'a str,
    /// Index among the pipelines, for colour and shape.
    pub series: usize,
    /// Time per frame, ms; lower is better.
    pub ms: f64,
    /// Accuracy; higher is better.
    pub accuracy: f64,
}

const SIZE: (f64, f64) = (760.0, 360.0);
const PLOT: Plot = Plot { left: 62.0, right: 740.0, top: 14.0, bottom: 308.0 };

/// Renders accuracy against time, with a line through the pipelines that no other beats in both
/// (the Pareto front).
pub fn front(marks: &[Mark<'_>], accuracy_name: &str, words: &Words<'_>) -> Markup {
    let x = Axis::around(Scale::Log, marks.iter().map(|m| m.ms), [PLOT.left, PLOT.right]);
    let accuracies = marks.iter().map(|m| m.accuracy);
    let y = Axis::around(Scale::Linear, accuracies, [PLOT.bottom, PLOT.top]);
    let stairs = stairs(&unbeaten(marks), |m| Some((x.at(m.ms)?, y.at(m.accuracy)?)));
    let drawn: Vec<_> =
        marks.iter().filter_map(|m| Some((m, (x.at(m.ms)?, y.at(m.accuracy)?)))).collect();
    let named: Vec<_> = drawn.iter().map(|&(m, at)| (m.name, at)).collect();
    let body = html! {
        (axes(PLOT, &x, &y, ["milliseconds per frame (median, log scale)", accuracy_name]))
        @if stairs.len() > 1 { polyline class="front" points=(points(stairs)) {} }
        @for ((m, at), (x, y, anchor)) in drawn.iter().zip(labels(&named)) {
            g.(series_class(m.series)) data-series=(m.series) {
                (mark(m.series, *at, 6.0))
                text class="label" x=(px(x)) y=(px(y)) text-anchor=(anchor) { (m.name) }
                (hint(&format!("{}: {:.3} at {:.2} ms", m.name, m.accuracy, m.ms)))
            }
        }
    };
    picture(words, SIZE, &body)
}

/// Rectangle: left, top, right, bottom.
type Box4 = [f64; 4];

/// Returns the position of each name: beside, above or below its mark, where it covers no mark and
/// no earlier name; if there is no such position, beside the mark, towards the middle.
fn labels(marks: &[(&str, (f64, f64))]) -> Vec<(f64, f64, &'static str)> {
    let mut taken: Vec<Box4> =
        marks.iter().map(|&(_, (x, y))| [x - 7.0, y - 7.0, x + 7.0, y + 7.0]).collect();
    let mut placed = Vec::new();
    for &(name, (x, y)) in marks {
        // In order of preference: a name beside its mark is the easiest to assign.
        let sides = [
            (x + 11.0, y + 4.0, "start"),
            (x - 11.0, y + 4.0, "end"),
            (x, y - 12.0, "middle"),
            (x, y + 21.0, "middle"),
            (x + 5.0, y - 12.0, "end"),
            (x + 5.0, y + 21.0, "end"),
        ];
        let right_half = x > 0.5 * (PLOT.left + PLOT.right);
        let free = sides.iter().find(|side| {
            let own = label_box(name, **side);
            let inside = own[0] >= PLOT.left && own[2] <= PLOT.right;
            inside && own[3] <= PLOT.bottom && !taken.iter().any(|other| overlap(&own, other))
        });
        let side = *free.unwrap_or(&sides[usize::from(right_half)]);
        taken.push(label_box(name, side));
        placed.push(side);
    }
    placed
}

/// Returns the approximate rectangle of a name.
fn label_box(name: &str, (x, y, anchor): (f64, f64, &str)) -> Box4 {
    // About seven units per character, because only the browser knows the width.
    let width = 7.0 * name.chars().count() as f64;
    let left = match anchor {
        "end" => x - width,
        "middle" => x - 0.5 * width,
        _ => x,
    };
    [left, y - 12.0, left + width, y + 3.0]
}

fn overlap(a: &Box4, b: &Box4) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// Returns the marks that no other beats in both time and accuracy, fastest first.
fn unbeaten<'a, 'b>(marks: &'b [Mark<'a>]) -> Vec<&'b Mark<'a>> {
    let mut sorted: Vec<&Mark<'_>> =
        marks.iter().filter(|m| m.ms.is_finite() && m.accuracy.is_finite()).collect();
    // Of equal times the most accurate comes first, so that the others fail the test.
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

/// Returns the best accuracy for each time as steps: it is constant until the next mark.
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

    #[test]
    fn names_do_not_cover_each_other() {
        let marks =
            [("alpha", (300.0, 100.0)), ("beta", (306.0, 108.0)), ("gamma", (320.0, 100.0))];
        let placed = labels(&marks);
        let boxes: Vec<_> = marks.iter().zip(placed).map(|(m, p)| label_box(m.0, p)).collect();
        assert!(!overlap(&boxes[0], &boxes[1]) && !overlap(&boxes[1], &boxes[2]));
        assert!(!overlap(&boxes[0], &boxes[2]));
    }

    proptest! {
        #[test]
        fn the_front_is_what_nobody_beats(values in prop::collection::vec((1u8..9, 0u8..9), 0..9)) {
            fn beats(a: &Mark<'_>, b: &Mark<'_>) -> bool { a.ms <= b.ms && a.accuracy >= b.accuracy
                && (a.ms, a.accuracy) != (b.ms, b.accuracy) }

            let marks: Vec<Mark<'_>> = values.iter().enumerate().map(|(series, &(ms, accuracy))| {
                Mark { name: "", series, ms: ms.into(), accuracy: accuracy.into() }
            }).collect();
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
