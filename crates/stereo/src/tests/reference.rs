//! References of the kernels, pixel by pixel and in wide integers.

use tagalong_core::GreyImage;

use crate::census::NEIGHBOURS;
use crate::cost::{MOST_BRIGHTNESS, MOST_SLOPE, SLOPE_WEIGHT};
use crate::winner::Winners;

fn clamped(image: &GreyImage, x: i64, y: i64) -> u8 {
    let right = image.width() as i64 - 1;
    let bottom = image.height() as i64 - 1;
    image.get(x.clamp(0, right), y.clamp(0, bottom)).unwrap()
}

pub fn census(image: &GreyImage, noise: u8, x: i64, y: i64) -> Vec<bool> {
    NEIGHBOURS
        .iter()
        .map(|(dx, dy)| {
            let neighbour = clamped(image, x + i64::from(*dx), y + i64::from(*dy));
            i16::from(neighbour) < i16::from(clamped(image, x, y)) - i16::from(noise)
        })
        .collect()
}

/// Counts the bits in which disparity `d` differs at the left image's pixel; the border of the
/// right image is continued.
pub fn bits(pair: &[GreyImage], noise: u8, x: i64, y: i64, d: i64) -> i64 {
    let left = census(&pair[0], noise, x, y);
    let right = census(&pair[1], noise, (x - d).max(0), y);
    left.iter().zip(right).filter(|(l, r)| **l != *r).count() as i64
}

pub fn blend(pair: &[GreyImage], noise: u8, x: i64, y: i64, d: i64) -> i64 {
    let right = (x - d).max(0);
    let brightness = dissimilarity(pair, x, right, |image, x| clamped(image, x, y).into());
    let slope = dissimilarity(pair, x, right, |image, x| slope(image, x, y));
    let cost = bits(pair, noise, x, y, d)
        + brightness.min(MOST_BRIGHTNESS.into())
        + i64::from(SLOPE_WEIGHT) * slope.min(MOST_SLOPE.into());
    cost / 2
}

fn slope(image: &GreyImage, x: i64, y: i64) -> i64 {
    let x = x.clamp(0, image.width() as i64 - 1);
    (128 + weighted_rise(image, x, y).div_euclid(2)).clamp(0, 255)
}

/// Returns the horizontal sum of a Sobel filter.
fn weighted_rise(image: &GreyImage, x: i64, y: i64) -> i64 {
    let mut sum = 0;
    for (dy, weight) in [(-1, 1), (0, 2), (1, 1)] {
        let right = i64::from(clamped(image, x + 1, y + dy));
        sum += weight * (right - i64::from(clamped(image, x - 1, y + dy)));
    }
    sum
}

/// Computes equations 1 to 3 of Birchfield and Tomasi, in integers.
fn dissimilarity(
    pair: &[GreyImage],
    left: i64,
    right: i64,
    level: impl Fn(&GreyImage, i64) -> i64,
) -> i64 {
    let [l, r] = [(&pair[0], left), (&pair[1], right)].map(|(image, x)| level(image, x));
    let ways = [(&pair[1], right, l, r), (&pair[0], left, r, l)].map(|(image, x, own, centre)| {
        let all = [centre, (centre + level(image, x - 1)) / 2, (centre + level(image, x + 1)) / 2];
        let least = all.into_iter().fold(i64::MAX, i64::min);
        let most = all.into_iter().fold(i64::MIN, i64::max);
        (own - most).max(least - own).max(0)
    });
    ways[0].min(ways[1])
}

/// Fills holes along a row pixel by pixel.
pub fn without_holes(image: &[f32], width: usize, most: (usize, f32), step: f32) -> Vec<f32> {
    let mut filled = image.to_vec();
    for at in (0..image.len()).filter(|at| image[*at].is_nan()) {
        let x = at % width;
        let row = at / width * width;
        let before = (0..x).rev().find(|x| !image[row + x].is_nan());
        let behind = (x..width).find(|x| !image[row + x].is_nan());
        let (Some(a), Some(b)) = (before, behind) else { continue };
        let from = image[row + a];
        let to = image[row + b];
        let most = (most.0 as f32).max(most.1 * from.min(to));
        if (b - a - 1) as f32 <= most && (to - from).abs() <= step {
            filled[at] = from + (to - from) * (x - a) as f32 / (b - a) as f32;
        }
    }
    filled
}

/// Costs of all disparities of all pixels, in row order.
pub struct Volume {
    pub width: i64,
    pub height: i64,
    pub disparities: i64,
    pub cells: Vec<i64>,
}

impl Volume {
    pub fn from_fn(size: (i64, i64, i64), mut cell: impl FnMut(i64, i64, i64) -> i64) -> Self {
        let (width, height, disparities) = size;
        let mut cells = Vec::new();
        for y in 0..height {
            for x in 0..width {
                cells.extend((0..disparities).map(|d| cell(x, y, d)));
            }
        }
        Self { width, height, disparities, cells }
    }

    pub fn size(&self) -> (i64, i64, i64) {
        (self.width, self.height, self.disparities)
    }

    pub fn get(&self, x: i64, y: i64, d: i64) -> Option<i64> {
        let inside = (0..self.width).contains(&x)
            && (0..self.height).contains(&y)
            && (0..self.disparities).contains(&d);
        inside.then(|| self.cells[((y * self.width + x) * self.disparities + d) as usize])
    }
}

/// Computes equation 13 of Hirschmueller for the paths that come from `(dx, dy)` away.
pub fn path(
    costs: &Volume,
    grey: &GreyImage,
    (dx, dy): (i64, i64),
    small: i64,
    large: impl Fn(u8) -> i64,
) -> Volume {
    let mut path = Volume::from_fn(costs.size(), |_, _, _| 0);
    let mut order: Vec<(i64, i64)> =
        (0..costs.height).flat_map(|y| (0..costs.width).map(move |x| (x, y))).collect();
    order.sort_by_key(|(x, y)| (*y, -dx.signum() * x));
    for (x, y) in order {
        let before: Vec<Option<i64>> =
            (-1..=costs.disparities).map(|d| path.get(x + dx, y + dy, d)).collect();
        let least = before.iter().flatten().min();
        let own = clamped(grey, x, y);
        let jump = large(own.abs_diff(clamped(grey, x + dx, y + dy)));
        let row: Vec<i64> = before
            .windows(3)
            .zip(0..)
            .map(|(before, d)| {
                let cost = costs.get(x, y, d).unwrap();
                let Some(least) = least else { return cost };
                let ways = [
                    before[1],
                    before[0].map(|c| c + small),
                    before[2].map(|c| c + small),
                    Some(least + jump),
                ];
                cost + ways.into_iter().flatten().min().unwrap() - least
            })
            .collect();
        let at = ((y * costs.width + x) * costs.disparities) as usize;
        path.cells[at..at + row.len()].copy_from_slice(&row);
    }
    path
}

/// Sets patches of fewer than `min_pixels` pixels to NaN, by flooding.
pub fn without_speckles(image: &[f32], width: usize, min_pixels: usize, step: f32) -> Vec<f32> {
    let mut cleaned = image.to_vec();
    let mut visited = vec![false; image.len()];
    for start in 0..image.len() {
        if visited[start] || image[start].is_nan() {
            continue;
        }
        let mut patch = vec![start];
        let mut next = 0;
        visited[start] = true;
        while next < patch.len() {
            let at = patch[next];
            next += 1;
            let beside = [
                (at % width > 0).then(|| at - 1),
                (at % width + 1 < width).then_some(at + 1),
                at.checked_sub(width),
                Some(at + width).filter(|n| *n < image.len()),
            ];
            for other in beside.into_iter().flatten() {
                if !visited[other] && (image[at] - image[other]).abs() <= step {
                    visited[other] = true;
                    patch.push(other);
                }
            }
        }
        if patch.len() < min_pixels {
            patch.iter().for_each(|at| cleaned[*at] = f32::NAN);
        }
    }
    cleaned
}

/// Returns half of Sobel's sum across pixel `x` of row `y`.
fn sobel(image: &GreyImage, x: i64, y: i64) -> u32 {
    (weighted_rise(image, x, y).unsigned_abs() / 2) as u32
}

/// Drops the smooth pixels of row `y` that differ from their textured neighbours, or
/// have none on a side.
pub fn supported(row: &[f32], image: &GreyImage, y: usize, least: u32) -> Vec<f32> {
    let is_anchor: Vec<bool> = (0..row.len())
        .map(|x| !row[x].is_nan() && sobel(image, x as i64, y as i64) >= least)
        .collect();
    (0..row.len())
        .map(|x| {
            if is_anchor[x] || agrees_with_anchors(row, &is_anchor, x) { row[x] } else { f32::NAN }
        })
        .collect()
}

/// Says whether a disparity is that of the surface between the next anchors on both sides.
fn agrees_with_anchors(row: &[f32], is_anchor: &[bool], x: usize) -> bool {
    fn tolerance(d: f32) -> f32 {
        0.75_f32.max(0.1 * d)
    }

    let before = (0..x).rev().find(|x| is_anchor[*x]);
    let after = (x + 1..row.len()).find(|x| is_anchor[*x]);
    let Some((a, b)) = before.zip(after) else { return false };
    let far = row[a].min(row[b]);
    let near = row[a].max(row[b]);
    let middle = if near - far <= tolerance(far) { 0.5 * (row[a] + row[b]) } else { far };
    (row[x] - middle).abs() <= tolerance(middle)
}

/// Returns brightness and slope of a smoothed row at `x`; its border is continued.
fn smoothed(image: &GreyImage, x: i64, y: i64) -> (f64, f64) {
    let [before, own, after] = [x - 1, x, x + 1].map(|x| {
        let [a, b, c] = [x - 1, x, x + 1].map(|x| f64::from(clamped(image, x, y)));
        0.25 * (a + 2.0 * b + c)
    });
    (own, 0.5 * (after - before))
}

/// Returns slope, and slope times disparity, of a pixel as in Lucas and Kanade, with less weight on
/// strong slopes.
fn equation(pair: &[GreyImage], x: usize, y: usize, d: f64, gain: f64) -> (f64, f64) {
    let (own, own_slope) = smoothed(&pair[0], x as i64, y as i64);
    let (other, slope) = matched(&pair[1], x, y, d);
    let g = 0.5 * (gain * own_slope + slope);
    let weight = 1.0 / (1.0 + (g / 6.0).powi(2)).sqrt();
    (weight * g, weight * (g * d + other - gain * own))
}

/// Returns brightness and slope of the right image at the match of pixel `x` of the left one.
fn matched(right: &GreyImage, x: usize, y: usize, d: f64) -> (f64, f64) {
    let last = right.width() as i64 - 1;
    let at = (x as f64 - d).clamp(0.0, last as f64);
    let low = at.floor();
    let part = at.fract();
    let [(a, a_slope), (b, b_slope)] =
        [0, 1].map(|i| smoothed(right, (low as i64 + i).min(last), y as i64));
    (a + part * (b - a), a_slope + part * (b_slope - a_slope))
}

/// Returns the ratio of the deviations of a row's brightness in the two images.
fn gain(pair: &[GreyImage], row: &[f32], y: usize) -> f64 {
    let known: Vec<usize> = (0..row.len()).filter(|x| !row[*x].is_nan()).collect();
    let left: Vec<f64> = known.iter().map(|x| smoothed(&pair[0], *x as i64, y as i64).0).collect();
    let right: Vec<f64> =
        known.iter().map(|x| matched(&pair[1], *x, y, row[*x].into()).0).collect();
    let [left, right] = [left, right].map(|levels| {
        let n = known.len().max(1) as f64;
        let mean = levels.iter().sum::<f64>() / n;
        4.0 + levels.iter().map(|level| (level - mean).powi(2)).sum::<f64>() / n
    });
    (right / left).sqrt().clamp(0.5, 2.0)
}

/// Returns the sums of squares and products around the means, over the window's part of a row that
/// is of one surface with column `x`.
fn row_of_window(pair: &[GreyImage], row: &[f32], x: usize, y: usize, radius: usize) -> (f64, f64) {
    let near = x.saturating_sub(radius)..(x + radius + 1).min(row.len());
    let same: Vec<usize> = near.filter(|near| (row[*near] - row[x]).abs() <= 1.0).collect();
    let gain = gain(pair, row, y);
    let all: Vec<(f64, f64)> =
        same.iter().map(|x| equation(pair, *x, y, row[*x].into(), gain)).collect();
    let n = all.len() as f64;
    let (g, q) = all.iter().fold((0.0, 0.0), |sum, e| (sum.0 + e.0 / n, sum.1 + e.1 / n));
    all.iter().fold((0.0, 0.0), |sum: (f64, f64), e: &(f64, f64)| {
        (sum.0 + (e.0 - g).powi(2), sum.1 + (e.0 - g) * (e.1 - q))
    })
}

/// Refines disparities pixel by pixel.
pub fn refined(pair: &[GreyImage], disparities: &[f32], radius: usize) -> Vec<f64> {
    let width = pair[0].width();
    let height = pair[0].height();
    let mut all = Vec::with_capacity(disparities.len());
    for (at, &was) in disparities.iter().enumerate() {
        let x = at % width;
        let y = at / width;
        let mut squares = 20.0;
        let mut sum = 20.0 * f64::from(was);
        for y in y.saturating_sub(radius)..(y + radius + 1).min(height) {
            let row = &disparities[y * width..(y + 1) * width];
            if (row[x] - was).abs() <= 1.0 {
                let (gg, gq) = row_of_window(pair, row, x, y, radius);
                (squares, sum) = (squares + gg, sum + gq);
            }
        }
        let was = f64::from(was);
        let new = was + (sum / squares - was).clamp(-0.5, 0.5);
        all.push(if new < 0.0 { 0.0 } else { new });
    }
    all
}

/// Returns the disparities of winners that pass the tests, and the numbers that fail: outside of
/// the right image, not unique, contradicted from the right.
pub fn judged(winners: &Winners, uniqueness: f32, tolerance: u8) -> (Vec<f32>, [u32; 3]) {
    let d: Vec<usize> = winners.disparity.iter().map(|d| usize::from(*d)).collect();
    let mut counts = [0; 3];
    let mut all = vec![f32::NAN; winners.cost.len()];
    for x in 0..all.len() {
        let cost = f32::from(winners.cost[x]);
        let second = f32::from(winners.second[x]);
        if d[x] > x {
            counts[0] += 1;
            continue;
        }
        if (second - cost).max(0.0) < uniqueness * second {
            counts[1] += 1;
            continue;
        }
        let rivals = (0..all.len()).filter(|other| *other + d[x] == x + d[*other]);
        let best = rivals.min_by_key(|other| winners.cost[*other]).unwrap();
        if d[best].abs_diff(d[x]) > usize::from(tolerance) {
            counts[2] += 1;
            continue;
        }
        let below = f32::from(winners.below[x]);
        let above = f32::from(winners.above[x]);
        let rise = below + above - 2.0 * cost;
        all[x] = d[x] as f32 + if rise > 0.0 { 0.5 * (below - above) / rise } else { 0.0 };
    }
    (all, counts)
}
