//! Drops disparities that nothing supports.
//!
//! Where an image is smooth, costs tell nothing, and paths carry the disparity of
//! a person's outline far into a bare wall. An outline belongs to the nearer
//! surface. So a smooth pixel keeps its disparity only if it is no nearer than
//! both of its textured neighbours in the row: the inside of a person is bounded
//! by the person on both sides, the wall beside is not.

/// Disparities that differ by less than this, px, or by less than a tenth, are of
/// one surface: people are not flat.
const SAME_PX: f32 = 0.75;
const SAME_PART: f32 = 0.1;

/// Judges the pixels of a row; keeps its buffers.
#[derive(Debug, Default)]
pub struct TextureTest {
    /// Which pixels are textured.
    textured: Vec<bool>,
    /// The disparity of the next textured pixel on the right; NaN = there is none.
    right: Vec<f32>,
}

impl TextureTest {
    /// Sets the disparities of a row that nothing supports to NaN, and returns how
    /// many. `rows` are the row of the image and its neighbours, `least` is the
    /// least slope of a textured pixel.
    pub fn apply(&mut self, row: &mut [f32], rows: [&[u8]; 3], least: u8) -> u64 {
        if least == 0 {
            return 0;
        }
        self.textured.clear();
        self.textured.resize(row.len(), false);
        find_textured(rows, least, &mut self.textured);
        self.right.resize(row.len(), f32::NAN);
        let mut next = f32::NAN;
        for (x, right) in self.right.iter_mut().enumerate().rev() {
            *right = next;
            next = if self.textured[x] && !row[x].is_nan() { row[x] } else { next };
        }
        let (mut dropped, mut last) = (0, f32::NAN);
        for ((value, textured), right) in row.iter_mut().zip(&self.textured).zip(&self.right) {
            if value.is_nan() {
                continue;
            }
            if *textured {
                last = *value;
            } else if !is_between(*value, last, *right) {
                *value = f32::NAN;
                dropped += 1;
            }
        }
        dropped
    }
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

/// True if a disparity is none nearer than both of its neighbours'.
fn is_between(value: f32, left: f32, right: f32) -> bool {
    let most = |beside: f32| beside + SAME_PX.max(SAME_PART * beside);
    value <= most(left) && value <= most(right)
}
