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
    window: Window,
    refined: Vec<f32>,
}

/// Sums over the rows of the windows around the pixels of a row.
#[derive(Debug, Default)]
struct Window {
    squares: Vec<f32>,
    sums: Vec<f32>,
}

impl Window {
    fn clear(&mut self, width: usize) {
        for row in [&mut self.squares, &mut self.sums] {
            row.clear();
            row.resize(width, 0.0);
        }
    }
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
    #[inline(always)]
    fn with(self, g: f32, q: f32) -> Self {
        Self { g: self.g + g, q: self.q + q, gg: self.gg + g * g, gq: self.gq + g * q }
    }

    /// Squares and products around the means, from `first` to here.
    #[inline(always)]
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
        for (y, refined) in self.refined.chunks_exact_mut(width).enumerate() {
            self.window.clear(width);
            let own = &disparities[y * width..(y + 1) * width];
            for near in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                let from = near * width;
                let (slopes, products) = (&self.slopes[from..], &self.products[from..]);
                add(own, &disparities[from..], slopes, products, &mut self.window);
            }
            solve(&self.window, refined);
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
        let i = (at as usize).min(last);
        let part = (at - i as f32).min(1.0);
        let next = (i + 1).min(last);
        let mix = |row: &[f32]| row[i] + part * (row[next] - row[i]);
        (mix(&self.level), mix(&self.slope))
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
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
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
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

/// Adds the values of a row where it is of the same surface.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn add(own: &[f32], near: &[f32], slopes: &[f32], products: &[f32], window: &mut Window) {
    let width = own.len();
    let (near, slopes, products) = (&near[..width], &slopes[..width], &products[..width]);
    let (squares, sums) = (&mut window.squares[..width], &mut window.sums[..width]);
    for x in 0..width {
        let same = is_same(own[x], near[x]);
        squares[x] += if same { slopes[x] } else { 0.0 };
        sums[x] += if same { products[x] } else { 0.0 };
    }
}

/// Solves for the disparities, with what they were as a weak prior.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn solve(window: &Window, disparities: &mut [f32]) {
    for ((d, squares), sum) in disparities.iter_mut().zip(&window.squares).zip(&window.sums) {
        let change = (PRIOR * *d + sum) / (PRIOR + squares) - *d;
        let new = *d + change.clamp(-MOST_PX, MOST_PX);
        *d = if new < 0.0 { 0.0 } else { new };
    }
}
