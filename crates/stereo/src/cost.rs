//! Matching costs of a row.

use tagalong_core::GreyImage;

use crate::census::{BYTES, CensusRow};
use crate::level::Level;
use crate::rows::Rows;

/// What is compared of a row of an image.
#[derive(Clone, Debug, Default)]
pub struct Features {
    rows: Rows,
    census: CensusRow,
    brightness: Level,
    slope: Level,
}

impl Features {
    /// Of row `y`, what [`bits`] compares; see [`CensusRow::compute`].
    pub fn census(&mut self, image: &GreyImage, y: usize, noise: u8, mirrored: Option<usize>) {
        self.rows.load(image, y);
        self.census.compute(&self.rows, noise, mirrored);
    }

    /// Of row `y`, what [`blend`] compares.
    pub fn all(&mut self, image: &GreyImage, y: usize, noise: u8, mirrored: Option<usize>) {
        self.census(image, y, noise, mirrored);
        self.brightness.brightness(&self.rows, mirrored);
        self.slope.slope(&self.rows, mirrored);
    }
}

/// Writes, for each column `x` and disparity `d`, in how many bits the left
/// pixel `x` and the right pixel `x - d` differ. `right` is mirrored. Left of
/// the image's first column its border goes on.
///
/// The costs take the place of a row that leaves a window, in the row itself and in
/// the sums of columns: at once, while they are in registers.
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

/// Greatest difference of brightness that counts: beyond, a pixel shows something
/// else, however great it is.
pub const MOST_BRIGHTNESS: u8 = 32;
/// Greatest difference of slope that counts, and what it costs.
pub const MOST_SLOPE: u8 = 8;
pub const SLOPE_WEIGHT: u8 = 3;

/// As [`bits`], and the differences of brightness and slope; half of it all. The
/// bits alone make up small patterns where there are none, the differences alone
/// mind unequal cameras. Weights are such that the Middlebury pairs come out best.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512vl+avx512bitalg",
    "x86_64+avx2"
))]
pub fn blend<const D: usize>(left: &Features, right: &Features, costs: &mut [[u8; D]]) {
    let width = costs.len();
    for (x, costs) in (0..width).zip(costs) {
        let (from, mut cost) = (width - 1 - x, [0; D]);
        differing(&left.census, &right.census, x, from, &mut cost);
        add::<D, MOST_BRIGHTNESS, 1>(&left.brightness, &right.brightness, x, from, &mut cost);
        add::<D, MOST_SLOPE, SLOPE_WEIGHT>(&left.slope, &right.slope, x, from, &mut cost);
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
        let differ = |byte: usize| (l[byte] ^ r[byte][d]).count_ones() as u8;
        costs[d] = differ(0).wrapping_add(differ(1)).wrapping_add(differ(2));
    }
}

/// Adds the difference, which is none if one may take the other's value within
/// half a pixel.
#[inline(always)]
fn add<const D: usize, const MOST: u8, const WEIGHT: u8>(
    left: &Level,
    right: &Level,
    x: usize,
    from: usize,
    costs: &mut [u8; D],
) {
    let (l, least, greatest) = (left.own[x], left.least[x], left.most[x]);
    let [r, r_least, r_greatest] =
        [&right.own, &right.least, &right.most].map(|row| &row[from..from + D]);
    for d in 0..D {
        let to_right = l.saturating_sub(r_greatest[d]).max(r_least[d].saturating_sub(l));
        let to_left = r[d].saturating_sub(greatest).max(least.saturating_sub(r[d]));
        let difference = to_right.min(to_left).min(MOST);
        costs[d] = costs[d].wrapping_add(difference.wrapping_mul(WEIGHT));
    }
}
