//! Semi-global matching: the cost of a disparity is summed up along straight paths that end in a
//! pixel, with a small penalty for disparities that change by one and a larger one for greater
//! changes.
//!
//! H. Hirschmueller, *Stereo processing by semiglobal matching and mutual
//! information*, PAMI 2008, section 2.3, equation 13. Paths come from the left,
//! the right and the row above (three directions), so that one pass over the
//! rows is enough and no cost volume is kept.
//!
//! All values are bytes. The minimum that equation 13 subtracts to keep them small is subtracted
//! when a value is stored, so that a stored value is the excess over the best disparity of that
//! pixel.

/// Padding between the pixels of a row for disparities outside of the range, bytes.
const GAP: usize = 16;

/// Penalties for a change of the disparity along a path.
#[derive(Clone, Debug)]
pub struct Penalties {
    /// Penalty of a change by one.
    pub small: u8,
    /// Penalty of a larger change, by the difference in brightness of the pixels.
    pub large: [u8; 256],
}

/// Excess costs of a path in one row, with one pixel more on both sides of the image.
#[derive(Clone, Debug, Default)]
pub struct Excess {
    cells: Vec<u8>,
}

impl Excess {
    /// Resets the costs to those before the first pixel of a path.
    pub fn reset<const D: usize>(&mut self, pixels: usize) {
        self.cells.clear();
        for _ in 0..pixels + 2 {
            // The largest cost never wins a minimum, so that no end of the range needs a test.
            self.cells.resize(self.cells.len() + GAP, u8::MAX);
            self.cells.resize(self.cells.len() + D, 0);
        }
        self.cells.resize(self.cells.len() + GAP, u8::MAX);
    }
}

/// Takes one step of a path. `before` are the excess costs of the previous pixel, from one below
/// the first disparity to one above the last; returns those of this pixel and adds its costs to
/// `sum`.
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

/// Takes the same step as [`step`], from a pixel with costs that are still in registers.
#[inline(always)]
fn step_on<const D: usize>(
    cost: &[u8; D],
    own: &[u8; D],
    small: u8,
    large: u8,
    sum: &mut [u8; D],
) -> [u8; D] {
    // At the ends a disparity is its own neighbour, which never wins with the penalty added.
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

/// Returns the index of the excess costs of pixel `x`, one disparity early.
#[inline(always)]
const fn place<const D: usize>(x: usize) -> usize {
    GAP - 1 + x * (D + GAP)
}

/// Returns the penalty of a jump between pixels of these brightnesses.
#[inline(always)]
fn jump(penalties: &Penalties, a: u8, b: u8) -> u8 {
    penalties.large[usize::from(a.abs_diff(b))]
}

/// Writes the sums of the costs of all paths in a row: `excess` are those from above left, above
/// and above right. The two paths along the row run at the same time, from both ends, because each
/// waits for its own previous step.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub fn sums<const D: usize>(
    costs: &[[u8; D]],
    (row, row_above): (&[u8], &[u8]),
    penalties: &Penalties,
    [left, above, right]: &mut [Excess; 3],
    sums: &mut [[u8; D]],
) {
    let last = costs.len() - 1;
    let small = penalties.small;
    let [mut from_left, mut from_right] = [[0; D]; 2];
    // The path from above left reads next where it writes, so its result is stored one pixel later.
    let mut waiting = [0; D];
    for x in 0..=last {
        let cost = &costs[x];
        let before = place::<D>(x);
        let here = place::<D>(x + 1);
        // The path from the right has already added to the right half.
        let mut sum = if 2 * x <= last { [0; D] } else { sums[x] };
        let west = x.saturating_sub(1);
        let east = (x + 1).min(last);
        let large = jump(penalties, row[x], row_above[west]);
        let after = step(cost, &left.cells[before..], small, large, &mut sum);
        left.cells[before + 1..=before + D].copy_from_slice(&waiting);
        waiting = after;
        let large = jump(penalties, row[x], row_above[x]);
        let after = step(cost, &above.cells[here..], small, large, &mut sum);
        above.cells[here + 1..=here + D].copy_from_slice(&after);
        let next = place::<D>(x + 2);
        let large = jump(penalties, row[x], row_above[east]);
        let after = step(cost, &right.cells[next..], small, large, &mut sum);
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
