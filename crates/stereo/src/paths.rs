//! Semi-global matching: the cost of a disparity is summed up along straight
//! paths that end in a pixel, with a small penalty for disparities that change
//! by one and a larger one for greater changes.
//!
//! H. Hirschmueller, *Stereo processing by semiglobal matching and mutual
//! information*, PAMI 2008, section 2.3, equation 13. Paths come from the left,
//! the right and the row above (three directions), so that one pass over the
//! rows is enough and no cost volume is kept.
//!
//! All numbers are bytes. What equation 13 subtracts to keep them small is
//! subtracted when a value is stored, so that a stored value is the excess over
//! the best disparity of that pixel.

/// Bytes between the pixels of a row, that stand for disparities which are none.
const GAP: usize = 16;

/// What it costs to change the disparity along a path.
#[derive(Clone, Debug)]
pub struct Penalties {
    /// To change it by one.
    pub small: u8,
    /// To change it by more, by the difference in brightness of the pixels.
    pub large: [u8; 256],
}

/// The excess costs of a path in one row, and of one pixel outside of the image
/// on both sides.
#[derive(Clone, Debug, Default)]
pub struct Excess {
    cells: Vec<u8>,
}

impl Excess {
    /// Starts anew: no path has come here yet.
    pub fn reset<const D: usize>(&mut self, pixels: usize) {
        self.cells.clear();
        for _ in 0..pixels + 2 {
            self.cells.resize(self.cells.len() + GAP, u8::MAX);
            self.cells.resize(self.cells.len() + D, 0);
        }
        self.cells.resize(self.cells.len() + GAP, u8::MAX);
    }
}

/// One step of a path. `before` are the excess costs of the pixel before, from
/// one below the first disparity to one above the last; `after` becomes those
/// of this pixel.
#[inline(always)]
fn step<const D: usize>(
    cost: &[u8; D],
    before: &[u8],
    small: u8,
    large: u8,
    sum: &mut [u8; D],
) -> [u8; D] {
    let before = &before[..D + 2];
    let own = std::array::from_fn(|d| before[d + 1]);
    let beside = std::array::from_fn(|d| before[d].min(before[d + 2]));
    ahead(cost, &own, &beside, small, large, sum)
}

/// As [`step`], from a pixel whose costs are still in registers.
#[inline(always)]
fn step_on<const D: usize>(
    cost: &[u8; D],
    own: &[u8; D],
    small: u8,
    large: u8,
    sum: &mut [u8; D],
) -> [u8; D] {
    let beside = std::array::from_fn(|d| own[d.saturating_sub(1)].min(own[(d + 1).min(D - 1)]));
    ahead(cost, own, &beside, small, large, sum)
}

#[inline(always)]
fn ahead<const D: usize>(
    cost: &[u8; D],
    own: &[u8; D],
    beside: &[u8; D],
    small: u8,
    large: u8,
    sum: &mut [u8; D],
) -> [u8; D] {
    let mut after = [0; D];
    for d in 0..D {
        let side = beside[d].saturating_add(small);
        after[d] = cost[d].saturating_add(own[d].min(side).min(large));
    }
    let mut least = u8::MAX;
    for a in after {
        least = least.min(a);
    }
    for d in 0..D {
        sum[d] = sum[d].saturating_add(after[d]);
        after[d] = after[d].wrapping_sub(least);
    }
    after
}

/// Where the excess costs of pixel `x` begin, one disparity early.
#[inline(always)]
const fn place<const D: usize>(x: usize) -> usize {
    GAP - 1 + x * (D + GAP)
}

/// What it costs to jump between pixels of these brightnesses.
#[inline(always)]
fn jump(penalties: &Penalties, a: u8, b: u8) -> u8 {
    penalties.large[usize::from(a.abs_diff(b))]
}

/// Writes the sums of the costs of all paths in a row: `excess` are those from above
/// left, above and above right. A path along the row waits for its own last step;
/// meanwhile the others go on.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub fn sums<const D: usize>(
    costs: &[[u8; D]],
    (row, row_above): (&[u8], &[u8]),
    penalties: &Penalties,
    [left, above, right]: &mut [Excess; 3],
    sums: &mut [[u8; D]],
) {
    let (last, small) = (costs.len() - 1, penalties.small);
    let [mut from_left, mut from_right] = [[0; D]; 2];
    // The path from above left reads next where it writes: it waits for a pixel.
    let mut waiting = [0; D];
    for x in 0..=last {
        let (cost, before, here) = (&costs[x], place::<D>(x), place::<D>(x + 1));
        // The path from the right was here first in the right half.
        let mut sum = if 2 * x <= last { [0; D] } else { sums[x] };
        let large = |from: usize| jump(penalties, row[x], row_above[from]);
        let (west, east) = (x.saturating_sub(1), (x + 1).min(last));
        let after = step(cost, &left.cells[before..], small, large(west), &mut sum);
        left.cells[before + 1..=before + D].copy_from_slice(&waiting);
        waiting = after;
        let after = step(cost, &above.cells[here..], small, large(x), &mut sum);
        above.cells[here + 1..=here + D].copy_from_slice(&after);
        let next = place::<D>(x + 2);
        let after = step(cost, &right.cells[next..], small, large(east), &mut sum);
        right.cells[here + 1..=here + D].copy_from_slice(&after);
        let large = jump(penalties, row[x], row[west]);
        from_left = step_on(cost, &from_left, small, large, &mut sum);
        sums[x] = sum;
        let x = last - x;
        let mut sum = if 2 * x > last { [0; D] } else { sums[x] };
        let large = jump(penalties, row[x], row[(x + 1).min(last)]);
        from_right = step_on(&costs[x], &from_right, small, large, &mut sum);
        sums[x] = sum;
    }
    let here = place::<D>(last + 1);
    left.cells[here + 1..=here + D].copy_from_slice(&waiting);
}
