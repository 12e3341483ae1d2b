//! Run of the pipeline for a visit: the people that it finds, and the candidates that each test
//! drops.

use std::collections::BTreeMap;

use tagalong_app::lacking::Lacking;
use tagalong_app::missed::{Depths, Witness};
use tagalong_core::{Frame, Funnel, RgbImage};
use tagalong_geometry::Rect;
use tagalong_log::LogFrame;
use tagalong_pipeline::{Fate, FrameReport, Pipeline};
use tagalong_render::background;

use super::coverage::Course;

/// Largest number of pictures of one test.
const EXAMPLES: usize = 16;

/// Picture of a dropped candidate.
pub struct Example {
    /// Index of the frame.
    pub frame: u64,
    /// Dropped region with its surroundings.
    pub picture: RgbImage,
}

/// Result of the pipeline on the frames.
#[derive(Default)]
pub struct Trial {
    /// Number of frames that it processed.
    pub frames: u64,
    /// Positions of its tracks.
    pub course: Course,
    /// Number of drops per test.
    pub funnel: Funnel,
    /// Dropped candidates and tracks of each frame.
    pub witness: Witness,
    /// Example pictures, by test.
    pub examples: BTreeMap<&'static str, Spread<Example>>,
    /// Reports of all frames, if pictures of them may be needed.
    pub reports: Vec<FrameReport>,
    /// Frames that it left out for want of an input.
    pub lacking: Lacking,
    /// Error that ended the run.
    pub failure: Option<String>,
}

impl Trial {
    /// Passes a frame to the pipeline; does nothing after an error of a plugin.
    pub fn step(&mut self, pipeline: &mut Pipeline, item: &LogFrame, with_pictures: bool) {
        if self.failure.is_some() {
            return;
        }
        match self.lacking.step(pipeline, &item.frame) {
            Ok(Some(report)) => self.take(item, report, with_pictures),
            Ok(None) => return,
            Err(error) => self.failure = Some(error.to_string()),
        }
        self.frames += 1;
    }

    /// Ends the run: it has failed if no frame had the inputs of the pipeline.
    pub fn end(&mut self) {
        let lacking = self.lacking.failure().map(ToString::to_string);
        self.failure = self.failure.take().or(lacking);
    }

    /// Returns the number of confirmed tracks that were seen in the last frame.
    pub fn in_view(&self) -> usize {
        let last = self.course.moments.last();
        last.map_or(0, |moment| moment.tracks.iter().filter(|track| track.seen).count())
    }

    fn take(&mut self, item: &LogFrame, report: FrameReport, with_pictures: bool) {
        self.course.take(&report, &item.odom_from_robot);
        self.funnel.merge(&report.funnel);
        self.witness.take(item, &report, Depths::of_frame(&item.frame));
        if !with_pictures {
            return;
        }
        let frame = &item.frame;
        for (test, place) in dropped(&report) {
            self.examples
                .entry(test)
                .or_default()
                .offer(|| Some(Example { frame: frame.index, picture: picture(frame, &place)? }));
        }
        self.reports.push(report);
    }
}

/// Returns one dropped region per test.
fn dropped(report: &FrameReport) -> BTreeMap<&'static str, Rect> {
    let examples = report.funnel.entries().iter().filter_map(|e| Some((e.test, e.example?)));
    let candidates = report.candidates.iter().filter_map(|candidate| match candidate.fate {
        Fate::Dropped(test) => Some((test, candidate.detection.rect()?)),
        _ => None,
    });
    // Candidates come last and replace the funnel's example of the same test.
    examples.chain(candidates).filter(|(_, place)| place.area() > 0.0).collect()
}

/// Side of a picture, pixels, and the fraction of it that the region fills.
const SIDE_PX: usize = 144;
const PART: f64 = 0.6;

/// Returns the region of the image, scaled to a fixed size.
fn picture(frame: &Frame, place: &Rect) -> Option<RgbImage> {
    let image = background(&frame.images())?;
    let scale = place.width.max(place.height) / (PART * SIDE_PX as f64);
    let centre = place.centre();
    let half = 0.5 * SIDE_PX as f64;
    Some(RgbImage::from_fn(SIDE_PX, SIDE_PX, |x, y| {
        let dx = x as f64 - half;
        let dy = y as f64 - half;
        let at = [centre.x + scale * dx, centre.y + scale * dy].map(|v| v.floor() as i64);
        let beyond_x = dx.abs() * scale - 0.5 * place.width;
        let beyond_y = dy.abs() * scale - 0.5 * place.height;
        let line = 0.5 * scale;
        let on_frame = beyond_x.abs() < line && dy.abs() * scale <= 0.5 * place.height + line
            || beyond_y.abs() < line && dx.abs() * scale <= 0.5 * place.width + line;
        if on_frame { [255, 220, 0] } else { image.get(at[0], at[1]).unwrap_or([24, 24, 28]) }
    }))
}

/// Collection that keeps a few of many items, spread evenly over all.
pub struct Spread<T> {
    kept: Vec<T>,
    every: u64,
    offered: u64,
}

impl<T> Default for Spread<T> {
    fn default() -> Self {
        Self { kept: Vec::new(), every: 1, offered: 0 }
    }
}

impl<T> Spread<T> {
    /// Adds an item if it is selected.
    pub fn offer(&mut self, make: impl FnOnce() -> Option<T>) {
        let is_due = self.offered.is_multiple_of(self.every);
        self.offered += 1;
        if !is_due {
            return;
        }
        // When it is full, every other item is dropped and the stride doubles, so that the
        // remaining items stay evenly spaced.
        if self.kept.len() == EXAMPLES {
            let mut number = 0;
            self.kept.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.every *= 2;
            // With the doubled stride this item may no longer be due.
            if !(self.offered - 1).is_multiple_of(self.every) {
                return;
            }
        }
        self.kept.extend(make());
    }

    /// Returns the kept items by value.
    pub fn into_kept(self) -> Vec<T> {
        self.kept
    }

    /// Returns the kept items.
    pub fn kept(&self) -> &[T] {
        &self.kept
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn few_are_kept_and_they_are_spread() {
        let mut spread = Spread::default();
        (0..1000).for_each(|i| spread.offer(|| Some(i)));
        let kept = spread.kept();
        assert!((EXAMPLES / 2..=EXAMPLES).contains(&kept.len()), "{kept:?}");
        assert!(kept[0] == 0 && *kept.last().unwrap() > 800, "{kept:?}");
        let steps: BTreeSet<i32> = kept.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert_eq!(steps.len(), 1, "{kept:?}");
    }
}
