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

/// What it costs to jump between pixels of these brightnesses.
#[inline(always)]
fn jump(penalties: &Penalties, a: u8, b: u8) -> u8 {
    penalties.large[usize::from(a.abs_diff(b))]
}

/// Adds the costs of the paths from the left and from the right to the sums of a
/// row. A path waits for its own last step; two of them wait together.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub fn along<const D: usize>(
    costs: &[[u8; D]],
    row: &[u8],
    penalties: &Penalties,
    sums: &mut [[u8; D]],
) {
    let last = costs.len() - 1;
    let mut lines = [[u8::MAX; 512]; 2];
    for line in &mut lines {
        line[1..=D].fill(0);
    }
    let [from_left, from_right] = &mut lines;
    for x in 0..=last {
        let large = jump(penalties, row[x], row[x.saturating_sub(1)]);
        let after = step(&costs[x], from_left, penalties.small, large, &mut sums[x]);
        from_left[1..=D].copy_from_slice(&after);
        let x = last - x;
        let large = jump(penalties, row[x], row[(x + 1).min(last)]);
        let after = step(&costs[x], from_right, penalties.small, large, &mut sums[x]);
        from_right[1..=D].copy_from_slice(&after);
    }
}

/// Adds the costs of the paths from above, on the left and on the right too, to
/// the sums of a row.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub fn down<const D: usize>(
    costs: &[[u8; D]],
    (row, row_above): (&[u8], &[u8]),
    penalties: &Penalties,
    [left, above, right]: &mut [Excess; 3],
    sums: &mut [[u8; D]],
) {
    let (last, small) = (costs.len() - 1, penalties.small);
    // The path from the left writes where it reads next.
    let mut beside = [u8::MAX; 512];
    beside[1..=D].fill(0);
    for x in 0..=last {
        let (cost, mut sum, here) = (&costs[x], sums[x], place::<D>(x + 1));
        let large = |from: usize| jump(penalties, row[x], row_above[from]);
        let after = step(cost, &beside, small, large(x.saturating_sub(1)), &mut sum);
        beside[1..=D].copy_from_slice(&left.cells[here + 1..=here + D]);
        left.cells[here + 1..=here + D].copy_from_slice(&after);
        let after = step(cost, &above.cells[here..], small, large(x), &mut sum);
        above.cells[here + 1..=here + D].copy_from_slice(&after);
        let next = place::<D>(x + 2);
        let after = step(cost, &right.cells[next..], small, large((x + 1).min(last)), &mut sum);
        right.cells[here + 1..=here + D].copy_from_slice(&after);
        sums[x] = sum;
    }
}
