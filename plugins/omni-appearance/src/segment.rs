use crate::circular::{Run, runs};
use crate::{Background, Config};

/// Number of differing pixels in each column, and their places.
#[derive(Clone, Debug, Default)]
pub struct Counts {
    /// 1 where a person may be, else 0; row by row.
    pub solid: Vec<u8>,
    /// The same, shadows included.
    pub taken: Vec<u8>,
    /// Sums of `solid` over each column.
    pub columns: Vec<u16>,
}

/// Comparator of images with the background. It reuses its buffers.
#[derive(Clone, Debug, Default)]
pub struct Segmenter {
    width: usize,
    counts: Counts,
    /// 1 where a colour value differs, else 0.
    differs: Vec<u8>,
    /// Histogram of the number of differing pixels in columns of the empty scene.
    seen_empty: Vec<u32>,
    least: u16,
}

/// Quantile of that histogram which a person's column must exceed.
const EMPTY_PART: f64 = 0.995;
/// Fixed-point unit of the comparison of shadows, 1/256.
const ONE: f64 = 256.0;

impl Segmenter {
    /// Creates a segmenter for images of this width.
    pub fn new(width: usize, config: &Config) -> Self {
        Self { width, least: config.column_pixels, ..Self::default() }
    }

    /// Returns the result of the last comparison.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Compares an image with the background. `tinted` is true for a colour image: in a grey one
    /// shadows cannot be told from dark clothes, so none are removed.
    pub fn compare(
        &mut self,
        colours: &[u8],
        background: &Background,
        tinted: bool,
        config: &Config,
    ) {
        let low = &background.level;
        let high = &background.level;
        self.compare_between(colours, [low, high], background, tinted, config);
    }

    /// Compares an image with a background that lies between two bounds.
    pub(crate) fn compare_between(
        &mut self,
        colours: &[u8],
        [low, high]: [&[u8]; 2],
        background: &Background,
        tinted: bool,
        config: &Config,
    ) {
        self.differs.resize(colours.len(), 0);
        let known = low.iter().zip(high).zip(&background.limit);
        for ((differs, colour), ((low, high), limit)) in
            self.differs.iter_mut().zip(colours).zip(known)
        {
            let off = colour.saturating_sub(*high).max(low.saturating_sub(*colour));
            *differs = u8::from(off > *limit);
        }
        let shadow = Shadow::new(config, tinted);
        let Counts { solid, taken, .. } = &mut self.counts;
        taken.clear();
        taken.extend(self.differs.chunks_exact(3).map(|d| d[0] | d[1] | d[2]));
        solid.clone_from(taken);
        let pixels = colours.chunks_exact(3).zip(background.level.chunks_exact(3));
        for (solid, (colour, level)) in solid.iter_mut().zip(pixels).filter(|(s, _)| **s != 0) {
            *solid = u8::from(!shadow.is_at(colour, level));
        }
        self.count();
    }

    fn count(&mut self) {
        let Counts { solid, columns, .. } = &mut self.counts;
        columns.clear();
        columns.resize(self.width, 0);
        for row in solid.chunks_exact(self.width.max(1)) {
            for (sum, solid) in columns.iter_mut().zip(row) {
                *sum += u16::from(*solid);
            }
        }
    }

    /// Learns from the last comparison the number of differing pixels in columns of the empty
    /// scene.
    pub fn learn_empty(&mut self, config: &Config) {
        for count in &self.counts.columns {
            let count = usize::from(*count);
            if self.seen_empty.len() <= count {
                self.seen_empty.resize(count + 1, 0);
            }
            self.seen_empty[count] += 1;
        }
        let all: u32 = self.seen_empty.iter().sum();
        let mut below = 0;
        let quantile = self.seen_empty.iter().position(|columns| {
            below += columns;
            f64::from(below) >= EMPTY_PART * f64::from(all)
        });
        let quantile = quantile.unwrap_or(0).min(usize::from(u16::MAX) - 1) as u16;
        self.least = config.column_pixels.max(quantile + 1);
    }

    /// Returns the runs of columns with more differing pixels than the empty scene has, divided
    /// where two people touch.
    pub fn runs(&self, config: &Config) -> Vec<Run> {
        let columns = &self.counts.columns;
        let on: Vec<bool> = columns.iter().map(|count| *count >= self.least).collect();
        let found = runs(&on, config.bridge_columns);
        found.iter().flat_map(|run| divided(run, columns, config.valley)).collect()
    }
}

/// Divides a run at each valley that is lower than `valley` times the lower of the peaks beside it.
fn divided(run: &Run, columns: &[u16], valley: f64) -> Vec<Run> {
    let width = columns.len();
    // Smoothed, because a single thin column is not a valley between two people.
    let heights: Vec<f64> = smoothed(run, columns);
    let mut parts = Vec::new();
    let mut start = 0;
    let mut peak = 0.0_f64;
    let mut lowest = (f64::INFINITY, 0);
    for (at, height) in heights.iter().copied().enumerate() {
        if height > peak && lowest.0.is_infinite() {
            peak = height;
        } else if height < lowest.0 && height < valley * peak {
            lowest = (height, at);
        }
        if lowest.0 < valley * height.min(peak) {
            parts.push(Run { first: (run.first + start) % width, length: lowest.1 - start });
            (start, peak, lowest) = (lowest.1, height, (f64::INFINITY, 0));
        }
    }
    parts.push(Run { first: (run.first + start) % width, length: run.length - start });
    parts.retain(|part| part.length > 0);
    parts
}

/// Returns means of three columns, within the run.
fn smoothed(run: &Run, columns: &[u16]) -> Vec<f64> {
    let counts: Vec<f64> = run.columns(columns.len()).map(|c| f64::from(columns[c])).collect();
    (0..counts.len())
        .map(|at| {
            let part = &counts[at.saturating_sub(1)..(at + 2).min(counts.len())];
            part.iter().sum::<f64>() / part.len() as f64
        })
        .collect()
}

/// Test for shadows: the colours are darker, and all by about the same part.
#[derive(Clone, Copy)]
struct Shadow {
    least: u32,
    most: u32,
    tint: u32,
}

impl Shadow {
    fn new(config: &Config, tinted: bool) -> Self {
        fn fixed(part: f64) -> u32 {
            (ONE * part).round() as u32
        }

        // No value is above this limit, so the test is never true.
        let least = if tinted { fixed(config.shadow_min) } else { u32::MAX };
        Self { least, most: fixed(config.shadow_max), tint: fixed(config.shadow_tint) }
    }

    fn is_at(&self, colour: &[u8], level: &[u8]) -> bool {
        // A black background must not divide by 0.
        let parts = [0, 1, 2].map(|i| 256 * u32::from(colour[i]) / u32::from(level[i]).max(1));
        let (least, most) =
            parts.iter().fold((u32::MAX, 0), |(a, b), part| (a.min(*part), b.max(*part)));
        let mean = parts.iter().sum::<u32>() / 3;
        mean > self.least && mean < self.most && most - least < self.tint
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(width: usize, rows: &[&[u8]]) -> Segmenter {
        let config = Config { column_pixels: 1, ..Config::default() };
        let mut background = Background::new(width, rows.len());
        background.add(&vec![200; 3 * width * rows.len()], &config);
        let colours: Vec<u8> =
            rows.iter().flat_map(|row| row.iter().flat_map(|v| [*v; 3])).collect();
        let mut segmenter = Segmenter::new(width, &config);
        segmenter.compare(&colours, &background, true, &config);
        segmenter
    }

    #[test]
    fn shadows_and_noise_are_left_out() {
        let row = [200, 196, 205, 150, 50, 255];
        assert_eq!(seen(6, &[&row]).counts().columns, [0, 0, 0, 0, 1, 1]);
    }

    #[test]
    fn a_coloured_thing_is_no_shadow() {
        let config = Config::default();
        let mut background = Background::new(1, 1);
        background.add(&[200, 200, 200], &config);
        let mut segmenter = Segmenter::new(1, &config);
        segmenter.compare(&[170, 150, 140], &background, true, &config);
        assert_eq!(segmenter.counts().columns, [1]);
        segmenter.compare(&[150, 150, 150], &background, false, &config);
        assert_eq!(segmenter.counts().columns, [1], "a grey image has no shadows");
    }

    #[test]
    fn one_colour_that_differs_is_enough() {
        let config = Config { column_pixels: 1, ..Config::default() };
        let mut background = Background::new(4, 1);
        background.add(&[200; 12], &config);
        let mut segmenter = Segmenter::new(4, &config);
        let colours = [50, 200, 200, 200, 50, 200, 200, 200, 50, 200, 200, 200];
        segmenter.compare(&colours, &background, true, &config);
        assert_eq!(segmenter.counts().taken, [1, 1, 1, 0]);
    }

    #[test]
    fn two_people_who_touch_are_divided_and_one_is_not() {
        let run = Run { first: 8, length: 8 };
        let two = [20, 40, 38, 4, 3, 31, 41, 20];
        let one = [5, 20, 40, 45, 38, 40, 20, 6];
        let [both, alone] = [two, one].map(|counts| {
            let mut columns = [0u16; 12];
            for (column, count) in run.columns(12).zip(counts) {
                columns[column] = count;
            }
            divided(&run, &columns, 0.5)
        });
        assert_eq!(both.len(), 2, "{both:?}");
        assert_eq!(both.iter().map(|part| part.length).sum::<usize>(), 8);
        assert_eq!(both[1].first, (both[0].first + both[0].length) % 12);
        assert_eq!(alone, [run]);
    }

    #[test]
    fn columns_of_the_empty_room_raise_the_bar() {
        let config = Config::default();
        let mut segmenter = seen(4, &[&[0, 200, 200, 200][..]; 9]);
        segmenter.learn_empty(&config);
        assert_eq!(segmenter.least, 10);
    }
}
