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
    /// The disparity of the next textured pixel on the right; NaN = there is none.
    right: Vec<f32>,
}

/// Change of brightness across each pixel of the middle one of three rows, of
/// columns side by side: half of Sobel's.
fn slope(rows: [&[u8]; 3], x: usize) -> u32 {
    let (before, after) = (x.saturating_sub(1), (x + 1).min(rows[1].len() - 1));
    let rise = |row: &[u8]| i32::from(row[after]).wrapping_sub(i32::from(row[before]));
    (rise(rows[0]) + 2 * rise(rows[1]) + rise(rows[2])).unsigned_abs() / 2
}

impl TextureTest {
    /// Sets the disparities of a row that nothing supports to NaN, and returns how
    /// many. `rows` are the row of the image and its neighbours, `least` is the
    /// least slope of a textured pixel.
    pub fn apply(&mut self, row: &mut [f32], rows: [&[u8]; 3], least: u32) -> u64 {
        let is_anchor = |x: usize, value: f32| !value.is_nan() && slope(rows, x) >= least;
        self.right.clear();
        self.right.resize(row.len(), f32::NAN);
        let mut next = f32::NAN;
        for x in (0..row.len()).rev() {
            self.right[x] = next;
            next = if is_anchor(x, row[x]) { row[x] } else { next };
        }
        let (mut dropped, mut last) = (0, f32::NAN);
        for (x, value) in row.iter_mut().enumerate() {
            if is_anchor(x, *value) {
                last = *value;
            } else if !value.is_nan() && !is_between(*value, last, self.right[x]) {
                *value = f32::NAN;
                dropped += 1;
            }
        }
        dropped
    }
}

/// True if a disparity is none nearer than both of its neighbours'.
fn is_between(value: f32, left: f32, right: f32) -> bool {
    let most = |beside: f32| beside + SAME_PX.max(SAME_PART * beside);
    value <= most(left) && value <= most(right)
}
