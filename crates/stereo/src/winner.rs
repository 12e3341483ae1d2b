//! Choice of the best disparities of a row from the costs of all disparities.

/// Best disparities of a row, column by column.
#[derive(Clone, Debug, Default)]
pub struct Winners {
    /// Disparity with the lowest cost, px; the smallest one of several.
    pub disparity: Vec<u8>,
    /// Lowest cost ...
    pub cost: Vec<u8>,
    /// ... and the costs of the disparities below and above; the lowest cost itself outside of the
    /// range.
    pub below: Vec<u8>,
    pub above: Vec<u8>,
    /// Lowest cost of a disparity that is not adjacent to the best one.
    pub second: Vec<u8>,
}

/// Disparities and confidences of a row.
pub struct RowWinners<'a> {
    /// Disparities to a fraction of a pixel, px; NaN = unknown.
    pub disparities: &'a mut [f32],
    /// Difference between the second best cost and the best one, as a fraction of the second, 0 to
    /// 255.
    pub confidences: &'a mut [u8],
}

/// Number of pixels without a disparity, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refused {
    /// The match would lie outside of the right image.
    pub outside: u32,
    /// Another match is nearly as good.
    pub not_unique: u32,
}

impl Winners {
    /// Resizes the buffers to the columns of a row.
    pub fn resize(&mut self, width: usize) {
        let Self { disparity, cost, below, above, second } = self;
        for row in [disparity, cost, below, above, second] {
            row.resize(width, 0);
        }
    }

    /// Finds the best disparity of each pixel.
    pub fn find<const D: usize>(&mut self, sums: &[[u8; D]]) {
        lowest(sums, &mut self.cost);
        first(sums, &self.cost, &mut self.disparity);
        rivals(sums, &self.disparity, &mut self.second);
        neighbours(sums, self);
    }

    /// Writes the disparities that lie within the right image and have a second best cost that is
    /// higher by at least the fraction `uniqueness` of it.
    pub fn judge(&self, uniqueness: f32, found: &mut RowWinners<'_>) -> Refused {
        judge(self, uniqueness, found)
    }

    /// Drops the disparities that differ by more than `tolerance` from that of their match in the
    /// right image, which is the best among those of the left pixels matched to it; returns their
    /// number.
    pub fn look_from_right(
        &self,
        tolerance: u8,
        FromRight { best, back }: &mut FromRight,
        disparities: &mut [f32],
    ) -> u32 {
        // Index of right columns: offset by the longest shift to the left.
        const REACH: usize = 256;

        // Iterators that count check for an overflow, which takes as long as the rest.
        fn match_of(x: usize, disparity: u8) -> usize {
            x.wrapping_add(REACH - usize::from(disparity))
        }

        let width = self.disparity.len();
        let disparity = &self.disparity[..width];
        let cost = &self.cost[..width];
        best.clear();
        best.resize(width + REACH, u16::MAX);
        for x in 0..width {
            let best = &mut best[match_of(x, disparity[x])];
            // Cost in the high byte, disparity in the low one: the minimum of both is one
            // comparison.
            *best = (*best).min(u16::from_be_bytes([cost[x], disparity[x]]));
        }
        back.resize(width, 0);
        let back = &mut back[..width];
        for x in 0..width {
            [_, back[x]] = best[match_of(x, disparity[x])].to_be_bytes();
        }
        leave_agreeing(disparity, back, tolerance, disparities)
    }
}

/// Buffers for a row seen from the right image.
#[derive(Debug, Default)]
pub struct FromRight {
    /// Best cost and its disparity by column of the right image.
    best: Vec<u16>,
    /// This disparity at the matches of the pixels of the left image.
    back: Vec<u8>,
}

/// Drops the disparities that differ from those of their matches, and counts them.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn leave_agreeing(there: &[u8], back: &[u8], tolerance: u8, disparities: &mut [f32]) -> u32 {
    let mut dropped = 0_u32;
    for ((there, back), value) in there.iter().zip(back).zip(disparities) {
        let differ = there.abs_diff(*back) > tolerance;
        dropped = dropped.wrapping_add(u32::from(differ & !value.is_nan()));
        *value = if differ { f32::NAN } else { *value };
    }
    dropped
}

// One loop per result of a row, because the compiler vectorises at most one of three results that share a
// loop, and small changes of the code decide which one.

/// Writes the lowest costs.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn lowest<const D: usize>(sums: &[[u8; D]], cost: &mut [u8]) {
    for (sums, cost) in sums.iter().zip(cost) {
        *cost = if D < ENOUGH { least(&filled(sums)) } else { least(sums) };
    }
}

/// Writes the first disparities with these costs.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn first<const D: usize>(sums: &[[u8; D]], cost: &[u8], disparity: &mut [u8]) {
    for ((sums, cost), disparity) in sums.iter().zip(cost).zip(disparity) {
        *disparity = if D < ENOUGH { place(&filled(sums), *cost) } else { place(sums, *cost) };
    }
}

/// Writes the lowest costs of disparities that are not adjacent to these.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn rivals<const D: usize>(sums: &[[u8; D]], disparity: &[u8], second: &mut [u8]) {
    for ((sums, at), second) in sums.iter().zip(disparity).zip(second) {
        *second = if D < ENOUGH { rival(&filled(sums), *at) } else { rival(sums, *at) };
    }
}

/// Writes the costs of the disparities below and above these.
fn neighbours<const D: usize>(sums: &[[u8; D]], winners: &mut Winners) {
    let below = winners.below.iter_mut();
    let above = winners.above.iter_mut();
    for (((sums, at), below), above) in sums.iter().zip(&winners.disparity).zip(below).zip(above) {
        let at = usize::from(*at);
        (*below, *above) = (sums[at.saturating_sub(1)], sums[(at + 1).min(D - 1)]);
    }
}

/// Minimum number of costs for which the compiler makes vector instructions of the loops.
const ENOUGH: usize = 64;

/// Pads the costs to [`ENOUGH`], with the highest cost for disparities out of range.
#[inline(always)]
fn filled<const D: usize>(sums: &[u8; D]) -> [u8; ENOUGH] {
    let mut all = [u8::MAX; ENOUGH];
    all[..D].copy_from_slice(sums);
    all
}

#[inline(always)]
fn least<const D: usize>(values: &[u8; D]) -> u8 {
    let mut least = u8::MAX;
    for value in values {
        least = least.min(*value);
    }
    least
}

#[inline(always)]
fn place<const D: usize>(sums: &[u8; D], cost: u8) -> u8 {
    let mut last = 0;
    for (d, sum) in sums.iter().enumerate() {
        // Numbered from the end, the first of equal costs is a maximum, which needs no branch.
        let from_end = (D - 1 - d) as u8;
        last = last.max(if *sum == cost { from_end } else { 0 });
    }
    (D - 1) as u8 - last
}

#[inline(always)]
fn rival<const D: usize>(sums: &[u8; D], at: u8) -> u8 {
    let below = at.saturating_sub(1);
    let near = at.saturating_add(1).wrapping_sub(below);
    let mut others = [0; D];
    for d in 0..D {
        // Below the range the difference wraps to a large number: one comparison tests both ends.
        let is_beside = (d as u8).wrapping_sub(below) <= near;
        others[d] = sums[d] | u8::from(is_beside).wrapping_neg();
    }
    least(&others)
}

#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
fn judge(winners: &Winners, uniqueness: f32, found: &mut RowWinners<'_>) -> Refused {
    let width = found.disparities.len();
    let Winners { disparity, cost, below, above, second } = winners;
    let disparity = &disparity[..width];
    let cost = &cost[..width];
    let second = &second[..width];
    let below = &below[..width];
    let above = &above[..width];
    let values = &mut *found.disparities;
    let confidences = &mut found.confidences[..width];
    let mut outside_count = 0_u32;
    let mut not_unique_count = 0_u32;
    for x in 0..width {
        let d = disparity[x];
        let rival = f32::from(second[x]);
        let ahead = f32::from(second[x].saturating_sub(cost[x]));
        let outside = u32::from(d) > x as u32;
        let not_unique = !outside & (ahead < uniqueness * rival);
        // A sum with an overflow check cannot be vectorised.
        outside_count = outside_count.wrapping_add(u32::from(outside));
        not_unique_count = not_unique_count.wrapping_add(u32::from(not_unique));
        let value = f32::from(d) + offset(below[x].into(), cost[x].into(), above[x].into());
        values[x] = if outside | not_unique { f32::NAN } else { value };
        // The lower bound keeps two costs of 0 from dividing by zero.
        confidences[x] = (255.0 * ahead / rival.max(1.0)) as u8;
    }
    Refused { outside: outside_count, not_unique: not_unique_count }
}

/// Returns the fraction of a pixel by a parabola through three costs. It is biased towards whole
/// pixels; two lines of equal slope are unbiased, but follow the noise of the sums more and had the
/// larger error overall.
#[inline(always)]
fn offset(below: f32, cost: f32, above: f32) -> f32 {
    let rise = below + above - 2.0 * cost;
    if rise > 0.0 { 0.5 * (below - above) / rise } else { 0.0 }
}
