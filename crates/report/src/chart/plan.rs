use maud::{Markup, html};

use super::{Axis, Plot, Scale, Words, axes, dashes, hint, mark, picture, points, px, track_class};
use crate::model::Trajectory;

/// Part of the floor that is drawn: a square, in metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Extent {
    x_m: [f64; 2],
    y_m: [f64; 2],
}

const SIZE: (f64, f64) = (380.0, 390.0);
const PLOT: Plot = Plot { left: 56.0, right: 370.0, top: 16.0, bottom: 330.0 };

/// Duration of a gap after which a line is interrupted, in seconds.
const PAUSE_S: f64 = 1.0;

/// Distance in the picture below which positions are drawn only once.
const NEAR: f64 = 1.5;

/// Width and height of a digit of an ID with its margin, in the picture.
const DIGIT: [f64; 2] = [8.0, 12.0];

/// Lower edges of an ID relative to the end of its track, first choice first, in the picture.
const ROWS: [f64; 4] = [-5.0, 13.0, -17.0, 25.0];

impl Extent {
    /// Returns the smallest square with a margin around all positions; `None` without any.
    pub fn around<'a>(all: impl IntoIterator<Item = &'a Trajectory>) -> Option<Self> {
        let mut places = all.into_iter().flat_map(|t| &t.points).filter(|p| drawable(p));
        let &[_, x, y] = places.next()?;
        let mut low = [x, y];
        let mut high = [x, y];
        for &[_, x, y] in places {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        }
        // Ten percent of margin; at least a metre, so that a person standing still has a scale.
        let half = 0.55 * (high[0] - low[0]).max(high[1] - low[1]).max(1.0);
        let [x_m, y_m] = [0, 1].map(|axis| {
            let centre = 0.5 * (low[axis] + high[axis]);
            [centre - half, centre + half]
        });
        Some(Self { x_m, y_m })
    }
}

/// Returns false for positions that are not finite or far beyond any floor, which would shrink all
/// others to a dot.
fn drawable(point: &[f64; 3]) -> bool {
    point.iter().all(|v| v.is_finite()) && point[1].abs().max(point[2].abs()) < 1e5
}

/// Renders a plan view: x (forward) runs up, y (left) runs left, both at the same scale. People are
/// wide pale lines, tracks are thin ones with their ID at the end.
pub fn plan(
    truth: &[Trajectory],
    tracks: &[Trajectory],
    extent: Extent,
    words: &Words<'_>,
) -> Markup {
    let ahead = Axis::new(Scale::Linear, extent.x_m, [PLOT.bottom, PLOT.top]);
    let left = Axis::new(Scale::Linear, extent.y_m, [PLOT.right, PLOT.left]);
    let mut drawn = Vec::new();
    let mut taken = Vec::new();
    for track in tracks {
        let lines = lines(track, &left, &ahead);
        let label = last_of(&lines).map(|end| Label::free(end, track.id, &mut taken));
        drawn.push((track, lines, label));
    }
    let body = html! {
        (axes(PLOT, &left, &ahead, ["y: metres to the left", "x: metres ahead"]))
        @for person in truth {
            g class="truth" {
                @for line in lines(person, &left, &ahead) { (truth_line(&line)) }
                (hint(&format!("person {}", person.id)))
            }
        }
        // Drawn after the people, so that the thin lines lie on the wide ones.
        @for (index, (track, lines, label)) in drawn.iter().enumerate() {
            @if let Some(label) = label { (track_lines(index, track, lines, label)) }
        }
    };
    picture(words, SIZE, &body)
}

fn truth_line(line: &[(f64, f64)]) -> Markup {
    html! {
        polyline class="person" points=(points(line.iter().copied())) {}
        @if let &[(x, y)] = line { circle class="place" cx=(px(x)) cy=(px(y)) r="7" {} }
    }
}

/// Returns the end of a track in the picture.
fn last_of(lines: &[Vec<(f64, f64)>]) -> Option<(f64, f64)> {
    lines.last()?.last().copied()
}

/// Position of the ID beside the end of its track.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Label {
    /// End of the track.
    end: (f64, f64),
    /// Left end of the text with its margin.
    left: f64,
    /// Lower edge of the text.
    base: f64,
    /// Width of the text with its margin.
    width: f64,
}

impl Label {
    /// Returns the first position around the end that no other ID has, so that two IDs are not read
    /// as one number: on the right and above if possible, and on the left near the right border.
    fn free(end: (f64, f64), id: i64, taken: &mut Vec<Self>) -> Self {
        let width = DIGIT[0] * id.to_string().len() as f64;
        let right = 7.0;
        let left = -7.0 - width;
        let sides = if end.0 > PLOT.right - 24.0 { [left, right] } else { [right, left] };
        for up in ROWS {
            for side in sides {
                let place = Self { end, left: end.0 + side, base: end.1 + up, width };
                if !taken.iter().any(|other| place.is_over(other)) {
                    taken.push(place);
                    return place;
                }
            }
        }
        Self { end, left: end.0 + sides[0], base: end.1 + ROWS[0], width }
    }

    fn is_over(&self, other: &Self) -> bool {
        let across = self.left < other.left + other.width && other.left < self.left + self.width;
        across && (self.base - other.base).abs() < DIGIT[1]
    }
}

fn track_lines(
    index: usize,
    track: &Trajectory,
    lines: &[Vec<(f64, f64)>],
    label: &Label,
) -> Markup {
    // The text itself is narrower than its box: it begins or ends beside the mark.
    let is_left = label.left < label.end.0;
    let (x, anchor) =
        if is_left { (label.left + label.width, "end") } else { (label.left, "start") };
    html! {
        g.(track_class(track.id)) {
            @for line in lines {
                polyline class="stroke" points=(points(line.iter().copied()))
                    stroke-dasharray=(dashes(index)) {}
            }
            (mark(index, label.end, 3.5))
            text class="label" x=(px(x)) y=(px(label.base)) text-anchor=(anchor) { (track.id) }
            (hint(&format!("track {}", track.id)))
        }
    }
}

/// Returns the parts of a trajectory between its gaps, as positions in the picture.
fn lines(trajectory: &Trajectory, left: &Axis, ahead: &Axis) -> Vec<Vec<(f64, f64)>> {
    let mut lines: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut before_s = f64::NEG_INFINITY;
    for point in trajectory.points.iter().filter(|p| drawable(p)) {
        let [t_s, x_m, y_m] = *point;
        let (Some(x), Some(y)) = (left.at(y_m), ahead.at(x_m)) else { continue };
        let goes_on = t_s - before_s <= PAUSE_S;
        before_s = t_s;
        match lines.last_mut().filter(|_| goes_on) {
            Some(line) => extend(line, (x, y)),
            None => lines.push(vec![(x, y)]),
        }
    }
    lines
}

fn extend(line: &mut Vec<(f64, f64)>, at: (f64, f64)) {
    let far = line.last().is_none_or(|last| (at.0 - last.0).hypot(at.1 - last.1) >= NEAR);
    if far {
        line.push(at);
    }
}
