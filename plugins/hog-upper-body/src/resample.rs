//! Resampling of images to other sizes.

use std::ops::Range;

use tagalong_core::GreyImage;

use crate::Spans;
use crate::hog::CELL;

/// Weights of the source pixels of each sample.
#[derive(Clone, Debug, Default)]
struct Taps {
    /// First source pixel of each sample, and index of its first weight.
    starts: Vec<(i64, usize)>,
    weights: Vec<f32>,
}

impl Taps {
    /// Computes the weights of `count` samples, `step` pixels apart, the first one centred half a
    /// step behind `origin`.
    fn fill(&mut self, origin: f64, step: f64, count: usize) {
        self.starts.clear();
        self.weights.clear();
        // In an enlarged image a triangle narrower than a pixel could miss all of them.
        let reach = step.max(1.0);
        for i in 0..count {
            let centre = origin + (i as f64 + 0.5) * step - 0.5;
            let start = (centre - reach).ceil() as i64;
            let end = (centre + reach).floor() as i64;
            let weights = (start..=end).map(|x| (1.0 - (x as f64 - centre).abs() / reach).max(0.0));
            let total: f64 = weights.clone().sum();
            self.starts.push((start, self.weights.len()));
            self.weights.extend(weights.map(|weight| (weight / total) as f32));
        }
    }

    /// Returns the first source pixel of some samples, and the weights from there on.
    fn of(&self, samples: Range<usize>) -> impl Iterator<Item = (i64, &[f32])> {
        samples.map(|sample| {
            let (start, from) = self.starts[sample];
            let next = self.starts.get(sample + 1);
            (start, &self.weights[from..next.map_or(self.weights.len(), |(_, from)| *from)])
        })
    }

    /// Returns the source pixels of some samples.
    fn sources(&self, samples: Range<usize>) -> Range<i64> {
        let start = self.starts[samples.start].0;
        let last = self.of(samples.end - 1..samples.end);
        start..last.fold(start, |_, (start, weights)| start + weights.len() as i64)
    }
}

/// Number of rows of the result that are computed at once.
const LANES: usize = 8;

/// Resampler of images; the memory is reused for the next image.
#[derive(Clone, Debug, Default)]
pub struct Resampler {
    columns: Taps,
    rows: Taps,
    /// Some rows of the result in all columns of the source that are needed.
    tall: [Vec<f32>; LANES],
    /// The same rows, interleaved for each column.
    beside: Vec<[f32; LANES]>,
    /// Samples of these rows, interleaved for each column of the result.
    across: Vec<[f32; LANES]>,
}

impl Resampler {
    /// Computes `width` by `height` samples of an image, `step` of its pixels apart, the first one
    /// centred half a step right of and below `origin` (pixel edges). Each is a triangular mean as
    /// wide as the step, so that small sizes do not alias; outside the image its border is
    /// continued. Samples that are not in `spans` keep their old values.
    pub fn fill(
        &mut self,
        image: &GreyImage,
        origin: (f64, f64),
        step: f64,
        (width, height): (usize, usize),
        spans: &Spans,
        out: &mut Vec<f32>,
    ) {
        out.resize(width * height, 0.0);
        if image.width() * image.height() * width * height == 0 {
            out.fill(0.0);
            return;
        }
        self.columns.fill(origin.0, step, width);
        self.rows.fill(origin.1, step, height);
        for (index, lines) in out.chunks_mut(width * LANES).enumerate() {
            let span = spans.pixels(index);
            let rows = LANES * index..height.min(LANES * (index + 1));
            if !span.is_empty() {
                self.fill_rows(image, span, rows, lines);
            }
        }
    }

    /// Computes some samples of a few rows.
    fn fill_rows(
        &mut self,
        image: &GreyImage,
        span: Range<usize>,
        rows: Range<usize>,
        lines: &mut [f32],
    ) {
        let Self { columns, rows: all_rows, tall, beside, across } = self;
        let sources = columns.sources(span.clone());
        let width = lines.len() / rows.len();
        for (tall, row) in tall.iter_mut().zip(all_rows.of(rows)) {
            add_rows(image, row, sources.clone(), tall);
        }
        lay_beside(tall.each_ref().map(Vec::as_slice), beside);
        blend_columns(columns.of(span.clone()), sources.start, beside, across);
        for (lane, line) in lines.chunks_exact_mut(width).enumerate() {
            let samples = line[span.clone()].iter_mut();
            samples.zip(&*across).for_each(|(sample, lanes)| *sample = lanes[lane]);
        }
    }
}

/// Computes the weighted mean of rows from `start` on, in some columns; both may lie outside of the
/// image.
fn add_rows(
    image: &GreyImage,
    (start, weights): (i64, &[f32]),
    columns: Range<i64>,
    out: &mut Vec<f32>,
) {
    let last_row = image.height() as i64 - 1;
    let last_column = image.width() as i64 - 1;
    let inside = columns.start.clamp(0, last_column)..columns.end.clamp(1, last_column + 1);
    out.clear();
    out.resize((columns.end - columns.start) as usize, 0.0);
    // If no column lies in the image, the nearest border column is read and continued.
    let at = (inside.start - columns.start).clamp(0, out.len() as i64 - 1) as usize;
    let length = (inside.end - inside.start).max(1) as usize;
    let middle = at..(at + length).min(out.len());
    for (y, weight) in (start..).zip(weights) {
        let source = &image.row(y.clamp(0, last_row) as usize)[inside.start as usize..];
        add_scaled(&mut out[middle.clone()], source, *weight);
    }
    let left = out[middle.start];
    let right = out[middle.end - 1];
    out[..middle.start].fill(left);
    out[middle.end..].fill(right);
}

#[multiversion::multiversion(targets("x86_64+avx2"))]
fn lay_beside(rows: [&[f32]; LANES], beside: &mut Vec<[f32; LANES]>) {
    let length = rows[0].len();
    beside.resize(length, [0.0; LANES]);
    let rows = rows.map(|row| if row.len() < length { rows[0] } else { &row[..length] });
    for (x, beside) in beside.iter_mut().enumerate() {
        for lane in 0..LANES {
            beside[lane] = rows[lane][x];
        }
    }
}

/// Computes samples of several rows from the values of their columns.
#[multiversion::multiversion(targets("x86_64+avx2"))]
fn blend_columns<'a>(
    columns: impl Iterator<Item = (i64, &'a [f32])>,
    first: i64,
    values: &[[f32; LANES]],
    samples: &mut Vec<[f32; LANES]>,
) {
    samples.clear();
    for (start, weights) in columns {
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

/// Resamples as `Resampler::fill`, once: columns and rows of cells of 8 samples, and one more sample
/// on each side.
pub fn resampled(image: &GreyImage, origin: (f64, f64), step: f64, cells: [usize; 2]) -> Vec<f32> {
    let ([width, height], mut out) = (cells.map(|cells| cells * CELL + 2), Vec::new());
    let spans = Spans::whole(width, height);
    Resampler::default().fill(image, origin, step, (width, height), &spans, &mut out);
    out
}
