use std::ops::Range;
use std::sync::Arc;

use tagalong_vision::RowSums;

use crate::config::DepthTemplateConfig;
use crate::view::Working;

/// One pixel that fits perfectly.
pub const ONE: i32 = 256;

/// Depths are told apart in steps of 3 %: finer ones cost time and change
/// nothing, since a body is deeper than that.
const LEVEL_STEP: f64 = 0.03;
const PER_STEP: f64 = 1.0 / LEVEL_STEP;
const LEVELS: usize = 160;
const NEAREST_M: f64 = 0.2;
/// Levels of a row for which there is room from the start.
const USUAL_LEVELS: usize = 8;
const NONE: u32 = u32::MAX;

/// A depth at which a person may be, as a step of a logarithmic scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Level(usize);

/// Levels of surfaces at some distance behind a face.
#[derive(Clone, Copy, Debug)]
pub struct Levels {
    face: f64,
    per_metre: f64,
}

impl Levels {
    /// For a face at `depth_m`.
    pub fn of_face(depth_m: f64) -> Self {
        let depth_m = depth_m.max(NEAREST_M);
        Self { face: (depth_m / NEAREST_M).ln() / LEVEL_STEP, per_metre: 1.0 / depth_m }
    }

    /// The level `behind_m` behind the face (the logarithm to second order).
    pub fn behind(&self, behind_m: f64) -> Level {
        let part = behind_m * self.per_metre;
        let level = self.face + (part - 0.5 * part * part) * PER_STEP;
        // A cast rounds down, and negative values up to zero.
        Level(((level + 0.5) as usize).min(LEVELS - 1))
    }
}

/// Running sums of the evidence in the pixels of a row for a person at one level, in units of 1 /
/// [`ONE`] pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sum {
    /// If the person covers them: [`ONE`] at the person's depth, falling with the square of the
    /// error; negative where one looks past the person; zero where a nearer object, or no reading,
    /// hides the place.
    pub covered: i32,
    /// If the person does not: pixels at the person's depth nevertheless.
    pub beside: i32,
}

/// The verdict of single pixels for all levels that were asked for, row by row,
/// made on demand and kept for the frame.
///
/// The cost of a pixel is limited and so no polynomial of its value: sums over
/// runs cannot be had from sums of powers. But hundreds of scenes differ by
/// centimetres and ask for the same few levels again and again.
pub struct Scores {
    image: Arc<Working>,
    columns: Range<usize>,
    places: Vec<u32>,
    sums: Vec<Sum>,
    verdicts: Vec<Verdict>,
}

/// Evidence of a value at one level.
#[derive(Clone, Copy, Debug)]
struct Verdict {
    expected: f32,
    per_unit: f32,
}

impl Scores {
    /// Scores of no image.
    pub fn new(config: &DepthTemplateConfig) -> Self {
        let verdicts = (0..LEVELS).map(|level| Verdict::at(level, config)).collect();
        let image = Arc::new(Working::empty());
        Self { image, columns: 0..0, places: Vec::new(), sums: Vec::new(), verdicts }
    }

    /// Scores of `image`, at least of the columns `from..to`.
    pub fn prepare(&mut self, image: &Arc<Working>, from: i64, to: i64) {
        let [start, end] = [from, to].map(|x| x.clamp(0, image.0.width() as i64) as usize);
        let wanted = start..end;
        let same = Arc::ptr_eq(&self.image, image);
        let covered = self.columns.start <= wanted.start && wanted.end <= self.columns.end;
        if same && covered {
            return;
        }
        self.columns = if same {
            wanted.start.min(self.columns.start)..wanted.end.max(self.columns.end)
        } else {
            wanted
        };
        self.image = Arc::clone(image);
        self.sums.clear();
        // Memory that grew within a frame was copied, and new to the processor, each time.
        self.sums.reserve(image.0.height() * (self.columns.len() + 1) * USUAL_LEVELS);
        self.places.clear();
        self.places.resize(image.0.height() * LEVELS, NONE);
    }

    /// Rows of the image.
    pub fn height(&self) -> i64 {
        self.image.0.height() as i64
    }

    /// The sums along a row inside the image. Their runs are clipped to the
    /// columns that were prepared.
    #[inline]
    pub fn row(&mut self, line: usize, level: Level) -> Row<'_> {
        let place = line * LEVELS + level.0;
        if self.places[place] == NONE {
            self.places[place] = self.sums.len() as u32;
            self.fill(line, level);
        }
        let start = self.places[place] as usize;
        let sums = &self.sums[start..=start + self.columns.len()];
        Row { first: self.columns.start as i64, sums }
    }

    fn fill(&mut self, line: usize, level: Level) {
        let verdict = self.verdicts[level.0];
        let mut running = Sum::default();
        self.sums.push(running);
        let values = &self.image.0.values(line)[self.columns.clone()];
        self.sums.extend(values.iter().map(|value| {
            let Sum { covered, beside } = verdict.of(*value);
            running.covered += covered;
            running.beside += beside;
            running
        }));
    }
}

/// Running sums along one row.
#[derive(Clone, Copy)]
pub struct Row<'a> {
    first: i64,
    sums: &'a [Sum],
}

impl Row<'_> {
    /// Sum over the pixels `from..to`.
    #[expect(
        clippy::inline_always,
        reason = "asked six times a row; a call costs half as much again"
    )]
    #[inline(always)]
    pub fn of(&self, (from, to): (i64, i64)) -> Sum {
        let last = self.sums.len() as i64 - 1;
        let a = (from - self.first).max(0).min(last);
        let b = (to - self.first).max(a).min(last);
        let a = self.sums[a as usize];
        let b = self.sums[b as usize];
        Sum { covered: b.covered - a.covered, beside: b.beside - a.beside }
    }
}

impl Verdict {
    /// The error counts in inverse depth, in units of the largest one that a
    /// person's body or the sensor's noise explains.
    fn at(level: usize, config: &DepthTemplateConfig) -> Self {
        let depth_m = NEAREST_M * (level as f64 * LEVEL_STEP).exp();
        let noise_m = config.sigma_depth_m + config.sigma_depth_per_m2 * depth_m * depth_m;
        let tolerance_m = config.likelihood_tolerance_m.max(3.0 * noise_m);
        let expected = RowSums::UNITS / depth_m;
        let tolerance = expected - RowSums::UNITS / (depth_m + tolerance_m);
        Self { expected: expected as f32, per_unit: (1.0 / tolerance) as f32 }
    }

    fn of(&self, value: u16) -> Sum {
        if value == 0 {
            return Sum::default();
        }
        let error = (f32::from(value) - self.expected) * self.per_unit;
        let square = error * error;
        let beside = (1.0 - square).max(0.0);
        let covered = (1.0 - 2.0 * square).max(if error < 0.0 { -1.0 } else { 0.0 });
        Sum { covered: (covered * ONE as f32) as i32, beside: (beside * ONE as f32) as i32 }
    }
}

#[cfg(test)]
impl Scores {
    /// The verdict on one pixel; nothing outside of the image.
    pub fn pixel(&self, x: i64, line: i64, level: Level) -> Sum {
        let value = self.image.0.value(x, line);
        value.map_or(Sum::default(), |value| self.verdicts[level.0].of(value))
    }
}

#[cfg(test)]
mod tests {
    use tagalong_core::DepthImage;

    use super::*;

    fn verdict(person_m: f64, seen_m: f32) -> Sum {
        let image = DepthImage::from_pixels(1, 1, vec![seen_m]).unwrap();
        let image = Arc::new(Working(RowSums::new(&image, 1)));
        let mut scores = Scores::new(&DepthTemplateConfig::default());
        scores.prepare(&image, 0, 1);
        scores.row(0, Levels::of_face(person_m).behind(0.0)).of((0, 1))
    }

    #[test]
    fn a_pixel_speaks_for_the_person_at_its_depth_and_against_one_in_front_of_it() {
        let one = f64::from(ONE);
        assert!(f64::from(verdict(2.0, 2.0).covered) > 0.9 * one);
        // Depth beyond the place shows nobody there; a nearer surface hides the person.
        for (seen_m, expected) in [(5.0, -1.0), (1.0, 0.0), (f32::NAN, 0.0)] {
            assert_eq!(f64::from(verdict(2.0, seen_m).covered) / one, expected, "{seen_m}");
        }
        assert!(verdict(2.0, 2.0).beside > ONE / 2 && verdict(2.0, 5.0).beside == 0);
    }

    #[test]
    fn levels_follow_the_depth() {
        fn away(depth_m: f64, behind_m: f64) -> usize {
            let a = Levels::of_face(depth_m).behind(behind_m);
            let b = Levels::of_face(depth_m + behind_m).behind(0.0);
            a.0.abs_diff(b.0)
        }

        assert!((5..60).all(|d| away(0.1 * f64::from(d), 0.2 * f64::from(d) * 0.1) <= 1));
    }
}
