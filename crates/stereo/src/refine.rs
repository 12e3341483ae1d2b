//! Fractions of a pixel from the images themselves, by least squares over a window
//! on the same surface. The sums of matching costs are bytes, and the parabola
//! through three of them follows the noise of the images.
//!
//! B. Lucas and T. Kanade, *An iterative image registration technique with an
//! application to stereo vision*, IJCAI 1981, section 4, one step, along the row.
//! The brightness of each row of the window may differ by a constant, and what the
//! pixels of the window had for disparities counts a little: where brightness says
//! nothing, that leaves their mean.
//!
//! The outline of a round thing lies behind its front, by the radius of a head for a
//! head, and has the strongest slopes. They count less than their square, so that a
//! face is where its faint features are.

use tagalong_core::GreyImage;

/// Neighbours whose disparities differ by at most this are of one surface, px.
const SAME_PX: f32 = 1.0;
/// Weight of a disparity as it was: the variance of the noise of a pixel, in grey
/// levels, over that of the disparity, in pixels.
const PRIOR: f32 = 1.0;
/// A slope beyond this many grey levels counts little more than one of it.
const STRONG: f32 = 6.0;
/// A disparity changes by at most this, px: brightness is no straight line for long.
const MOST_PX: f32 = 1.0;
/// Largest radius of a window, px.
pub const MAX_RADIUS: usize = 16;
/// Pixels that are worked on at once.
const LANES: usize = 16;

/// Refines disparities; keeps its buffers.
#[derive(Debug, Default)]
pub struct Refiner {
    left: Line,
    right: Line,
    row: Equations,
    /// By pixel: the squared slopes of its window's row, and their product with the
    /// disparity.
    squares: Vec<f32>,
    products: Vec<f32>,
    window: [Vec<f32>; 2],
    refined: Vec<f32>,
}

/// True if two disparities are of one surface; never for an unknown one.
#[inline(always)]
fn is_same(a: f32, b: f32) -> bool {
    (a - b).abs() <= SAME_PX
}

impl Refiner {
    /// Refines the disparities of the left image in windows of `2 * radius + 1`
    /// columns and rows; `radius` is at most [`MAX_RADIUS`].
    pub fn apply(
        &mut self,
        [left, right]: [&GreyImage; 2],
        radius: usize,
        disparities: &mut [f32],
    ) {
        let (width, height) = (left.width(), left.height());
        self.squares.resize(disparities.len(), 0.0);
        self.products.resize(disparities.len(), 0.0);
        let sums = self.squares.chunks_exact_mut(width).zip(self.products.chunks_exact_mut(width));
        for (y, sums) in sums.enumerate() {
            self.left.load(left.row(y));
            self.right.load(right.row(y));
            self.row.load(&self.left, &self.right, &disparities[y * width..(y + 1) * width]);
            across(&self.row, radius, sums);
        }
        self.refined.clear();
        self.refined.extend_from_slice(disparities);
        for (y, refined) in self.refined.chunks_exact_mut(width).enumerate() {
            self.window.iter_mut().for_each(|row| row.clear());
            self.window.iter_mut().for_each(|row| row.resize(width, 0.0));
            let own = &disparities[y * width..(y + 1) * width];
            for near in y.saturating_sub(radius)..(y + radius + 1).min(height) {
                let from = near * width;
                let sums = [&self.squares[from..], &self.products[from..]];
                add(own, &disparities[from..], sums, &mut self.window);
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
    /// Brightness, with weights 1, 2, 1, so that lines between pixels follow it, and
    /// its change from pixel to pixel; the last pixel twice.
    level: Vec<f32>,
    slope: Vec<f32>,
}

impl Line {
    fn load(&mut self, row: &[u8]) {
        self.padded.clear();
        self.padded.resize(2, row[0]);
        self.padded.extend_from_slice(row);
        self.padded.resize(row.len() + 5, row[row.len() - 1]);
        self.level.resize(row.len() + 1, 0.0);
        self.slope.resize(row.len() + 1, 0.0);
        levels(&self.padded, &mut self.level, &mut self.slope);
        self.level[row.len()] = self.level[row.len() - 1];
        self.slope[row.len()] = self.slope[row.len() - 1];
    }

    /// Level and slope between the pixels; the border goes on.
    #[inline(always)]
    fn between(&self, at: f32) -> (f32, f32) {
        let last = self.level.len() - 2;
        let i = (at.max(0.0) as usize).min(last);
        let part = (at - i as f32).clamp(0.0, 1.0);
        let mix = |row: &[f32]| row[i] + part * (row[i + 1] - row[i]);
        (mix(&self.level), mix(&self.slope))
    }
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn levels(padded: &[u8], level: &mut [f32], slope: &mut [f32]) {
    let width = level.len();
    let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|from| &padded[from..from + width]);
    let slope = &mut slope[..width];
    for x in 0..width {
        let [a, b, c, d, e] = [a[x], b[x], c[x], d[x], e[x]].map(f32::from);
        level[x] = 0.25 * (b + 2.0 * c + d);
        slope[x] = 0.125 * (e + 2.0 * (d - b) - a);
    }
}

/// What the pixels of a row say of their disparity `d`: `g d = q`, in grey levels, of
/// strong slopes less.
/// There is room for a window on both sides, of unknown disparities.
#[derive(Debug, Default)]
struct Equations {
    d: Vec<f32>,
    g: Vec<f32>,
    q: Vec<f32>,
}

impl Equations {
    fn load(&mut self, left: &Line, right: &Line, disparities: &[f32]) {
        let room = disparities.len() + 2 * MAX_RADIUS + LANES;
        for (row, value) in [(&mut self.d, f32::NAN), (&mut self.g, 0.0), (&mut self.q, 0.0)] {
            row.resize(room, value);
        }
        let inside = MAX_RADIUS..MAX_RADIUS + disparities.len();
        self.d[inside.end..].fill(f32::NAN);
        self.d[inside.clone()].copy_from_slice(disparities);
        let rows = self.g[inside.clone()].iter_mut().zip(&mut self.q[inside]);
        let own = left.level.iter().zip(&left.slope).zip(disparities);
        for ((x, (g, q)), ((l, slope), d)) in rows.enumerate().zip(own) {
            let (level, r_slope) = right.between(x as f32 - d);
            let slope = 0.5 * (slope + r_slope);
            let weight = 1.0 / (1.0 + slope * slope / (STRONG * STRONG)).sqrt();
            *g = weight * slope;
            *q = weight * (slope * d + level - l);
        }
    }
}

/// Sums up over the windows' part of a row that is of one surface, around the means.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn across(row: &Equations, radius: usize, (squares, products): (&mut [f32], &mut [f32])) {
    let chunks = squares.chunks_mut(LANES).zip(products.chunks_mut(LANES));
    for (i, (squares, products)) in chunks.enumerate() {
        let from = MAX_RADIUS + i * LANES;
        let own: [f32; LANES] = std::array::from_fn(|lane| row.d[from..from + LANES][lane]);
        let [mut n, mut d, mut g, mut q, mut gg, mut gq] = [[0.0_f32; LANES]; 6];
        for near in from - radius..from + radius + 1 {
            let [ds, gs, qs] = [&row.d, &row.g, &row.q].map(|row| &row[near..near + LANES]);
            for lane in 0..LANES {
                let same = is_same(own[lane], ds[lane]);
                let if_same = |value: f32| if same { value } else { 0.0 };
                n[lane] += if_same(1.0);
                d[lane] += if_same(ds[lane]);
                g[lane] += if_same(gs[lane]);
                q[lane] += if_same(qs[lane]);
                gg[lane] += if_same(gs[lane] * gs[lane]);
                gq[lane] += if_same(gs[lane] * qs[lane]);
            }
        }
        let (mut square, mut product) = ([0.0; LANES], [0.0; LANES]);
        for lane in 0..LANES {
            let mean = g[lane] / n[lane];
            square[lane] = (gg[lane] - mean * g[lane]).max(0.0) + PRIOR * n[lane];
            product[lane] = gq[lane] - mean * q[lane] + PRIOR * d[lane];
        }
        squares.copy_from_slice(&square[..squares.len()]);
        products.copy_from_slice(&product[..products.len()]);
    }
}

/// Adds the sums of a row where it is of the same surface.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn add(own: &[f32], near: &[f32], sums: [&[f32]; 2], window: &mut [Vec<f32>; 2]) {
    let width = own.len();
    let (near, [squares, products]) = (&near[..width], sums.map(|row| &row[..width]));
    let [all_squares, all_products] = window;
    let (all_squares, all_products) = (&mut all_squares[..width], &mut all_products[..width]);
    for x in 0..width {
        let same = is_same(own[x], near[x]);
        all_squares[x] += if same { squares[x] } else { 0.0 };
        all_products[x] += if same { products[x] } else { 0.0 };
    }
}

/// Solves for the disparities.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn solve([squares, products]: &[Vec<f32>; 2], disparities: &mut [f32]) {
    for ((d, squares), product) in disparities.iter_mut().zip(squares).zip(products) {
        let new = *d + (product / squares - *d).clamp(-MOST_PX, MOST_PX);
        *d = if new < 0.0 { 0.0 } else { new };
    }
}
