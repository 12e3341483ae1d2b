//! From the costs of all disparities of a row to the best ones.

/// The best disparity of a pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Winner {
    /// The disparity with the lowest cost, px.
    pub disparity: u8,
    /// Its cost ...
    pub cost: u8,
    /// ... and those of the disparities below and above; its own where there
    /// is none.
    pub beside: [u8; 2],
    /// The lowest cost of a disparity that is not beside the best one.
    pub second: u8,
}

impl Winner {
    /// How far the second best cost is above the best one, as a fraction of
    /// the second, 0 to 1.
    pub fn margin(&self) -> f32 {
        f32::from(self.second.saturating_sub(self.cost)) / f32::from(self.second.max(1))
    }

    /// True if the second best cost is above the best one by less than this
    /// fraction of it.
    pub fn is_doubtful(&self, uniqueness: f32) -> bool {
        f32::from(self.second.saturating_sub(self.cost)) < uniqueness * f32::from(self.second)
    }

    /// The disparity to a fraction of a pixel, by a parabola through the three
    /// costs. It leans to whole pixels; two lines of equal slope, which do not,
    /// follow the noise of the sums more, and were further off in all.
    pub fn refined(&self) -> f32 {
        let [below, above] = self.beside.map(f32::from);
        let rise = below + above - 2.0 * f32::from(self.cost);
        let offset = if rise > 0.0 { 0.5 * (below - above) / rise } else { 0.0 };
        f32::from(self.disparity) + offset
    }
}

/// Finds the best disparity of each pixel.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512vl", "x86_64+avx2"))]
pub fn row<const D: usize>(sums: &[[u8; D]], winners: &mut [Winner]) {
    for (sums, winner) in sums.iter().zip(winners) {
        *winner = best(sums);
    }
}

#[inline(always)]
fn best<const D: usize>(sums: &[u8; D]) -> Winner {
    let cost = least(sums, |_| true);
    let mut at = u8::MAX;
    for (d, sum) in sums.iter().enumerate() {
        at = at.min(if *sum == cost { d as u8 } else { u8::MAX });
    }
    let d = usize::from(at);
    let beside = [sums[d.saturating_sub(1)], sums[(d + 1).min(D - 1)]];
    let below = at.saturating_sub(1);
    let near = at.saturating_add(1).wrapping_sub(below);
    let second = least(sums, |d| d.wrapping_sub(below) > near);
    Winner { disparity: at, cost, beside, second }
}

/// The least of those that count.
#[inline(always)]
fn least<const D: usize>(cells: &[u8; D], counts: impl Fn(u8) -> bool) -> u8 {
    let mut least = u8::MAX;
    for (d, cell) in cells.iter().enumerate() {
        least = least.min(if counts(d as u8) { *cell } else { u8::MAX });
    }
    least
}
