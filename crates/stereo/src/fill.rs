//! Filling of small holes in a surface.

/// Maximum size of holes that are filled.
#[derive(Clone, Copy, Debug)]
pub struct Most {
    /// Length along a row, pixels ...
    pub px: usize,
    /// ... or in baselines, whichever is longer: at disparity `d` a baseline is `d` pixels long.
    pub baselines: f32,
    /// Difference between the disparities at the ends, px.
    pub step: f32,
}

impl Most {
    fn spans(&self, hole: usize, from: f32, to: f32) -> bool {
        let most = (self.px as f32).max(self.baselines * from.min(to));
        hole as f32 <= most && (to - from).abs() <= self.step
    }
}

/// Fills small holes along a row by linear interpolation; returns the number of pixels filled. An
/// area that only one camera sees lies between a near and a far surface, and so stays open.
pub fn holes(image: &mut [f32], width: usize, most: &Most) -> u64 {
    let rows = image.chunks_exact_mut(width.max(1));
    rows.map(|row| fill_row(row, most)).sum()
}

fn fill_row(row: &mut [f32], most: &Most) -> u64 {
    let mut filled = 0;
    let mut known = next(row, 0, |v| !v.is_nan());
    while let Some(hole) = known.and_then(|at| next(row, at, f32::is_nan)) {
        known = next(row, hole, |v| !v.is_nan());
        let Some(end) = known else { break };
        if most.spans(end - hole, row[hole - 1], row[end]) {
            bridge(&mut row[hole - 1..=end]);
            filled += (end - hole) as u64;
        }
    }
    filled
}

/// Returns the next column from `at` on that satisfies the condition.
fn next(row: &[f32], at: usize, is_so: impl Fn(f32) -> bool) -> Option<usize> {
    row[at..].iter().position(|v| is_so(*v)).map(|columns| at + columns)
}

fn bridge(row: &mut [f32]) {
    let end = row.len() - 1;
    let first = row[0];
    let slope = (row[end] - row[0]) / end as f32;
    for (i, value) in row.iter_mut().enumerate().take(end).skip(1) {
        *value = first + slope * i as f32;
    }
}
