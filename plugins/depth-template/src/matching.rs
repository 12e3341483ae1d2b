use tagalong_vision::RowSums;

use crate::bank::Template;
use crate::config::{Cost, DepthTemplateConfig};

/// Fit of a silhouette at one place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// Dissimilarity; 0 is perfect. The scale depends on [`Cost`].
    pub cost: f64,
    /// Fraction of the person's pixels that have a reading.
    pub foreground_valid: f64,
}

/// Matches templates against [`RowSums`], a few operations per row.
#[derive(Clone, Debug)]
pub struct Matcher {
    config: DepthTemplateConfig,
    /// The background value that the papers use: the percentile of the frame.
    background: f64,
    /// True if no row makes the cost of those above it less.
    rises: bool,
}

/// Sums that one template collects over its rows.
#[derive(Default)]
struct Tally {
    foreground_valid: f64,
    foreground_cost: f64,
    background_valid: f64,
    background_cost: f64,
    unknown: f64,
    outside: f64,
}

/// Rows from one look at the cost so far to the next: each has divisions of its own.
const ROWS_PER_LOOK: usize = 4;

/// A run of pixels of a row, inside the image.
type Run = (usize, usize, usize);

/// Thresholds of all rows that follow from the depth of a face. Inverse depths are in
/// [`RowSums::UNITS`].
struct Face {
    depth_m: f64,
    inverse: f64,
    /// Value from which on a pixel beside the person is nearer than the person.
    nearest_beside: f64,
    /// Background that is farther than this is as good as background can be.
    clearly_behind: f64,
    /// Depth errors of the person that cost nothing and everything, m.
    free_m: f64,
    full_m: f64,
}

impl Face {
    fn new(config: &DepthTemplateConfig, depth_m: f64) -> Self {
        let margin_m = config.boundary_margin_m;
        let noise_m = config.relief_per_m2 * depth_m * depth_m;
        Self {
            depth_m,
            inverse: RowSums::UNITS / depth_m,
            nearest_beside: RowSums::UNITS / (depth_m - margin_m).max(0.2),
            clearly_behind: RowSums::UNITS / (depth_m + margin_m),
            free_m: config.relief_free_m + noise_m,
            full_m: config.relief_full_m + noise_m,
        }
    }
}

impl Matcher {
    /// A matcher for one frame; `background` is the percentile of its inverse
    /// depths, in [`RowSums::UNITS`].
    pub fn new(config: &DepthTemplateConfig, background: f64) -> Self {
        let rises = config.cost == Cost::Robust
            && (0.0..=1.0).contains(&config.foreground_weight)
            && config.unknown_cost >= 0.0;
        Self { config: config.clone(), background, rises }
    }

    /// Fits `template` with its head centre on the reduced pixel (`x`, `y`) and
    /// the face at `depth_m`. `None` if too little of the person has a reading.
    pub fn fit(
        &self,
        rows: &RowSums,
        template: &Template,
        x: i64,
        y: i64,
        depth_m: f64,
    ) -> Option<Match> {
        self.fit_up_to(f64::INFINITY, rows, template, (x, y), depth_m)
    }

    /// As [`Matcher::fit`]; `None` also where the rows down to some one already cost more than
    /// `most`: most places without a person cost too much within a few rows.
    pub fn fit_up_to(
        &self,
        most: f64,
        rows: &RowSums,
        template: &Template,
        (x, y): (i64, i64),
        depth_m: f64,
    ) -> Option<Match> {
        let mut tally = Tally::default();
        let face = Face::new(&self.config, depth_m);
        let width = rows.width() as i64;
        // Every fourth row first: a cost that is too high shows sooner all over the
        // silhouette than from the top of the head down.
        let all = &template.rows;
        let rest =
            (0..ROWS_PER_LOOK).flat_map(|first| all.iter().skip(first).step_by(ROWS_PER_LOOK));
        for (i, row) in rest.enumerate() {
            let window = (x - template.half_width, x + template.half_width + 1);
            let sides = [(window.0, x + row.guard_from), (x + row.guard_to, window.1)];
            let wanted = sides.map(|(from, to)| (to - from).max(0) as f64);
            let Some(line) = usize::try_from(y + row.dy).ok().filter(|l| *l < rows.height()) else {
                tally.outside += wanted[0] + wanted[1];
                continue;
            };
            let [first, end] =
                [x + row.from, x + row.to].map(|column| column.clamp(0, width) as usize);
            self.foreground(&mut tally, rows, (line, first, end), &face, row.relief_m);
            for ((from, to), wanted) in sides.into_iter().zip(wanted) {
                let [first, end] = [from, to].map(|column| column.clamp(0, width) as usize);
                let run = (line, first, end.max(first));
                tally.outside += wanted - (run.2 - run.1) as f64;
                self.background(&mut tally, rows, run, &face);
            }
            let is_asked = self.rises && i % ROWS_PER_LOOK == 0;
            if is_asked && self.robust_cost(&tally, template, 0.0) > most {
                return None;
            }
        }
        self.judge(&tally, template)
    }

    fn foreground(&self, tally: &mut Tally, rows: &RowSums, run: Run, face: &Face, relief_m: f64) {
        let sums = rows.run(run.0, run.1, run.2);
        if sums.count == 0 {
            return;
        }
        let count = f64::from(sums.count);
        tally.foreground_valid += count;
        let relief_m = if self.config.cost == Cost::Robust { relief_m } else { 0.0 };
        let expected_m = (face.depth_m + relief_m).max(0.1);
        let expected = RowSums::UNITS / expected_m;
        let error = sums.squared_error(expected);
        tally.foreground_cost += match self.config.cost {
            Cost::Robust => {
                let [free, full] = [face.free_m, face.full_m]
                    .map(|m| (RowSums::UNITS / (expected_m - m).max(0.1) - expected).powi(2));
                count * ((error / count - free) / (full - free)).clamp(0.0, 1.0)
            }
            Cost::Squared => error,
        };
    }

    fn background(&self, tally: &mut Tally, rows: &RowSums, run: Run, face: &Face) {
        let sums = rows.run(run.0, run.1, run.2);
        let count = f64::from(sums.count);
        tally.unknown += (run.2 - run.1) as f64 - count;
        if sums.count == 0 {
            return;
        }
        if self.config.cost != Cost::Robust {
            tally.background_valid += count;
            let limit = RowSums::UNITS / (face.depth_m + 1.0);
            tally.background_cost += sums.squared_error(self.background.min(limit));
            return;
        }
        let mean = sums.mean();
        if mean > face.nearest_beside {
            tally.unknown += count;
            return;
        }
        let expected = mean.min(face.clearly_behind);
        let contrast = face.inverse - expected;
        let error = sums.squared_error(expected) / (contrast * contrast);
        tally.background_valid += count;
        tally.background_cost += error.min(count);
    }

    fn judge(&self, tally: &Tally, template: &Template) -> Option<Match> {
        let foreground_valid = tally.foreground_valid / template.person.max(1.0);
        if foreground_valid < self.config.min_foreground_valid {
            return None;
        }
        let valid = tally.foreground_valid + tally.background_valid;
        let sum = tally.foreground_cost + tally.background_cost;
        let cost = match self.config.cost {
            Cost::Robust => {
                let holes = (0.95 * template.person - tally.foreground_valid).max(0.0);
                self.robust_cost(tally, template, holes)
            }
            Cost::Squared => (sum / valid.max(1.0)).sqrt() / RowSums::UNITS,
        };
        Some(Match { cost, foreground_valid })
    }

    /// Returns the part of the person's pixels that have a reading, for a head centre on the reduced pixel
    /// (`x`, `y`).
    pub fn valid_part(&self, rows: &RowSums, template: &Template, (x, y): (i64, i64)) -> f64 {
        let width = rows.width() as i64;
        let mut valid = 0;
        for row in &template.rows {
            let Some(line) = usize::try_from(y + row.dy).ok().filter(|l| *l < rows.height()) else {
                continue;
            };
            let [first, end] =
                [x + row.from, x + row.to].map(|column| column.clamp(0, width) as usize);
            valid += rows.run(line, first, end).count;
        }
        f64::from(valid) / template.person.max(1.0)
    }

    /// Returns the cost of the collected sums; `holes` are pixels of the person without a reading
    /// that are too many.
    fn robust_cost(&self, tally: &Tally, template: &Template, holes: f64) -> f64 {
        let inside = (tally.foreground_cost + 3.0 * holes) / template.person.max(1.0);
        let unknown = self.config.unknown_cost * tally.unknown;
        let beside = tally.background_cost + unknown + tally.outside;
        let weight = self.config.foreground_weight;
        weight * inside + (1.0 - weight) * beside / template.background.max(1.0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tagalong_core::DepthImage;

    use super::*;
    use crate::bank::{Bank, Direction, Pose};

    /// Returns the readings among some pixels.
    fn readings_among(pixels: &[Option<u16>]) -> Vec<f64> {
        pixels.iter().flatten().filter(|value| **value > 0).map(|value| f64::from(*value)).collect()
    }

    /// The robust cost, pixel by pixel, straight from its definition.
    fn slow(
        config: &DepthTemplateConfig,
        rows: &RowSums,
        t: &Template,
        x: i64,
        y: i64,
        z: f64,
    ) -> Option<f64> {
        let units = RowSums::UNITS;
        let mut person = 0.0;
        let mut seen = 0.0;
        let mut bad = 0.0;
        let mut beside = 0.0;
        let mut wrong = 0.0;
        for row in &t.rows {
            let window = x - t.half_width..x + t.half_width + 1;
            let [person_pixels, left, right] = [
                x + row.from..x + row.to,
                i64::MIN..x + row.guard_from,
                x + row.guard_to..i64::MAX,
            ]
            .map(|part| -> Vec<Option<u16>> {
                let columns = window.clone().filter(|u| part.contains(u));
                columns.map(|u| rows.value(u, y + row.dy)).collect()
            });
            let fg = readings_among(&person_pixels);
            person += person_pixels.len() as f64;
            seen += fg.len() as f64;
            let e = units / (z + row.relief_m).max(0.1);
            let noise = config.relief_per_m2 * z * z;
            let [free, full] = [config.relief_free_m, config.relief_full_m]
                .map(|m| (units / (z + row.relief_m - (m + noise)).max(0.1) - e).powi(2));
            let mean_error =
                fg.iter().map(|v| (v - e).powi(2)).sum::<f64>() / fg.len().max(1) as f64;
            bad += fg.len() as f64 * ((mean_error - free) / (full - free)).clamp(0.0, 1.0);
            for side in [left, right] {
                beside += side.len() as f64;
                for pixel in &side {
                    wrong += match pixel {
                        None => 1.0,
                        Some(0) => config.unknown_cost,
                        Some(_) => 0.0,
                    };
                }
                let bg = readings_among(&side);
                if bg.is_empty() {
                    continue;
                }
                let mean = bg.iter().sum::<f64>() / bg.len() as f64;
                if mean > units / (z - config.boundary_margin_m).max(0.2) {
                    wrong += config.unknown_cost * bg.len() as f64;
                    continue;
                }
                let b = mean.min(units / (z + config.boundary_margin_m));
                let contrast = (units / z - b).powi(2);
                let error = bg.iter().map(|v| (v - b).powi(2)).sum::<f64>() / contrast;
                wrong += error.min(bg.len() as f64);
            }
        }
        let inside = (bad + 3.0 * (0.95 * person - seen).max(0.0)) / person.max(1.0);
        let w = config.foreground_weight;
        (seen / person.max(1.0) >= config.min_foreground_valid)
            .then(|| w * inside + (1.0 - w) * wrong / beside.max(1.0))
    }

    proptest! {
        #[test]
        fn runs_equal_pixels(
            pixels in prop::collection::vec(prop_oneof![Just(f32::NAN), 1.5f32..2.5, 3.0f32..6.0], 48 * 40),
            x in -4i64..52, y in -4i64..44, z in 1.5f64..4.0, noise in 0.0f64..0.03, roll in -0.4f64..0.4, which in 0usize..3,
            most in 0.0f64..1.0,
        ) {
            let rows = RowSums::new(&DepthImage::from_pixels(48, 40, pixels).unwrap(), 1);
            let pose = Pose::nearest(Direction::ALL[which], 0.3, roll, 40.0);
            let mut bank = Bank::new(100);
            let template = bank.template(pose);
            let config = DepthTemplateConfig {
                min_foreground_valid: 0.2,
                relief_per_m2: noise,
                ..Default::default()
            };
            let fast = Matcher::new(&config, 300.0).fit(&rows, template, x, y, z).map(|m| m.cost);
            let [at_cost, at_most] = [fast.unwrap_or(most), most].map(|most| {
                let found = Matcher::new(&config, 300.0).fit_up_to(most, &rows, template, (x, y), z);
                found.map(|m| m.cost)
            });
            prop_assert!(fast.is_none() || at_cost == fast);
            prop_assert!(at_most.is_none_or(|cost| Some(cost) == fast));
            prop_assert!(fast.is_none_or(|cost| cost > most || at_most == fast));
            let slow = slow(&config, &rows, template, x, y, z);
            prop_assert_eq!(fast.is_some(), slow.is_some());
            if let (Some(a), Some(b)) = (fast, slow) {
                prop_assert!((a - b).abs() < 1e-9, "{} {}", a, b);
            }
        }
    }

    /// A square scene: a person of the template's shape at `z`, a wall at `wall`.
    fn scene(z: f64, wall: f64, scale: f64) -> RowSums {
        let mut bank = Bank::new(10_000);
        let template = bank.template(Pose::nearest(Direction::Along, 0.0, 0.0, scale)).clone();
        let depth = DepthImage::from_fn(160, 160, |x, y| {
            let row = template.rows.iter().find(|r| r.dy == y as i64 - 70);
            let dx = x as i64 - 80;
            if row.is_some_and(|r| r.from <= dx && dx < r.to) { z as f32 } else { wall as f32 }
        });
        RowSums::new(&depth, 1)
    }

    fn cost_of(cost: Cost, z: f64, wall: f64) -> f64 {
        let scale = 250.0 / z;
        let config = DepthTemplateConfig { cost, ..Default::default() };
        let rows = scene(z, wall, scale);
        let mut bank = Bank::new(1000);
        let template = bank.template(Pose::nearest(Direction::Along, 0.0, 0.0, scale));
        let background = RowSums::UNITS / 8.0;
        Matcher::new(&config, background).fit(&rows, template, 80, 70, z).unwrap().cost
    }

    #[test]
    fn a_nearer_wall_does_not_change_the_robust_cost() {
        let far = cost_of(Cost::Robust, 2.0, 8.0);
        let near = cost_of(Cost::Robust, 2.0, 3.0);
        assert!(far < 0.02 && near < 0.02, "{far} {near}");
        let far = cost_of(Cost::Squared, 2.0, 8.0);
        let near = cost_of(Cost::Squared, 2.0, 3.0);
        assert!(near > 3.0 * far, "one background value for all: {far} {near}");
    }

    #[test]
    fn the_squared_cost_does_not_depend_on_the_range() {
        // The same wall, so the same error in every background pixel.
        fn ratio(cost: Cost) -> f64 {
            cost_of(cost, 4.0, 6.0) / cost_of(cost, 2.0, 6.0)
        }

        assert!((ratio(Cost::Squared) - 1.0).abs() < 0.1, "{}", ratio(Cost::Squared));
    }
}
