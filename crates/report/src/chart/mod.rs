//! Charts as SVG: scales, marks and the surrounding frame.
//!
//! Every chart is a function from numbers to markup. Colours are classes, so that the style sheet
//! defines them for light mode, dark mode and print. Series also differ by the shape of their marks
//! and by dashes, never by colour alone.

mod axis;
mod curves;
mod inline;
mod plan;
mod scatter;

use maud::{Markup, html};

pub use axis::{Axis, Scale, minus};
pub use curves::{Curve, miss_rate};
pub use inline::{bar, interval};
pub use plan::{Extent, plan};
pub use scatter::{Mark, front};

/// Number of series that look different.
pub const SERIES: usize = 8;

/// Returns the class that colours a series.
pub fn series_class(index: usize) -> String {
    format!("s{}", index % SERIES)
}

/// Number of colours of tracks, which differ from those of pipelines.
const TRACK_COLOURS: i64 = 20;

/// Returns the class that colours a track, the same as in pictures and pages of runs.
pub fn track_class(id: i64) -> String {
    format!("t{}", id.rem_euclid(TRACK_COLOURS))
}

/// Returns the dashes of a series; a second round of colours gets other dashes.
pub fn dashes(index: usize) -> &'static str {
    ["none", "7 3", "2 3", "9 3 2 3"][(index + index / SERIES) % 4]
}

/// Formats a length or a position in the units of a chart, as short as possible.
pub fn px(value: f64) -> String {
    let text = format!("{value:.1}");
    let text = text.strip_suffix(".0").unwrap_or(&text);
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Corners of the marks of the series, for a radius of one.
const SHAPES: [&[(f64, f64)]; 6] = [
    &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
    &[(0.0, -1.2), (1.1, 0.8), (-1.1, 0.8)],
    &[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)],
    &[(0.0, 1.2), (1.1, -0.8), (-1.1, -0.8)],
    &[(-0.5, -1.1), (0.5, -1.1), (1.1, 0.0), (0.5, 1.1), (-0.5, 1.1), (-1.1, 0.0)],
    &[(-1.2, -0.5), (1.2, -0.5), (1.2, 0.5), (-1.2, 0.5)],
];

/// Renders the mark of a series at a position, with a radius.
pub fn mark(index: usize, (x, y): (f64, f64), radius: f64) -> Markup {
    // The first shape is a circle; `SHAPES` holds the others.
    let shape = index % (SHAPES.len() + 1);
    let Some(corners) = shape.checked_sub(1).map(|at| SHAPES[at]) else {
        return html! { circle class="mark" cx=(px(x)) cy=(px(y)) r=(px(radius)) {} };
    };
    let corners = corners.iter().map(|&(dx, dy)| (x + dx * radius, y + dy * radius));
    html! { polygon class="mark" points=(points(corners)) {} }
}

/// Formats positions as the `points` of a polygon or a line.
pub fn points(places: impl IntoIterator<Item = (f64, f64)>) -> String {
    let texts: Vec<String> =
        places.into_iter().map(|(x, y)| format!("{},{}", px(x), px(y))).collect();
    texts.join(" ")
}

/// Renders a series in a legend: its line, its mark and its name.
pub fn key(index: usize, name: &str) -> Markup {
    html! {
        span.key.(series_class(index)) data-series=(index) {
            svg class="swatch" viewBox="0 0 26 12" width="26" height="12" aria-hidden="true" {
                line class="stroke" x1="0" y1="6" x2="26" y2="6" stroke-dasharray=(dashes(index)) {}
                (mark(index, (13.0, 6.0), 4.0))
            }
            " " (name)
        }
    }
}

/// Texts of a chart for screen readers.
pub struct Words<'a> {
    /// Name of the chart.
    pub title: &'a str,
    /// Content of the chart, as a sentence.
    pub says: &'a str,
}

/// Renders an image of `width` times `height` units; the page scales it.
pub fn picture(words: &Words<'_>, (width, height): (f64, f64), body: &Markup) -> Markup {
    let label = format!("{}. {}", words.title, words.says);
    html! {
        svg class="chart" role="img" aria-label=(label)
            viewBox=(format!("0 0 {} {}", px(width), px(height))) { (body) }
    }
}

/// Area of a chart for the data, within margins for the labels of the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plot {
    pub left: f64,
    pub right: f64,
    pub top: f64,
    pub bottom: f64,
}

/// Renders grid, ticks and names of two axes; `x` runs right and `y` runs up.
pub fn axes(plot: Plot, x: &Axis, y: &Axis, [x_name, y_name]: [&str; 2]) -> Markup {
    let middle = 0.5 * (plot.top + plot.bottom);
    html! {
        g class="axes" {
            @for (value, at) in x.ticks() {
                line class="grid" x1=(px(at)) x2=(px(at)) y1=(px(plot.top)) y2=(px(plot.bottom)) {}
                text x=(px(at)) y=(px(plot.bottom + 16.0)) text-anchor="middle" { (value) }
            }
            @for (value, at) in y.ticks() {
                line class="grid" x1=(px(plot.left)) x2=(px(plot.right)) y1=(px(at)) y2=(px(at)) {}
                text x=(px(plot.left - 6.0)) y=(px(at + 4.0)) text-anchor="end" { (value) }
            }
            text class="name" x=(px(plot.right)) y=(px(plot.bottom + 33.0)) text-anchor="end" { (x_name) }
            text class="name" x="12" y=(px(middle)) text-anchor="middle"
                transform=(format!("rotate(-90 12 {})", px(middle))) { (y_name) }
        }
    }
}

/// Renders a hint that appears over a mark.
pub fn hint(text: &str) -> Markup {
    html! { title { (text) } }
}

#[cfg(test)]
mod tests;
