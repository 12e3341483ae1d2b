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

/// Judges the pixels of a row; keeps its buffer.
#[derive(Debug, Default)]
pub struct TextureTest {
    /// Which pixels are textured.
    textured: Vec<bool>,
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
        let (mut dropped, mut from, mut before) = (0, 0, f32::NEG_INFINITY);
        for x in 0..row.len() {
            if self.textured[x] && !row[x].is_nan() {
                let most = most(row[x]);
                dropped += limit(&mut row[from..x], before.min(most));
                (from, before) = (x + 1, most);
            }
        }
        dropped + limit(&mut row[from..], f32::NEG_INFINITY)
    }
}

/// The greatest disparity on a surface beside this one.
fn most(beside: f32) -> f32 {
    beside + SAME_PX.max(SAME_PART * beside)
}

/// Drops the pixels of a stretch that are nearer than that, and counts them.
fn limit(stretch: &mut [f32], most: f32) -> u64 {
    let mut dropped = 0;
    for value in stretch {
        dropped += u64::from(*value > most);
        *value = if *value > most { f32::NAN } else { *value };
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
