/// Log-odds as a straight line of the decision value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line {
    /// Log-odds per unit of the decision value.
    pub slope: f64,
    /// Log-odds of the decision value 0.
    pub offset: f64,
}

/// Steps of Newton's method at most.
const STEPS: usize = 100;

/// Platt's logistic calibration with smoothed targets (Platt 1999; Newton's
/// method with halved steps after Lin, Lin and Weng 2007). Each class weighs
/// the same, so the line gives the evidence without the prior. The values have
/// to come from data that the machine was not fitted to.
pub fn platt(values: &[(f64, bool)]) -> Line {
    let people = values.iter().filter(|(_, is_person)| *is_person).count() as f64;
    let others = values.len() as f64 - people;
    let points: Vec<Point> = values
        .iter()
        .map(|&(value, is_person)| {
            let count = if is_person { people } else { others };
            let sure = (count + 1.0) / (count + 2.0);
            let target = if is_person { sure } else { 1.0 - sure };
            Point { value, target, weight: 0.5 / count.max(1.0) }
        })
        .collect();
    let mut line = Line { slope: 0.0, offset: 0.0 };
    for _ in 0..STEPS {
        let next = improved(line, &points);
        let moved = (next.slope - line.slope).abs() + (next.offset - line.offset).abs();
        line = next;
        if moved < 1e-9 {
            break;
        }
    }
    line
}

struct Point {
    value: f64,
    target: f64,
    weight: f64,
}

/// One step of Newton's method, halved until the loss falls.
fn improved(line: Line, points: &[Point]) -> Line {
    let (mut g, mut h) = ([0.0; 2], [1e-9, 0.0, 1e-9]);
    for Point { value, target, weight } in points {
        let p = 1.0 / (1.0 + (-(line.slope * value + line.offset)).exp());
        let (first, second) = (weight * (p - target), weight * p * (1.0 - p));
        g = [g[0] + first * value, g[1] + first];
        h = [h[0] + second * value * value, h[1] + second * value, h[2] + second];
    }
    let determinant = h[0] * h[2] - h[1] * h[1];
    let slope = (h[2] * g[0] - h[1] * g[1]) / determinant;
    let offset = (h[0] * g[1] - h[1] * g[0]) / determinant;
    let before = loss(line, points);
    (0..30)
        .map(|halvings| 0.5f64.powi(halvings))
        .map(|t| Line { slope: line.slope - t * slope, offset: line.offset - t * offset })
        .find(|candidate| loss(*candidate, points) < before)
        .unwrap_or(line)
}

/// Cross-entropy, in a form that cannot overflow.
fn loss(line: Line, points: &[Point]) -> f64 {
    let each = points.iter().map(|Point { value, target, weight }| {
        let f = line.slope * value + line.offset;
        weight * (f.max(0.0) - f * target + (-f.abs()).exp().ln_1p())
    });
    each.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_finds_the_log_odds_that_the_values_were_drawn_from() {
        // Of 1,000 at each value, as many are people as 2 f - 1 log-odds say.
        let values: Vec<(f64, bool)> = (-20..=20)
            .flat_map(|k| {
                let f = f64::from(k) / 10.0;
                let people = (1000.0 / (1.0 + (1.0 - 2.0 * f).exp())).round() as usize;
                (0..1000).map(move |n| (f, n < people))
            })
            .collect();
        let line = platt(&values);
        let people = values.iter().filter(|v| v.1).count() as f64;
        let prior = (people / (values.len() as f64 - people)).ln();
        assert!((line.slope - 2.0).abs() < 0.02, "{line:?}");
        assert!((line.offset - (-1.0 - prior)).abs() < 0.05, "{line:?}");
    }

    #[test]
    fn separable_values_do_not_give_certainty() {
        let values: Vec<(f64, bool)> =
            (0..50).map(|k| (if k % 2 == 0 { 1.0 } else { -1.0 }, k % 2 == 0)).collect();
        let line = platt(&values);
        assert!(line.slope.is_finite() && line.slope > 1.0 && line.slope < 5.0, "{line:?}");
    }

    #[test]
    fn values_that_say_nothing_give_no_evidence() {
        let values: Vec<(f64, bool)> = (0..60).map(|k| (0.3, k % 3 == 0)).collect();
        let line = platt(&values);
        assert!((line.slope * 0.3 + line.offset).abs() < 0.05, "{line:?}");
    }
}
