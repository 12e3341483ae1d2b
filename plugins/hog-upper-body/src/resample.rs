//! Images in other sizes.

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

/// Brings images to other sizes; keeps its memory from one to the next.
#[derive(Clone, Debug, Default)]
pub struct Resampler {
    columns: Taps,
    rows: Taps,
    /// A row of the result in all columns of the source that matter.
    tall: Vec<f32>,
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
        out.clear();
        out.resize(width * height, 0.0);
        if image.width() * image.height() * width * height == 0 {
            return;
        }
        self.columns.fill(origin.0, step, width);
        self.rows.fill(origin.1, step, height);
        let first = self.columns.each().map(|(start, _)| start).min().unwrap_or(0);
        let ends = self.columns.each().map(|(start, weights)| start + weights.len() as i64);
        let end = ends.max().unwrap_or(0);
        let (last_row, last_column) = (image.height() as i64 - 1, image.width() as i64 - 1);
        let first = first.min(last_column);
        let end = end.max(first + 1).max(1);
        let inside = first.max(0)..end.min(last_column + 1);
        for (line, (start, weights)) in out.chunks_exact_mut(width).zip(self.rows.each()) {
            self.tall.clear();
            self.tall.resize((end - first) as usize, 0.0);
            let at = (inside.start - first) as usize;
            let length = (inside.end - inside.start) as usize;
            for (y, weight) in (start..).zip(weights) {
                let source = &image.row(y.clamp(0, last_row) as usize)[inside.start as usize..];
                add_scaled(&mut self.tall[at..at + length], source, *weight);
            }
            // The border goes on to both sides.
            let (left, right) = (self.tall[at], self.tall[at + length - 1]);
            self.tall[..at].fill(left);
            self.tall[at + length..].fill(right);
            for (sample, (start, weights)) in line.iter_mut().zip(self.columns.each()) {
                let source = &self.tall[(start - first) as usize..];
                *sample = source.iter().zip(weights).map(|(v, w)| v * w).sum();
            }
        }
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
