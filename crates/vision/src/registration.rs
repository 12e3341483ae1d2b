//! Check of the registration of depth to colour, by the overlap of outlines in depth with edges of
//! the intensity image.
//!
//! An outline in depth is a jump between neighbouring readings of a row (or of a column). Pixels
//! without a reading between them, the shadow beside a near object, are skipped, and the outline
//! belongs to the nearer side. If depth is registered, the intensity changes across most outlines;
//! if it is shifted by a few pixels, it does not. So the mean change of intensity across all
//! outlines, as a function of the shift of the outlines, peaks at the offset.

use tagalong_core::{DepthImage, GreyImage};

/// Settings of the comparison.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OverlapSettings {
    /// Maximum offset that is tried in each direction, pixels.
    pub reach_px: usize,
    /// Relative difference of readings beyond which they belong to two objects.
    pub jump: f32,
    /// Longest run without a reading between the two sides of an outline, pixels.
    pub shadow_px: usize,
    /// Maximum depth of a reading that is used, m.
    pub max_depth_m: f32,
    /// Limit to which changes of intensity are clamped, grey levels.
    pub ceiling: u8,
}

impl Default for OverlapSettings {
    fn default() -> Self {
        Self { reach_px: 16, jump: 0.1, shadow_px: 24, max_depth_m: 6.0, ceiling: 40 }
    }
}

/// Offset between depth and colour.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Offset {
    /// Columns and rows by which the depth image has to be shifted to match the colour image.
    pub px: [i32; 2],
    /// Standard errors of both, by leaving out each part of the images in turn, pixels.
    pub error_px: [f64; 2],
    /// Relative increase of the intensity change across the outlines from no offset to this one.
    pub gain: f64,
    /// Relative increase compared with the average over all offsets.
    pub contrast: f64,
    /// Number of outline pixels that were compared.
    pub outlines: u64,
}

/// Number of parts that are left out in turn: the quarters of even and of odd frames.
const PARTS: usize = 8;

/// Sums over frames of the intensity changes across outlines.
#[derive(Clone, Debug)]
pub struct EdgeOverlap {
    settings: OverlapSettings,
    frames: usize,
    /// For each part, the sums over all offsets, row by row, and the number of outlines.
    parts: [(Vec<u64>, u64); PARTS],
}

/// Outline pixel: its column and row, and true if it was crossed along a column.
type Outline = (usize, usize, bool);

impl EdgeOverlap {
    /// Creates the sums before the first frame.
    pub fn new(settings: OverlapSettings) -> Self {
        let side = 2 * settings.reach_px + 1;
        Self { settings, frames: 0, parts: std::array::from_fn(|_| (vec![0; side * side], 0)) }
    }

    /// Adds a frame; images of different size are ignored.
    pub fn add(&mut self, grey: &GreyImage, depth: &DepthImage) {
        let size = (grey.width(), grey.height());
        if size != (depth.width(), depth.height()) {
            return;
        }
        let changes = Changes::of(grey, self.settings.ceiling);
        for outline in outlines(depth, &self.settings) {
            let quarter =
                usize::from(2 * outline.0 >= size.0) + 2 * usize::from(2 * outline.1 >= size.1);
            let part = &mut self.parts[4 * (self.frames % 2) + quarter];
            changes.collect(outline, self.settings.reach_px, part);
        }
        self.frames += 1;
    }

    /// Returns the offset; `None` without outlines and edges.
    pub fn offset(&self) -> Option<Offset> {
        let all = self.without(None);
        let outlines: u64 = self.parts.iter().map(|(_, count)| count).sum();
        let best = self.peak(&all)?;
        let here = all[all.len() / 2];
        let there = all[best];
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let px = self.offset_of(best);
        let counted = (0..PARTS).filter(|part| self.parts[*part].1 > 0);
        let peaks: Vec<[i32; 2]> = counted
            .filter_map(|part| self.peak(&self.without(Some(part))))
            .map(|at| self.offset_of(at))
            .collect();
        Some(Offset {
            px,
            error_px: [0, 1].map(|axis| jackknife(peaks.iter().map(|p| f64::from(p[axis])))),
            gain: there / here.max(1e-9) - 1.0,
            contrast: there / mean.max(1e-9) - 1.0,
            outlines,
        })
    }

    /// Returns the mean change across the outlines for each offset, smoothed; one of the parts can
    /// be left out.
    fn without(&self, left_out: Option<usize>) -> Vec<f64> {
        let side = 2 * self.settings.reach_px + 1;
        let kept = self.parts.iter().enumerate().filter(|(i, _)| Some(*i) != left_out);
        let count = kept.clone().map(|(_, (_, count))| count).sum::<u64>().max(1) as f64;
        let mut means = Vec::with_capacity(side * side);
        for i in 0..side * side {
            means.push(kept.clone().map(|(_, (sums, _))| sums[i]).sum::<u64>() as f64 / count);
        }
        smoothed(&means, side)
    }

    fn peak(&self, scores: &[f64]) -> Option<usize> {
        let best = (0..scores.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b]))?;
        (scores[best] > 0.0).then_some(best)
    }

    fn offset_of(&self, index: usize) -> [i32; 2] {
        let reach = self.settings.reach_px as i32;
        let side = 2 * self.settings.reach_px + 1;
        [(index % side) as i32 - reach, (index / side) as i32 - reach]
    }
}

/// Returns the jackknife standard error of a figure, from its values with one part left out each
/// (Quenouille; Tukey).
fn jackknife(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count.max(1.0);
    let spread = values.map(|value| (value - mean).powi(2)).sum::<f64>();
    ((count - 1.0).max(0.0) / count.max(1.0) * spread).sqrt()
}

/// Returns the mean over three by three offsets, so that noise does not decide where the peak is.
fn smoothed(scores: &[f64], side: usize) -> Vec<f64> {
    let mut means = Vec::with_capacity(side * side);
    for y in 0..side {
        for x in 0..side {
            let [columns, rows] = [x, y].map(|at| at.saturating_sub(1)..(at + 2).min(side));
            let around = rows.flat_map(|y| columns.clone().map(move |x| scores[y * side + x]));
            means.push(around.clone().sum::<f64>() / around.count() as f64);
        }
    }
    means
}

/// Changes of intensity between columns and between rows.
struct Changes {
    width: usize,
    height: usize,
    along_row: Vec<u8>,
    along_column: Vec<u8>,
}

impl Changes {
    fn of(grey: &GreyImage, ceiling: u8) -> Self {
        fn next(at: usize, size: usize) -> usize {
            (at + 1).min(size - 1)
        }

        let width = grey.width();
        let height = grey.height();
        let mut along_row = Vec::with_capacity(width * height);
        let mut along_column = Vec::with_capacity(width * height);
        for y in 0..height {
            let row = grey.row(y);
            let above = grey.row(y.saturating_sub(1));
            let below = grey.row(next(y, height));
            for x in 0..width {
                let across = row[x.saturating_sub(1)].abs_diff(row[next(x, width)]);
                along_row.push(across.min(ceiling));
                along_column.push(above[x].abs_diff(below[x]).min(ceiling));
            }
        }
        Self { width, height, along_row, along_column }
    }

    /// Adds the changes at all offsets of an outline pixel, if it stays inside the image at all of
    /// them.
    fn collect(&self, (x, y, down): Outline, reach: usize, (sums, count): &mut (Vec<u64>, u64)) {
        // Otherwise the offsets would be means over different outlines.
        let columns = reach..self.width.saturating_sub(reach);
        let rows = reach..self.height.saturating_sub(reach);
        if !(columns.contains(&x) && rows.contains(&y)) {
            return;
        }
        let changes = if down { &self.along_column } else { &self.along_row };
        let side = 2 * reach + 1;
        *count += 1;
        for (row, sums) in sums.chunks_exact_mut(side).enumerate() {
            let start = (y + row - reach) * self.width + x - reach;
            for (sum, change) in sums.iter_mut().zip(&changes[start..start + side]) {
                *sum += u64::from(*change);
            }
        }
    }
}

/// Returns the outline pixels of a depth image.
fn outlines(depth: &DepthImage, settings: &OverlapSettings) -> Vec<Outline> {
    let width = depth.width();
    let height = depth.height();
    let mut found = Vec::new();
    for y in 0..height {
        jumps(width, settings, |x| depth.row(y)[x], |x| found.push((x, y, false)));
    }
    for x in 0..width {
        jumps(height, settings, |y| depth.row(y)[x], |y| found.push((x, y, true)));
    }
    found
}

/// Walks along a line of readings and reports the nearer side of each jump to `tell`.
fn jumps(
    length: usize,
    settings: &OverlapSettings,
    reading: impl Fn(usize) -> f32,
    mut tell: impl FnMut(usize),
) {
    let mut last: Option<(usize, f32)> = None;
    for at in 0..length {
        let here = reading(at);
        if !(here > 0.0 && here.is_finite()) {
            continue;
        }
        if let Some((before, there)) = last {
            let near = here.min(there);
            let jumps = (here - there).abs() > settings.jump * near && near < settings.max_depth_m;
            if jumps && at - before <= settings.shadow_px + 1 {
                tell(if here < there { at } else { before });
            }
        }
        last = Some((at, here));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Renders a dark board and a bright one in front of a textured wall, with depth shifted by an
    /// offset.
    fn scene(offset: [i64; 2], boards: &[(i64, i64, i64)]) -> (GreyImage, DepthImage) {
        let grey =
            GreyImage::from_fn(160, 120, |x, y| match board_at(boards, x as i64, y as i64) {
                Some(which) => [30, 220, 60][which % 3],
                None => 120 + ((x * 7 + y * 13) % 11) as u8,
            });
        let depth = DepthImage::from_fn(160, 120, |x, y| {
            match board_at(boards, x as i64 - offset[0], y as i64 - offset[1]) {
                Some(which) => 1.5 + 0.5 * which as f32,
                None => 4.0,
            }
        });
        (grey, depth)
    }

    /// Returns the index of the board that a pixel shows.
    fn board_at(boards: &[(i64, i64, i64)], x: i64, y: i64) -> Option<usize> {
        boards.iter().position(|(left, top, side)| {
            (*left..left + side).contains(&x) && (*top..top + side + 10).contains(&y)
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn the_offset_is_found(dx in -12..=12i64, dy in -12..=12i64, left in 30..50i64) {
            let mut overlap = EdgeOverlap::new(OverlapSettings::default());
            let (grey, depth) = scene([-dx, -dy], &[(left, 30, 24), (left + 45, 45, 30)]);
            overlap.add(&grey, &depth);
            let found = overlap.offset().unwrap();
            prop_assert!((i64::from(found.px[0]) - dx).abs() <= 1, "{found:?} {dx} {dy}");
            prop_assert!((i64::from(found.px[1]) - dy).abs() <= 1, "{found:?} {dx} {dy}");
            prop_assert!(found.contrast > 0.5, "{found:?}");
        }
    }

    /// Computes the same sums as [`EdgeOverlap`], offset by offset.
    fn slowly(grey: &GreyImage, depth: &DepthImage, dx: i64, dy: i64) -> u64 {
        let settings = OverlapSettings::default();
        let reach = settings.reach_px as i64;
        let mut sum = 0;
        for (x, y, down) in outlines(depth, &settings) {
            let x = x as i64;
            let y = y as i64;
            if !((reach..160 - reach).contains(&x) && (reach..120 - reach).contains(&y)) {
                continue;
            }
            let (sx, sy) = if down { (0, 1) } else { (1, 0) };
            let [before, after] = [-1, 1].map(|side| {
                let x = (x + dx + side * sx).clamp(0, 159);
                grey.get(x, (y + dy + side * sy).clamp(0, 119)).unwrap()
            });
            sum += u64::from(before.abs_diff(after).min(settings.ceiling));
        }
        sum
    }

    #[test]
    fn the_sums_are_those_of_the_slow_way() {
        let (grey, depth) = scene([3, -2], &[(40, 30, 24), (85, 45, 30)]);
        let mut overlap = EdgeOverlap::new(OverlapSettings::default());
        overlap.add(&grey, &depth);
        for (dx, dy) in [(0, 0), (-3, 2), (16, -16), (-16, 5)] {
            let index = ((dy + 16) * 33 + dx + 16) as usize;
            let sum: u64 = overlap.parts.iter().map(|(sums, _)| sums[index]).sum();
            assert_eq!(sum, slowly(&grey, &depth, dx, dy), "{dx} {dy}");
        }
    }

    #[test]
    fn the_quarters_of_even_and_of_odd_frames_are_the_parts() {
        for (quarter, left, top) in [(0, 30, 20), (1, 100, 20), (2, 30, 70), (3, 100, 70)] {
            let mut overlap = EdgeOverlap::new(OverlapSettings::default());
            let (grey, depth) = scene([0, 0], &[(left, top, 24)]);
            for expected in [vec![quarter], vec![quarter, quarter + 4]] {
                overlap.add(&grey, &depth);
                let with_outlines = (0..PARTS).filter(|part| overlap.parts[*part].1 > 0);
                assert_eq!(with_outlines.collect::<Vec<_>>(), expected);
            }
        }
    }

    #[test]
    fn the_gain_is_what_the_offset_adds_to_none() {
        fn gain(offset: [i64; 2]) -> f64 {
            let mut overlap = EdgeOverlap::new(OverlapSettings::default());
            let (grey, depth) = scene(offset, &[(40, 30, 24), (85, 45, 30)]);
            overlap.add(&grey, &depth);
            overlap.offset().unwrap().gain
        }

        assert_eq!(gain([0, 0]), 0.0);
        assert!(gain([6, 4]) > 1.0, "{}", gain([6, 4]));
    }

    #[test]
    fn the_error_of_a_figure_is_told_by_leaving_parts_out() {
        // Squares around the mean 2: 1 + 0 + 1, times (3 - 1) / 3.
        let error = jackknife([1.0, 2.0, 3.0].into_iter());
        assert!((error - (4.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(jackknife([5.0, 5.0].into_iter()), 0.0);
        assert_eq!(jackknife(std::iter::empty()), 0.0);
    }

    #[test]
    fn an_outline_is_on_the_nearer_side_of_a_shadow() {
        let nan = f32::NAN;
        let row = [4.0, 4.0, nan, nan, 1.5, 1.5, nan, 4.0, 4.1];
        let mut found = Vec::new();
        jumps(row.len(), &OverlapSettings::default(), |at| row[at], |at| found.push(at));
        assert_eq!(found, [4, 5]);
    }

    #[test]
    fn without_outlines_nothing_is_said() {
        let mut overlap = EdgeOverlap::new(OverlapSettings::default());
        assert_eq!(overlap.offset(), None);
        overlap.add(&GreyImage::filled(64, 48, 9), &DepthImage::filled(64, 48, 2.0));
        overlap.add(&GreyImage::filled(64, 48, 9), &DepthImage::filled(32, 48, 2.0));
        overlap.add(&GreyImage::filled(0, 0, 9), &DepthImage::filled(0, 0, 2.0));
        assert_eq!(overlap.offset(), None);
    }
}
