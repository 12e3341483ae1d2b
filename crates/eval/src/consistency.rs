use serde::{Deserialize, Serialize};
use statrs::function::gamma::checked_gamma_lr;

/// Consistency of a filter: whether its covariance agrees with its errors.
///
/// The squares of innovations (NIS) or errors (NEES), normalised by their covariance, follow a
/// chi-square distribution with as many degrees of freedom as they have components, if the filter
/// is consistent (Bar-Shalom, Li and Kirubarajan, 2001, section 5.4). With a mean above the bounds
/// the filter is overconfident, with one below them it is too cautious.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Consistency {
    /// Mean of the values.
    pub mean: f64,
    /// Expected mean: the degrees of freedom of a single value.
    pub expected: f64,
    /// Lower bound of the mean.
    pub lower: f64,
    /// Upper bound of the mean.
    pub upper: f64,
    /// Fraction of the single values below their own upper quantile.
    pub inside: f64,
    /// Number of values.
    pub count: u64,
}

impl Consistency {
    /// Summarises NIS or NEES values with `freedom` degrees of freedom each. The bounds have this
    /// confidence level (between 0 and 1), and assume that the values are independent. `None`
    /// without values or degrees of freedom.
    pub fn of(values: &[f64], freedom: u32, confidence: f64) -> Option<Self> {
        if values.is_empty() || freedom == 0 {
            return None;
        }
        let count = values.len() as f64;
        let single = f64::from(freedom);
        let tail = 0.5 * (1.0 - confidence);
        let limit = chi_square_quantile(confidence, single)?;
        Some(Self {
            mean: tagalong_math::mean(values)?,
            expected: single,
            lower: chi_square_quantile(tail, single * count)? / count,
            upper: chi_square_quantile(1.0 - tail, single * count)? / count,
            inside: values.iter().filter(|&&v| v <= limit).count() as f64 / count,
            count: values.len() as u64,
        })
    }
}

/// Returns the quantile of a chi-square distribution; `None` unless the probability lies within 0
/// and 1 and the degrees of freedom are positive.
///
/// ```
/// let bound = tagalong_eval::chi_square_quantile(0.95, 2.0).unwrap();
/// assert!((bound - 5.991_464_547).abs() < 1e-8);
/// ```
pub fn chi_square_quantile(probability: f64, freedom: f64) -> Option<f64> {
    let sensible = (0.0..1.0).contains(&probability) && freedom > 0.0 && freedom.is_finite();
    if !sensible {
        return None;
    }
    let mut high = freedom + 10.0;
    while chi_square_below(high, freedom) < probability {
        high *= 2.0;
    }
    Some(bisect(0.0, high, |x| chi_square_below(x, freedom) < probability))
}

/// Returns the probability that a chi-square variable lies below a value.
fn chi_square_below(x: f64, freedom: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    checked_gamma_lr(0.5 * freedom, 0.5 * x).unwrap_or(1.0)
}

/// Returns the point between the bounds where `too_low` turns from true to false.
fn bisect(mut low: f64, mut high: f64, too_low: impl Fn(f64) -> bool) -> f64 {
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return middle;
        }
        if too_low(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_equal_the_tables() {
        for (p, freedom, value) in [
            (0.95, 1.0, 3.841_458_820_694_124),
            (0.025, 3.0, 0.215_795_282_623_898),
            (0.975, 100.0, 129.561_197_186_583_66),
            (0.99, 2.0, 9.210_340_371_976_18),
        ] {
            let got = chi_square_quantile(p, freedom).unwrap();
            assert!((got - value).abs() < 1e-8 * value, "{p} {freedom}: {got}");
        }
        assert_eq!(chi_square_quantile(1.0, 2.0), None);
        assert_eq!(chi_square_quantile(0.5, 0.0), None);
    }

    #[test]
    fn an_honest_a_too_sure_and_a_too_timid_filter() {
        // Evenly spaced quantiles of two degrees of freedom: -2 ln(1 - u).
        let honest: Vec<f64> =
            (0..500).map(|i| -2.0 * (1.0 - (f64::from(i) + 0.5) / 500.0).ln()).collect();
        let [timid, honest, sure] = [0.5, 1.0, 1.5].map(|scale| {
            let values: Vec<f64> = honest.iter().map(|value| value * scale).collect();
            Consistency::of(&values, 2, 0.95).unwrap()
        });
        assert!(honest.lower <= honest.mean && honest.mean <= honest.upper, "{honest:?}");
        assert!((honest.inside - 0.95).abs() < 0.01);
        assert!(sure.mean > sure.upper);
        assert!(timid.mean < timid.lower);
        assert_eq!(Consistency::of(&[], 2, 0.95), None);
        assert_eq!(Consistency::of(&[1.0], 0, 0.95), None);
    }

    #[test]
    fn bounds_are_those_of_the_sum_of_all_values() {
        let of = Consistency::of(&[1.0, 2.0, 6.0], 1, 0.95).unwrap();
        assert_eq!((of.mean, of.expected, of.count), (3.0, 1.0, 3));
        // Three degrees of freedom at 2.5 and 97.5 %.
        assert!((of.lower - 0.215_795_282_6 / 3.0).abs() < 1e-9, "{of:?}");
        assert!((of.upper - 9.348_403_604 / 3.0).abs() < 1e-8, "{of:?}");
        assert!((of.inside - 2.0 / 3.0).abs() < 1e-12, "{of:?}");
    }
}
