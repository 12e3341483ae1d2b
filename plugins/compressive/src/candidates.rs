//! Boxes that a search compares, and example boxes beside a person.

use tagalong_geometry::Rect;

/// A box in whole pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Pixels {
    pub(crate) x: i64,
    pub(crate) y: i64,
    pub(crate) width: usize,
    pub(crate) height: usize,
}

impl Pixels {
    pub(crate) fn rect(self) -> Rect {
        Rect::new(self.x as f64, self.y as f64, self.width as f64, self.height as f64)
    }
}

/// Returns the offsets in a disc, row by row, every `step` pixels.
pub(crate) fn disc(radius: f64, step: i64) -> impl Iterator<Item = (i64, i64)> {
    let step = step.max(1);
    let reach = (radius.max(0.0) as i64 / step).min(200);
    (-reach..=reach)
        .flat_map(move |i| (-reach..=reach).map(move |j| (j * step, i * step)))
        .filter(move |(x, y)| ((x * x + y * y) as f64) <= radius * radius)
}

/// Returns `count` offsets spread evenly over a ring: a spiral in steps of the golden angle.
pub(crate) fn ring(from: f64, to: f64, count: usize) -> impl Iterator<Item = (i64, i64)> {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    (0..count).map(move |i| {
        let part = (i as f64 + 0.5) / count as f64;
        let radius = (from * from + part * (to * to - from * from)).sqrt();
        let (sin, cos) = (GOLDEN_ANGLE * i as f64).sin_cos();
        ((radius * cos).round() as i64, (radius * sin).round() as i64)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disc_is_every_place_within_the_radius_on_its_grid() {
        for (radius, step) in [(2.0, 1), (5.0, 2), (7.3, 3), (0.5, 1), (3.0, 0), (-1.0, 1)] {
            let apart = step.max(1);
            let mut expected = Vec::new();
            for y in (-20..=20_i64).filter(|y| y % apart == 0) {
                for x in (-20..=20_i64).filter(|x| x % apart == 0) {
                    if ((x * x + y * y) as f64) <= f64::max(radius, 0.0).powi(2) {
                        expected.push((x, y));
                    }
                }
            }
            let found: Vec<_> = disc(radius, step).collect();
            assert_eq!(found, expected, "radius {radius}, step {step}");
        }
    }

    #[test]
    fn a_ring_is_filled_evenly() {
        fn radius((x, y): &(f64, f64)) -> f64 {
            x.hypot(*y)
        }

        let from = 40.0;
        let to = 100.0;
        let count = 400;
        let all: Vec<(f64, f64)> =
            ring(from, to, count).map(|(x, y)| (x as f64, y as f64)).collect();
        assert_eq!(all.len(), count);
        assert!(all.iter().all(|at| (from - 1.0..to + 1.0).contains(&radius(at))));
        // Half of the area lies within the root of the mean square of the two radii.
        let half = (0.5 * (from * from + to * to)).sqrt();
        let within = all.iter().filter(|at| radius(at) < half).count();
        assert!((180..220).contains(&within), "{within} of {count}");
        for (right, below) in [(true, true), (true, false), (false, true), (false, false)] {
            let quarter = all.iter().filter(|(x, y)| (*x > 0.0) == right && (*y > 0.0) == below);
            let quarter = quarter.count();
            assert!((85..115).contains(&quarter), "{quarter} of {count}");
        }
    }

    /// Offsets so large that whole pixels hardly matter.
    #[test]
    fn a_ring_turns_by_the_golden_angle_from_its_inner_to_its_outer_radius() {
        // The first and last have half a step to the edges: a 120th of the area.
        fn at(part: f64) -> f64 {
            1e5 * (1.0 + part * 3.0).sqrt()
        }

        let all: Vec<(f64, f64)> = ring(1e5, 2e5, 60).map(|(x, y)| (x as f64, y as f64)).collect();
        let radii: Vec<f64> = all.iter().map(|(x, y)| x.hypot(*y)).collect();
        assert!(radii.is_sorted());
        assert!((radii[0] - at(0.5 / 60.0)).abs() < 1.0, "{}", radii[0]);
        assert!((radii[59] - at(59.5 / 60.0)).abs() < 1.0, "{}", radii[59]);
        // (3 - sqrt 5) half turns.
        let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        for (index, (x, y)) in all.iter().enumerate() {
            let turned = golden * index as f64 - y.atan2(*x);
            let off = (turned / std::f64::consts::TAU).fract();
            assert!(off.abs().min(1.0 - off.abs()) < 1e-4, "{index}: {off}");
        }
    }

    #[test]
    fn pixels_are_a_box() {
        let pixels = Pixels { x: -3, y: 7, width: 11, height: 13 };
        assert_eq!(pixels.rect(), Rect::new(-3.0, 7.0, 11.0, 13.0));
    }
}
