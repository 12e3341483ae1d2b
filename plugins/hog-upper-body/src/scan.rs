//! Scan of an image with windows of many sizes.

use std::ops::Range;

use tagalong_core::GreyImage;
use tagalong_geometry::Rect;
use tagalong_vision::islands;

use crate::coverage::{Coverage, FILLED, SIDE, WINDOW_PX, margins, window_of};
use crate::hog::CELL;
use crate::judge::Judge;
use crate::model::{Field, Kind, Layout, Model};
use crate::resample::{Resampler, resampled};
use crate::spans::Spans;

/// Returns the number of cells that are resampled around windows: they have a share in the
/// outermost cells of a window, and for trees in the normalisation there.
const fn around(kind: Kind) -> usize {
    match kind {
        Kind::Linear => 1,
        Kind::Trees => 2,
    }
}

/// Returns the same in pixels, with one more for the gradients.
const fn around_px(kind: Kind) -> usize {
    around(kind) * CELL + 1
}

impl Layout {
    /// Returns the numbers of columns and rows of cells that are resampled for one window.
    pub(crate) const fn cells(self) -> [usize; 2] {
        let around = 2 * around(self.kind);
        [SIDE + 1 + around, self.coverage.rows() + around]
    }
}

/// A scanned window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Upper-body square, pixels of the image.
    pub region: Rect,
    /// Depth of its object, m, if known.
    pub depth_m: Option<f64>,
    /// Sum of the machine.
    pub sum: f32,
}

/// Scanner of the windows of images; the memory is reused for the next image.
#[derive(Clone, Debug)]
pub struct Scanner {
    judge: Judge,
    /// Layout of the model's windows.
    layout: Layout,
    resampler: Resampler,
    pixels: Vec<f32>,
    wanted: Vec<Wanted>,
    spans: Spans,
    sums: Vec<f32>,
    looked_at: u64,
}

/// A window that is to be scanned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wanted {
    /// Column of the cell at which the window begins, of 8 pixels of the resampled image ...
    pub x: i64,
    /// ... and the row. A window may begin outside of the image.
    pub y: i64,
    /// Depth of the object in its square, m, if known.
    pub depth_m: Option<f64>,
}

impl Scanner {
    /// Creates a scanner for one model.
    pub fn new(model: &Model) -> Self {
        Self {
            judge: Judge::new(model),
            layout: model.layout(),
            resampler: Resampler::default(),
            pixels: Vec::new(),
            wanted: Vec::new(),
            spans: Spans::default(),
            sums: Vec::new(),
            looked_at: 0,
        }
    }

    /// Returns the number of windows scanned so far.
    pub fn looked_at(&self) -> u64 {
        self.looked_at
    }

    /// Adds all windows with an upper-body square of one of `sides`, pixels, that `propose` adds
    /// for their size, row by row. Windows with sums below `least` are left out.
    pub fn scan(
        &mut self,
        image: &GreyImage,
        sides: impl Iterator<Item = f64>,
        least: f32,
        mut propose: impl FnMut(&Grid, &mut Vec<Wanted>),
        found: &mut Vec<Window>,
    ) {
        let mut wanted = std::mem::take(&mut self.wanted);
        // Islands that are this far apart share no pixels.
        let gap = self.layout.cells().into_iter().max().unwrap_or_default() as i64;
        for side in sides {
            let grid = Grid::new((image.width(), image.height()), side);
            wanted.clear();
            propose(&grid, &mut wanted);
            self.looked_at += wanted.len() as u64;
            islands(&mut wanted, |w| [w.x, w.y], gap, &mut |island| {
                let bounds = bounds(island);
                self.fill(image, grid.step, island, bounds);
                self.judge(island, &grid, bounds, least, found);
            });
        }
        self.wanted = wanted;
    }

    /// Computes the features of the machine for wanted windows within bounds.
    fn fill(&mut self, image: &GreyImage, step: f64, wanted: &[Wanted], bounds: Bounds) {
        let around_px = around_px(self.layout.kind);
        let [wide, tall] = self.layout.cells();
        let [left, top, right, bottom] = bounds;
        let across = (right - left) as usize + wide;
        let down = (bottom - top) as usize + tall;
        let places = wanted.iter().map(|w| ((w.x - left) as usize, (w.y - top) as usize));
        self.spans.fill(places, (wide, tall), down);
        let [x, y] =
            [left, top].map(|cell| ((cell * CELL as i64) as f64 - around_px as f64) * step);
        let origin = (x, y);
        let size = [across, down].map(|n| n * CELL + 2);
        let size = (size[0], size[1]);
        let spans = &self.spans;
        self.resampler.fill(image, origin, step, size, spans, &mut self.pixels);
        self.judge.fill(&self.pixels, size.0, spans);
    }

    /// Adds the wanted windows that reach `least`; neighbours are classified together.
    fn judge(
        &mut self,
        wanted: &[Wanted],
        grid: &Grid,
        [left, top, ..]: Bounds,
        least: f32,
        found: &mut Vec<Window>,
    ) {
        for run in wanted.chunk_by(|a, b| (a.x + 1, a.y) == (b.x, b.y)) {
            self.sums.clear();
            self.sums.resize(run.len(), 0.0);
            let [x, y] = [run[0].x - left, run[0].y - top]
                .map(|cell| cell as usize + around(self.layout.kind));
            self.judge.sums((x, y), &mut self.sums);
            let good = run.iter().zip(&self.sums).filter(|(_, sum)| **sum >= least);
            found.extend(good.map(|(window, sum)| Window {
                region: grid.square(window.x, window.y),
                depth_m: window.depth_m,
                sum: *sum,
            }));
        }
    }
}

/// All windows of one size.
#[derive(Clone, Debug)]
pub struct Grid {
    /// Side of their squares, pixels of the image.
    pub side: f64,
    /// Columns of the cells at which windows begin.
    pub columns: Range<i64>,
    /// Rows of the cells at which windows begin.
    pub rows: Range<i64>,
    /// Size of a pixel of the resampled image, pixels.
    step: f64,
}

impl Grid {
    /// Creates the grid for an image of some width and height.
    pub(crate) fn new((width, height): (usize, usize), side: f64) -> Self {
        let step = side / (FILLED * WINDOW_PX as f64);
        let (left_px, above_px) = margins();
        let columns = inside(width as f64 / step, left_px);
        let rows = inside(height as f64 / step, above_px);
        Self { side, columns, rows, step }
    }

    /// Returns the upper-body square of the window that begins at a cell.
    pub fn square(&self, x: i64, y: i64) -> Rect {
        let (left_px, above_px) = margins();
        let [left, top] = [(x, left_px), (y, above_px)]
            .map(|(cell, margin)| ((cell * CELL as i64) as f64 + margin) * self.step);
        Rect::new(left, top, self.side, self.side)
    }

    /// Returns the windows that `ask` allows, row by row; it is given the square, and returns the
    /// depth of its object if that is known.
    pub fn windows(
        &self,
        mut ask: impl FnMut(&Rect) -> Option<Option<f64>>,
    ) -> impl Iterator<Item = Wanted> {
        let cells = self.rows.clone().flat_map(|y| self.columns.clone().map(move |x| (x, y)));
        cells.filter_map(move |(x, y)| Some(Wanted { x, y, depth_m: ask(&self.square(x, y))? }))
    }
}

/// Returns the first cells of the windows with their square in an image of `length` pixels; the
/// rest of a window may extend beyond it, where the border is continued.
fn inside(length: f64, margin: f64) -> Range<i64> {
    let cell = CELL as f64;
    let last = (length - margin - FILLED * WINDOW_PX as f64) / cell;
    (-margin / cell).ceil() as i64..last.floor() as i64 + 1
}

/// Smallest column and row of windows, and largest ones.
type Bounds = [i64; 4];

fn bounds(wanted: &[Wanted]) -> Bounds {
    let none = [i64::MAX, i64::MAX, i64::MIN, i64::MIN];
    wanted.iter().fold(none, |[left, top, right, bottom], w| {
        [left.min(w.x), top.min(w.y), right.max(w.x), bottom.max(w.y)]
    })
}

/// Returns the values of the window of an upper-body square, in one layout.
pub fn window_numbers(image: &GreyImage, square: &Rect, layout: impl Into<Layout>) -> Vec<f32> {
    let layout = layout.into();
    let Layout { kind, coverage } = layout;
    let step = square.width.max(1.0) / (FILLED * WINDOW_PX as f64);
    let window = window_of(square, coverage);
    let margin = around_px(kind) as f64 * step;
    let origin = (window.x - margin, window.y - margin);
    let cells = layout.cells();
    let [width, height] = cells.map(|cells| cells * CELL + 2);
    let pixels = resampled(image, origin, step, cells);
    let mut field = Field::new(kind);
    field.fill(&pixels, width, &Spans::whole(width, height));
    field.numbers((around(kind), around(kind)), coverage)
}

/// Keeps the best of each group of windows, best first: a window that overlaps a better one by more
/// than `overlap` is removed, unless the two are `apart_m` or more apart in depth. Two people one
/// behind the other both stay. The overlap is that of the parts of people which the windows show.
pub fn merge(windows: &mut Vec<Window>, coverage: Coverage, overlap: f64, apart_m: f64) {
    windows.sort_by(|a, b| b.sum.total_cmp(&a.sum));
    let mut kept = 0;
    for at in 0..windows.len() {
        let window = windows[at];
        let is_same = windows[..kept].iter().any(|better| {
            let apart = match (window.depth_m, better.depth_m) {
                (Some(a), Some(b)) => (a - b).abs() >= apart_m,
                _ => false,
            };
            !apart
                && coverage.person(&window.region).iou(&coverage.person(&better.region)) > overlap
        });
        if !is_same {
            windows[kept] = window;
            kept += 1;
        }
    }
    windows.truncate(kept);
}
