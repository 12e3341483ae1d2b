use std::sync::Arc;

use tagalong_core::{Frame, Result};
use tagalong_depth_template::{FrameComparison, Match, SilhouetteComparison, Template, background};
use tagalong_vision::RowSums;

use super::scene_likelihood::Metres;

/// P4's comparison of silhouettes with an image.
#[derive(Clone, Copy, Debug)]
pub struct PrintedComparison {
    /// Background of the frame as a percentile of its depths.
    pub background_percentile: f64,
    /// Fraction of the person's pixels that must have a reading.
    pub min_foreground_valid: f64,
}

impl SilhouetteComparison for PrintedComparison {
    fn prepare(&self, frame: &Frame) -> Result<Box<dyn FrameComparison>> {
        let inverse = background(frame.depth()?, self.background_percentile);
        Ok(Box::new(Dissimilarity {
            metres: frame.derived()?,
            background_m: RowSums::UNITS / inverse,
            min_foreground_valid: self.min_foreground_valid,
        }))
    }
}

/// P4's dissimilarity in one frame: the plain sum of squared differences between the depths of a
/// binary template and those of the image, over the whole window, m².
#[derive(Clone, Debug)]
pub struct Dissimilarity {
    /// The depths of the frame.
    pub metres: Arc<Metres>,
    /// The one depth of all that is not the person, m.
    pub background_m: f64,
    /// Fraction of the person's pixels that must have a reading.
    pub min_foreground_valid: f64,
}

impl FrameComparison for Dissimilarity {
    /// Compares `template` with its head centre on the reduced pixel (`x`, `y`) and the
    /// foreground at `depth_m`. Where there is no reading, of which the papers say
    /// nothing, the mean of the other pixels stands. `None` if too little of the person
    /// has one.
    fn fit(&self, template: &Template, (x, y): (i64, i64), depth_m: f64) -> Option<Match> {
        let mut read = 0.0;
        let mut person = 0.0;
        let mut person_read = 0.0;
        let mut sum = 0.0;
        for row in &template.rows {
            // The outline lies in the middle of the guard.
            let from = (row.from + row.guard_from) / 2;
            let to = (row.to + row.guard_to) / 2;
            person += (to - from) as f64;
            let line = y + row.dy;
            let ends = [-template.half_width, from, to, template.half_width + 1];
            let ends = ends.map(|end| x + end);
            let depths = [self.background_m, depth_m, self.background_m];
            for (k, expected_m) in depths.into_iter().enumerate() {
                let run = self.metres.run(line, (ends[k], ends[k + 1]));
                sum += run.squared_error(expected_m).max(0.0);
                read += run.count;
                person_read += if k == 1 { run.count } else { 0.0 };
            }
        }
        let foreground_valid = person_read / f64::max(person, 1.0);
        let is_seen = foreground_valid >= self.min_foreground_valid && read > 0.0;
        is_seen.then(|| Match { cost: sum / read * window(template), foreground_valid })
    }
}

/// Pixels of the window, those of rows that are left out included.
fn window(template: &Template) -> f64 {
    let [first, last] =
        [template.rows.first(), template.rows.last()].map(|row| row.map_or(0, |row| row.dy));
    ((last - first + 1) * (2 * template.half_width + 1)) as f64
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tagalong_core::DepthImage;
    use tagalong_depth_template::{Bank, Direction, Pose};

    use super::*;

    const BACKGROUND_M: f64 = 7.0;

    fn dissimilarity(rows: &RowSums) -> Dissimilarity {
        let metres = Arc::new(Metres::new(rows));
        Dissimilarity { metres, background_m: BACKGROUND_M, min_foreground_valid: 0.2 }
    }

    /// The sum over every pixel of the window.
    fn slow(rows: &RowSums, t: &Template, (x, y): (i64, i64), z: f64) -> (f64, f64) {
        let mut sum = 0.0;
        let mut read = 0.0;
        for row in &t.rows {
            let person = (row.from + row.guard_from) / 2..(row.to + row.guard_to) / 2;
            for dx in -t.half_width..=t.half_width {
                let Some(seen) = rows.depth_m(x + dx, y + row.dy) else { continue };
                let expected = if person.contains(&dx) { z } else { BACKGROUND_M };
                sum += (seen - expected).powi(2);
                read += 1.0;
            }
        }
        (sum, read)
    }

    proptest! {
        #[test]
        fn runs_equal_pixels(
            pixels in prop::collection::vec(prop_oneof![Just(f32::NAN), 1.5f32..2.5, 3.0f32..9.0], 48 * 40),
            x in -4i64..52, y in -4i64..44, z in 1.5f64..4.0, which in 0usize..3,
        ) {
            let rows = RowSums::new(&DepthImage::from_pixels(48, 40, pixels).unwrap(), 1);
            let mut bank = Bank::new(100);
            let template = bank.template(Pose::nearest(Direction::ALL[which], 0.0, 0.0, 40.0));
            let fast = dissimilarity(&rows).fit(template, (x, y), z);
            let (sum, read) = slow(&rows, template, (x, y), z);
            let pixels = (template.rows.len() as i64 * (2 * template.half_width + 1)) as f64;
            if let Some(fast) = fast {
                prop_assert!((fast.cost - sum * pixels / read).abs() < 1e-6, "{} {}", fast.cost, sum);
            }
        }
    }

    /// Returns the cost of a person that fits, 2 m in front of a wall.
    fn cost_at(z: f64, max_rows: usize) -> f64 {
        let pose = Pose::nearest(Direction::Along, 0.0, 0.0, 250.0 / z);
        let shape = Bank::new(10_000).template(pose).clone();
        let depth = DepthImage::from_fn(220, 220, |x, y| {
            let row = shape.rows.iter().find(|r| r.dy == y as i64 - 100);
            let dx = x as i64 - 110;
            let is_person = row.is_some_and(|row| {
                ((row.from + row.guard_from) / 2..(row.to + row.guard_to) / 2).contains(&dx)
            });
            if is_person { z as f32 } else { z as f32 + 2.0 }
        });
        let rows = RowSums::new(&depth, 1);
        let mut bank = Bank::new(max_rows);
        let found = dissimilarity(&rows).fit(bank.template(pose), (110, 100), z);
        found.unwrap().cost
    }

    #[test]
    fn a_wall_between_the_person_and_the_one_background_costs_and_the_sum_shrinks_with_range() {
        // 3 m between the wall and the background, 1 m farther away; the window has a
        // quarter of the pixels.
        let near = cost_at(2.0, 1000);
        let far = cost_at(4.0, 1000);
        let ratio = near / far;
        assert!((ratio / (4.0 * 9.0) - 1.0).abs() < 0.2, "{near} {far}: {ratio}");
    }

    #[test]
    fn thinned_rows_stand_for_all_of_them() {
        let all = cost_at(2.0, 1000);
        let some = cost_at(2.0, 20);
        assert!((some / all - 1.0).abs() < 0.05, "{all} {some}");
    }
}
