//! Matching costs of a row.

use tagalong_core::GreyImage;

use crate::census::{BYTES, CensusRow};
use crate::level::Level;
use crate::rows::Rows;

/// Quantities of an image row that the costs compare.
#[derive(Clone, Debug, Default)]
pub struct Features {
    rows: Rows,
    census: CensusRow,
    brightness: Level,
    slope: Level,
}

impl Features {
    /// Computes the census strings of row `y`, for [`bits`]; see [`CensusRow::compute`].
    pub fn census(&mut self, image: &GreyImage, y: usize, noise: u8, mirrored: Option<usize>) {
        self.rows.load(image, y);
        self.census.compute(&self.rows, noise, mirrored);
    }

    /// Computes the quantities of row `y` that [`blend`] compares.
    pub fn all(&mut self, image: &GreyImage, y: usize, noise: u8, mirrored: Option<usize>) {
        self.census(image, y, noise, mirrored);
        self.brightness.brightness(&self.rows, mirrored);
        self.slope.slope(&self.rows, mirrored);
    }
}

/// Writes the number of differing bits between the left pixel `x` and the right pixel `x - d`, for
/// each column `x` and disparity `d`. `right` is mirrored. Left of the first column the border of
/// the image is continued.
///
/// The costs replace the row that leaves the window, in the row itself and in the column sums, in
/// one pass while they are in registers.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512vl+avx512bitalg",
    "x86_64+avx2"
))]
pub fn bits<const D: usize>(
    left: &Features,
    right: &Features,
    row: &mut [[u8; D]],
    columns: &mut [[u8; D]],
) {
    let width = row.len();
    let columns = &mut columns[..width];
    for x in 0..width {
        let mut costs = [0; D];
        differing(&left.census, &right.census, x, width - 1 - x, &mut costs);
        for d in 0..D {
            columns[x][d] = columns[x][d].wrapping_add(costs[d]).wrapping_sub(row[x][d]);
        }
        row[x] = costs;
    }
}

/// Upper limit of the difference in brightness; above it the pixels show different points, however
/// large the difference is.
pub const MOST_BRIGHTNESS: u8 = 32;
/// Upper limit of the difference in slope, and its weight.
pub const MOST_SLOPE: u8 = 8;
pub const SLOPE_WEIGHT: u8 = 3;

/// Computes the costs of [`bits`] plus the differences of brightness and slope, and halves the sum.
/// The bits alone respond to noise in smooth areas, the differences alone to unequal cameras. The
/// weights were chosen on the Middlebury pairs.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512vl+avx512bitalg",
    "x86_64+avx2"
))]
pub fn blend<const D: usize>(left: &Features, right: &Features, costs: &mut [[u8; D]]) {
    let width = costs.len();
    for (x, costs) in (0..width).zip(costs) {
        let from = width - 1 - x;
        let mut cost = [0; D];
        differing(&left.census, &right.census, x, from, &mut cost);
        add::<D, MOST_BRIGHTNESS, 1>(&left.brightness, &right.brightness, x, from, &mut cost);
        add::<D, MOST_SLOPE, SLOPE_WEIGHT>(&left.slope, &right.slope, x, from, &mut cost);
        // At most 24 + 32 + 3 * 8 = 80, half of which fits in a byte five times, once for each
        // path.
        *costs = cost.map(|cost| cost >> 1);
    }
}

#[inline(always)]
fn differing<const D: usize>(
    left: &CensusRow,
    right: &CensusRow,
    x: usize,
    from: usize,
    costs: &mut [u8; D],
) {
    let l: [u8; BYTES] = std::array::from_fn(|byte| left.planes[byte][x]);
    let r: [&[u8]; BYTES] = std::array::from_fn(|byte| &right.planes[byte][from..from + D]);
    for d in 0..D {
        let first = (l[0] ^ r[0][d]).count_ones() as u8;
        let second = (l[1] ^ r[1][d]).count_ones() as u8;
        let third = (l[2] ^ r[2][d]).count_ones() as u8;
        costs[d] = first.wrapping_add(second).wrapping_add(third);
    }
}

/// Adds the difference, which is 0 if one value lies in the other's range within half a pixel.
#[inline(always)]
fn add<const D: usize, const MOST: u8, const WEIGHT: u8>(
    left: &Level,
    right: &Level,
    x: usize,
    from: usize,
    costs: &mut [u8; D],
) {
    let l = left.own[x];
    let least = left.least[x];
    let greatest = left.most[x];
    let [r, r_least, r_greatest] =
        [&right.own, &right.least, &right.most].map(|row| &row[from..from + D]);
    for d in 0..D {
        let to_right = l.saturating_sub(r_greatest[d]).max(r_least[d].saturating_sub(l));
        let to_left = r[d].saturating_sub(greatest).max(least.saturating_sub(r[d]));
        let difference = to_right.min(to_left).min(MOST);
        costs[d] = costs[d].wrapping_add(difference.wrapping_mul(WEIGHT));
    }
}
