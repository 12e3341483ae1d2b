/// Returns the mean; `None` without values.
///
/// ```
/// assert_eq!(tagalong_math::mean(&[1.0, 3.0]), Some(2.0));
/// ```
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Returns the mean and the population standard deviation (divided by the number of values, not by
/// one less); `None` without values.
pub fn mean_and_deviation(values: &[f64]) -> Option<(f64, f64)> {
    let mean = mean(values)?;
    let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
    Some((mean, (squares / values.len() as f64).sqrt()))
}

/// Returns the median. For an even number of values it is the upper of the middle two, so that it
/// is always one of the values; `None` without values.
///
/// ```
/// assert_eq!(tagalong_math::median([4.0, 1.0, 3.0, 2.0]), Some(3.0));
/// ```
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    let middle = values.len() / 2;
    let any = !values.is_empty();
    any.then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Returns the value below which a fraction of the values lies, interpolated between neighbours (as
/// numpy does by default); `None` without values.
pub fn percentile(values: &[f64], fraction: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = fraction.clamp(0.0, 1.0) * last as f64;
    let below = at.floor() as usize;
    let above = (below + 1).min(last);
    Some(sorted[below] + (at - below as f64) * (sorted[above] - sorted[below]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summaries_of_known_values() {
        let values = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0];
        assert_eq!(mean_and_deviation(&values), Some((5.0, 2.0)));
        assert_eq!((mean(&[]), mean_and_deviation(&[]), median([])), (None, None, None));
        assert_eq!(median([3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(values), Some(5.0), "the upper of the middle two");
    }

    #[test]
    fn percentiles_interpolate() {
        assert_eq!(percentile(&[3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(percentile(&[0.0, 10.0], 0.95), Some(9.5));
        assert_eq!(percentile(&[], 0.5), None);
    }
}
