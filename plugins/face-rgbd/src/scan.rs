//! Scan of an image with windows of many sizes, as in OpenCV's `detectMultiScale`.

use std::ops::Range;

use tagalong_core::GreyImage;
use tagalong_geometry::Rect;

use crate::cascade::{Cascade, Part};
use crate::compiled::{Block, Compiled, LANES};
use crate::group::Hit;
use crate::level::Level;

/// Scale from which windows begin at every pixel of the shrunk image; below it at every second one.
const FINE_FROM: f64 = 2.0;

/// A window that passed all stages, with the pixels that the cascade read.
#[derive(Clone, Copy, Debug)]
pub struct PassedWindow<'a> {
    /// Computed part of the image in the current size.
    pub level: &'a Level,
    /// Position of this part in the whole image of that size.
    pub part: Part,
    /// Left edge in the level.
    pub x: usize,
    /// Upper edge in the level.
    pub y: usize,
    /// Excess over the threshold of the last stage.
    pub margin: f32,
}

/// Scanner of the windows of images; the memory is reused for the next image.
#[derive(Clone, Debug, Default)]
pub struct Scanner {
    level: Level,
    /// The cascade for windows at each pixel, and at every second one.
    compiled: [Option<Compiled>; 2],
    wanted: Vec<bool>,
    looked_at: u64,
}

impl Scanner {
    /// Returns the number of windows scanned so far.
    pub fn looked_at(&self) -> u64 {
        self.looked_at
    }

    /// Discards the compiled cascade: the next scan may use another one.
    pub fn forget(&mut self) {
        self.compiled = [None, None];
    }

    /// Adds all windows of all `scales` that pass, in pixels of the image.
    pub fn scan(
        &mut self,
        image: &GreyImage,
        cascade: &Cascade,
        scales: impl Iterator<Item = f64>,
        hits: &mut Vec<Hit>,
    ) {
        let everywhere = [whole(image)];
        for scale in scales {
            self.scan_within(image, cascade, scale, &everywhere, |_| true, hits);
        }
    }

    /// Adds the windows of one size that pass, with their middle in one of some `areas`, and that
    /// `propose` allows; all in pixels of the image. A window in two areas is added twice.
    pub fn scan_within(
        &mut self,
        image: &GreyImage,
        cascade: &Cascade,
        scale: f64,
        areas: &[Rect],
        propose: impl Fn(&Rect) -> bool,
        hits: &mut Vec<Hit>,
    ) {
        let size = [cascade.width, cascade.height].map(|length| rounded(length as f64 * scale));
        for area in areas {
            self.size(
                image,
                cascade,
                scale,
                area,
                &|x, y| propose(&scaled_region([x, y], scale, size)),
                &mut |seen| {
                    let at = [seen.part.x + seen.x, seen.part.y + seen.y];
                    let region = scaled_region(at, scale, size);
                    hits.push(Hit { region, margin: seen.margin });
                },
            );
        }
    }

    /// Passes to `take` the windows of one size that pass, in the image shrunk by `scale`, with
    /// their middle in an area of the image. `propose` is given the upper left corner in the shrunk
    /// image.
    pub fn size(
        &mut self,
        image: &GreyImage,
        cascade: &Cascade,
        scale: f64,
        area: &Rect,
        propose: &impl Fn(usize, usize) -> bool,
        take: &mut impl FnMut(PassedWindow<'_>),
    ) {
        let step = if scale >= FINE_FROM { 1 } else { 2 };
        let size =
            [image.width(), image.height()].map(|length| rounded(length as f64 / scale) as usize);
        let columns = ends_of_places(area.x..area.right(), size[0], cascade.width, scale, step);
        let rows = ends_of_places(area.y..area.bottom(), size[1], cascade.height, scale, step);
        let (Some((left, right)), Some((top, bottom))) = (columns, rows) else { return };
        let part = Part {
            x: left,
            y: top,
            width: right - left + cascade.width,
            height: bottom - top + cascade.height,
        };
        let Self { level, compiled, wanted, looked_at } = self;
        level.fill_part(image, size.into(), part, step);
        let compiled = &mut compiled[step - 1];
        // A larger image makes rows of sums longer, and compiled offsets invalid.
        compiled.take_if(|compiled| !compiled.fits(level));
        let compiled = compiled.get_or_insert_with(|| Compiled::new(cascade, level));
        if compiled.is_tilted() {
            level.add_tilted();
        }
        for y in (top..=bottom).step_by(step) {
            wanted.clear();
            wanted.extend((left..=right).step_by(step).map(|x| propose(x, y)));
            let mut row = Row { level, compiled, part, y: y - top, step, is_skipped: false };
            for (wanted, first) in wanted.chunks(LANES).zip((0..).step_by(LANES)) {
                *looked_at += row.look(wanted, first * step, take);
            }
        }
    }
}

/// Returns the first and the last place, in pixels of the shrunk image, of a window along an axis
/// of this length, with its middle in a range of the image.
fn ends_of_places(
    range: Range<f64>,
    length: usize,
    window: usize,
    scale: f64,
    step: usize,
) -> Option<(usize, usize)> {
    let half = 0.5 * rounded(window as f64 * scale);
    let all = (0..=length.checked_sub(window)?).step_by(step);
    let mut inside = all.filter(|x| range.contains(&(rounded(*x as f64 * scale) + half)));
    let first = inside.next()?;
    Some((first, inside.last().unwrap_or(first)))
}

/// Returns the region of the image of a window at this place, which has this size there.
#[inline]
fn scaled_region(at: [usize; 2], scale: f64, [width, height]: [f64; 2]) -> Rect {
    let [x, y] = at.map(|length| rounded(length as f64 * scale));
    Rect::new(x, y, width, height)
}

/// Rounds a value that is not negative to the nearest whole number. Called for each window, where
/// `round` would be a call of a library.
fn rounded(value: f64) -> f64 {
    (value + 0.5) as i64 as f64
}

/// Returns the area of a whole image.
pub fn whole(image: &GreyImage) -> Rect {
    Rect::new(0.0, 0.0, image.width() as f64, image.height() as f64)
}

/// A row of windows.
struct Row<'a> {
    level: &'a Level,
    compiled: &'a Compiled,
    part: Part,
    y: usize,
    step: usize,
    /// True if the next window is the neighbour of one that failed the first stage.
    is_skipped: bool,
}

impl Row<'_> {
    /// Scans the wanted windows from column `x` on; returns their number.
    fn look(&mut self, wanted: &[bool], x: usize, take: &mut impl FnMut(PassedWindow<'_>)) -> u64 {
        if !wanted.contains(&true) {
            // A gap in the wanted windows interrupts the row, so no neighbour is skipped behind it.
            self.is_skipped = false;
            return 0;
        }
        let mut block = self.compiled.start(self.level, (x, self.y));
        let looked_at = self.choose(wanted, &mut block);
        self.compiled.finish(self.level, &mut block);
        for lane in block.lanes() {
            let margin = self.compiled.margin(&block, lane);
            let x = x + lane * self.step;
            let part = self.part;
            take(PassedWindow { level: self.level, part, x, y: self.y, margin });
        }
        looked_at
    }

    /// Keeps the wanted windows that pass the first stage. As in OpenCV, the neighbour of one that
    /// fails is skipped.
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

/// Returns the scales at which windows are between `least` and `most` pixels wide, each `step`
/// times the one before, beginning with 1.
pub fn scales(cascade: &Cascade, least: f64, most: f64, step: f64) -> impl Iterator<Item = f64> {
    let width = cascade.width as f64;
    // OpenCV keeps scales as 32-bit numbers, and rounded windows depend on it.
    std::iter::successors(Some(1.0_f64), move |scale| Some(scale * step))
        .map(|scale| f64::from(scale as f32))
        .take_while(move |scale| (width * scale).round() <= most)
        .filter(move |scale| (width * scale).round() >= least)
}
