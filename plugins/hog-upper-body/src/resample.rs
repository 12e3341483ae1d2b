//! Images in other sizes.

use std::ops::Range;

use tagalong_core::GreyImage;

/// Weights of the source pixels that a sample is the mean of.
#[derive(Clone, Debug, Default)]
struct Taps {
    /// The first source pixel of each sample, and where its weights begin.
    starts: Vec<(i64, usize)>,
    weights: Vec<f32>,
}

impl Taps {
    /// `count` samples, `step` pixels apart, the first one centred half a step
    /// behind `origin`.
    fn fill(&mut self, origin: f64, step: f64, count: usize) {
        self.starts.clear();
        self.weights.clear();
        let reach = step.max(1.0);
        for i in 0..count {
            let centre = origin + (i as f64 + 0.5) * step - 0.5;
            let (start, end) = ((centre - reach).ceil() as i64, (centre + reach).floor() as i64);
            let weight = |x: i64| (1.0 - (x as f64 - centre).abs() / reach).max(0.0);
            let total: f64 = (start..=end).map(weight).sum();
            self.starts.push((start, self.weights.len()));
            self.weights.extend((start..=end).map(|x| (weight(x) / total) as f32));
        }
    }

    fn each(&self) -> impl Iterator<Item = (i64, &[f32])> {
        let ends = self.starts.iter().skip(1).map(|(_, from)| *from);
        let ends = ends.chain(std::iter::once(self.weights.len()));
        self.starts.iter().zip(ends).map(|((start, from), to)| (*start, &self.weights[*from..to]))
    }
}

/// Rows of the result that are made at once.
const LANES: usize = 8;

/// Brings images to other sizes; keeps its memory from one to the next.
#[derive(Clone, Debug, Default)]
pub struct Resampler {
    columns: Taps,
    rows: Taps,
    /// A row of the result in all columns of the source that matter.
    tall: Vec<f32>,
    /// The same of several rows, side by side for each column.
    beside: Vec<[f32; LANES]>,
    /// Samples of these rows, side by side for each column of the result.
    across: Vec<[f32; LANES]>,
}

impl Resampler {
    /// `width` by `height` samples of an image, `step` of its pixels apart, the
    /// first one centred half a step right of and below `origin` (pixel edges).
    /// Each is a triangular mean as wide as the step, so that small sizes do not
    /// alias; outside the image its border goes on.
    pub fn fill(
        &mut self,
        image: &GreyImage,
        origin: (f64, f64),
        step: f64,
        (width, height): (usize, usize),
        out: &mut Vec<f32>,
    ) {
        out.resize(width * height, 0.0);
        if image.width() * image.height() * width * height == 0 {
            out.fill(0.0);
            return;
        }
        self.columns.fill(origin.0, step, width);
        self.rows.fill(origin.1, step, height);
        let first = self.columns.each().map(|(start, _)| start).min().unwrap_or(0);
        let ends = self.columns.each().map(|(start, weights)| start + weights.len() as i64);
        let end = ends.max().unwrap_or(0).max(first + 1);
        self.beside.resize((end - first) as usize, [0.0; LANES]);
        let Self { columns, rows, tall, beside, across } = self;
        let mut rows = rows.each();
        for lines in out.chunks_mut(width * LANES) {
            for (lane, (start, weights)) in rows.by_ref().take(LANES).enumerate() {
                add_rows(image, (start, weights), first..end, tall);
                beside.iter_mut().zip(&*tall).for_each(|(lanes, value)| lanes[lane] = *value);
            }
            blend_columns(columns, first, beside, across);
            for (lane, line) in lines.chunks_exact_mut(width).enumerate() {
                line.iter_mut().zip(&*across).for_each(|(sample, lanes)| *sample = lanes[lane]);
            }
        }
    }
}

/// The weighted mean of rows from `start` on, in some columns; both may lie outside
/// of the image.
fn add_rows(
    image: &GreyImage,
    (start, weights): (i64, &[f32]),
    columns: Range<i64>,
    out: &mut Vec<f32>,
) {
    let (last_row, last_column) = (image.height() as i64 - 1, image.width() as i64 - 1);
    let inside = columns.start.clamp(0, last_column)..columns.end.clamp(1, last_column + 1);
    out.clear();
    out.resize((columns.end - columns.start) as usize, 0.0);
    // Where nothing of the image is wanted, its border is what goes on.
    let at = (inside.start - columns.start).clamp(0, out.len() as i64 - 1) as usize;
    let length = (inside.end - inside.start).max(1) as usize;
    let middle = at..(at + length).min(out.len());
    for (y, weight) in (start..).zip(weights) {
        let source = &image.row(y.clamp(0, last_row) as usize)[inside.start as usize..];
        add_scaled(&mut out[middle.clone()], source, *weight);
    }
    let (left, right) = (out[middle.start], out[middle.end - 1]);
    out[..middle.start].fill(left);
    out[middle.end..].fill(right);
}

/// Samples of several rows from the values of their columns.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn blend_columns(
    columns: &Taps,
    first: i64,
    values: &[[f32; LANES]],
    samples: &mut Vec<[f32; LANES]>,
) {
    samples.clear();
    for (start, weights) in columns.each() {
        let mut sums = [0.0_f32; LANES];
        for (values, weight) in values[(start - first) as usize..].iter().zip(weights) {
            for lane in 0..LANES {
                sums[lane] += values[lane] * weight;
            }
        }
        samples.push(sums);
    }
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn add_scaled(to: &mut [f32], from: &[u8], scale: f32) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to += scale * f32::from(*from));
}

/// As `Resampler::fill`, once.
pub fn resampled(
    image: &GreyImage,
    origin: (f64, f64),
    step: f64,
    width: usize,
    height: usize,
) -> Vec<f32> {
    let mut out = Vec::new();
    Resampler::default().fill(image, origin, step, (width, height), &mut out);
    out
}
