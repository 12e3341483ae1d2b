//! Windows over an image in many sizes.

use tagalong_core::{GreyImage, Rect};

use crate::Model;
use crate::hog::{Blocks, CELL};
use crate::model::SIDE;
use crate::resample::resampled;

/// Side of a window, pixels of the resampled image.
pub(crate) const WINDOW_PX: usize = (SIDE + 1) * CELL;
/// The upper-body square fills this much of a window.
pub(crate) const FILLED: f64 = 0.8;

/// What is resampled around windows: a cell, because its gradients vote for the
/// outermost cells of the window, too, and a pixel for their gradients.
const AROUND_PX: usize = CELL + 1;

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
#[derive(Clone, Debug, Default)]
pub struct Scanner {
    blocks: Blocks,
    looked_at: u64,
}

impl Scanner {
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
        let cells = |pixels: usize| (pixels as f64 / (step * CELL as f64)) as usize;
        let (across, down) = (cells(image.width()), cells(image.height()));
        if across <= SIDE || down <= SIDE {
            return;
        }
        let margin = 0.5 * (1.0 - FILLED) * WINDOW_PX as f64;
        let square = |x: usize, y: usize| {
            let at = |cell: usize| ((cell * CELL) as f64 + margin) * step;
            Rect::new(at(x), at(y), side, side)
        };
        let mut wanted: Vec<(usize, usize, Option<f64>)> = Vec::new();
        for y in 0..down - SIDE {
            wanted.extend((0..across - SIDE).filter_map(|x| Some((x, y, propose(&square(x, y))?))));
        }
        let Some((left, top, right, bottom)) = bounds(&wanted) else { return };
        self.looked_at += wanted.len() as u64;
        let long = |from: usize, to: usize| (to - from + SIDE + 1) * CELL + 2 * AROUND_PX;
        let (width, height) = (long(left, right), long(top, bottom));
        let start = |cell: usize| ((cell * CELL) as f64 - AROUND_PX as f64) * step;
        let pixels = resampled(image, (start(left), start(top)), step, width, height);
        self.blocks.fill(&pixels, width);
        for (x, y, depth_m) in wanted {
            let sum = model.sum(&self.blocks, x - left + 1, y - top + 1);
            if sum >= least {
                found.push(Window { region: square(x, y), depth_m, sum });
            }
        }
    }
}

/// Smallest and largest column and row.
fn bounds(wanted: &[(usize, usize, Option<f64>)]) -> Option<(usize, usize, usize, usize)> {
    let (x, y) = (|| wanted.iter().map(|w| w.0), || wanted.iter().map(|w| w.1));
    Some((x().min()?, y().min()?, x().max()?, y().max()?))
}

/// The numbers of the window whose upper-body square is `square`.
pub fn window_numbers(image: &GreyImage, square: &Rect) -> Vec<f32> {
    let step = square.width.max(1.0) / (FILLED * WINDOW_PX as f64);
    let margin = (0.5 * (1.0 - FILLED) * WINDOW_PX as f64 + AROUND_PX as f64) * step;
    let (origin, side) = ((square.x - margin, square.y - margin), WINDOW_PX + 2 * AROUND_PX);
    let pixels = resampled(image, origin, step, side, side);
    let mut blocks = Blocks::default();
    blocks.fill(&pixels, side);
    (1..=SIDE).flat_map(|y| blocks.run(1, y, SIDE).iter().copied()).collect()
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
