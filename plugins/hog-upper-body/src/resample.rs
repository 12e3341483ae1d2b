//! Images in other sizes.

use tagalong_core::GreyImage;

/// Weights of the source pixels from `start` on.
struct Taps {
    start: i64,
    weights: Vec<f32>,
}

/// `width` by `height` samples of an image, `step` of its pixels apart, the first
/// one centred half a step right of and below `origin` (pixel edges). Each is a
/// triangular mean as wide as the step, so that small sizes do not alias;
/// outside the image its border goes on.
pub fn resampled(
    image: &GreyImage,
    origin: (f64, f64),
    step: f64,
    width: usize,
    height: usize,
) -> Vec<f32> {
    if image.width() == 0 || image.height() == 0 {
        return vec![0.0; width * height];
    }
    let columns = taps(origin.0, step, width);
    let rows = taps(origin.1, step, height);
    let top = rows.iter().map(|taps| taps.start).min().unwrap_or(0);
    let bottom = rows.iter().map(|taps| taps.start + taps.weights.len() as i64).max().unwrap_or(0);
    let narrow = squeezed(image, &columns, top..bottom);
    let mut out = vec![0.0_f32; width * height];
    for (line, taps) in out.chunks_exact_mut(width.max(1)).zip(&rows) {
        for (y, weight) in (taps.start - top..).zip(&taps.weights) {
            let source = &narrow[y as usize * width..][..width];
            line.iter_mut().zip(source).for_each(|(sum, value)| *sum += weight * value);
        }
    }
    out
}

/// The rows of an image with their columns resampled.
fn squeezed(image: &GreyImage, columns: &[Taps], rows: std::ops::Range<i64>) -> Vec<f32> {
    let (last_column, last_row) = (image.width() as i64 - 1, image.height() as i64 - 1);
    let mut narrow = Vec::with_capacity(columns.len() * (rows.end - rows.start) as usize);
    for y in rows {
        let row = image.row(y.clamp(0, last_row) as usize);
        narrow.extend(columns.iter().map(|taps| {
            let end = taps.start + taps.weights.len() as i64;
            if taps.start >= 0 && end <= last_column + 1 {
                let source = &row[taps.start as usize..end as usize];
                return source.iter().zip(&taps.weights).map(|(v, w)| w * f32::from(*v)).sum();
            }
            let at = |x: i64| f32::from(row[x.clamp(0, last_column) as usize]);
            (taps.start..).zip(&taps.weights).map(|(x, w)| w * at(x)).sum::<f32>()
        }));
    }
    narrow
}

fn taps(origin: f64, step: f64, count: usize) -> Vec<Taps> {
    let reach = step.max(1.0);
    (0..count)
        .map(|i| {
            let centre = origin + (i as f64 + 0.5) * step - 0.5;
            let (start, end) = ((centre - reach).ceil() as i64, (centre + reach).floor() as i64);
            let weight = |x: i64| (1.0 - (x as f64 - centre).abs() / reach).max(0.0);
            let total: f64 = (start..=end).map(weight).sum();
            let weights = (start..=end).map(|x| (weight(x) / total) as f32).collect();
            Taps { start, weights }
        })
        .collect()
}
