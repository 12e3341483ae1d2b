//! Sensors: from the surfaces that rays meet to camera images with exposure, blur and noise, and to
//! the depth of a structured-light camera.

use std::ops::Range;
use std::sync::LazyLock;

use tagalong_core::{DepthImage, GreyImage, Image, RgbImage};

use crate::material::luma;
use crate::parallel::in_pieces;
use crate::random::{normal_at, uniform_at};
use crate::world::Hit;

/// Mean brightness that the exposure aims at, 1 is white.
const TARGET: f64 = 0.28;
/// Rows that a thread works on at once.
const STRIP_ROWS: usize = 16;
/// Loss of light in the corners.
const VIGNETTING: f32 = 0.22;
/// Light at which the gain is 1, lx times reflectance; less light, more noise.
const BASE_LIGHT: f64 = 60.0;
/// Standard deviation of the read noise and of the shot noise of a white pixel
/// at gain 1, where 1 is white.
const READ_NOISE: f64 = 0.0025;
const SHOT_NOISE: f64 = 0.012;
/// Least infrared light that is matched: reflectance times cosine over m².
const LEAST_RETURN: f64 = 0.004;
/// Steps per pixel of disparity (Khoshelham & Oude Elberink 2012).
const STEPS_PER_PX: f64 = 8.0;
/// Standard deviation of the place that a depth is taken from, pixels (Handa et
/// al. 2014).
const EDGE_JITTER_PX: f64 = 0.5;

/// The automatic exposure of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exposure {
    /// Light that becomes [`TARGET`], lx times reflectance.
    mean_light: Option<f64>,
    threads: usize,
}

/// Moment of an image: all that changes it besides the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Seed of the noise, another one for each image.
    pub seed: u64,
    /// Columns that the view moves by while the shutter is open.
    pub smear_px: f64,
    /// Sensitivity against that of the camera's partner.
    pub gain: f64,
}

impl Exposure {
    /// Of a camera that has not seen anything yet. `threads` develop an image.
    pub fn new(threads: usize) -> Self {
        Self { mean_light: None, threads }
    }

    /// A colour image.
    pub fn colour(&mut self, seen: &Image<Hit>, moment: &Moment) -> RgbImage {
        let factor = self.adapt(seen);
        let film = Film::new(seen, moment, factor);
        let mut image = RgbImage::filled(seen.width(), seen.height(), [0; 3]);
        film.expose(self.threads, image.pixels_mut(), |hit| hit.light, |pixel| pixel);
        image
    }

    /// A grey image.
    pub fn grey(&mut self, seen: &Image<Hit>, moment: &Moment) -> GreyImage {
        let factor = self.adapt(seen);
        let film = Film::new(seen, moment, factor);
        let mut image = GreyImage::filled(seen.width(), seen.height(), 0);
        film.expose(self.threads, image.pixels_mut(), |hit| [luma(hit.light)], |[pixel]| pixel);
        image
    }

    /// Adapts to the light within some images; returns the factor on light.
    fn adapt(&mut self, seen: &Image<Hit>) -> f64 {
        let pixels = seen.pixels();
        // Every seventh pixel is enough for a mean, and coprime to usual widths.
        let sampled = pixels.iter().step_by(7).map(|hit| luma(hit.light)).sum::<f64>();
        let now = (sampled / pixels.len().div_ceil(7) as f64).max(1e-3);
        // Part of the way only, because an automatic exposure is slow.
        let light = self.mean_light.map_or(now, |before| before + 0.2 * (now - before));
        self.mean_light = Some(light);
        TARGET / light
    }
}

/// Properties that the channels of an image share.
struct Film<'a> {
    seen: &'a Image<Hit>,
    moment: &'a Moment,
    /// Factor on light, so that 1 is white.
    factor: f64,
    /// Variance of the read noise, and that of the shot noise of a white pixel.
    noise: [f64; 2],
}

impl<'a> Film<'a> {
    fn new(seen: &'a Image<Hit>, moment: &'a Moment, factor: f64) -> Self {
        // Below the base light a camera raises its gain, and the noise with it.
        let gain = (TARGET / factor / BASE_LIGHT).recip().clamp(1.0, 16.0);
        let noise = [(READ_NOISE * gain).powi(2), SHOT_NOISE * SHOT_NOISE * gain];
        Self { seen, moment, factor, noise }
    }

    /// All channels: lens blur, motion blur, vignetting, noise, gamma.
    fn expose<const CHANNELS: usize, P: Send>(
        &self,
        threads: usize,
        pixels: &mut [P],
        light: impl Fn(&Hit) -> [f64; CHANNELS] + Sync,
        pixel: impl Fn([u8; CHANNELS]) -> P + Sync,
    ) {
        let width = self.seen.width();
        in_pieces(pixels, STRIP_ROWS * width, threads, |number, strip| {
            let rows = number * STRIP_ROWS..number * STRIP_ROWS + strip.len() / width;
            let across = self.blurred_across(&rows, &light);
            let mut levels = [(); CHANNELS].map(|()| vec![0; width]);
            let mut soft = vec![0.0; width];
            for (row, strip) in rows.clone().zip(strip.chunks_mut(width)) {
                for ((channel, levels), across) in (0..).zip(&mut levels).zip(&across) {
                    self.blur_along(row, rows.start, across, &mut soft);
                    self.develop(&soft, row, channel, levels);
                }
                for (x, to) in strip.iter_mut().enumerate() {
                    *to = pixel(levels.each_ref().map(|levels| CURVE[usize::from(levels[x])]));
                }
            }
        });
    }

    /// The channels of some rows and of those above and below, blurred along the rows.
    fn blurred_across<const CHANNELS: usize>(
        &self,
        rows: &Range<usize>,
        light: impl Fn(&Hit) -> [f64; CHANNELS],
    ) -> [Vec<f32>; CHANNELS] {
        let width = self.seen.width();
        let height = self.seen.height();
        let rows = rows.start.saturating_sub(1)..height.min(rows.end + 1);
        let mut across = [(); CHANNELS].map(|()| Vec::with_capacity(rows.len() * width));
        let mut sharp = [(); CHANNELS].map(|()| vec![0.0; width]);
        let mut smeared = vec![0.0; width];
        for row in rows {
            for (x, hit) in self.seen.row(row).iter().enumerate() {
                for (sharp, light) in sharp.iter_mut().zip(light(hit)) {
                    sharp[x] = (light * self.factor) as f32;
                }
            }
            for (sharp, across) in sharp.iter().zip(&mut across) {
                smear(sharp, self.moment.smear_px, &mut smeared);
                soften_across(&smeared, across);
            }
        }
        across
    }

    /// The other half of the blur of a lens; the border stays. `top` is the row after the first one
    /// in `across`, which is missing at the upper border.
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

/// Brightness of a row in 12 bits: vignetting and noise.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn develop(film: &Film<'_>, soft: &[f32], row: usize, seed: u64, levels: &mut [u16]) {
    let width = film.seen.width();
    let height = film.seen.height();
    let cx = 0.5 * width as f32;
    let cy = 0.5 * height as f32;
    let dy = row as f32 - cy;
    let (gain, [read, shot]) = (film.moment.gain, film.noise);
    let first = (row * width) as u64;
    // A counter of 32 bits, because wider ones are no vector instruction to convert.
    let mut x = 0_i32;
    for (light, level) in soft.iter().zip(levels) {
        let dx = x as f32 - cx;
        // Light falls with the square of the distance from the centre, near enough to cos^4.
        let corner = VIGNETTING * (dx * dx + dy * dy) / (cx * cx + cy * cy);
        let dimmed = f64::from(light * (1.0 - corner)) * gain;
        let sigma = (read + shot * dimmed).sqrt();
        let noisy = dimmed + sigma * normal_at(seed, first.wrapping_add(x as u64));
        *level = (noisy.clamp(0.0, 1.0) * 4095.0) as i32 as u16;
        x = x.wrapping_add(1);
    }
}

/// 12-bit linear light to 8 bit.
static CURVE: LazyLock<[u8; 4096]> = LazyLock::new(|| {
    std::array::from_fn(|i| (255.0 * (i as f64 / 4095.0).powf(1.0 / 2.2)).round() as u8)
});

/// The blur of a camera that turns: a running mean along a row.
fn smear(row: &[f32], by_px: f64, to: &mut [f32]) {
    let reach = (0.5 * by_px.abs()).round() as usize;
    if reach == 0 {
        to.copy_from_slice(row);
        return;
    }
    for (x, to) in to.iter_mut().enumerate() {
        let part = &row[x.saturating_sub(reach)..(x + reach + 1).min(row.len())];
        *to = part.iter().sum::<f32>() / part.len() as f32;
    }
}

/// One half of the blur of a lens: weights 1 2 1 along a row; the border stays.
fn soften_across(row: &[f32], to: &mut Vec<f32>) {
    let from = to.len();
    to.extend_from_slice(row);
    let (Some(inner), true) = (to.get_mut(from + 1..), row.len() > 2) else { return };
    weigh(row, &row[1..], &row[2..], &mut inner[..row.len() - 2]);
}

/// Mean of three rows with the weights 1 2 1.
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
    /// Distance of camera and projector, m.
    pub baseline_m: f64,
    /// Nearest and farthest depth, m.
    pub range_m: [f64; 2],
}

impl DepthSensor {
    /// The depth image; NaN where there is no reading: out of range, too little
    /// light returned, or in the shadow of the projector, which stands to the right.
    pub fn measure(&self, seen: &Image<Hit>, seed: u64, threads: usize) -> DepthImage {
        let mut depth = DepthImage::filled(seen.width(), seen.height(), f32::NAN);
        let width = seen.width();
        in_pieces(depth.pixels_mut(), STRIP_ROWS * width, threads, |number, strip| {
            let mut row = DepthRow::new(width);
            for (y, depth) in (number * STRIP_ROWS..).zip(strip.chunks_mut(width)) {
                row.look(seen, seed, y);
                row.measure(self, seed, y);
                row.cast_shadows(self);
                depth.copy_from_slice(&row.depth_m);
            }
        });
        depth
    }
}

/// One row of a depth image in work.
struct DepthRow {
    /// Columns and rows that each pixel is displaced by.
    off: [Vec<i32>; 2],
    /// Of the surfaces seen: depth, reflectance in the near infrared, cosine to the normal.
    t: Vec<f64>,
    infrared: Vec<f64>,
    facing: Vec<f64>,
    depth_m: Vec<f32>,
}

impl DepthRow {
    fn new(width: usize) -> Self {
        let numbers = || vec![0.0; width];
        Self {
            off: [vec![0; width], vec![0; width]],
            t: numbers(),
            infrared: numbers(),
            facing: numbers(),
            depth_m: vec![f32::NAN; width],
        }
    }

    /// Takes the surfaces near each pixel: measured edges are displaced.
    fn look(&mut self, seen: &Image<Hit>, seed: u64, y: usize) {
        let first = (y * seen.width()) as u64;
        for (salt, off) in [0x54, 0x55].into_iter().zip(&mut self.off) {
            jitter(seed ^ salt, first, off);
        }
        let [columns, rows] = &self.off;
        for (x, here) in seen.row(y).iter().enumerate() {
            let column = x.wrapping_add_signed(columns[x] as isize);
            let row = y.wrapping_add_signed(rows[x] as isize);
            let inside = column < seen.width() && row < seen.height();
            let hit = if inside { &seen.pixels()[row * seen.width() + column] } else { here };
            (self.t[x], self.infrared[x], self.facing[x]) = (hit.t, hit.infrared, hit.facing);
        }
    }

    fn measure(&mut self, sensor: &DepthSensor, seed: u64, y: usize) {
        measure(self, sensor, seed, y as u64);
    }

    /// Removes the readings in the shadow of the projector.
    fn cast_shadows(&mut self, sensor: &DepthSensor) {
        let steps = sensor.focal_px * sensor.baseline_m;
        // From right to left, because the projector stands to the right of the camera: near
        // surfaces shadow the pixels to their left.
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

/// Whole pixels that the places of readings are off by.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn jitter(seed: u64, first: u64, off: &mut [i32]) {
    let mut key = first;
    for off in off {
        *off = (EDGE_JITTER_PX * normal_at(seed, key)).round() as i32;
        key = key.wrapping_add(1);
    }
}

/// Depths without the shadow of the projector; NaN where too little light returns.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn measure(row: &mut DepthRow, sensor: &DepthSensor, seed: u64, y: u64) {
    let width = row.depth_m.len();
    let first = y.wrapping_mul(width as u64);
    let [nearest, farthest] = sensor.range_m;
    // Structured light measures disparities, so depth has steps that grow with its square.
    let steps = STEPS_PER_PX * sensor.focal_px * sensor.baseline_m;
    let t = &row.t[..width];
    let infrared = &row.infrared[..width];
    let facing = &row.facing[..width];
    for (x, depth_m) in row.depth_m.iter_mut().enumerate() {
        let t = t[x];
        let x64 = x as u64;
        let facing = if facing[x] > 0.0 { facing[x] } else { 0.0 };
        let light = infrared[x] * facing / (t * t);
        // The matcher decides for patches of 9 x 9 dots: holes have a size.
        let coarse = 0.5 + uniform_at(seed ^ 0x51, (y >> 2) << 20 | x64 >> 2);
        let fine = 0.75 + 0.5 * uniform_at(seed ^ 0x52, y << 20 | x64);
        let returns = (t >= nearest) & (t <= farthest) & (light > LEAST_RETURN * coarse * fine);
        let disparity = steps / t + normal_at(seed ^ 0x53, first.wrapping_add(x64)) / 6.0;
        let whole = disparity.round();
        let measured = (steps / if whole > 1.0 { whole } else { 1.0 }) as f32;
        *depth_m = if returns { measured } else { f32::NAN };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENSOR: DepthSensor =
        DepthSensor { focal_px: 580.0, baseline_m: 0.075, range_m: [0.5, 8.0] };

    fn wall(t: f64, infrared: f64) -> Hit {
        Hit { t, infrared, facing: 1.0, light: [100.0; 3], person: None }
    }

    fn spread(z: f64) -> (f64, f64) {
        let seen = Image::filled(200, 50, wall(z, 0.6));
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
            let depth = SENSOR.measure(&Image::filled(40, 40, hit), 3, 2);
            depth.pixels().iter().filter(|d| d.is_nan()).count()
        }

        assert_eq!(holes(wall(2.0, 0.6)), 0);
        assert_eq!((holes(wall(0.4, 0.6)), holes(wall(9.0, 0.9))), (1600, 1600));
        assert!(holes(wall(4.0, 0.03)) > 1500);
    }

    #[test]
    fn the_projector_throws_a_shadow_beside_what_is_near() {
        let seen = Image::from_fn(200, 4, |x, _| wall(if x > 100 { 1.0 } else { 3.0 }, 0.6));
        let depth = SENSOR.measure(&seen, 3, 1);
        let holes = depth.row(1).iter().filter(|d| d.is_nan()).count() as f64;
        let expected = 580.0 * 0.075 * (1.0 - 1.0 / 3.0);
        assert!((holes - expected).abs() < 4.0, "{holes} {expected}");
    }

    #[test]
    fn exposure_brings_light_and_dark_rooms_to_one_brightness() {
        let moment = Moment { seed: 1, smear_px: 0.0, gain: 1.0 };
        let mean_and_noise = |light: f64| {
            let seen = Image::filled(64, 64, Hit { light: [light; 3], ..wall(2.0, 0.5) });
            let grey = Exposure::default().grey(&seen, &moment);
            let row = &grey.row(32)[24..40];
            let mean = row.iter().map(|v| f64::from(*v)).sum::<f64>() / 16.0;
            (mean, row.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / 16.0)
        };
        let ((bright, little), (dark, much)) = (mean_and_noise(300.0), mean_and_noise(6.0));
        assert!((bright - dark).abs() < 12.0, "{bright} {dark}");
        assert!(much > 2.0 * little, "{little} {much}");
    }
}
