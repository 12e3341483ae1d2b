use maud::{Markup, html};
use tagalong_eval::{CurvePoint, REFERENCE_FPPI};

use super::{
    Axis, Plot, Scale, Words, axes, dashes, hint, mark, picture, points, px, series_class,
};

/// Miss-rate curve of a pipeline.
#[derive(Clone, Debug)]
pub struct Curve<'a> {
    /// Name of the pipeline.
    pub name: &'a str,
    /// Index among the pipelines.
    pub series: usize,
    /// Points of the curve, in any order.
    pub points: &'a [CurvePoint],
}

const SIZE: (f64, f64) = (480.0, 300.0);
const PLOT: Plot = Plot { left: 58.0, right: 468.0, top: 12.0, bottom: 250.0 };

/// False positives per image below which a curve is drawn at the edge: few logs are long enough to
/// measure lower values.
const LEAST_FPPI: f64 = 1e-3;

/// Renders miss rate against false positives per image, one line per pipeline. The band is the
/// range in which the log-average miss rate reads the curve.
pub fn miss_rate(curves: &[Curve<'_>], words: &Words<'_>) -> Markup {
    let reference = [REFERENCE_FPPI[0], REFERENCE_FPPI[8]];
    let most = curves.iter().flat_map(|c| c.points).map(|p| p.fppi).filter(|v| v.is_finite());
    let range = [LEAST_FPPI, most.fold(reference[1], f64::max)];
    let x = Axis::new(Scale::Log, range, [PLOT.left, PLOT.right]);
    let y = Axis::new(Scale::Linear, [0.0, 1.0], [PLOT.bottom, PLOT.top]);
    let band = [x.at(reference[0]), x.at(reference[1])].map(Option::unwrap_or_default);
    let body = html! {
        rect class="band" x=(px(band[0])) width=(px(band[1] - band[0]))
            y=(px(PLOT.top)) height=(px(PLOT.bottom - PLOT.top)) {}
        (axes(PLOT, &x, &y, ["false positives per image (log scale)", "miss rate"]))
        @for curve in curves { (line(curve, &x, &y)) }
    };
    picture(words, SIZE, &body)
}

fn line(curve: &Curve<'_>, x: &Axis, y: &Axis) -> Markup {
    let steps = steps(curve.points, x, y);
    let Some(&end) = steps.last() else { return html! {} };
    html! {
        g.(series_class(curve.series)) data-series=(curve.series) {
            polyline class="stroke" points=(points(steps))
                stroke-dasharray=(dashes(curve.series)) {}
            (mark(curve.series, end, 4.0))
            (hint(curve.name))
        }
    }
}

/// Returns the steps of a curve: the miss rate is constant until a lower score adds the next false
/// positive. Steps smaller than a dot are left out.
fn steps(curve: &[CurvePoint], x: &Axis, y: &Axis) -> Vec<(f64, f64)> {
    let mut sorted: Vec<&CurvePoint> = curve.iter().collect();
    sorted.sort_by(|a, b| a.fppi.total_cmp(&b.fppi).then(b.miss_rate.total_cmp(&a.miss_rate)));
    let places: Vec<(f64, f64)> =
        sorted.iter().filter_map(|p| Some((x.at(p.fppi)?, y.at(p.miss_rate)?))).collect();
    let mut line: Vec<(f64, f64)> = Vec::new();
    for (index, &at) in places.iter().enumerate() {
        let Some(&before) = line.last() else {
            line.push(at);
            continue;
        };
        // The last point is never left out, because the mark of the series is drawn there.
        let last = index + 1 == places.len();
        if last || (at.0 - before.0).hypot(at.1 - before.1) >= 1.0 {
            line.push((at.0, before.1));
            line.push(at);
        }
    }
    line
}
