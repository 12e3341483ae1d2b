use tagalong_core::GreyImage;
use tagalong_geometry::Rect;

use crate::{Scaling, gradients};

/// Rows and columns of a patch (P4, section II-C).
pub const SIDE: usize = 20;
/// Number of grey values in a patch.
pub const PIXELS: usize = SIDE * SIDE;

/// Normalised grey values of a candidate, row by row.
pub type Patch = [f32; PIXELS];

/// Least root mean square of the grey values about their mean; below it a patch shows nothing but
/// noise.
const LEAST_CONTRAST: f32 = 1.0;

/// Sampler of patches from an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampler {
    /// Fraction of its side by which the square is enlarged.
    pub grow: f64,
    /// Normalisation of the grey values.
    pub scaling: Scaling,
}

impl Sampler {
    /// Samples the patch of a region. Outside the image its border is continued; a patch without
    /// contrast is all zeros (not with `fraction` and `raw`).
    pub fn patch(&self, grey: &GreyImage, region: &Rect) -> Patch {
        let mut patch = [0.0; PIXELS];
        if grey.width() == 0 || grey.height() == 0 {
            return patch;
        }
        let around = region.inflated(self.grow);
        let columns = cells(around.x, around.width, grey.width());
        for (row, (top, bottom)) in cells(around.y, around.height, grey.height()).iter().enumerate()
        {
            for (column, (left, right)) in columns.iter().enumerate() {
                let sum: u64 = (*top..*bottom).map(|y| sum_of(&grey.row(y)[*left..*right])).sum();
                let count = (right - left) * (bottom - top);
                patch[row * SIDE + column] = (sum as f64 / count as f64) as f32;
            }
        }
        match self.scaling {
            Scaling::Unit => normalise(&mut patch),
            Scaling::Gradients => patch = gradients::of(&patch),
            Scaling::Fraction => patch.iter_mut().for_each(|v| *v /= f32::from(u8::MAX)),
            Scaling::Raw => {}
        }
        patch
    }
}

fn sum_of(greys: &[u8]) -> u64 {
    greys.iter().map(|grey| u64::from(*grey)).sum()
}

/// Returns the pixel range of each of the 20 cells along one axis, at least one pixel each.
fn cells(start: f64, length: f64, size: usize) -> [(usize, usize); SIDE] {
    let edges: [f64; SIDE + 1] =
        std::array::from_fn(|k| (start + length * k as f64 / SIDE as f64).clamp(0.0, size as f64));
    std::array::from_fn(|k| {
        // Cells outside the image collapse to its first or last pixel, which continues the
        // border.
        let first = (edges[k] as usize).min(size - 1);
        (first, (edges[k + 1] as usize).clamp(first + 1, size))
    })
}

/// Removes brightness (the mean) and contrast (the length).
fn normalise(patch: &mut Patch) {
    let mean = patch.iter().sum::<f32>() / PIXELS as f32;
    patch.iter_mut().for_each(|v| *v -= mean);
    // The length is the root mean square times the root of the number of pixels, which is
    // `SIDE`.
    let length = patch.iter().map(|v| v * v).sum::<f32>().sqrt();
    let enough = length >= LEAST_CONTRAST * SIDE as f32;
    let factor = if enough { 1.0 / length } else { 0.0 };
    patch.iter_mut().for_each(|v| *v *= factor);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const UNIT: Sampler = Sampler { grow: 0.0, scaling: Scaling::Unit };
    const RAW: Sampler = Sampler { grow: 0.0, scaling: Scaling::Raw };
    const GRADIENTS: Sampler = Sampler { grow: 0.0, scaling: Scaling::Gradients };

    /// The mean of all pixels with column and row in a cell.
    fn slow(grey: &GreyImage, x0: usize, y0: usize, block: usize) -> Vec<f32> {
        let mut sums = vec![0.0f64; PIXELS];
        for y in 0..SIDE * block {
            for x in 0..SIDE * block {
                let cell = y / block * SIDE + x / block;
                sums[cell] += f64::from(grey.row(y0 + y)[x0 + x]);
            }
        }
        sums.iter().map(|sum| (sum / (block * block) as f64) as f32).collect()
    }

    fn noise(width: usize, height: usize, seed: u32) -> GreyImage {
        let mut state = seed | 1;
        GreyImage::from_fn(width, height, |_, _| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        #[test]
        fn cells_are_means_of_their_pixels(seed: u32, x in 0usize..9, y in 0usize..9, block in 1usize..6) {
            let grey = noise(120, 120, seed);
            let side = (SIDE * block) as f64;
            let patch = RAW.patch(&grey, &Rect::new(x as f64, y as f64, side, side));
            for (fast, slow) in patch.iter().zip(slow(&grey, x, y, block)) {
                prop_assert!((fast - slow).abs() < 1e-3);
            }
        }

        #[test]
        fn light_does_not_matter(seed: u32, gain in 0.3f64..0.9, offset in 0.0f64..20.0) {
            let grey = noise(60, 60, seed);
            let other = grey.map(|v| (gain * f64::from(v) + offset).round() as u8);
            let square = Rect::new(2.0, 3.0, 40.0, 40.0);
            for sampler in [UNIT, GRADIENTS] {
                let a = sampler.patch(&grey, &square);
                let b = sampler.patch(&other, &square);
                let correlation: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                prop_assert!(correlation > 0.995, "{correlation}");
            }
        }
    }

    #[test]
    fn a_unit_patch_has_no_mean_and_length_one() {
        let patch = UNIT.patch(&noise(50, 50, 7), &Rect::new(5.5, 4.2, 30.0, 30.0));
        assert!(patch.iter().sum::<f32>().abs() < 1e-4);
        assert!((patch.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_fraction_is_of_the_largest_grey_value() {
        let fraction = Sampler { grow: 0.0, scaling: Scaling::Fraction };
        let grey = noise(50, 50, 7);
        let square = Rect::new(5.5, 4.2, 30.0, 30.0);
        let both = fraction.patch(&grey, &square).into_iter().zip(RAW.patch(&grey, &square));
        both.for_each(|(part, raw)| assert!((255.0 * part - raw).abs() < 1e-3));
    }

    #[test]
    fn flat_walls_and_squares_outside_of_the_image_are_zero() {
        let wall = GreyImage::filled(40, 40, 90);
        for sampler in [UNIT, GRADIENTS] {
            assert_eq!(sampler.patch(&wall, &Rect::new(0.0, 0.0, 30.0, 30.0)), [0.0; PIXELS]);
        }
        let outside = Rect::new(-500.0, -500.0, 20.0, 20.0);
        assert_eq!(UNIT.patch(&noise(40, 40, 3), &outside), [0.0; PIXELS]);
    }

    /// A standard deviation of one grey value is the least.
    #[test]
    fn a_patch_with_less_contrast_is_flat() {
        fn length(amplitude: f32) -> f32 {
            let mut patch: Patch =
                std::array::from_fn(|at| 90.0 + if at % 2 == 0 { amplitude } else { -amplitude });
            normalise(&mut patch);
            patch.iter().map(|v| v * v).sum::<f32>()
        }

        assert!((length(1.02) - 1.0).abs() < 1e-4);
        assert_eq!(length(0.98), 0.0);
    }
}
