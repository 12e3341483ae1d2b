//! Matching costs of a row: how many bits of the census strings differ.

use crate::census::{BYTES, CensusRow};

/// Writes, for each column `x` and disparity `d`, in how many bits the left
/// pixel `x` and the right pixel `x - d` differ. `right` is mirrored. Right of
/// the image's first column its border goes on.
#[multiversion::multiversion(targets(
    "x86_64+avx2",
    "x86_64+avx512f+avx512bw+avx512vl+avx512bitalg"
))]
pub fn row<const D: usize>(left: &CensusRow, right: &CensusRow, costs: &mut [[u8; D]]) {
    let width = costs.len();
    for (x, costs) in costs.iter_mut().enumerate() {
        let l: [u8; BYTES] = std::array::from_fn(|byte| left.planes[byte][x]);
        let from = width - 1 - x;
        let r: [&[u8]; BYTES] = std::array::from_fn(|byte| &right.planes[byte][from..from + D]);
        for d in 0..D {
            let differ = |byte: usize| (l[byte] ^ r[byte][d]).count_ones() as u8;
            costs[d] = differ(0).wrapping_add(differ(1)).wrapping_add(differ(2));
        }
    }
}
