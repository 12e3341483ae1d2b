//! Windows over an image in many sizes, as OpenCV's `detectMultiScale` looks at
//! them.

use tagalong_core::{GreyImage, Rect};

use crate::cascade::Cascade;
use crate::compiled::{Block, Compiled, LANES};
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
    /// The cascade for windows at each pixel, and at every second one.
    compiled: [Option<Compiled>; 2],
    wanted: Vec<bool>,
    looked_at: u64,
}

impl Scanner {
    /// How many windows were looked at so far.
    pub fn looked_at(&self) -> u64 {
        self.looked_at
    }

    /// Forgets the cascade of before: the next scan may be with another one.
    pub fn forget(&mut self) {
        self.compiled = [None, None];
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
        let Self { level, compiled, wanted, looked_at } = self;
        let compiled = &mut compiled[step - 1];
        let last = width - cascade.width;
        let mut is_filled = false;
        for y in (0..=height - cascade.height).step_by(step) {
            wanted.clear();
            wanted.extend((0..=last).step_by(step).map(|x| propose(x, y)));
            if !wanted.contains(&true) {
                continue;
            }
            if !is_filled {
                level.fill(image, (width, height), step);
                is_filled = true;
            }
            compiled.take_if(|compiled| !compiled.fits(level));
            let compiled = compiled.get_or_insert_with(|| Compiled::new(cascade, level));
            let mut row = Row { level, compiled, y, step, is_skipped: false };
            for (wanted, first) in wanted.chunks(LANES).zip((0..).step_by(LANES)) {
                *looked_at += row.look(wanted, first * step, take);
            }
        }
    }
}

/// A row of windows.
struct Row<'a> {
    level: &'a Level,
    compiled: &'a Compiled,
    y: usize,
    step: usize,
    /// The next window is the neighbour of one that failed the first stage.
    is_skipped: bool,
}

impl Row<'_> {
    /// Looks at the wanted windows from column `x` on; returns how many it looked at.
    fn look(&mut self, wanted: &[bool], x: usize, take: &mut impl FnMut(Seen<'_>)) -> u64 {
        if !wanted.contains(&true) {
            self.is_skipped = false;
            return 0;
        }
        let mut block = self.compiled.start(self.level, (x, self.y));
        let looked_at = self.choose(wanted, &mut block);
        self.compiled.finish(self.level, &mut block);
        for lane in block.lanes() {
            let margin = self.compiled.margin(&block, lane);
            take(Seen { level: self.level, x: x + lane * self.step, y: self.y, margin });
        }
        looked_at
    }

    /// Keeps the wanted windows that pass the first stage. As in OpenCV, the neighbour
    /// of one that fails is not looked at.
    fn choose(&mut self, wanted: &[bool], block: &mut Block) -> u64 {
        let mut looked_at = 0;
        block.keep(|block, lane| {
            let is_wanted = wanted.get(lane) == Some(&true);
            if std::mem::take(&mut self.is_skipped) || !is_wanted {
                return false;
            }
            looked_at += 1;
            let is_worth_it = Compiled::is_worth_it(block, lane);
            let passes = is_worth_it && self.compiled.passes(0, block, lane);
            self.is_skipped = is_worth_it && !passes;
            passes
        });
        looked_at
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
