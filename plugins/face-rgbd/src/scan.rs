//! Windows over an image in many sizes, as OpenCV's `detectMultiScale` looks at
//! them.

use tagalong_core::{GreyImage, Rect};

use crate::cascade::Cascade;
use crate::compiled::{Compiled, Row};
use crate::group::Hit;
use crate::level::Level;

/// Images that are smaller than one through this are looked at pixel by pixel,
/// others at every second.
const FINE_FROM: f64 = 2.0;

/// A window that passed all stages, as the cascade saw it.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The image in the size in question.
    pub level: &'a Level,
    /// Left edge in it.
    pub x: usize,
    /// Upper edge in it.
    pub y: usize,
    /// By how much the last stage was passed.
    pub margin: f32,
}

/// Looks at the windows of images; keeps its memory from one to the next.
#[derive(Clone, Debug, Default)]
pub struct Scanner {
    level: Level,
    compiled: Compiled,
    row: Row,
    wanted: Vec<bool>,
    chosen: Vec<usize>,
    looked_at: u64,
}

impl Scanner {
    /// How many windows were looked at so far.
    pub fn looked_at(&self) -> u64 {
        self.looked_at
    }

    /// Forgets the cascade of before: the next scan may be with another one.
    pub fn forget(&mut self) {
        self.compiled = Compiled::default();
    }

    /// Adds the windows of all `scales` that pass and that `propose` allows;
    /// it is given the window in pixels of the image.
    pub fn scan(
        &mut self,
        image: &GreyImage,
        cascade: &Cascade,
        scales: impl Iterator<Item = f64>,
        mut propose: impl FnMut(&Rect) -> bool,
        hits: &mut Vec<Hit>,
    ) {
        for scale in scales {
            let size = |length: usize| (length as f64 * scale).round();
            let (width, height) = (size(cascade.width), size(cascade.height));
            let region = |x: usize, y: usize| Rect::new(size(x), size(y), width, height);
            let mut take = |seen: Seen<'_>| {
                hits.push(Hit { region: region(seen.x, seen.y), margin: seen.margin });
            };
            self.size(image, cascade, scale, &mut |x, y| propose(&region(x, y)), &mut take);
        }
    }

    /// One size: the image shrunk by `scale`.
    pub fn size(
        &mut self,
        image: &GreyImage,
        cascade: &Cascade,
        scale: f64,
        propose: &mut impl FnMut(usize, usize) -> bool,
        take: &mut impl FnMut(Seen<'_>),
    ) {
        let shrunk = |length: usize| (length as f64 / scale).round() as usize;
        let (width, height) = (shrunk(image.width()), shrunk(image.height()));
        if width < cascade.width || height < cascade.height {
            return;
        }
        let step = if scale >= FINE_FROM { 1 } else { 2 };
        let mut is_filled = false;
        for y in (0..=height - cascade.height).step_by(step) {
            let Some((first, count)) = self.ask(width - cascade.width, y, step, propose) else {
                continue;
            };
            if !is_filled {
                self.fill(image, cascade, (width, height));
                is_filled = true;
            }
            self.row(y, first, count, step, take);
        }
    }

    fn fill(&mut self, image: &GreyImage, cascade: &Cascade, (width, height): (usize, usize)) {
        self.level.fill(image, width, height);
        if self.compiled.stride() != self.level.stride() {
            self.compiled = Compiled::new(cascade, self.level.stride());
        }
    }

    /// Notes which windows of a row are wanted; the first one, and how many
    /// there are up to the last one.
    fn ask(
        &mut self,
        last: usize,
        y: usize,
        step: usize,
        propose: &mut impl FnMut(usize, usize) -> bool,
    ) -> Option<(usize, usize)> {
        self.wanted.clear();
        self.wanted.extend((0..=last).step_by(step).map(|x| propose(x, y)));
        let first = self.wanted.iter().position(|wanted| *wanted)?;
        let last = self.wanted.iter().rposition(|wanted| *wanted)?;
        Some((first, last + 1 - first))
    }

    /// The windows of a row. As in OpenCV, the neighbour of one that fails the
    /// first stage is not looked at.
    fn row(
        &mut self,
        y: usize,
        first: usize,
        count: usize,
        step: usize,
        take: &mut impl FnMut(Seen<'_>),
    ) {
        let Self { level, compiled, row, wanted, chosen, looked_at } = self;
        let place = (first * step, y);
        compiled.start(level, place, step, row, count);
        compiled.all(0, level, place, step, row);
        chosen.clear();
        let mut at = 0;
        while at < count {
            let is_wanted = wanted[first + at];
            *looked_at += u64::from(is_wanted);
            if is_wanted && Compiled::is_worth_it(row, at) {
                if compiled.passes(0, row.sums[at]) {
                    chosen.push(at);
                } else {
                    at += 1;
                }
            }
            at += 1;
        }
        let mut stage = 1;
        while compiled.pays(stage, chosen.len(), count) {
            compiled.all(stage, level, place, step, row);
            chosen.retain(|at| compiled.passes(stage, row.sums[*at]));
            stage += 1;
        }
        compiled.rest(stage, level, y, row, chosen);
        for (x, sum) in row.columns.iter().zip(&row.sums) {
            take(Seen { level, x: *x as usize, y, margin: compiled.margin(*sum) });
        }
    }
}

/// The scales at which windows are between `least` and `most` pixels wide, each
/// `step` times the one before, counted from a window as it is.
pub fn scales(cascade: &Cascade, least: f64, most: f64, step: f64) -> impl Iterator<Item = f64> {
    let width = cascade.width as f64;
    // Scales are kept as 32-bit numbers by OpenCV, and rounded windows depend on it.
    std::iter::successors(Some(1.0_f64), move |scale| Some(scale * step))
        .map(|scale| f64::from(scale as f32))
        .take_while(move |scale| (width * scale).round() <= most)
        .filter(move |scale| (width * scale).round() >= least)
}
