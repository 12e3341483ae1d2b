//! Sensors: from the surfaces that rays meet to camera images with exposure, blur and noise, and to
//! the depth of a structured-light camera.

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
        let film = Film::new(seen, moment, factor, self.threads);
        let channel = |c: usize| film.expose(c as u64, |hit| hit.light[c]);
        let [red, green, blue] = [channel(0), channel(1), channel(2)];
        RgbImage::from_fn(seen.width(), seen.height(), |x, y| {
            let at = y * seen.width() + x;
            [red[at], green[at], blue[at]]
        })
    }

    /// A grey image.
    pub fn grey(&mut self, seen: &Image<Hit>, moment: &Moment) -> GreyImage {
        let factor = self.adapt(seen);
        let pixels = Film::new(seen, moment, factor, self.threads).expose(0, |hit| luma(hit.light));
        GreyImage::from_fn(seen.width(), seen.height(), |x, y| pixels[y * seen.width() + x])
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
    curve: Vec<u8>,
    threads: usize,
}

impl<'a> Film<'a> {
    fn new(seen: &'a Image<Hit>, moment: &'a Moment, factor: f64, threads: usize) -> Self {
        // Below the base light a camera raises its gain, and the noise with it.
        let gain = (TARGET / factor / BASE_LIGHT).recip().clamp(1.0, 16.0);
        let noise = [(READ_NOISE * gain).powi(2), SHOT_NOISE * SHOT_NOISE * gain];
        Self { seen, moment, factor, noise, curve: gamma_curve(), threads }
    }

    /// One channel: lens blur, motion blur, vignetting, noise, gamma.
    fn expose(&self, channel: u64, light: impl Fn(&Hit) -> f64) -> Vec<u8> {
        let width = self.seen.width();
        let sharp: Vec<f32> =
            self.seen.pixels().iter().map(|hit| (light(hit) * self.factor) as f32).collect();
        let soft = soften(&smear(&sharp, width, self.moment.smear_px), width);
        let mut pixels = vec![0; soft.len()];
        in_pieces(&mut pixels, STRIP_ROWS * width, self.threads, |number, strip| {
            let first = number * STRIP_ROWS * width;
            for ((at, pixel), light) in (first..).zip(strip).zip(&soft[first..]) {
                *pixel = self.develop(*light, at, channel);
            }
        });
        pixels
    }

    fn develop(&self, light: f32, at: usize, channel: u64) -> u8 {
        let (width, height) = (self.seen.width(), self.seen.height());
        let (cx, cy) = (0.5 * width as f32, 0.5 * height as f32);
        let (dx, dy) = ((at % width) as f32 - cx, (at / width) as f32 - cy);
        // Light falls with the square of the distance from the centre, near enough to cos^4.
        let corner = VIGNETTING * (dx * dx + dy * dy) / (cx * cx + cy * cy);
        let dimmed = f64::from(light * (1.0 - corner)) * self.moment.gain;
        let sigma = (self.noise[0] + self.noise[1] * dimmed).sqrt();
        let noisy = dimmed + sigma * normal_at(self.moment.seed ^ (channel << 48), at as u64);
        self.curve[(noisy.clamp(0.0, 1.0) * 4095.0) as usize]
    }
}

/// 12-bit linear light to 8 bit.
fn gamma_curve() -> Vec<u8> {
    (0..4096).map(|i| (255.0 * (f64::from(i) / 4095.0).powf(1.0 / 2.2)).round() as u8).collect()
}

/// The blur of a camera that turns: a running mean along the rows.
fn smear(values: &[f32], width: usize, by_px: f64) -> Vec<f32> {
    let reach = (0.5 * by_px.abs()).round() as usize;
    if reach == 0 {
        return values.to_vec();
    }
    let blur = |row: &[f32]| -> Vec<f32> {
        let mean = |x: usize| {
            let part = &row[x.saturating_sub(reach)..(x + reach + 1).min(width)];
            part.iter().sum::<f32>() / part.len() as f32
        };
        (0..width).map(mean).collect()
    };
    values.chunks(width).flat_map(blur).collect()
}

/// The blur of a lens: weights 1 2 1 both ways; the border stays.
fn soften(values: &[f32], width: usize) -> Vec<f32> {
    let mut across = values.to_vec();
    for (to, from) in across.chunks_mut(width).zip(values.chunks(width)) {
        for x in 1..width.saturating_sub(1) {
            to[x] = 0.25 * (from[x - 1] + 2.0 * from[x] + from[x + 1]);
        }
    }
    let mut both = across.clone();
    for at in width..values.len().saturating_sub(width) {
        both[at] = 0.25 * (across[at - width] + 2.0 * across[at] + across[at + width]);
    }
    both
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
        in_pieces(depth.pixels_mut(), seen.width(), threads, |y, row| {
            self.measure_row(seen, seed, y, row);
        });
        depth
    }

    fn measure_row(&self, seen: &Image<Hit>, seed: u64, y: usize, row: &mut [f32]) {
        // From right to left, because the projector stands to the right of the camera: near
        // surfaces shadow the pixels to their left.
        let mut leftmost = f64::INFINITY;
        for x in (0..row.len()).rev() {
            let key = (y * row.len() + x) as u64;
            let hit = jittered(seen, x, y, seed, key);
            let lit_from = x as f64 - self.focal_px * self.baseline_m / hit.t;
            let shadowed = lit_from > leftmost + 1.0;
            leftmost = leftmost.min(lit_from);
            if !shadowed && self.returns(&hit, x, y, seed) {
                row[x] = self.quantised(hit.t, seed, key) as f32;
            }
        }
    }

    fn returns(&self, hit: &Hit, x: usize, y: usize, seed: u64) -> bool {
        let light = hit.infrared * hit.facing.max(0.0) / (hit.t * hit.t);
        // The matcher decides for patches of 9 x 9 dots: holes have a size.
        let patch = ((y / 4) << 20 | (x / 4)) as u64;
        let coarse = 0.5 + uniform_at(seed ^ 0x51, patch);
        let fine = 0.75 + 0.5 * uniform_at(seed ^ 0x52, (y << 20 | x) as u64);
        (self.range_m[0]..=self.range_m[1]).contains(&hit.t) && light > LEAST_RETURN * coarse * fine
    }

    fn quantised(&self, depth_m: f64, seed: u64, key: u64) -> f64 {
        // Structured light measures disparities, so depth has steps that grow with its square.
        let steps = STEPS_PER_PX * self.focal_px * self.baseline_m;
        let disparity = steps / depth_m + normal_at(seed ^ 0x53, key) / 6.0;
        steps / disparity.round().max(1.0)
    }
}

/// Returns a surface seen near a pixel: measured edges are displaced.
fn jittered(seen: &Image<Hit>, x: usize, y: usize, seed: u64, key: u64) -> Hit {
    let off = |salt: u64| (EDGE_JITTER_PX * normal_at(seed ^ salt, key)).round() as i64;
    let near = seen.get(x as i64 + off(0x54), y as i64 + off(0x55));
    near.unwrap_or_else(|| seen.pixels()[y * seen.width() + x])
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
        let holes = |hit: Hit| {
            let depth = SENSOR.measure(&Image::filled(40, 40, hit), 3, 2);
            depth.pixels().iter().filter(|d| d.is_nan()).count()
        };
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
