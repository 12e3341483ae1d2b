//! Which boxes are looked at.

use tagalong_core::DepthImage;

/// Places a side at which the depth of a box is read.
const TAPS: usize = 5;
/// Readings that a box needs to show anything.
const LEAST_READINGS: usize = 5;

/// A box in whole pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pixels {
    pub(crate) x: i64,
    pub(crate) y: i64,
    pub(crate) width: usize,
    pub(crate) height: usize,
}

/// The depth of what fills the middle of a box, m: the median of the readings
/// in its central half; `None` without enough of them.
pub(crate) fn surface_m(depth: &DepthImage, of: Pixels) -> Option<f64> {
    let mut readings = [0.0_f32; TAPS * TAPS];
    let mut count = 0;
    let tap = |from: i64, size: usize, i: usize| from + (size * (2 + i) / (TAPS + 3)) as i64;
    for row in 0..TAPS {
        for column in 0..TAPS {
            let (x, y) = (tap(of.x, of.width, column), tap(of.y, of.height, row));
            if let Some(metres) = depth.get(x, y).filter(|m| m.is_finite() && *m > 0.0) {
                readings[count] = metres;
                count += 1;
            }
        }
    }
    let readings = &mut readings[..count];
    if count < LEAST_READINGS {
        return None;
    }
    let (_, median, _) = readings.select_nth_unstable_by(count / 2, f32::total_cmp);
    Some(f64::from(*median))
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
