//! Removal of disparities without support from texture.
//!
//! Where an image is smooth, costs carry no information, and paths extend the disparity of a
//! person's outline far into a bare wall. An outline belongs to the nearer surface. Therefore a
//! smooth pixel only keeps its disparity if it equals that of its textured neighbours in the row,
//! or of the farther one of them: the interior of a person lies between two outlines of the person,
//! whereas the wall beside does not. Disparities that are too small are dropped like those that are
//! too large, because removing noise on one side only would make all surfaces too far.

use tagalong_core::GreyImage;

use crate::share::{band_rows, share};

/// Largest difference between disparities of one surface, px, or as a fraction, because people are
/// not flat.
const SAME_PX: f32 = 0.75;
const SAME_PART: f32 = 0.1;

/// Filter of pixels by row; keeps its buffers.
#[derive(Debug, Default)]
pub struct TextureTest {
    /// One for each thread.
    bands: Vec<Band>,
}

/// Buffers for a row, and the number of dropped pixels of a band.
#[derive(Debug, Default)]
struct Band {
    dropped: u64,
    /// Mask of each pixel: all bits set if it is textured and has a disparity.
    textured: Vec<u32>,
    /// Disparity of the last textured pixel up to each one, and of the next.
    before: Vec<f32>,
    behind: Vec<f32>,
}

impl TextureTest {
    /// Sets the unsupported disparities of an image to NaN, and returns their number. `least` is
    /// the minimum slope of a textured pixel; 0 leaves them all.
    pub fn apply(
        &mut self,
        image: &GreyImage,
        least: u8,
        threads: usize,
        disparities: &mut [f32],
    ) -> u64 {
        let width = image.width();
        let height = image.height();
        if least == 0 || disparities.is_empty() {
            return 0;
        }
        let rows = band_rows(height, threads);
        self.bands.resize_with(height.div_ceil(rows), Band::default);
        let jobs = self.bands.iter_mut().zip(disparities.chunks_mut(rows * width)).enumerate();
        share(jobs, |(i, (band, disparities))| {
            let all = (i * rows..).zip(disparities.chunks_exact_mut(width));
            let judged = all.map(|(y, row)| {
                let near = [y.saturating_sub(1), y, (y + 1).min(height - 1)];
                band.judge(row, near.map(|y| image.row(y)), least)
            });
            band.dropped = judged.sum();
        });
        self.bands.iter().map(|band| band.dropped).sum()
    }
}

impl Band {
    /// Filters one row of the image, given its neighbours.
    fn judge(&mut self, row: &mut [f32], rows: [&[u8]; 3], least: u8) -> u64 {
        for buffer in [&mut self.before, &mut self.behind] {
            buffer.resize(row.len(), f32::NAN);
        }
        self.textured.resize(row.len(), 0);
        find_textured(rows, least, &mut self.textured);
        leave_known(row, &mut self.textured);
        let mut last = f32::NAN.to_bits();
        let own = row.iter().zip(&self.textured);
        for ((own, textured), before) in own.clone().zip(&mut self.before) {
            *before = carried(&mut last, *own, *textured);
        }
        last = f32::NAN.to_bits();
        for ((own, textured), behind) in own.zip(&mut self.behind).rev() {
            *behind = carried(&mut last, *own, *textured);
        }
        u64::from(limit(row, &self.before, &self.behind))
    }
}

/// Propagates the disparity of the last textured pixel. It uses bit masks, because branches on the
/// texture would be mispredicted.
#[inline(always)]
const fn carried(last: &mut u32, own: f32, textured: u32) -> f32 {
    *last = (own.to_bits() & textured) | (*last & !textured);
    f32::from_bits(*last)
}

/// Clears the masks of pixels without a disparity.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn leave_known(row: &[f32], textured: &mut [u32]) {
    for (textured, own) in textured.iter_mut().zip(row) {
        *textured &= u32::from(!own.is_nan()).wrapping_neg();
    }
}

/// Returns the maximum difference between disparities of one surface.
#[inline(always)]
fn tolerance(disparity: f32) -> f32 {
    SAME_PX.max(SAME_PART * disparity)
}

/// Returns the expected disparity between two textured pixels; NaN if there is only one.
#[inline(always)]
fn expected(a: f32, b: f32) -> f32 {
    let far = if a < b { a } else { b };
    let mean = 0.5 * (a + b);
    if (a - b).abs() > tolerance(far) { far } else { mean }
}

/// Drops the pixels whose disparity differs from the expected one, and counts them.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn limit(row: &mut [f32], before: &[f32], behind: &[f32]) -> u32 {
    let before = &before[..row.len()];
    let behind = &behind[..row.len()];
    let mut dropped = 0;
    for (x, value) in row.iter_mut().enumerate() {
        let expected = expected(before[x], behind[x]);
        let stays = (*value - expected).abs() <= tolerance(expected);
        // A sum with an overflow check cannot be vectorised.
        dropped = u32::wrapping_add(dropped, u32::from(!stays & !value.is_nan()));
        *value = if stays { *value } else { f32::NAN };
    }
    dropped
}

/// Finds the pixels across which brightness changes by at least `least`: half of Sobel's sum. The
/// first and the last column have a neighbour on one side only.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn find_textured(rows: [&[u8]; 3], least: u8, textured: &mut [u32]) {
    fn rise(a: u8, b: u8) -> i16 {
        i16::from(b).wrapping_sub(i16::from(a))
    }

    fn slope([a, b, c]: [i16; 3]) -> i16 {
        a.wrapping_add(b.wrapping_mul(2)).wrapping_add(c).abs() / 2
    }

    fn mask(slope: i16, least: u8) -> u32 {
        if slope >= i16::from(least) { u32::MAX } else { 0 }
    }

    let last = textured.len() - 1;
    for (x, from, to) in [(0, 0, 1.min(last)), (last, last.saturating_sub(1), last)] {
        textured[x] = mask(slope(rows.map(|row| rise(row[from], row[to]))), least);
    }
    let Some(middle) = textured.get_mut(1..last) else { return };
    let width = middle.len();
    let [a, b, c] = rows.map(|row| (&row[..width], &row[2..width + 2]));
    for (x, textured) in middle.iter_mut().enumerate() {
        let rises = [a, b, c].map(|(left, right)| rise(left[x], right[x]));
        *textured = mask(slope(rises), least);
    }
}
