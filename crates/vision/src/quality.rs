//! Quality of images: depth readings and exposure.

use tagalong_core::{DepthImage, GreyImage};

/// Statistics of the readings of depth images.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct DepthQuality {
    /// Median reading, m.
    pub median_m: f64,
    /// Fraction of the pixels without a reading.
    pub without: f64,
    /// Median step between neighbouring distinct values within a tenth of the median, m; `None` if
    /// they are all equal.
    pub step_m: Option<f64>,
}

impl DepthQuality {
    /// Computes the statistics of several images together; `None` without a reading.
    pub fn of<'a>(images: impl IntoIterator<Item = &'a DepthImage>) -> Option<Self> {
        let mut readings = Vec::new();
        let mut pixels = 0usize;
        for image in images {
            pixels += image.pixels().len();
            let usable = image.pixels().iter().filter(|z| z.is_finite() && **z > 0.0);
            readings.extend(usable.copied());
        }
        readings.sort_by(f32::total_cmp);
        let median = *readings.get(readings.len() / 2)?;
        Some(Self {
            median_m: median.into(),
            without: 1.0 - readings.len() as f64 / pixels as f64,
            step_m: step(&readings, median),
        })
    }
}

/// Returns the median step between distinct values near this one, in sorted readings.
fn step(sorted: &[f32], near: f32) -> Option<f64> {
    let around = &sorted[sorted.partition_point(|z| *z < 0.9 * near)..];
    let around = &around[..around.partition_point(|z| *z <= 1.1 * near)];
    let pairs = around.windows(2).map(|pair| pair[1] - pair[0]);
    let mut steps: Vec<f32> = pairs.filter(|step| *step > 0.0).collect();
    steps.sort_by(f32::total_cmp);
    steps.get(steps.len() / 2).map(|step| f64::from(*step))
}

/// Grey levels below which a pixel is black, and from which on it is saturated.
const BLACK: u8 = 16;
const WHITE: u8 = 250;

/// Statistics of the exposure of an image.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Exposure {
    /// Fraction of the pixels that are black.
    pub black: f64,
    /// Fraction of the pixels that are saturated.
    pub white: f64,
    /// Standard deviation of the grey levels.
    pub contrast: f64,
}

impl Exposure {
    /// Computes the statistics of one image.
    pub fn of(grey: &GreyImage) -> Self {
        let pixels = grey.pixels();
        let count = pixels.len().max(1) as f64;
        let black = pixels.iter().filter(|v| **v < BLACK).count() as f64 / count;
        let white = pixels.iter().filter(|v| **v >= WHITE).count() as f64 / count;
        let mean = pixels.iter().map(|v| f64::from(*v)).sum::<f64>() / count;
        let spread = pixels.iter().map(|v| (f64::from(*v) - mean).powi(2)).sum::<f64>() / count;
        Self { black, white, contrast: spread.sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_are_summed_up() {
        let near = DepthImage::from_fn(10, 10, |x, _| if x < 5 { f32::NAN } else { 2.0 });
        let far = DepthImage::from_fn(10, 10, |_, y| 2.0 + 0.004 * y as f32);
        let quality = DepthQuality::of([&near, &far]).unwrap();
        assert!((quality.without - 0.25).abs() < 1e-12);
        assert!((quality.median_m - 2.008).abs() < 1e-6, "{quality:?}");
        assert!((quality.step_m.unwrap() - 0.004).abs() < 1e-6);
    }

    #[test]
    fn steps_are_those_near_the_median_and_not_of_what_is_nearer_or_farther() {
        // Around 2 m in steps of 4 mm; nearer ones in many steps of 1 mm, farther ones of 10 mm.
        fn reading(x: usize) -> f32 {
            match x {
                0..60 => 1.0 + 0.001 * x as f32,
                60..100 => 1.92 + 0.004 * (x - 60) as f32,
                _ => 2.3 + 0.01 * (x - 100) as f32,
            }
        }

        let both = DepthImage::from_fn(160, 1, |x, _| reading(x));
        let [no_nearer, no_farther] = [60..160, 0..100].map(|range: std::ops::Range<usize>| {
            DepthImage::from_fn(range.len(), 1, |x, _| reading(range.start + x))
        });
        // As many pixels on both sides keep the median at 2 m.
        let level = DepthImage::filled(200, 1, 2.0);
        for image in [&both, &no_nearer, &no_farther] {
            let step_m = DepthQuality::of([image, &level]).unwrap().step_m.unwrap();
            assert!((step_m - 0.004).abs() < 1e-5, "{step_m}");
        }
    }

    #[test]
    fn nothing_read_is_nothing_to_say() {
        assert_eq!(DepthQuality::of([&DepthImage::filled(4, 4, f32::NAN)]), None);
        assert_eq!(DepthQuality::of([]), None);
        let flat = DepthQuality::of([&DepthImage::filled(4, 4, 3.0)]).unwrap();
        assert_eq!((flat.step_m, flat.without), (None, 0.0));
    }

    #[test]
    fn black_and_white_are_told_apart() {
        let half = GreyImage::from_fn(4, 4, |x, _| if x < 1 { 255 } else { 3 });
        let exposure = Exposure::of(&half);
        assert_eq!((exposure.black, exposure.white), (0.75, 0.25));
        assert!((exposure.contrast - 252.0 * (0.25f64 * 0.75).sqrt()).abs() < 1e-9);
        assert_eq!(Exposure::of(&GreyImage::filled(0, 0, 0)).contrast, 0.0);
    }
}
