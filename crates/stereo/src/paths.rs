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
    let mut after = [0; D];
    let before = &before[..D + 2];
    for d in 0..D {
        let side = before[d].min(before[d + 2]).saturating_add(small);
        after[d] = cost[d].saturating_add(before[d + 1].min(side).min(large));
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

/// Takes the paths from the left, from above and from above on the right to a
/// row, and writes the sum of their costs.
#[multiversion::multiversion(targets("x86_64+avx2", "x86_64+avx512f+avx512bw+avx512vl"))]
pub fn forward<const D: usize>(
    costs: &[[u8; D]],
    rows: (&[u8], &[u8]),
    penalties: &Penalties,
    above: &mut Excess,
    right: &mut Excess,
    sums: &mut [[u8; D]],
) {
    let (row, row_above) = rows;
    let mut line = [u8::MAX; 512];
    line[1..=D].fill(0);
    for x in 0..costs.len() {
        let grey = row[x];
        let large = |other: u8| penalties.large[usize::from(grey.abs_diff(other))];
        let mut sum = [0; D];
        let after =
            step(&costs[x], &line, penalties.small, large(row[x.saturating_sub(1)]), &mut sum);
        line[1..=D].copy_from_slice(&after);
        let here = place::<D>(x + 1);
        let after =
            step(&costs[x], &above.cells[here..], penalties.small, large(row_above[x]), &mut sum);
        above.cells[here + 1..=here + D].copy_from_slice(&after);
        let next = place::<D>(x + 2);
        let beside = row_above[(x + 1).min(costs.len() - 1)];
        let after = step(&costs[x], &right.cells[next..], penalties.small, large(beside), &mut sum);
        right.cells[here + 1..=here + D].copy_from_slice(&after);
        sums[x] = sum;
    }
}

/// Takes the paths from the right and from above on the left to a row, and adds
/// their costs to the sums.
#[multiversion::multiversion(targets("x86_64+avx2", "x86_64+avx512f+avx512bw+avx512vl"))]
pub fn backward<const D: usize>(
    costs: &[[u8; D]],
    rows: (&[u8], &[u8]),
    penalties: &Penalties,
    left: &mut Excess,
    sums: &mut [[u8; D]],
) {
    let (row, row_above) = rows;
    let mut line = [u8::MAX; 512];
    line[1..=D].fill(0);
    for x in (0..costs.len()).rev() {
        let grey = row[x];
        let large = |other: u8| penalties.large[usize::from(grey.abs_diff(other))];
        let mut sum = sums[x];
        let beside = row[(x + 1).min(costs.len() - 1)];
        let after = step(&costs[x], &line, penalties.small, large(beside), &mut sum);
        line[1..=D].copy_from_slice(&after);
        let before = place::<D>(x);
        let beside = row_above[x.saturating_sub(1)];
        let after =
            step(&costs[x], &left.cells[before..], penalties.small, large(beside), &mut sum);
        let here = place::<D>(x + 1);
        left.cells[here + 1..=here + D].copy_from_slice(&after);
        sums[x] = sum;
    }
}
