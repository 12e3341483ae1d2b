//! Which boxes are looked at.

use tagalong_core::Rect;

/// A box in whole pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pixels {
    pub(crate) x: i64,
    pub(crate) y: i64,
    pub(crate) width: usize,
    pub(crate) height: usize,
}

impl Pixels {
    pub(crate) fn rect(self) -> Rect {
        Rect::new(self.x as f64, self.y as f64, self.width as f64, self.height as f64)
    }
}

/// Offsets in a disc, nearest rows first come first, every `step` pixels.
pub(crate) fn disc(radius: f64, step: i64) -> impl Iterator<Item = (i64, i64)> {
    let step = step.max(1);
    let reach = (radius.max(0.0) as i64 / step).min(200);
    let places = move |i: i64| (-reach..=reach).map(move |j| (j * step, i * step));
    let inside = move |(x, y): &(i64, i64)| ((x * x + y * y) as f64) <= radius * radius;
    (-reach..=reach).flat_map(places).filter(inside)
}

/// `count` offsets spread evenly over a ring: a spiral in steps of the golden
/// angle.
pub(crate) fn ring(from: f64, to: f64, count: usize) -> impl Iterator<Item = (i64, i64)> {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    (0..count).map(move |i| {
        let part = (i as f64 + 0.5) / count as f64;
        let radius = (from * from + part * (to * to - from * from)).sqrt();
        let (sin, cos) = (GOLDEN_ANGLE * i as f64).sin_cos();
        ((radius * cos).round() as i64, (radius * sin).round() as i64)
    })
}
