//! Fractions of a pixel from the images themselves, by least squares over a window
//! on the same surface. The sums of matching costs are bytes, and the parabola
//! through three of them follows the noise of the images.
//!
//! B. Lucas and T. Kanade, *An iterative image registration technique with an
//! application to stereo vision*, IJCAI 1981, section 4, one step, along the row.
//! The brightness of each row of the window may differ by a constant.

use tagalong_core::GreyImage;

/// Neighbours whose disparities differ by at most this are of one surface, px.
const SAME_PX: f32 = 1.0;
/// Weight of the disparity as it was: the variance of the noise of a pixel, in grey
/// levels, over that of the disparity, in pixels.
const PRIOR: f32 = 20.0;
/// A disparity changes by at most this, px: brightness is no straight line for long.
const MOST_PX: f32 = 0.5;

/// Refines disparities; keeps its buffers.
#[derive(Debug, Default)]
pub struct Refiner {
    left: Line,
    right: Line,
    sums: Vec<Sums>,
    /// By pixel: the squared slopes in its window, and their product with the
    /// disparity.
    slopes: Vec<f32>,
    products: Vec<f32>,
    refined: Vec<f32>,
}

/// Sums over the pixels of a row up to some place: slope `g`, and `q`, the slope
/// times the disparity that explains the difference in brightness.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    g: f32,
    q: f32,
    gg: f32,
    gq: f32,
}

impl Sums {
    fn with(self, g: f32, q: f32) -> Self {
        Self { g: self.g + g, q: self.q + q, gg: self.gg + g * g, gq: self.gq + g * q }
    }

    /// Squares and products around the means, from `first` to here.
    fn since(self, first: Self, count: f32) -> (f32, f32) {
        let (g, q) = (self.g - first.g, self.q - first.q);
        let (gg, gq) = (self.gg - first.gg, self.gq - first.gq);
        ((gg - g * g / count).max(0.0), gq - g * q / count)
    }
}

/// True if two disparities are of one surface; never for an unknown one.
#[inline(always)]
fn is_same(a: f32, b: f32) -> bool {
    (a - b).abs() <= SAME_PX
}

impl Refiner {
    /// Refines the disparities of the left image in windows of `2 * radius + 1`
    /// columns and rows.
    pub fn apply(
        &mut self,
        [left, right]: [&GreyImage; 2],
        radius: usize,
        disparities: &mut [f32],
    ) {
        let (width, height) = (left.width(), left.height());
        self.slopes.resize(disparities.len(), 0.0);
        self.products.resize(disparities.len(), 0.0);
        for y in 0..height {
            self.left.load(left.row(y));
            self.right.load(right.row(y));
            let place = y * width..(y + 1) * width;
            let [slopes, products] = [&mut self.slopes, &mut self.products];
            let sums = (&mut slopes[place.clone()], &mut products[place.clone()]);
            let lines = (&self.left, &self.right);
            along(lines, &disparities[place], radius, &mut self.sums, sums);
        }
        self.refined.clear();
        self.refined.extend_from_slice(disparities);
        for y in 0..height {
            let near = y.saturating_sub(radius)..(y + radius + 1).min(height);
            let row = y * width..(y + 1) * width;
            let place = near.start * width..near.end * width;
            let from = (
                &disparities[place.clone()],
                &self.slopes[place.clone()],
                &self.products[place],
            );
            across(&disparities[row.clone()], from, &mut self.refined[row]);
        }
        disparities.copy_from_slice(&self.refined);
    }
}

/// A row of an image.
#[derive(Debug, Default)]
struct Line {
    padded: Vec<u8>,
    /// Brightness, times 4: weights 1, 2, 1, so that lines between pixels follow it.
    level: Vec<f32>,
    /// Its change from pixel to pixel, times 8.
    slope: Vec<f32>,
}

impl Line {
    fn load(&mut self, row: &[u8]) {
        self.padded.clear();
        self.padded.resize(2, row[0]);
        self.padded.extend_from_slice(row);
        self.padded.resize(row.len() + 4, row[row.len() - 1]);
        self.level.resize(row.len(), 0.0);
        self.slope.resize(row.len(), 0.0);
        levels(&self.padded, &mut self.level, &mut self.slope);
    }

    /// Level and slope between the pixels; the border goes on.
    #[inline(always)]
    fn between(&self, at: f32) -> (f32, f32) {
        let last = self.level.len() - 1;
        let at = at.max(0.0);
        let (i, part) = ((at as usize).min(last), at.fract());
        let next = (i + 1).min(last);
        let mix = |row: &[f32]| row[i] + part * (row[next] - row[i]);
        (mix(&self.level), mix(&self.slope))
    }
}

#[multiversion::multiversion(targets("x86_64+avx2", "x86_64+avx512f+avx512bw+avx512vl"))]
fn levels(padded: &[u8], level: &mut [f32], slope: &mut [f32]) {
    let width = level.len();
    let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|from| &padded[from..from + width]);
    for x in 0..width {
        let [a, b, c, d, e] = [a[x], b[x], c[x], d[x], e[x]].map(f32::from);
        level[x] = b + 2.0 * c + d;
        slope[x] = e + 2.0 * (d - b) - a;
    }
}

/// Sums up along a row, within the surface of each pixel.
fn along(
    (left, right): (&Line, &Line),
    disparities: &[f32],
    radius: usize,
    sums: &mut Vec<Sums>,
    (slopes, products): (&mut [f32], &mut [f32]),
) {
    let width = disparities.len();
    let mut from = 0;
    while from < width {
        let mut end = from + 1;
        while end < width && is_same(disparities[end], disparities[end - 1]) {
            end += 1;
        }
        sums.clear();
        sums.push(Sums::default());
        for x in from..end {
            let before = sums[x - from];
            sums.push(if disparities[x].is_nan() {
                before
            } else {
                let (g, q) = equation(left, right, x, disparities[x]);
                before.with(g, q)
            });
        }
        for x in from..end {
            let (a, b) = (x.saturating_sub(radius).max(from), (x + radius + 1).min(end));
            (slopes[x], products[x]) = sums[b - from].since(sums[a - from], (b - a) as f32);
        }
        from = end;
    }
}

/// What a pixel says of its disparity `d`: `g d = q`, in grey levels.
#[inline(always)]
fn equation(left: &Line, right: &Line, x: usize, disparity: f32) -> (f32, f32) {
    let (level, slope) = right.between(x as f32 - disparity);
    let g = 0.0625 * (left.slope[x] + slope);
    (g, g * disparity + 0.25 * (level - left.level[x]))
}

/// Columns that are worked on at once.
const LANES: usize = 16;

/// Adds up the rows of the window that are of the same surface, and solves.
#[multiversion::multiversion(targets("x86_64+avx2", "x86_64+avx512f+avx512bw+avx512vl"))]
fn across(row: &[f32], (near, slopes, products): (&[f32], &[f32], &[f32]), refined: &mut [f32]) {
    let width = row.len();
    let (own, rest) = row.as_chunks::<LANES>();
    for (i, was) in own.iter().enumerate() {
        let from = i * LANES;
        let (mut squares, mut sums) = ([PRIOR; LANES], was.map(|d| PRIOR * d));
        for first in (from..near.len()).step_by(width) {
            let window = [near, slopes, products].map(|plane| &plane[first..first + LANES]);
            for lane in 0..LANES {
                let same = is_same(was[lane], window[0][lane]);
                squares[lane] += if same { window[1][lane] } else { 0.0 };
                sums[lane] += if same { window[2][lane] } else { 0.0 };
            }
        }
        for lane in 0..LANES {
            refined[from + lane] = changed(was[lane], sums[lane] / squares[lane]);
        }
    }
    for (x, was) in (own.len() * LANES..width).zip(rest) {
        let same = || (x..near.len()).step_by(width).filter(|at| is_same(*was, near[*at]));
        let squares = same().fold(PRIOR, |sum, at| sum + slopes[at]);
        let sum = same().fold(PRIOR * was, |sum, at| sum + products[at]);
        refined[x] = changed(*was, sum / squares);
    }
}

#[inline(always)]
fn changed(was: f32, wanted: f32) -> f32 {
    let new = was + (wanted - was).clamp(-MOST_PX, MOST_PX);
    if new < 0.0 { 0.0 } else { new }
}
