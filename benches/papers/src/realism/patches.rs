//! Two-sample test: a simple classifier tries to separate simulated people from real ones by their
//! depth. An area under the ROC curve of one half means that it cannot, one that it always can.
//!
//! Each sample is the depth in the upper-body square of a wholly visible person. Its features are
//! the medians of a 6x6 grid relative to the trunk, the share of readings in a 3x3 grid, and the
//! roughness. A linear discriminant is trained on all recordings but one, and on all simulated
//! rooms but some, and tested on the rest.

use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, DVector};
use tagalong_config::{FileLimit, read_text};
use tagalong_core::DepthImage;
use tagalong_eval::formats::people;
use tagalong_geometry::Rect;
use tagalong_log::{FrameSource, Input, InputSettings, Inputs, Limits};
use tagalong_trials::TrialError;

use super::{Check, scene, simulated};
use crate::draws::mean;

const GROUP: &str = "simulated against real depth patches";
/// Folder of the recordings with annotated people, relative to the repository.
const LOGS: &str = "../shared/data/logs";
/// Recordings with depth and annotated people.
const REAL: [&str; 3] = ["filinha", "lab2-camera2", "um"];
/// Cells of the grid of depths, and of the grid of readings, along a side.
const CELLS: usize = 6;
const FILLS: usize = 3;
/// Bound on the difference of depth from the trunk, m.
const FAR_M: f32 = 1.0;
/// Ridge of the discriminant, part of the mean variance.
const RIDGE: f64 = 0.05;

type Sample = DVector<f64>;

pub fn checks(seeds: u64) -> Result<Vec<Check>, TrialError> {
    fn count(folds: &[Vec<Sample>]) -> f64 {
        folds.iter().map(Vec::len).sum::<usize>() as f64
    }

    fn within(folds: &[Vec<Sample>]) -> f64 {
        cross_validated(&folds[..1], &folds[1..2])
    }

    let real: Vec<Vec<Sample>> =
        REAL.iter().filter_map(|name| recording(&log(name))).filter(|l| l.len() >= 5).collect();
    if real.len() < 2 {
        let why = format!("skipped: {LOGS} has no two recordings with annotated people");
        return Ok(vec![Check::skipped(GROUP, why)]);
    }
    let sim = rooms(real.len(), seeds);
    let what = format!("area under the curve, left out by recording ({} folds)", real.len());
    let limit = [f64::NEG_INFINITY, 0.8];
    Ok(vec![
        Check::told(GROUP, "real patches", count(&real), ""),
        Check::told(GROUP, "simulated patches", count(&sim), ""),
        Check::between(GROUP, what, cross_validated(&real, &sim), "", limit),
        Check::told(GROUP, "for comparison: one recording against another", within(&real), ""),
    ])
}

/// Frames without depth are useless here; colour is not needed.
const DEPTH: Inputs = Inputs::NONE.require(Input::Depth);

fn log(name: &str) -> PathBuf {
    Path::new(LOGS).join(format!("{name}.mcap"))
}

/// Returns the samples of the wholly visible people of a recording; `None` where it is absent.
fn recording(log: &Path) -> Option<Vec<Sample>> {
    let text = read_text(&log.with_extension("people.csv"), FileLimit::Table).ok()?;
    let rows = people::parse(&text, "people.csv").ok()?;
    let mut source =
        FrameSource::open(log, &InputSettings::default(), &Limits::default(), DEPTH).ok()?;
    let mut samples = Vec::new();
    while let Some(item) = source.next_frame() {
        let Ok(depth) = item.frame.depth() else { continue };
        let here = rows.iter().filter(|row| u64::from(row.frame) == item.frame.index);
        for row in here.filter(|row| row.visible > 0.95) {
            let Some(at) = row.upper_body else { continue };
            let square = Rect::new(at.x, at.y, at.width, at.height);
            samples.extend(features(depth, &square));
        }
    }
    Some(samples)
}

/// Returns samples from simulated rooms, in as many folds as there are recordings.
fn rooms(folds: usize, seeds: u64) -> Vec<Vec<Sample>> {
    let mut all = vec![Vec::new(); folds];
    for seed in 1..=seeds.max(2 * folds as u64) {
        let high = seed % 2 == 0;
        let (height, pitch) = if high { (2.3, 25.0) } else { (1.15, 2.0) };
        // The recordings are of small rooms: walls farther away give fewer readings.
        let length = 5.0 + 0.5 * (seed / 2 % 4) as f64;
        let text = format!(
            "seed = {seed}\nduration_s = 6.0\ncrowd = 4\n[room]\nsize_m = [{length:.1}, 5.0]\nclutter = 6\n[camera]\n\
             rate_hz = 1.0\nheight_m = {height}\npitch_down_deg = {pitch:.1}\n\
             [robot]\nstart = [0.6, 2.5]\n"
        );
        for simulated in simulated(&scene(&text)) {
            let Ok(depth) = simulated.frame.depth() else { continue };
            let seen = simulated.truth.iter().filter(|person| person.visible_fraction > 0.95);
            let squares = seen.filter_map(|person| person.upper_body);
            all[seed as usize % folds].extend(squares.filter_map(|at| features(depth, &at)));
        }
    }
    all
}

/// Returns the features of an upper-body square; `None` if it is hardly in the image.
fn features(depth: &DepthImage, square: &Rect) -> Option<Sample> {
    let square = square.clipped(depth.width(), depth.height());
    if square.width < 24.0 || square.height < 24.0 {
        return None;
    }
    let middle = cell(depth, &square, 3, 1, 1);
    let trunk = median(&middle)?;
    let mut values = Vec::with_capacity(CELLS * CELLS + FILLS * FILLS + 2);
    for (row, column) in cells(CELLS) {
        let here = median(&cell(depth, &square, CELLS, row, column));
        let off = here.map_or(FAR_M, |z| (z - trunk).clamp(-FAR_M, FAR_M));
        values.push(f64::from(off));
    }
    for (row, column) in cells(FILLS) {
        let here = cell(depth, &square, FILLS, row, column);
        values
            .push(here.iter().filter(|z| z.is_finite()).count() as f64 / here.len().max(1) as f64);
    }
    values.push(roughness(&middle, trunk));
    values.push(f64::from(trunk) / 5.0);
    Some(DVector::from_vec(values))
}

fn cells(side: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..side).flat_map(move |row| (0..side).map(move |column| (row, column)))
}

/// Returns the pixels of one cell of a grid over the square, row by row.
fn cell(depth: &DepthImage, square: &Rect, side: usize, row: usize, column: usize) -> Vec<f32> {
    let [left, right] = [column, column + 1]
        .map(|index| (square.x + square.width * index as f64 / side as f64) as usize);
    let [top, bottom] = [row, row + 1]
        .map(|index| (square.y + square.height * index as f64 / side as f64) as usize);
    let inside = bottom.min(depth.height());
    (top..inside)
        .flat_map(|y| depth.row(y)[left..right.min(depth.width())].iter().copied())
        .collect()
}

/// Returns the median of the finite values.
fn median(values: &[f32]) -> Option<f32> {
    let finite = values.iter().copied().filter(|z| z.is_finite());
    tagalong_math::median(finite.map(f64::from)).map(|middle| middle as f32)
}

/// Returns the median step between neighbours, in thousandths of the squared range.
fn roughness(pixels: &[f32], trunk_m: f32) -> f64 {
    let steps: Vec<f32> = pixels.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    f64::from(median(&steps).unwrap_or(0.0) / (trunk_m * trunk_m).max(0.1)) * 1e3
}

/// Returns the mean area under the ROC curve over held-out folds. With a single fold, every other
/// sample is held out.
fn cross_validated(a: &[Vec<Sample>], b: &[Vec<Sample>]) -> f64 {
    fn halves(all: &[Vec<Sample>]) -> Vec<Vec<Sample>> {
        [0, 1].map(|odd| all[0].iter().skip(odd).step_by(2).cloned().collect()).to_vec()
    }

    fn others(all: &[Vec<Sample>], fold: usize) -> Vec<Sample> {
        let kept = all.iter().enumerate().filter(|(at, _)| *at != fold);
        kept.flat_map(|(_, samples)| samples.iter().cloned()).collect()
    }

    if a.len() < 2 {
        return cross_validated(&halves(a), &halves(b));
    }
    let areas = (0..a.len()).filter_map(|fold| {
        let weights = discriminant(&others(a, fold), &others(b, fold))?;
        let [of_a, of_b] = [&a[fold], &b[fold]]
            .map(|samples| samples.iter().map(|s| weights.dot(s)).collect::<Vec<f64>>());
        area(&of_a, &of_b)
    });
    mean(&areas.collect::<Vec<f64>>())
}

/// Returns Fisher's linear discriminant with a ridge, larger on `a`.
fn discriminant(a: &[Sample], b: &[Sample]) -> Option<DVector<f64>> {
    fn scatter(all: &[Sample], centre: &DVector<f64>) -> DMatrix<f64> {
        all.iter().map(|s| (s - centre) * (s - centre).transpose()).sum::<DMatrix<f64>>()
            / all.len() as f64
    }

    let size = a.first()?.len();
    if b.is_empty() {
        return None;
    }
    let [of_a, of_b] = [a, b].map(|all| all.iter().sum::<DVector<f64>>() / all.len() as f64);
    let mut within = scatter(a, &of_a) + scatter(b, &of_b);
    let ridge = RIDGE * within.trace() / size as f64;
    // The ridge also keeps the matrix positive definite if a feature never varies.
    (0..size).for_each(|i| within[(i, i)] += ridge.max(1e-9));
    Some(within.cholesky()?.solve(&(of_a - of_b)))
}

/// Returns the share of pairs in which the score of `a` is above that of `b`; ties are half.
fn area(a: &[f64], b: &[f64]) -> Option<f64> {
    let pairs = a.iter().flat_map(|x| b.iter().map(move |y| (x, y)));
    let wins = pairs.map(|(x, y)| if x > y { 1.0 } else { f64::from(u8::from(x == y)) * 0.5 });
    (!a.is_empty() && !b.is_empty()).then(|| wins.sum::<f64>() / (a.len() * b.len()) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(centre: f64, count: usize, from: u64) -> Vec<Sample> {
        let mut state = from;
        let mut samples = Vec::new();
        for _ in 0..count {
            let sample = [centre, 0.0].map(|middle| {
                state = state
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                middle + ((state >> 33) as f64 / f64::from(1u32 << 31) - 0.5)
            });
            samples.push(DVector::from_vec(sample.to_vec()));
        }
        samples
    }

    #[test]
    fn what_is_alike_cannot_be_told_apart_and_what_differs_can() {
        let same = cross_validated(
            &[cloud(0.0, 200, 1), cloud(0.0, 200, 2)],
            &[cloud(0.0, 200, 3), cloud(0.0, 200, 4)],
        );
        assert!((same - 0.5).abs() < 0.08, "{same}");
        let other = cross_validated(
            &[cloud(0.0, 50, 1), cloud(0.0, 50, 2)],
            &[cloud(2.0, 50, 3), cloud(2.0, 50, 4)],
        );
        assert!(other > 0.999, "{other}");
    }

    #[test]
    fn the_area_counts_pairs() {
        assert_eq!(area(&[2.0, 1.0], &[1.0, 0.0]), Some(0.875));
        assert_eq!(area(&[], &[1.0]), None);
    }

    #[test]
    fn a_flat_patch_has_flat_features() {
        let depth = DepthImage::filled(64, 64, 2.5);
        let features = features(&depth, &Rect::new(4.0, 4.0, 50.0, 50.0)).unwrap();
        assert_eq!(features.len(), CELLS * CELLS + FILLS * FILLS + 2);
        assert!(features.rows(0, 36).iter().all(|v| *v == 0.0));
        assert!(features.rows(36, 9).iter().all(|v| *v == 1.0));
        assert!(super::features(&depth, &Rect::new(0.0, 0.0, 9.0, 9.0)).is_none());
    }
}
