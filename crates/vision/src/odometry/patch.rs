//! Brightness around a point, and its difference from an image.

use nalgebra::Vector2;
use tagalong_core::GreyImage;

/// Side of a patch, px.
const SIDE: usize = 7;
/// Pixels of a patch.
pub const PIXELS: usize = SIDE * SIDE;
/// Distance from the centre to the border of a patch, px.
const HALF: usize = SIDE / 2;

/// Brightness around a point, and its slopes, with the mean removed from each, because the exposure
/// of cameras adapts.
#[derive(Clone, Debug)]
pub struct Patch {
    grey: [f32; PIXELS],
    /// Slopes along the rows and along the columns, grey levels per pixel.
    slopes: [[f32; PIXELS]; 2],
    /// Sums of the products of the slopes: xx, xy, yy.
    pub products: [f64; 3],
}

/// Difference between an image and a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Mean over the pixels, grey levels squared.
    pub mean_square: f64,
    /// Sums of the differences times each slope.
    pub along: [f64; 2],
}

impl Patch {
    /// Cuts out the patch around a pixel; `None` if that is too near to the border of the image.
    pub fn new(image: &GreyImage, x: usize, y: usize) -> Option<Self> {
        fn is_inside(at: usize, size: usize) -> bool {
            at > HALF && at + HALF + 1 < size
        }

        if !(is_inside(x, image.width()) && is_inside(y, image.height())) {
            return None;
        }
        let mut grey = [0.0; PIXELS];
        let mut slopes = [[0.0; PIXELS]; 2];
        for i in 0..PIXELS {
            let x = x + i % SIDE - HALF;
            let row = y + i / SIDE - HALF;
            let [above, own, below] = [row - 1, row, row + 1].map(|y| image.row(y));
            grey[i] = f32::from(own[x]);
            slopes[0][i] = 0.5 * (f32::from(own[x + 1]) - f32::from(own[x - 1]));
            slopes[1][i] = 0.5 * (f32::from(below[x]) - f32::from(above[x]));
        }
        let slopes = slopes.map(without_mean);
        let products = [(0, 0), (0, 1), (1, 1)].map(|(a, b)| dot(&slopes[a], &slopes[b]));
        Some(Self { grey: without_mean(grey), slopes, products })
    }

    /// Returns the variance of the brightness, grey levels squared.
    pub fn variance(&self) -> f64 {
        dot(&self.grey, &self.grey) / PIXELS as f64
    }

    /// Compares the patch with an image around a position, which may lie between pixels; `None`
    /// beyond the border of the image.
    pub fn compare(&self, image: &GreyImage, middle: Vector2<f64>) -> Option<Difference> {
        let mut difference = without_mean(sample(image, middle)?);
        difference.iter_mut().zip(&self.grey).for_each(|(shown, own)| *shown -= own);
        Some(Difference {
            mean_square: dot(&difference, &difference) / PIXELS as f64,
            along: [0, 1].map(|axis| dot(&difference, &self.slopes[axis])),
        })
    }
}

/// Samples the brightness around a position, bilinearly.
fn sample(image: &GreyImage, middle: Vector2<f64>) -> Option<[f32; PIXELS]> {
    fn is_inside(at: f64, size: usize) -> bool {
        at >= HALF as f64 && at + ((HALF + 1) as f64) < size as f64
    }

    if !(is_inside(middle.x, image.width()) && is_inside(middle.y, image.height())) {
        return None;
    }
    let left = middle.x as usize - HALF;
    let top = middle.y as usize - HALF;
    let [across, down] = [middle.x, middle.y].map(|at| at.fract() as f32);
    let mut out = [0.0; PIXELS];
    // Each interpolated row is the lower one of one output row and the upper one of the next.
    let mut above = between(image.row(top), left, across);
    for (row, out) in out.chunks_exact_mut(SIDE).enumerate() {
        let below = between(image.row(top + row + 1), left, across);
        for ((out, above), below) in out.iter_mut().zip(&above).zip(&below) {
            *out = above + down * (below - above);
        }
        above = below;
    }
    Some(out)
}

/// Interpolates between the pixels of a row.
fn between(row: &[u8], left: usize, part: f32) -> [f32; SIDE] {
    let pixels = &row[left..=left + SIDE];
    std::array::from_fn(|i| {
        let here = f32::from(pixels[i]);
        let next = f32::from(pixels[i + 1]);
        here + part * (next - here)
    })
}

fn without_mean(mut values: [f32; PIXELS]) -> [f32; PIXELS] {
    let mean = values.iter().sum::<f32>() / PIXELS as f32;
    values.iter_mut().for_each(|value| *value -= mean);
    values
}

fn dot(a: &[f32; PIXELS], b: &[f32; PIXELS]) -> f64 {
    f64::from(a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn image(width: usize, height: usize) -> GreyImage {
        GreyImage::from_fn(width, height, |x, y| ((x * x * 31 + y * 57 + x * y * 13) % 251) as u8)
    }

    /// Interpolates between four pixels, one position after the other.
    fn slow_sample(image: &GreyImage, middle: Vector2<f64>) -> Vec<f64> {
        let mut all = Vec::new();
        for row in -3..=3 {
            for column in -3..=3 {
                let x = middle.x + f64::from(column);
                let y = middle.y + f64::from(row);
                let left = x.floor();
                let top = y.floor();
                let a = x - left;
                let b = y - top;
                let [above, below] = [top, top + 1.0].map(|y| {
                    let [l, r] = [left, left + 1.0]
                        .map(|x| f64::from(image.get(x as i64, y as i64).unwrap()));
                    (1.0 - a) * l + a * r
                });
                all.push((1.0 - b) * above + b * below);
            }
        }
        all
    }

    proptest! {
        #[test]
        fn brightness_between_pixels_is_that_of_the_slow_way(x in 3.0..28.0f64, y in 3.0..18.0f64) {
            let image = image(32, 22);
            let middle = Vector2::new(x, y);
            let fast = sample(&image, middle).unwrap();
            for (fast, slow) in fast.iter().zip(slow_sample(&image, middle)) {
                prop_assert!((f64::from(*fast) - slow).abs() < 1e-3);
            }
        }

        #[test]
        fn nothing_is_read_beyond_the_image(x in -5.0..40.0f64, y in -5.0..30.0f64) {
            let image = image(32, 22);
            let is_inside = (3.0..28.0).contains(&x) && (3.0..18.0).contains(&y);
            prop_assert_eq!(sample(&image, Vector2::new(x, y)).is_some(), is_inside);
        }
    }

    #[test]
    fn a_patch_is_like_itself_in_any_light() {
        let dim = image(32, 22).map(|grey| grey / 2);
        let bright = dim.map(|grey| grey + 100);
        let patch = Patch::new(&dim, 10, 9).unwrap();
        let found = patch.compare(&bright, Vector2::new(10.0, 9.0)).unwrap();
        assert!(found.mean_square < 1e-6, "{found:?}");
    }

    #[test]
    fn the_difference_of_a_ramp_tells_how_far_it_was_moved() {
        let ramp = GreyImage::from_fn(32, 22, |x, y| (4 * x + (y * y) / 4) as u8);
        let patch = Patch::new(&ramp, 12, 10).unwrap();
        let found = patch.compare(&ramp, Vector2::new(12.0, 10.5)).unwrap();
        let [_, _, yy] = patch.products;
        assert!((found.along[1] / yy - 0.5).abs() < 0.05, "{found:?}");
        assert!(Patch::new(&ramp, 3, 10).is_none() && Patch::new(&ramp, 12, 18).is_none());
    }
}
