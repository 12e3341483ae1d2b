//! Sensors: convert the surfaces that rays hit to camera images with exposure, blur and noise, and
//! to the depth of a structured-light camera.

use std::ops::Range;
use std::sync::LazyLock;

use tagalong_core::{DepthImage, GreyImage, RgbImage};

use crate::hits::{HitGroup, HitImage};
use crate::lanes::LANES;
use crate::material::luma;
use crate::parallel::in_pieces;
use crate::random::{normal_at, uniform_at};

/// Mean brightness at which the exposure aims; 1 is white.
const TARGET: f64 = 0.28;
/// One of this number of pixels is sampled for the mean brightness.
const SAMPLED: usize = 7;
/// Number of rows that a thread processes at once.
const STRIP_ROWS: usize = 16;
/// Loss of light in the corners.
const VIGNETTING: f32 = 0.22;
/// Light at which the gain is 1, lx times reflectance; less light, more noise.
const BASE_LIGHT: f64 = 60.0;
/// Standard deviation of the read noise and of the shot noise of a white pixel
/// at gain 1, where 1 is white.
const READ_NOISE: f64 = 0.0025;
const SHOT_NOISE: f64 = 0.012;
/// Minimum infrared light that can be matched: reflectance times cosine over m².
const LEAST_RETURN: f64 = 0.004;
/// Steps per pixel of disparity (Khoshelham & Oude Elberink 2012).
const STEPS_PER_PX: f64 = 8.0;
/// Standard deviations of the noise of a disparity per step: 1 / 48 pixel at 8 steps per pixel.
const SIGMAS_PER_STEP: f64 = 6.0;
/// Number of columns, and of rows, that share a part of the matcher's noise.
const PATCH: usize = 4;
/// Standard deviation of the position from which a depth is taken, pixels (Handa et al. 2014).
const EDGE_JITTER_PX: f64 = 0.5;
/// Maximum displacement of a reading, pixels: [`normal_at`] returns no number above twice the root
/// of 3.
const REACH: usize = 2;

/// The automatic exposure of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exposure {
    /// Light that becomes [`TARGET`], lx times reflectance.
    mean_light: Option<f64>,
    threads: usize,
}

/// Properties of one image other than the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Seed of the noise, different for each image.
    pub seed: u64,
    /// Columns by which the view moves during the exposure.
    pub smear_px: f64,
    /// Sensitivity relative to that of the other camera of a pair.
    pub gain: f64,
}

impl Exposure {
    /// Creates the exposure of a camera that has not seen anything yet. `threads` is the number of
    /// threads that develop an image.
    pub fn new(threads: usize) -> Self {
        Self { mean_light: None, threads }
    }

    /// Returns a colour image.
    pub fn colour(&mut self, seen: &HitImage, moment: &Moment) -> RgbImage {
        let factor = self.adapt(seen);
        let film = Film::new(seen, moment, factor);
        let mut image = RgbImage::filled(seen.width(), seen.height(), [0; 3]);
        film.expose(self.threads, image.pixels_mut(), channel_light, colour_row);
        image
    }

    /// Returns a grey image.
    pub fn grey(&mut self, seen: &HitImage, moment: &Moment) -> GreyImage {
        let factor = self.adapt(seen);
        let film = Film::new(seen, moment, factor);
        let mut image = GreyImage::filled(seen.width(), seen.height(), 0);
        film.expose(self.threads, image.pixels_mut(), grey_light, grey_row);
        image
    }

    /// Adapts to the light within a few images; returns the factor for the light.
    fn adapt(&mut self, seen: &HitImage) -> f64 {
        let width = seen.width();
        let mut sum = 0.0;
        for y in 0..seen.height() {
            // Every seventh pixel is enough for a mean, and seven is coprime to usual widths.
            let first = (SAMPLED - y * width % SAMPLED) % SAMPLED;
            for x in (first..width).step_by(SAMPLED) {
                let (group, lane) = seen.group(x, y);
                sum += luma(group.light.map(|channel| channel[lane]));
            }
        }
        let count = (width * seen.height()).div_ceil(SAMPLED);
        let now = (sum / count as f64).max(1e-3);
        // Only part of the way, because an automatic exposure is slow.
        let light = self.mean_light.map_or(now, |before| before + 0.2 * (now - before));
        self.mean_light = Some(light);
        TARGET / light
    }
}

/// Properties that the channels of an image share.
struct Film<'a> {
    seen: &'a HitImage,
    moment: &'a Moment,
    /// Factor for the light, so that 1 is white.
    factor: f64,
    /// Variance of the read noise, and that of the shot noise of a white pixel.
    noise: [f64; 2],
}

impl<'a> Film<'a> {
    fn new(seen: &'a HitImage, moment: &'a Moment, factor: f64) -> Self {
        // Below the base light a camera raises its gain, and the noise with it.
        let gain = (TARGET / factor / BASE_LIGHT).recip().clamp(1.0, 16.0);
        let noise = [(READ_NOISE * gain).powi(2), SHOT_NOISE * SHOT_NOISE * gain];
        Self { seen, moment, factor, noise }
    }

    /// Computes all channels: lens blur, motion blur, vignetting, noise, gamma. `light` writes the
    /// light of a row and channel times a factor, `print` a row of pixels from the levels of its
    /// channels.
    fn expose<const CHANNELS: usize, P: Send>(
        &self,
        threads: usize,
        pixels: &mut [P],
        light: impl Fn(&[HitGroup], usize, f64, &mut [f32]) + Sync,
        print: impl Fn(&[Vec<u16>; CHANNELS], &mut [P]) + Sync,
    ) {
        let width = self.seen.width();
        in_pieces(pixels, STRIP_ROWS * width, threads, |number, strip| {
            let rows = number * STRIP_ROWS..number * STRIP_ROWS + strip.len() / width;
            let across: [Vec<f32>; CHANNELS] = self.blurred_across(&rows, &light);
            let mut levels = [(); CHANNELS].map(|()| vec![0; width]);
            let mut soft = vec![0.0; width];
            for (row, strip) in rows.clone().zip(strip.chunks_mut(width)) {
                for ((channel, levels), across) in (0..).zip(&mut levels).zip(&across) {
                    self.blur_along(row, rows.start, across, &mut soft);
                    self.develop(&soft, row, channel, levels);
                }
                print(&levels, strip);
            }
        });
    }

    /// Returns the channels of some rows and of those above and below, blurred along the rows.
    fn blurred_across<const CHANNELS: usize>(
        &self,
        rows: &Range<usize>,
        light: impl Fn(&[HitGroup], usize, f64, &mut [f32]),
    ) -> [Vec<f32>; CHANNELS] {
        let width = self.seen.width();
        let height = self.seen.height();
        let rows = rows.start.saturating_sub(1)..height.min(rows.end + 1);
        let mut across = [(); CHANNELS].map(|()| Vec::with_capacity(rows.len() * width));
        let mut sharp = vec![0.0; LANES * self.seen.row_groups()];
        let mut smeared = vec![0.0; width];
        for row in rows {
            for (channel, across) in across.iter_mut().enumerate() {
                light(self.seen.row(row), channel, self.factor, &mut sharp);
                smear(&sharp[..width], self.moment.smear_px, &mut smeared);
                soften_across(&smeared, across);
            }
        }
        across
    }

    /// Applies the other half of the lens blur; the border is unchanged. `top` is the row after the
    /// first one in `across`, which is missing at the upper border.
    fn blur_along(&self, row: usize, top: usize, across: &[f32], soft: &mut [f32]) {
        let width = soft.len();
        let at = (row - top.saturating_sub(1)) * width;
        let here = &across[at..at + width];
        if row == 0 || row + 1 == self.seen.height() {
            soft.copy_from_slice(here);
            return;
        }
        let above = &across[at - width..at];
        let below = &across[at + width..at + 2 * width];
        weigh(above, here, below, soft);
    }

    fn develop(&self, soft: &[f32], row: usize, channel: u64, levels: &mut [u16]) {
        let seed = self.moment.seed ^ (channel << 48);
        develop(self, soft, row, seed, levels);
    }
}

/// Computes the brightness of a row in 12 bits, with vignetting and noise.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn develop(film: &Film<'_>, soft: &[f32], row: usize, seed: u64, levels: &mut [u16]) {
    let width = film.seen.width();
    let height = film.seen.height();
    let cx = 0.5 * width as f32;
    let cy = 0.5 * height as f32;
    let dy = row as f32 - cy;
    let (gain, [read, shot]) = (film.moment.gain, film.noise);
    let first = (row * width) as u64;
    // A counter of 32 bits, because wider ones cannot be converted with vector instructions.
    let mut x = 0_i32;
    for (light, level) in soft.iter().zip(levels) {
        let dx = x as f32 - cx;
        // Light falls off with the square of the distance from the centre, a good approximation of
        // cos^4.
        let corner = VIGNETTING * (dx * dx + dy * dy) / (cx * cx + cy * cy);
        let dimmed = f64::from(light * (1.0 - corner)) * gain;
        let sigma = (read + shot * dimmed).sqrt();
        let noisy = dimmed + sigma * normal_at(seed, first.wrapping_add(x as u64));
        *level = (noisy.clamp(0.0, 1.0) * 4095.0) as i32 as u16;
        x = x.wrapping_add(1);
    }
}

/// Curve from 12-bit linear light to 8 bits.
static CURVE: LazyLock<[u8; 4096]> = LazyLock::new(|| {
    std::array::from_fn(|i| (255.0 * (i as f64 / 4095.0).powf(1.0 / 2.2)).round() as u8)
});

/// Writes the light of a row in one colour, times a factor, in groups of [`LANES`] pixels.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn channel_light(row: &[HitGroup], channel: usize, factor: f64, to: &mut [f32]) {
    for (group, to) in row.iter().zip(to.chunks_exact_mut(LANES)) {
        let light = &group.light[channel];
        for lane in 0..LANES {
            to[lane] = (light[lane] * factor) as f32;
        }
    }
}

/// Does the same as [`channel_light`] for the brightness of all colours together.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn grey_light(row: &[HitGroup], _: usize, factor: f64, to: &mut [f32]) {
    for (group, to) in row.iter().zip(to.chunks_exact_mut(LANES)) {
        let [red, green, blue] = &group.light;
        for lane in 0..LANES {
            to[lane] = (luma([red[lane], green[lane], blue[lane]]) * factor) as f32;
        }
    }
}

/// Writes a row of colours from the levels of their channels.
fn colour_row([red, green, blue]: &[Vec<u16>; 3], to: &mut [[u8; 3]]) {
    let curve: &[u8; 4096] = &CURVE;
    for (((to, red), green), blue) in to.iter_mut().zip(red).zip(green).zip(blue) {
        *to = [curve[usize::from(*red)], curve[usize::from(*green)], curve[usize::from(*blue)]];
    }
}

/// Writes a row of grey values from their levels.
fn grey_row([grey]: &[Vec<u16>; 1], to: &mut [u8]) {
    let curve: &[u8; 4096] = &CURVE;
    for (to, grey) in to.iter_mut().zip(grey) {
        *to = curve[usize::from(*grey)];
    }
}

/// Applies the blur of a turning camera: a running mean along a row.
fn smear(row: &[f32], by_px: f64, to: &mut [f32]) {
    let reach = (0.5 * by_px.abs()).round() as usize;
    if reach == 0 {
        to.copy_from_slice(row);
        return;
    }
    let inner = reach.min(row.len())..row.len().saturating_sub(reach).max(reach.min(row.len()));
    for x in (0..inner.start).chain(inner.end..row.len()) {
        let part = &row[x.saturating_sub(reach)..(x + reach + 1).min(row.len())];
        to[x] = part.iter().sum::<f32>() / part.len() as f32;
    }
    // A narrow image has no column far enough from both borders.
    if !inner.is_empty() {
        running_mean(row, 2 * reach + 1, &mut to[inner]);
    }
}

/// Computes the means of `of` consecutive numbers, from each number for which there are enough.
/// Each sum runs from its first number to its last, as in a loop over one of them.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn running_mean(row: &[f32], of: usize, to: &mut [f32]) {
    to.copy_from_slice(&row[..to.len()]);
    for first in 1..of {
        for (to, further) in to.iter_mut().zip(&row[first..]) {
            *to += further;
        }
    }
    let count = of as f32;
    for to in to {
        *to /= count;
    }
}

/// Applies one half of the lens blur: weights 1 2 1 along a row; the border is unchanged.
fn soften_across(row: &[f32], to: &mut Vec<f32>) {
    let from = to.len();
    to.extend_from_slice(row);
    let (Some(inner), true) = (to.get_mut(from + 1..), row.len() > 2) else { return };
    weigh(row, &row[1..], &row[2..], &mut inner[..row.len() - 2]);
}

/// Computes the mean of three rows with the weights 1 2 1.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn weigh(before: &[f32], here: &[f32], after: &[f32], to: &mut [f32]) {
    for (((to, before), here), after) in to.iter_mut().zip(before).zip(here).zip(after) {
        *to = 0.25 * (before + 2.0 * here + after);
    }
}

/// A structured-light depth camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthSensor {
    /// Focal length, pixels.
    pub focal_px: f64,
    /// Distance between camera and projector, m.
    pub baseline_m: f64,
    /// Minimum and maximum depth, m.
    pub range_m: [f64; 2],
}

impl DepthSensor {
    /// Returns the depth image, with NaN where there is no reading: out of range, too little light
    /// returned, or in the shadow of the projector, which is to the right.
    pub fn measure(&self, seen: &HitImage, seed: u64, threads: usize) -> DepthImage {
        let mut depth = DepthImage::filled(seen.width(), seen.height(), f32::NAN);
        let width = seen.width();
        in_pieces(depth.pixels_mut(), STRIP_ROWS * width, threads, |number, strip| {
            let mut row = DepthRow::new(width);
            let top = number * STRIP_ROWS;
            let near = NearSurfaces::new(seen, top, strip.len() / width);
            for (y, depth) in (top..).zip(strip.chunks_mut(width)) {
                row.look(&near, seed, y);
                row.measure(self, seed, y);
                row.cast_shadows(self);
                depth.copy_from_slice(&row.depth_m);
            }
        });
        depth
    }
}

/// Surfaces in some rows of an image and in those around them, value by value.
struct NearSurfaces {
    /// Number of rows of the image.
    height: usize,
    /// The first row that is stored.
    top: usize,
    /// Number of values per row.
    stride: usize,
    t: Vec<f64>,
    infrared: Vec<f64>,
    facing: Vec<f64>,
}

impl NearSurfaces {
    fn new(seen: &HitImage, top: usize, rows: usize) -> Self {
        let first = top.saturating_sub(REACH);
        let end = seen.height().min(top + rows + REACH);
        let stride = LANES * seen.row_groups();
        let count = stride * (end - first);
        let mut near = Self {
            height: seen.height(),
            top: first,
            stride,
            t: Vec::with_capacity(count),
            infrared: Vec::with_capacity(count),
            facing: Vec::with_capacity(count),
        };
        for group in (first..end).flat_map(|y| seen.row(y)) {
            near.t.extend_from_slice(&group.t);
            near.infrared.extend_from_slice(&group.infrared);
            near.facing.extend_from_slice(&group.facing);
        }
        near
    }
}

/// One row of a depth image while it is computed.
struct DepthRow {
    /// Columns and rows by which each pixel is displaced.
    off: [Vec<i32>; 2],
    /// Properties of the visible surfaces: depth, reflectance in the near infrared, cosine to the
    /// normal.
    t: Vec<f64>,
    infrared: Vec<f64>,
    facing: Vec<f64>,
    /// Noise of the matcher in patches of [`PATCH`] pixels, and for each pixel.
    patches: Vec<f64>,
    coarse: Vec<f64>,
    depth_m: Vec<f32>,
}

impl DepthRow {
    fn new(width: usize) -> Self {
        Self {
            off: [vec![0; width], vec![0; width]],
            t: vec![0.0; width],
            infrared: vec![0.0; width],
            facing: vec![0.0; width],
            patches: vec![0.0; width.div_ceil(PATCH)],
            coarse: vec![0.0; width],
            depth_m: vec![f32::NAN; width],
        }
    }

    /// Takes the surface at a position near each pixel, because measured edges are displaced.
    fn look(&mut self, near: &NearSurfaces, seed: u64, y: usize) {
        let width = self.t.len();
        let first = (y * width) as u64;
        for (salt, off) in [0x54, 0x55].into_iter().zip(&mut self.off) {
            jitter(seed ^ salt, first, off);
        }
        let [columns, rows] = &self.off;
        let to = self.t.iter_mut().zip(&mut self.infrared).zip(&mut self.facing);
        let off = columns.iter().zip(rows);
        let own = (y - near.top) * near.stride;
        for (x, (((t, infrared), facing), (columns, rows))) in to.zip(off).enumerate() {
            let column = x.wrapping_add_signed(*columns as isize);
            let row = y.wrapping_add_signed(*rows as isize);
            let is_inside = (column < width) & (row < near.height);
            let there = row.wrapping_sub(near.top).wrapping_mul(near.stride).wrapping_add(column);
            let at = if is_inside { there } else { own.wrapping_add(x) };
            (*t, *infrared, *facing) = (near.t[at], near.infrared[at], near.facing[at]);
        }
    }

    fn measure(&mut self, sensor: &DepthSensor, seed: u64, y: usize) {
        measure(self, sensor, seed, y as u64);
    }

    /// Removes the readings in the shadow of the projector.
    fn cast_shadows(&mut self, sensor: &DepthSensor) {
        let steps = sensor.focal_px * sensor.baseline_m;
        // From right to left, because the projector is to the right of the camera: near surfaces
        // shadow the pixels to their left.
        let mut leftmost = f64::INFINITY;
        for (x, (t, depth_m)) in self.t.iter().zip(&mut self.depth_m).enumerate().rev() {
            let lit_from = x as f64 - steps / t;
            if lit_from > leftmost + 1.0 {
                *depth_m = f32::NAN;
            }
            leftmost = leftmost.min(lit_from);
        }
    }
}

/// Returns the integer offsets of the positions of readings, pixels.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn jitter(seed: u64, first: u64, off: &mut [i32]) {
    let mut key = first;
    for off in off {
        *off = (EDGE_JITTER_PX * normal_at(seed, key)).round() as i32;
        key = key.wrapping_add(1);
    }
}

/// Computes depths without the shadow of the projector; NaN if too little light returns.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn measure(row: &mut DepthRow, sensor: &DepthSensor, seed: u64, y: u64) {
    let width = row.depth_m.len();
    let first = y.wrapping_mul(width as u64);
    let [nearest, farthest] = sensor.range_m;
    // Structured light measures disparities, so depth has steps that grow with its square.
    let steps = STEPS_PER_PX * sensor.focal_px * sensor.baseline_m;
    let mut key = 0_u64;
    for patch in &mut row.patches {
        *patch = 0.5 + uniform_at(seed ^ 0x51, (y >> 2) << 20 | key);
        key = key.wrapping_add(1);
    }
    for (coarse, patch) in row.coarse.chunks_mut(PATCH).zip(&row.patches) {
        coarse.fill(*patch);
    }
    let coarse = &row.coarse[..width];
    let t = &row.t[..width];
    let infrared = &row.infrared[..width];
    let facing = &row.facing[..width];
    for (x, depth_m) in row.depth_m.iter_mut().enumerate() {
        let t = t[x];
        let x64 = x as u64;
        let facing = if facing[x] > 0.0 { facing[x] } else { 0.0 };
        let light = infrared[x] * facing / (t * t);
        // The matcher decides for patches of 9 x 9 dots, so holes have a minimum size.
        let coarse = coarse[x];
        let fine = 0.75 + 0.5 * uniform_at(seed ^ 0x52, y << 20 | x64);
        let returns = (t >= nearest) & (t <= farthest) & (light > LEAST_RETURN * coarse * fine);
        let disparity =
            steps / t + normal_at(seed ^ 0x53, first.wrapping_add(x64)) / SIGMAS_PER_STEP;
        let whole = disparity.round();
        let measured = (steps / if whole > 1.0 { whole } else { 1.0 }) as f32;
        *depth_m = if returns { measured } else { f32::NAN };
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::world::Hit;

    const SENSOR: DepthSensor =
        DepthSensor { focal_px: 580.0, baseline_m: 0.075, range_m: [0.5, 8.0] };

    fn wall(t: f64, infrared: f64) -> Hit {
        Hit { t, infrared, facing: 1.0, light: [100.0; 3], person: None }
    }

    fn spread(z: f64) -> (f64, f64) {
        let seen = HitImage::from_fn(200, 50, |_, _| wall(z, 0.6));
        let depth = SENSOR.measure(&seen, 9, 2);
        let read: Vec<f64> =
            depth.pixels().iter().filter(|d| !d.is_nan()).map(|d| f64::from(*d)).collect();
        let mean = read.iter().sum::<f64>() / read.len() as f64;
        (mean, (read.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / read.len() as f64).sqrt())
    }

    #[test]
    fn depth_steps_grow_with_the_square_of_the_distance() {
        // One step is 11.5 mm at 2 m and 46 mm at 4 m.
        for (z, step) in [(2.0, 0.0115), (4.0, 0.046)] {
            let (mean, sigma) = spread(z);
            assert!((mean - z).abs() < step && sigma < step, "{z}: {mean} {sigma}");
            let grid = 8.0 * 580.0 * 0.075;
            assert!((grid / z - grid / (z + step) - 1.0).abs() < 0.02);
        }
    }

    #[test]
    fn near_far_and_black_things_are_not_seen() {
        fn holes(hit: Hit) -> usize {
            let depth = SENSOR.measure(&HitImage::from_fn(40, 40, |_, _| hit), 3, 2);
            depth.pixels().iter().filter(|d| d.is_nan()).count()
        }

        assert_eq!(holes(wall(2.0, 0.6)), 0);
        assert_eq!((holes(wall(0.4, 0.6)), holes(wall(9.0, 0.9))), (1600, 1600));
        assert!(holes(wall(4.0, 0.03)) > 1500);
    }

    #[test]
    fn the_projector_throws_a_shadow_beside_what_is_near() {
        let seen = HitImage::from_fn(200, 4, |x, _| wall(if x > 100 { 1.0 } else { 3.0 }, 0.6));
        let depth = SENSOR.measure(&seen, 3, 1);
        let holes = depth.row(1).iter().filter(|d| d.is_nan()).count() as f64;
        let expected = 580.0 * 0.075 * (1.0 - 1.0 / 3.0);
        assert!((holes - expected).abs() < 4.0, "{holes} {expected}");
    }

    #[test]
    fn exposure_brings_light_and_dark_rooms_to_one_brightness() {
        let moment = Moment { seed: 1, smear_px: 0.0, gain: 1.0 };
        let [(bright, little), (dark, much)] = [300.0, 6.0].map(|light| {
            let hit = Hit { light: [light; 3], ..wall(2.0, 0.5) };
            let seen = HitImage::from_fn(64, 64, |_, _| hit);
            let grey = Exposure::default().grey(&seen, &moment);
            let row = &grey.row(32)[24..40];
            let mean = row.iter().map(|v| f64::from(*v)).sum::<f64>() / 16.0;
            (mean, row.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / 16.0)
        });
        assert!((bright - dark).abs() < 12.0, "{bright} {dark}");
        assert!(much > 2.0 * little, "{little} {much}");
    }

    /// Surfaces that differ from pixel to pixel.
    fn mixed(width: usize, height: usize, seed: u64) -> HitImage {
        HitImage::from_fn(width, height, |x, y| {
            let part = [0, 1, 2, 3, 4, 5, 6, 7]
                .map(|salt| uniform_at(seed ^ salt, (y * width + x) as u64));
            Hit {
                t: 2.0 + (y % 8) as f64 + 0.1 * part[1] - if part[7] < 0.02 { 1.7 } else { 0.0 },
                light: [300.0 * part[2], 90.0 * part[3], 60.0 * part[4]],
                infrared: part[5],
                facing: part[6] - 0.1,
                person: None,
            }
        })
    }

    /// Light of a row after the blur of a turn and one half of that of a lens.
    fn slow_row(seen: &HitImage, y: usize, factor: f64, reach: usize) -> Vec<f32> {
        let row = (0..seen.width() as i64).map(|x| seen.get(x, y as i64).unwrap());
        let row: Vec<f32> = row.map(|hit| (luma(hit.light) * factor) as f32).collect();
        let last = row.len() - 1;
        let means = (0..row.len()).map(|x| {
            let part = &row[x.saturating_sub(reach)..=(x + reach).min(last)];
            part.iter().sum::<f32>() / part.len() as f32
        });
        let smeared: Vec<f32> = means.collect();
        let mut soft = smeared.clone();
        for x in 1..last {
            soft[x] = 0.25 * (smeared[x - 1] + 2.0 * smeared[x] + smeared[x + 1]);
        }
        soft
    }

    /// A grey image, pixel by pixel.
    fn slow_grey(seen: &HitImage, moment: &Moment) -> Vec<u8> {
        let (width, height) = (seen.width(), seen.height());
        let sampled: Vec<f64> = seen.hits().iter().step_by(7).map(|hit| luma(hit.light)).collect();
        let factor = TARGET / (sampled.iter().sum::<f64>() / sampled.len() as f64);
        let film = Film::new(seen, moment, factor);
        let reach = (0.5 * moment.smear_px.abs()).round() as usize;
        let rows: Vec<_> = (0..height).map(|y| slow_row(seen, y, factor, reach)).collect();
        let mut grey = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let is_border = y == 0 || y + 1 == height;
                let light = if is_border {
                    rows[y][x]
                } else {
                    0.25 * (rows[y - 1][x] + 2.0 * rows[y][x] + rows[y + 1][x])
                };
                let (cx, cy) = (0.5 * width as f32, 0.5 * height as f32);
                let (dx, dy) = (x as f32 - cx, y as f32 - cy);
                let corner = VIGNETTING * (dx * dx + dy * dy) / (cx * cx + cy * cy);
                let dimmed = f64::from(light * (1.0 - corner)) * moment.gain;
                let sigma = (film.noise[0] + film.noise[1] * dimmed).sqrt();
                let noisy = dimmed + sigma * normal_at(moment.seed, (y * width + x) as u64);
                grey.push(CURVE[(noisy.clamp(0.0, 1.0) * 4095.0) as usize]);
            }
        }
        grey
    }

    /// A depth image, pixel by pixel.
    fn slow_depth(seen: &HitImage, seed: u64) -> Vec<f32> {
        let mut depth = Vec::new();
        for y in 0..seen.height() as u64 {
            let mut lit_from = Vec::new();
            let mut row = Vec::new();
            for x in 0..seen.width() as u64 {
                let key = y * seen.width() as u64 + x;
                let [across, down] = [0x54, 0x55]
                    .map(|salt| (EDGE_JITTER_PX * normal_at(seed ^ salt, key)).round() as i64);
                let there = seen.get(x as i64 + across, y as i64 + down);
                let hit = there.unwrap_or_else(|| seen.get(x as i64, y as i64).unwrap());
                let light = hit.infrared * hit.facing.max(0.0) / (hit.t * hit.t);
                let coarse = 0.5 + uniform_at(seed ^ 0x51, ((y / 4) << 20) | (x / 4));
                let fine = 0.75 + 0.5 * uniform_at(seed ^ 0x52, y << 20 | x);
                let steps = STEPS_PER_PX * SENSOR.focal_px * SENSOR.baseline_m;
                let noise = normal_at(seed ^ 0x53, key) / SIGMAS_PER_STEP;
                let disparity = (steps / hit.t + noise).round();
                let returns = (0.5..=8.0).contains(&hit.t) && light > LEAST_RETURN * coarse * fine;
                row.push(if returns { (steps / disparity.max(1.0)) as f32 } else { f32::NAN });
                lit_from.push(x as f64 - SENSOR.focal_px * SENSOR.baseline_m / hit.t);
            }
            for (x, metres) in row.into_iter().enumerate() {
                let is_shadowed = lit_from[x + 1..].iter().any(|other| lit_from[x] > other + 1.0);
                depth.push(if is_shadowed { f32::NAN } else { metres });
            }
        }
        depth
    }

    proptest! {
        #[test]
        fn images_are_those_of_a_loop_over_pixels(
            width in 3..90usize, height in 3..40usize, seed in 0..1000u64, smear_px in -30.0..30.0f64,
        ) {
            let seen = mixed(width, height, seed);
            let moment = Moment { seed, smear_px, gain: 1.03 };
            let grey = Exposure::new(2).grey(&seen, &moment);
            prop_assert_eq!(grey.pixels(), slow_grey(&seen, &moment));
            // Colours are grey images of one channel each, but for the seeds of their noise.
            let same = HitImage::from_fn(width, height, |x, y| {
                let hit = seen.get(x as i64, y as i64).unwrap();
                Hit { light: [luma(hit.light); 3], ..hit }
            });
            let colour = Exposure::new(2).colour(&same, &moment);
            let red: Vec<u8> = colour.pixels().iter().map(|pixel| pixel[0]).collect();
            prop_assert_eq!(red, slow_grey(&same, &moment));
        }

        #[test]
        fn depths_are_those_of_a_loop_over_pixels(
            width in 1..90usize, height in 1..40usize, seed in 0..1000u64,
        ) {
            let seen = mixed(width, height, seed);
            let depth = SENSOR.measure(&seen, seed, 2);
            let slow = slow_depth(&seen, seed);
            let mut readings = 0;
            for (depth, slow) in depth.pixels().iter().zip(slow) {
                prop_assert!(*depth == slow || depth.is_nan() && slow.is_nan(), "{depth} {slow}");
                readings += usize::from(!depth.is_nan());
            }
            prop_assert!(readings > 0 || width * height < 400);
        }
    }
}
