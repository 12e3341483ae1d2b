//! Check of the layout of recorded boxes: some detectors write something other than centre and size
//! in pixels, and a probability. The values show it.

use std::sync::{Mutex, PoisonError};

use tagalong_geometry::{Camera, Rect};

use crate::tally::Tally;

/// Minimum number of boxes for this check.
const LEAST_BOXES: u64 = 5;
/// Maximum fraction of the boxes that fit into the image if their layout is wrong.
const FEW: f64 = 0.5;
/// Minimum fraction of the boxes that fit into the image if their layout is right.
const MOST: f64 = 0.9;
/// Fraction of a side of the image by which boxes may extend beyond it.
const MARGIN: f64 = 0.1;
/// Minimum standard deviation of the columns of centres, as a fraction of the image width, from
/// which motion can reveal corners.
const LEAST_MOTION: f64 = 0.02;
/// Fraction of that deviation below which the width follows the column: that of a second corner
/// does so, but a real width does not.
const FOLLOWS: f64 = 0.5;
/// Ratio of width to height from which on a box is wide. Standing people are taller than wide.
const WIDE: f64 = 1.5;

/// Statistics of the boxes of people in images that were read so far.
#[derive(Default)]
pub(super) struct BoxLayout(Mutex<Seen>);

#[derive(Default)]
struct Seen {
    boxes: u64,
    /// Numbers of boxes that fit as they are, with x and y exchanged, and as two corners.
    fit: u64,
    fit_exchanged: u64,
    fit_corners: u64,
    wide: u64,
    /// Column of the rightmost centre, pixels.
    rightmost: f64,
    /// Sums and sums of squares, from which deviations are computed: of the columns of centres, and
    /// of the widths minus those columns, pixels.
    columns: [f64; 2],
    rests: [f64; 2],
    /// Number of boxes whose centre is outside of the image.
    outside: u64,
    /// Columns and rows of the image, and the farthest right and lower edges of the boxes, pixels.
    image: [f64; 2],
    reach: [f64; 2],
    /// Lowest and highest score.
    scores: Option<[f64; 2]>,
}

impl BoxLayout {
    /// Adds a box with its score.
    pub(super) fn take(&self, region: &Rect, score: f64, camera: &Camera) {
        // Images of a mirror are unwrapped, but the boxes may be those of the raw images.
        if camera.is_blind() || camera.panorama().is_some() {
            return;
        }
        let mut seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        seen.take(region, [camera.width as f64, camera.height as f64]);
        let [least, most] = seen.scores.unwrap_or([score; 2]);
        seen.scores = Some([least.min(score), most.max(score)]);
    }

    /// Reports at the end of a log if the boxes have another layout.
    pub(super) fn close(&self, topic: &str, tally: &mut Tally) {
        let seen = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(why) = seen.misplaced() {
            tally.lose("detections_of_other_layout", || format!("{topic}: {why}"));
        } else if let Some(why) = seen.lying() {
            tally.note(format!("{topic}: {why}"));
        }
        if let Some([least, most]) = seen.scores
            && (least < 0.0 || most > 1.0)
        {
            tally.note(format!(
                "{topic}: scores from {least:.2} to {most:.2} are no probabilities: let the \
                 detector write 0 to 1; log-odds need `score = \"log-odds\"` of \
                 recorded-detections"
            ));
        }
    }
}

impl Seen {
    fn take(&mut self, region: &Rect, image: [f64; 2]) {
        let Rect { x, y, width, height } = *region;
        let [across, down] = [x + 0.5 * width, y + 0.5 * height];
        self.boxes += 1;
        self.image = image;
        self.reach = [self.reach[0].max(x + width), self.reach[1].max(y + height)];
        let is_inside = (0.0..image[0]).contains(&across) && (0.0..image[1]).contains(&down);
        self.outside += u64::from(!is_inside);
        self.rightmost = self.rightmost.max(across);
        let rest = width - across;
        self.columns = [self.columns[0] + across, self.columns[1] + across * across];
        self.rests = [self.rests[0] + rest, self.rests[1] + rest * rest];
        self.wide += u64::from(width > WIDE * height);
        self.fit += u64::from(fits(region, image));
        self.fit_exchanged += u64::from(fits(&Rect::new(y, x, height, width), image));
        // Interprets centre and size as the first and the second corner.
        let corners = Rect::new(across, down, width - across, height - down);
        let has_size = corners.width > 0.0 && corners.height > 0.0;
        self.fit_corners += u64::from(has_size && fits(&corners, image));
    }

    fn are_most(&self, count: u64) -> bool {
        count as f64 >= MOST * self.boxes as f64
    }

    /// Returns the standard deviation from these sums.
    fn deviation(&self, [sum, squares]: [f64; 2]) -> f64 {
        let mean = sum / self.boxes as f64;
        (squares / self.boxes as f64 - mean * mean).max(0.0).sqrt()
    }

    /// Returns true if the widths change with the columns of the centres, as a second corner
    /// changes with the first one.
    fn widths_follow(&self) -> bool {
        let moved = self.deviation(self.columns);
        moved > LEAST_MOTION * self.image[0] && self.deviation(self.rests) < FOLLOWS * moved
    }

    /// Returns the reason why most boxes extend beyond the image, with the remedy.
    fn misplaced(&self) -> Option<String> {
        if self.boxes < LEAST_BOXES || self.fit as f64 >= FEW * self.boxes as f64 {
            return None;
        }
        let [columns, rows] = self.image;
        let all = self.boxes;
        let out = format!(
            "{} of the {all} boxes of people stick out of the {columns}x{rows} images",
            all - self.fit
        );
        // Boxes of near people at the left border are also inside if taken as corners, but they do
        // not get wider the farther to the right they are.
        let is_corner = self.rightmost > 0.5 * columns || self.widths_follow();
        if self.are_most(self.fit_corners) && is_corner {
            return Some(format!(
                "{out}, and {} are inside if their middle and size are two corners: let the detector \
                 write the middle and the size",
                self.fit_corners
            ));
        }
        // Boxes of near people extend beyond the image, but their centre is inside.
        let are_beyond = self.outside as f64 >= FEW * all as f64;
        if are_beyond && self.are_most(self.fit_exchanged) {
            return Some(format!(
                "{out}, and {} are inside with x and y exchanged: let the detector write x before y",
                self.fit_exchanged
            ));
        }
        self.are_most(self.outside).then(|| {
            format!(
                "{out}, as far as to x = {:.0} and y = {:.0}: let the detector write pixels of these \
                 images, and not of its own input",
                self.reach[0], self.reach[1]
            )
        })
    }

    /// Returns a message about boxes that are wide, and would also fit with x and y exchanged.
    fn lying(&self) -> Option<String> {
        let is_likely = self.boxes >= LEAST_BOXES
            && self.are_most(self.wide)
            && self.are_most(self.fit_exchanged);
        is_likely.then(|| {
            format!(
                "{} of the {} boxes of people are wider than high by more than a half: if people \
                 stand, the detector writes y before x",
                self.wide, self.boxes
            )
        })
    }
}

/// Returns true for a box inside the image, or slightly beyond it.
fn fits(region: &Rect, [columns, rows]: [f64; 2]) -> bool {
    let [aside, above] = [MARGIN * columns, MARGIN * rows];
    region.x >= -aside
        && region.y >= -above
        && region.x + region.width <= columns + aside
        && region.y + region.height <= rows + above
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns what is told of boxes with these middles and sizes in images of 640x480 pixels.
    fn told(boxes: &[[f64; 4]]) -> (Option<String>, Option<String>) {
        let mut seen = Seen::default();
        for [x, y, width, height] in boxes {
            let region = Rect::new(x - 0.5 * width, y - 0.5 * height, *width, *height);
            seen.take(&region, [640.0, 480.0]);
        }
        (seen.misplaced(), seen.lying())
    }

    /// Returns people walking through the image: middle and size of each box.
    fn people() -> Vec<[f64; 4]> {
        (0..10).map(|step| [100.0 + 45.0 * f64::from(step), 250.0, 90.0, 300.0]).collect()
    }

    #[test]
    fn middles_and_sizes_in_pixels_are_right() {
        assert_eq!(told(&people()), (None, None));
        // Near people, of whom the image shows a part.
        let near: Vec<[f64; 4]> =
            people().iter().map(|[x, ..]| [*x, 300.0, 250.0, 700.0]).collect();
        assert_eq!(told(&near), (None, None));
        // One walking away at the left: farther away the box is narrower, and nearer to the middle.
        let leaves: Vec<[f64; 4]> = (0..10)
            .map(|step| {
                let part = 1.0 / (1.0 + 0.1 * f64::from(step));
                [320.0 - 200.0 * part, 240.0, 290.0 * part, 700.0 * part]
            })
            .collect();
        assert_eq!(told(&leaves), (None, None));
        for stands in [[320.0, 343.0, 147.0, 500.0], [150.0, 300.0, 250.0, 520.0]] {
            assert_eq!(told(&[stands; 10]), (None, None), "{stands:?}");
        }
    }

    #[test]
    fn other_layouts_are_told_by_the_values() {
        let exchanged: Vec<[f64; 4]> =
            people().iter().map(|[x, y, w, h]| [*y, *x, *h, *w]).collect();
        let (_, lying) = told(&exchanged[..8]);
        assert!(lying.unwrap().contains("8 of the 8 boxes of people are wider than high"));
        let right: Vec<[f64; 4]> =
            (0..10).map(|step| [250.0, 500.0 + 12.0 * f64::from(step), 300.0, 90.0]).collect();
        assert_eq!(told(&right[..4]), (None, None), "too few to tell");
        let (misplaced, _) = told(&right);
        assert!(misplaced.unwrap().contains("with x and y exchanged"), "{right:?}");
        let corners: Vec<[f64; 4]> = people()
            .iter()
            .map(|[x, y, w, h]| [x - 0.5 * w, y - 0.5 * h, x + 0.5 * w, y + 0.5 * h])
            .collect();
        let (misplaced, _) = told(&corners);
        assert!(misplaced.unwrap().contains("are two corners"), "{corners:?}");
        // People staying at the left.
        let at_left: Vec<[f64; 4]> = (0..10)
            .map(|step| {
                let left = 20.0 + 12.0 * f64::from(step);
                [left, 100.0, left + 90.0 + f64::from(step % 3), 400.0]
            })
            .collect();
        let (misplaced, _) = told(&at_left);
        assert!(misplaced.unwrap().contains("are two corners"), "{at_left:?}");
        let larger: Vec<[f64; 4]> = people().iter().map(|all| all.map(|side| 3.0 * side)).collect();
        let (misplaced, _) = told(&larger);
        assert!(misplaced.unwrap().contains("pixels of these images"), "{larger:?}");
    }
}
