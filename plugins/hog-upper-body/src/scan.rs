//! Windows over an image in many sizes.

use std::ops::RangeInclusive;

use tagalong_core::{GreyImage, Rect};
use tagalong_vision::islands;

use crate::hog::CELL;
use crate::judge::Judge;
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
/// cells of a window, and for trees they say what is usual there.
const fn around(kind: Kind) -> usize {
    match kind {
        Kind::Linear => 1,
        Kind::Trees => 2,
    }
}

/// The same in pixels, with one more for the gradients.
const fn around_px(kind: Kind) -> usize {
    around(kind) * CELL + 1
}

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
    judge: Judge,
    /// Of the model.
    kind: Kind,
    resampler: Resampler,
    pixels: Vec<f32>,
    wanted: Vec<Wanted>,
    sums: Vec<f32>,
    looked_at: u64,
}

/// A window that is worth a look: the cell at which it begins, and the depth of what
/// it shows.
#[derive(Clone, Copy, Debug)]
struct Wanted {
    x: i64,
    y: i64,
    depth_m: Option<f64>,
}

impl Scanner {
    /// For one model.
    pub fn new(model: &Model) -> Self {
        Self {
            judge: Judge::new(model),
            kind: model.kind(),
            resampler: Resampler::default(),
            pixels: Vec::new(),
            wanted: Vec::new(),
            sums: Vec::new(),
            looked_at: 0,
        }
    }

    /// How many windows were looked at so far.
    pub fn looked_at(&self) -> u64 {
        self.looked_at
    }

    /// Adds all windows whose upper-body square has one of `sides`, pixels, and that
    /// `propose` allows; it is given the square and says the depth of what it
    /// shows, if there is one to say. Windows below `least` are left out.
    pub fn scan(
        &mut self,
        image: &GreyImage,
        sides: impl Iterator<Item = f64>,
        least: f32,
        mut propose: impl FnMut(&Rect) -> Option<Option<f64>>,
        found: &mut Vec<Window>,
    ) {
        for side in sides {
            let size = Size { side, step: side / (FILLED * WINDOW_PX as f64) };
            self.ask(image, &size, &mut propose);
            self.looked_at += self.wanted.len() as u64;
            let mut wanted = std::mem::take(&mut self.wanted);
            // Islands that are this far apart share no pixels.
            let gap = (SIDE + 1 + 2 * around(self.kind)) as i64;
            islands(&mut wanted, |w| [w.x, w.y], gap, &mut |island| {
                let bounds = bounds(island);
                self.fill(image, size.step, bounds);
                self.judge(island, &size, bounds, least, found);
            });
            self.wanted = wanted;
        }
    }

    /// Notes which windows of a size are wanted, row by row.
    fn ask(
        &mut self,
        image: &GreyImage,
        size: &Size,
        propose: &mut impl FnMut(&Rect) -> Option<Option<f64>>,
    ) {
        let (left_px, above_px) = margins();
        let columns = inside(image.width() as f64 / size.step, left_px);
        self.wanted.clear();
        for y in inside(image.height() as f64 / size.step, above_px) {
            let of = |x| Some(Wanted { x, y, depth_m: propose(&size.square(x, y))? });
            self.wanted.extend(columns.clone().filter_map(of));
        }
    }

    /// Makes what the machine looks at, for windows within bounds.
    fn fill(&mut self, image: &GreyImage, step: f64, [left, top, right, bottom]: Bounds) {
        let around_px = around_px(self.kind);
        let long = |from: i64, to: i64| ((to - from) as usize + SIDE + 1) * CELL + 2 * around_px;
        let start = |cell: i64| ((cell * CELL as i64) as f64 - around_px as f64) * step;
        let (origin, size) = ((start(left), start(top)), (long(left, right), long(top, bottom)));
        self.resampler.fill(image, origin, step, size, &mut self.pixels);
        self.judge.fill(&self.pixels, size.0);
    }

    /// Adds the wanted windows that reach `least`; neighbours are judged together.
    fn judge(
        &mut self,
        wanted: &[Wanted],
        size: &Size,
        [left, top, ..]: Bounds,
        least: f32,
        found: &mut Vec<Window>,
    ) {
        let at = |cell: i64, first: i64| (cell - first) as usize + around(self.kind);
        for run in wanted.chunk_by(|a, b| (a.x + 1, a.y) == (b.x, b.y)) {
            self.sums.clear();
            self.sums.resize(run.len(), 0.0);
            self.judge.sums((at(run[0].x, left), at(run[0].y, top)), &mut self.sums);
            let good = run.iter().zip(&self.sums).filter(|(_, sum)| **sum >= least);
            found.extend(good.map(|(window, sum)| Window {
                region: size.square(window.x, window.y),
                depth_m: window.depth_m,
                sum: *sum,
            }));
        }
    }
}

/// Windows of one size: the side of their square, and that of a pixel of the
/// resampled image, pixels.
#[derive(Clone, Copy, Debug)]
struct Size {
    side: f64,
    step: f64,
}

impl Size {
    /// The square of the window that begins at a cell.
    fn square(&self, x: i64, y: i64) -> Rect {
        let (left_px, above_px) = margins();
        let at = |cell: i64, margin: f64| ((cell * CELL as i64) as f64 + margin) * self.step;
        Rect::new(at(x, left_px), at(y, above_px), self.side, self.side)
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

/// Smallest column and row of windows, and largest ones.
type Bounds = [i64; 4];

fn bounds(wanted: &[Wanted]) -> Bounds {
    let none = [i64::MAX, i64::MAX, i64::MIN, i64::MIN];
    wanted.iter().fold(none, |[left, top, right, bottom], w| {
        [left.min(w.x), top.min(w.y), right.max(w.x), bottom.max(w.y)]
    })
}

/// The numbers of the window whose upper-body square is `square`, for machines of
/// one kind.
pub fn window_numbers(image: &GreyImage, square: &Rect, kind: Kind) -> Vec<f32> {
    let step = square.width.max(1.0) / (FILLED * WINDOW_PX as f64);
    let (window, margin) = (window_of(square), around_px(kind) as f64 * step);
    let (origin, side) = ((window.x - margin, window.y - margin), WINDOW_PX + 2 * around_px(kind));
    let pixels = resampled(image, origin, step, side, side);
    let mut field = Field::new(kind);
    field.fill(&pixels, side);
    field.numbers(around(kind), around(kind))
}

/// Leaves the best of each group of windows, best first: greedily, best first, those that overlap
/// a better one by more than `overlap` go, unless they are `apart_m` nearer or
/// farther. Two people one behind the other both stay.
pub fn merge(windows: &mut Vec<Window>, overlap: f64, apart_m: f64) {
    windows.sort_by(|a, b| b.sum.total_cmp(&a.sum));
    let mut kept = 0;
    for at in 0..windows.len() {
        let window = windows[at];
        let is_same = |better: &Window| {
            let apart = match (window.depth_m, better.depth_m) {
                (Some(a), Some(b)) => (a - b).abs() >= apart_m,
                _ => false,
            };
            !apart && window.region.iou(&better.region) > overlap
        };
        if !windows[..kept].iter().any(is_same) {
            windows[kept] = window;
            kept += 1;
        }
    }
    windows.truncate(kept);
}
