//! Sub-pixel disparities from the images themselves, by least squares over a window on the same
//! surface. This is needed because the sums of matching costs are bytes, and the parabola through
//! three of them follows the noise of the images.
//!
//! B. Lucas and T. Kanade, *An iterative image registration technique with an application to stereo
//! vision*, IJCAI 1981, section 4, one step, along the row. The right camera may be more sensitive,
//! by a factor that is estimated from the contrast of each row; the brightness of each row of the
//! window may differ by a constant. Without texture a disparity stays as it was: a mean over the
//! window would blur the step between a person and the wall behind, which is less than a pixel
//! beyond 4 m.
//!
//! The outline of a round object lies behind its front (for a head, by the radius of the head), and
//! has the strongest slopes. Slopes count less than their square, so that the disparity of a face
//! is determined by its faint features.

use tagalong_core::GreyImage;

use crate::share::{band_rows, share};

/// Maximum difference between neighbouring disparities of one surface, px.
const SAME_PX: f32 = 1.0;
/// Weight of the previous disparity: the variance of the noise of a pixel, in grey levels, over
/// that of the disparity, in pixels.
const PRIOR: f32 = 20.0;
/// Slope above which the weight hardly grows, grey levels.
const STRONG: f32 = 6.0;
/// Variance added to that of each row, so that noise does not decide the gain of a row without
/// contrast.
const FAINT: f32 = 4.0;
/// Mean brightness.
const MIDDLE: f32 = 128.0;
/// Maximum change of a disparity, px: brightness is linear over a short distance only.
const MOST_PX: f32 = 0.5;
/// Largest radius of a window, px.
pub const MAX_RADIUS: usize = 16;
/// Number of pixels that are processed at once.
const LANES: usize = 16;
/// Substitute for an unknown disparity where values must be finite.
const UNKNOWN: f32 = 1e6;

/// Refines disparities; keeps its buffers.
#[derive(Debug, Default)]
pub struct Refiner {
    /// One for each thread.
    loaders: Vec<Loader>,
    sums: Sums,
}

/// Buffers for the equations of a row.
#[derive(Debug, Default)]
struct Loader {
    left: Vec<[f32; 2]>,
    right: Vec<[f32; 2]>,
    padded: Vec<u8>,
    row: Equations,
}

/// Previous disparity of each pixel and sums of the window's row around it: squared slopes, and
/// their products with the disparity. Rows are padded to a multiple of [`LANES`].
#[derive(Debug, Default)]
struct Sums {
    was: Vec<f32>,
    squares: Vec<f32>,
    products: Vec<f32>,
}

/// Returns adjacent values.
#[inline(always)]
fn lanes(row: &[f32], from: usize) -> &[f32; LANES] {
    &row[from..].as_chunks().0[0]
}

/// Returns 1 if two disparities belong to the same surface, otherwise 0; an unknown one differs
/// from any known one.
#[inline(always)]
fn same(a: f32, b: f32) -> f32 {
    if (a - b).abs() <= SAME_PX { 1.0 } else { 0.0 }
}

impl Refiner {
    /// Refines the disparities of the left image in windows of `2 * radius + 1`
    /// columns and rows; `radius` is at most [`MAX_RADIUS`].
    pub fn apply(
        &mut self,
        images: [&GreyImage; 2],
        radius: usize,
        threads: usize,
        disparities: &mut [f32],
    ) {
        let width = images[0].width();
        let height = images[0].height();
        let padded = width.next_multiple_of(LANES);
        let rows = band_rows(height, threads);
        let Sums { was, squares, products } = &mut self.sums;
        for row in [&mut *was, &mut *squares, &mut *products] {
            row.resize(height * padded, 0.0);
        }
        self.loaders.resize_with(height.div_ceil(rows), Loader::default);
        let bands = squares.chunks_mut(rows * padded).zip(products.chunks_mut(rows * padded));
        let bands = was.chunks_mut(rows * padded).zip(bands).zip(disparities.chunks(rows * width));
        share(self.loaders.iter_mut().zip(bands).enumerate(), |(band, (loader, place))| {
            let ((was, (squares, products)), disparities) = place;
            let sums = squares.chunks_exact_mut(padded).zip(products.chunks_exact_mut(padded));
            let rows_of = was.chunks_exact_mut(padded).zip(disparities.chunks_exact(width));
            for (y, ((was, row), (squares, products))) in (band * rows..).zip(rows_of.zip(sums)) {
                was[..width].copy_from_slice(row);
                loader.load(images.map(|image| image.row(y)), row);
                across(&loader.row, radius, squares, products);
            }
        });
        let sums = &self.sums;
        share(disparities.chunks_mut(rows * width).enumerate(), |(band, disparities)| {
            for (y, row) in (band * rows..).zip(disparities.chunks_exact_mut(width)) {
                let window = y.saturating_sub(radius)..(y + radius + 1).min(height);
                down(sums, (y, window), row);
            }
        });
    }
}

impl Loader {
    fn load(&mut self, [left, right]: [&[u8]; 2], disparities: &[f32]) {
        levels(left, &mut self.padded, &mut self.left);
        levels(right, &mut self.padded, &mut self.right);
        self.row.load(&self.left, &self.right, disparities);
    }
}

/// Computes the brightness of each pixel, with weights 1, 2, 1, so that linear interpolation
/// follows it, and its change from pixel to pixel; the last one is repeated.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn levels(row: &[u8], padded: &mut Vec<u8>, levels: &mut Vec<[f32; 2]>) {
    let width = row.len();
    padded.clear();
    padded.resize(2, row[0]);
    padded.extend_from_slice(row);
    padded.resize(width + 4, row[width - 1]);
    levels.resize(width + 1, [0.0; 2]);
    let padded = &padded[..width + 4];
    for (x, level) in levels[..width].iter_mut().enumerate() {
        let a = i32::from(padded[x]);
        let b = i32::from(padded[x + 1]);
        let c = i32::from(padded[x + 2]);
        let d = i32::from(padded[x + 3]);
        let e = i32::from(padded[x + 4]);
        *level = [0.25 * (b + 2 * c + d) as f32, 0.125 * (e + 2 * (d - b) - a) as f32];
    }
    levels[width] = levels[width - 1];
}

/// Linear equations of the pixels of a row for their disparity `d`: `g d = q`, in grey levels, with
/// reduced weight for strong slopes. Both sides are padded for a window.
#[derive(Debug, Default)]
struct Equations {
    d: Vec<f32>,
    g: Vec<f32>,
    q: Vec<f32>,
    /// Columns of the right image up to which the pixels are shifted.
    columns: Vec<u32>,
}

impl Equations {
    fn load(&mut self, left: &[[f32; 2]], right: &[[f32; 2]], disparities: &[f32]) {
        let from = MAX_RADIUS;
        let to = MAX_RADIUS + disparities.len();
        for (row, value) in [(&mut self.d, UNKNOWN), (&mut self.g, 0.0), (&mut self.q, 0.0)] {
            row.resize(to + MAX_RADIUS + LANES, value);
            row[to..].fill(value);
        }
        for (own, d) in self.d[from..to].iter_mut().zip(disparities) {
            *own = if d.is_nan() { UNKNOWN } else { *d };
        }
        let d = &self.d[from..to];
        let g = &mut self.g[from..to];
        let q = &mut self.q[from..to];
        between(right, d, &mut self.columns, g, q);
        solve_for(left, d, gain(left, d, q), g, q);
    }
}

/// From this power of two on, the last bits of a float are the integer itself. A saturating cast is
/// no vector instruction.
const WHOLE: f32 = 8_388_608.0;
const LAST_BITS: u32 = WHOLE as u32 - 1;

/// Interpolates brightness and slope of the right image at the matches of the left pixels; outside
/// of the image, its border is continued.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn between(
    right: &[[f32; 2]],
    disparities: &[f32],
    columns: &mut Vec<u32>,
    slope: &mut [f32],
    level: &mut [f32],
) {
    let width = disparities.len();
    columns.resize(width, 0);
    let columns = &mut columns[..width];
    let slope = &mut slope[..width];
    let level = &mut level[..width];
    let last = (width - 1) as f32;
    // The columns are computed first, without access to the images, so that this loop is
    // vectorised.
    for x in 0..width {
        let at = (x as i32 as f32 - disparities[x]).clamp(0.0, last);
        columns[x] = (at.floor() + WHOLE).to_bits() & LAST_BITS;
        level[x] = at - at.floor();
    }
    for x in 0..width {
        let Some([here, next]) = right[columns[x] as usize..].first_chunk() else { break };
        let part = level[x];
        level[x] = here[0] + part * (next[0] - here[0]);
        slope[x] = here[1] + part * (next[1] - here[1]);
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn solve_for(left: &[[f32; 2]], disparities: &[f32], gain: f32, g: &mut [f32], q: &mut [f32]) {
    for (((own, d), g), q) in left.iter().zip(disparities).zip(g).zip(q) {
        let own = own.map(|left| gain * left);
        let slope = 0.5 * (own[1] + *g);
        let weight = 1.0 / (1.0 + slope * slope * (1.0 / (STRONG * STRONG))).sqrt();
        *q = weight * (slope * d + *q - own[0]);
        *g = weight * slope;
    }
}

/// Returns the factor by which the contrast of a row is greater in the right image, over the pixels
/// with a match.
fn gain(left: &[[f32; 2]], disparities: &[f32], right: &[f32]) -> f32 {
    let [mut n, mut l, mut r, mut ll, mut rr] = [0.0_f32; 5];
    for ((own, d), other) in left.iter().zip(disparities).zip(right) {
        let known = if *d < UNKNOWN { 1.0 } else { 0.0 };
        let own = own[0] - MIDDLE;
        let other = *other - MIDDLE;
        n += known;
        l += known * own;
        r += known * other;
        ll += known * own * own;
        rr += known * other * other;
    }
    let n = n.max(1.0);
    let own = ll - l * l / n + FAINT * n;
    let other = rr - r * r / n + FAINT * n;
    (other / own).sqrt().clamp(0.5, 2.0)
}

/// Sums up over the part of a window's row that is of one surface, around the means.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn across(row: &Equations, radius: usize, squares: &mut [f32], products: &mut [f32]) {
    let squares = squares.as_chunks_mut().0;
    let products = products.as_chunks_mut().0;
    for (i, (squares, products)) in squares.iter_mut().zip(products).enumerate() {
        let from = MAX_RADIUS + i * LANES;
        let own = lanes(&row.d, from);
        let [mut n, mut g, mut q, mut gg, mut gq] = [[0.0_f32; LANES]; 5];
        for near in from - radius..from + radius + 1 {
            let ds = lanes(&row.d, near);
            let gs = lanes(&row.g, near);
            let qs = lanes(&row.q, near);
            for lane in 0..LANES {
                let same = same(own[lane], ds[lane]);
                let slope = same * gs[lane];
                n[lane] += same;
                g[lane] += slope;
                q[lane] += same * qs[lane];
                gg[lane] += slope * gs[lane];
                gq[lane] += slope * qs[lane];
            }
        }
        let (squares, products): (&mut [f32; LANES], &mut [f32; LANES]) = (squares, products);
        for lane in 0..LANES {
            let mean = g[lane] / n[lane];
            // Rounding can make the variance of equal slopes negative.
            squares[lane] = (gg[lane] - mean * g[lane]).max(0.0);
            products[lane] = gq[lane] - mean * q[lane];
        }
    }
}

/// Solves for the disparities of row `y` with the sums of some rows.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn down(sums: &Sums, (y, rows): (usize, std::ops::Range<usize>), row: &mut [f32]) {
    let was = sums.was.as_slice();
    let width = row.len().next_multiple_of(LANES);
    for (i, new) in row.chunks_mut(LANES).enumerate() {
        let own = lanes(was, y * width + i * LANES);
        let mut squares = [PRIOR; LANES];
        let mut products = [0.0_f32; LANES];
        for lane in 0..LANES {
            products[lane] = PRIOR * own[lane];
        }
        for near in rows.clone() {
            let at = near * width + i * LANES;
            let ds = lanes(was, at);
            let ss = lanes(&sums.squares, at);
            let ps = lanes(&sums.products, at);
            for lane in 0..LANES {
                let same = same(own[lane], ds[lane]);
                squares[lane] += same * ss[lane];
                products[lane] += same * ps[lane];
            }
        }
        let mut solved = [0.0; LANES];
        for lane in 0..LANES {
            let change = products[lane] / squares[lane] - own[lane];
            let d = own[lane] + change.clamp(-MOST_PX, MOST_PX);
            // Not `max`, which would turn an unknown disparity (NaN) into 0.
            solved[lane] = if d < 0.0 { 0.0 } else { d };
        }
        new.copy_from_slice(&solved[..new.len()]);
    }
}
