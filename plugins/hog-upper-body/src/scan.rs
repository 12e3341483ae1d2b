//! Windows over an image in many sizes.

use std::ops::RangeInclusive;

use tagalong_core::{GreyImage, Rect};

use crate::hog::CELL;
use crate::model::{Field, Kind, Model, SIDE};
use crate::resample::{Resampler, resampled};

/// Side of a window, pixels of the resampled image.
pub(crate) const WINDOW_PX: usize = (SIDE + 1) * CELL;
/// The upper-body square fills this much of the width of a window: arms, hips and
/// what is around a person tell more than the outline of head and shoulders alone.
pub(crate) const FILLED: f64 = 0.5;
/// The square is in the middle of the columns, and this part of a window is above
/// it.
const ABOVE: f64 = 0.1;

/// Cells that are resampled around windows: they have a share in the outermost
/// cells of a window, and say what is usual there.
const AROUND: usize = 2;
/// The same in pixels, with one more for the gradients.
const AROUND_PX: usize = AROUND * CELL + 1;

/// A window that was looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// The upper-body square, pixels of the image.
    pub region: Rect,
    /// Depth of what it shows, m, where that is known.
    pub depth_m: Option<f64>,
    /// The weighted sum.
    pub sum: f32,
}

/// Looks at the windows of images; keeps its memory from one to the next.
#[derive(Clone, Debug)]
pub struct Scanner {
    field: Field,
    resampler: Resampler,
    pixels: Vec<f32>,
    looked_at: u64,
}

impl Scanner {
    /// For models of one kind.
    pub fn new(kind: Kind) -> Self {
        Self {
            field: Field::new(kind),
            resampler: Resampler::default(),
            pixels: Vec::new(),
            looked_at: 0,
        }
    }

    /// How many windows were looked at so far.
    pub fn looked_at(&self) -> u64 {
        self.looked_at
    }

    /// Looks at all windows whose upper-body square has one of `sides`, pixels,
    /// and that `propose` allows; it is given the square and says the depth of
    /// what it shows, if there is one to say. Windows below `least` are left out.
    pub fn scan(
        &mut self,
        image: &GreyImage,
        model: &Model,
        sides: impl Iterator<Item = f64>,
        least: f32,
        mut propose: impl FnMut(&Rect) -> Option<Option<f64>>,
    ) -> Vec<Window> {
        let mut found = Vec::new();
        for side in sides {
            self.size(image, model, side, least, &mut propose, &mut found);
        }
        found
    }

    fn size(
        &mut self,
        image: &GreyImage,
        model: &Model,
        side: f64,
        least: f32,
        propose: &mut impl FnMut(&Rect) -> Option<Option<f64>>,
        found: &mut Vec<Window>,
    ) {
        let step = side / (FILLED * WINDOW_PX as f64);
        let (left_px, above_px) = margins();
        let square = |x: i64, y: i64| {
            let at = |cell: i64, margin: f64| ((cell * CELL as i64) as f64 + margin) * step;
            Rect::new(at(x, left_px), at(y, above_px), side, side)
        };
        let columns = inside(image.width() as f64 / step, left_px);
        let mut wanted: Vec<(i64, i64, Option<f64>)> = Vec::new();
        for y in inside(image.height() as f64 / step, above_px) {
            let row = columns.clone();
            wanted.extend(row.filter_map(|x| Some((x, y, propose(&square(x, y))?))));
        }
        let Some((left, top, right, bottom)) = bounds(&wanted) else { return };
        self.looked_at += wanted.len() as u64;
        let long = |from: i64, to: i64| ((to - from) as usize + SIDE + 1) * CELL + 2 * AROUND_PX;
        let (width, height) = (long(left, right), long(top, bottom));
        let start = |cell: i64| ((cell * CELL as i64) as f64 - AROUND_PX as f64) * step;
        let origin = (start(left), start(top));
        self.resampler.fill(image, origin, step, (width, height), &mut self.pixels);
        self.field.fill(&self.pixels, width);
        for (x, y, depth_m) in wanted {
            let at = |cell: i64, first: i64| (cell - first) as usize + AROUND;
            let sum = model.sum(&self.field, at(x, left), at(y, top));
            if sum >= least {
                found.push(Window { region: square(x, y), depth_m, sum });
            }
        }
    }
}

/// What a window shows left of and above the upper-body square, pixels of the
/// resampled image.
fn margins() -> (f64, f64) {
    (0.5 * (1.0 - FILLED) * WINDOW_PX as f64, ABOVE * WINDOW_PX as f64)
}

/// The first cells of the windows whose square lies in an image of `length`
/// pixels; the rest of a window may hang over, where the border goes on.
fn inside(length: f64, margin: f64) -> RangeInclusive<i64> {
    let cell = CELL as f64;
    let last = (length - margin - FILLED * WINDOW_PX as f64) / cell;
    (-margin / cell).ceil() as i64..=last.floor() as i64
}

/// The window of an upper-body square, pixels of the image.
pub fn window_of(square: &Rect) -> Rect {
    let step = square.width / (FILLED * WINDOW_PX as f64);
    let (left, above) = margins();
    let side = WINDOW_PX as f64 * step;
    Rect::new(square.x - left * step, square.y - above * step, side, side)
}

/// Smallest and largest column and row.
fn bounds(wanted: &[(i64, i64, Option<f64>)]) -> Option<(i64, i64, i64, i64)> {
    let (x, y) = (|| wanted.iter().map(|w| w.0), || wanted.iter().map(|w| w.1));
    Some((x().min()?, y().min()?, x().max()?, y().max()?))
}

/// The numbers of the window whose upper-body square is `square`, for machines of
/// one kind.
pub fn window_numbers(image: &GreyImage, square: &Rect, kind: Kind) -> Vec<f32> {
    let step = square.width.max(1.0) / (FILLED * WINDOW_PX as f64);
    let (window, around) = (window_of(square), AROUND_PX as f64 * step);
    let (origin, side) = ((window.x - around, window.y - around), WINDOW_PX + 2 * AROUND_PX);
    let pixels = resampled(image, origin, step, side, side);
    let mut field = Field::new(kind);
    field.fill(&pixels, side);
    field.numbers(AROUND, AROUND)
}

/// The best of each group of windows: greedily, best first, those that overlap
/// a better one by more than `overlap` go, unless they are `apart_m` nearer or
/// farther. Two people one behind the other both stay.
pub fn merge(mut windows: Vec<Window>, overlap: f64, apart_m: f64) -> Vec<Window> {
    windows.sort_by(|a, b| b.sum.total_cmp(&a.sum));
    let mut kept: Vec<Window> = Vec::new();
    for window in windows {
        let is_same = |better: &Window| {
            let apart = match (window.depth_m, better.depth_m) {
                (Some(a), Some(b)) => (a - b).abs() >= apart_m,
                _ => false,
            };
            !apart && window.region.iou(&better.region) > overlap
        };
        if !kept.iter().any(is_same) {
            kept.push(window);
        }
    }
    kept
}
