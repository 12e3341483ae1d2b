//! A chart of named points, as SVG.

use std::fmt::Write as _;

/// Named points on two axes, the first of them logarithmic.
pub struct Scatter<'a> {
    /// Title of the chart.
    pub title: &'a str,
    /// Name of the logarithmic axis, with its unit.
    pub across: &'a str,
    /// Name of the other axis, with its unit; it starts at 0.
    pub up: &'a str,
    /// Name, position across (above 0), position up.
    pub points: Vec<(String, f64, f64)>,
}

const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 420.0;
/// Left, top, right, bottom.
const MARGIN: [f64; 4] = [70.0, 60.0, 130.0, 56.0];

impl Scatter<'_> {
    /// Renders the chart; points that are not finite, or not positive across, are left out.
    pub fn svg(&self) -> String {
        let points: Vec<_> = self
            .points
            .iter()
            .filter(|p| p.1.is_finite() && p.1 > 0.0 && p.2.is_finite())
            .collect();
        let low = points.iter().map(|p| p.1.log10().floor()).fold(f64::INFINITY, f64::min);
        let high = points.iter().map(|p| p.1.log10().ceil()).fold(f64::NEG_INFINITY, f64::max);
        // Headroom above the highest point.
        let top = 1.15 * points.iter().map(|p| p.2).fold(0.0, f64::max);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" \
             font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"{WIDTH}\" \
             height=\"{HEIGHT}\" fill=\"white\"/>\n"
        );
        // A single decade, or no height at all, would divide by zero.
        let frame = Frame { low, decades: (high - low).max(1.0), top: top.max(1e-9) };
        text(&mut svg, WIDTH / 2.0, 24.0, "middle", self.title);
        text(&mut svg, WIDTH / 2.0, HEIGHT - 12.0, "middle", self.across);
        text(&mut svg, 8.0, MARGIN[1] - 14.0, "start", self.up);
        if !points.is_empty() {
            frame.grid(&mut svg);
        }
        let mut labels = Vec::new();
        for (name, x, y) in points {
            let x = frame.x(x.log10());
            let y = frame.y(*y);
            let _ = writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\" fill=\"#1f6fb2\"/>");
            let label = free_place(&mut labels, (x + 9.0, y + 4.0));
            text(&mut svg, label.0, label.1, "start", name);
        }
        svg + "</svg>\n"
    }
}

/// Transformation from values to the picture.
struct Frame {
    low: f64,
    decades: f64,
    top: f64,
}

impl Frame {
    fn x(&self, log: f64) -> f64 {
        MARGIN[0] + (WIDTH - MARGIN[0] - MARGIN[2]) * (log - self.low) / self.decades
    }

    fn y(&self, value: f64) -> f64 {
        HEIGHT - MARGIN[3] - (HEIGHT - MARGIN[1] - MARGIN[3]) * value / self.top
    }

    fn grid(&self, svg: &mut String) {
        for decade in 0..=self.decades as i32 {
            let log = self.low + f64::from(decade);
            let x = self.x(log);
            line(svg, (x, MARGIN[1]), (x, HEIGHT - MARGIN[3]));
            text(svg, x, HEIGHT - MARGIN[3] + 18.0, "middle", &format!("{}", 10f64.powf(log)));
        }
        for part in 0..=4 {
            let value = self.top * f64::from(part) / 4.0;
            let y = self.y(value);
            line(svg, (MARGIN[0], y), (WIDTH - MARGIN[2], y));
            text(svg, MARGIN[0] - 8.0, y + 4.0, "end", &format!("{value:.3}"));
        }
    }
}

/// Returns a position for a label, at or below the wanted one, that no earlier label covers.
fn free_place(labels: &mut Vec<(f64, f64)>, wanted: (f64, f64)) -> (f64, f64) {
    fn covers(at: &(f64, f64), by: &(f64, f64)) -> bool {
        (at.0 - by.0).abs() < LABEL_PX.0 && (at.1 - by.1).abs() < LABEL_PX.1
    }

    let mut place = wanted;
    while labels.iter().any(|label| covers(&place, label)) {
        // Small steps keep a label near its point.
        place.1 += LABEL_PX.1 / 4.0;
    }
    labels.push(place);
    place
}

/// Width and height of a label.
const LABEL_PX: (f64, f64) = (160.0, 14.0);

fn line(svg: &mut String, from: (f64, f64), to: (f64, f64)) {
    let _ = writeln!(
        svg,
        "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"#ccc\"/>",
        from.0, from.1, to.0, to.1
    );
}

fn text(svg: &mut String, x: f64, y: f64, anchor: &str, words: &str) {
    let words = words.replace('&', "&amp;").replace('<', "&lt;");
    let _ = writeln!(
        svg,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"black\">{words}</text>"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_points_that_meet_lie_below_each_other() {
        let mut labels = Vec::new();
        let places = [10.0, 11.0, 60.0].map(|y| free_place(&mut labels, (5.0, y)).1);
        assert!(places[1] >= places[0] + LABEL_PX.1 && places[2] == 60.0, "{places:?}");
    }

    #[test]
    fn points_are_named_and_lie_in_the_picture() {
        let points = vec![("a<b".to_owned(), 0.1, 0.02), ("none".to_owned(), f64::NAN, 1.0)];
        let svg = Scatter { title: "t", across: "ms", up: "m", points }.svg();
        assert!(svg.contains("a&lt;b") && !svg.contains("none") && !svg.contains("NaN"), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 1);
        let empty = Scatter { title: "t", across: "ms", up: "m", points: vec![] }.svg();
        assert!(!empty.contains("inf") && !empty.contains("NaN"), "{empty}");
    }
}
