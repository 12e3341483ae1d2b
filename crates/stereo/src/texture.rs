//! Drops disparities that nothing supports.
//!
//! Where an image is smooth, costs tell nothing, and paths carry the disparity of
//! a person's outline far into a bare wall. An outline belongs to the nearer
//! surface. So a smooth pixel keeps its disparity only if it is that of its textured
//! neighbours in the row, or of the farther one of them: the inside of a person is
//! bounded by the person on both sides, the wall beside is not. What is too far is
//! dropped as what is too near: noise that is cut on one side only leaves all
//! surfaces too far.

use tagalong_core::GreyImage;

/// Disparities that differ by less than this, px, or by less than a tenth, are of
/// one surface: people are not flat.
const SAME_PX: f32 = 0.75;
const SAME_PART: f32 = 0.1;

/// Judges pixels by row; keeps its buffer.
#[derive(Debug, Default)]
pub struct TextureTest {
    /// Which pixels are textured.
    textured: Vec<bool>,
}

impl TextureTest {
    /// Sets the disparities of an image that nothing supports to NaN, and returns
    /// how many. `least` is the least slope of a textured pixel; 0 leaves them all.
    pub fn apply(&mut self, image: &GreyImage, least: u8, disparities: &mut [f32]) -> u64 {
        if least == 0 {
            return 0;
        }
        let last = image.height().saturating_sub(1);
        let rows = disparities.chunks_exact_mut(image.width().max(1)).enumerate();
        rows.map(|(y, row)| {
            let near = [y.saturating_sub(1), y, (y + 1).min(last)];
            self.judge(row, near.map(|y| image.row(y)), least)
        })
        .sum()
    }

    /// As above, for a row of the image with its neighbours.
    fn judge(&mut self, row: &mut [f32], rows: [&[u8]; 3], least: u8) -> u64 {
        self.textured.clear();
        self.textured.resize(row.len(), false);
        find_textured(rows, least, &mut self.textured);
        let (mut dropped, mut from, mut before) = (0, 0, f32::NAN);
        for x in 0..row.len() {
            if self.textured[x] && !row[x].is_nan() {
                let beside = row[x];
                dropped += limit(&mut row[from..x], expected(before, beside));
                (from, before) = (x + 1, beside);
            }
        }
        dropped + limit(&mut row[from..], f32::NAN)
    }
}

/// How much disparities of one surface differ at most.
fn tolerance(disparity: f32) -> f32 {
    SAME_PX.max(SAME_PART * disparity)
}

/// The disparity between two textured pixels; NaN where there is only one.
fn expected(a: f32, b: f32) -> f32 {
    let far = a.min(b);
    let is_one_surface = (a - b).abs() <= tolerance(far);
    if is_one_surface || a.is_nan() || b.is_nan() { 0.5 * (a + b) } else { far }
}

/// Drops the pixels of a stretch that have another disparity, and counts them.
fn limit(stretch: &mut [f32], expected: f32) -> u64 {
    let mut dropped = 0;
    for value in stretch.iter_mut().filter(|value| !value.is_nan()) {
        let off = (*value - expected).abs();
        if off.is_nan() || off > tolerance(expected) {
            (*value, dropped) = (f32::NAN, dropped + 1);
        }
    }
    dropped
}

/// Finds the pixels across which brightness changes by at least so much: half of
/// Sobel's sum. The first and the last column have a neighbour on one side only.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn find_textured(rows: [&[u8]; 3], least: u8, textured: &mut [bool]) {
    let rise = |a: u8, b: u8| i16::from(b).wrapping_sub(i16::from(a));
    let slope = |[a, b, c]: [i16; 3]| a.wrapping_add(b.wrapping_mul(2)).wrapping_add(c).abs() / 2;
    let last = textured.len() - 1;
    for (x, from, to) in [(0, 0, 1.min(last)), (last, last.saturating_sub(1), last)] {
        textured[x] = slope(rows.map(|row| rise(row[from], row[to]))) >= i16::from(least);
    }
    let Some(middle) = textured.get_mut(1..last) else { return };
    let width = middle.len();
    let [a, b, c] = rows.map(|row| (&row[..width], &row[2..width + 2]));
    for (x, textured) in middle.iter_mut().enumerate() {
        let rises = [a, b, c].map(|(left, right)| rise(left[x], right[x]));
        *textured = slope(rises) >= i16::from(least);
    }
}
