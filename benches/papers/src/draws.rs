//! Figures of several draws of a scene, with their intervals over draws.

use tagalong_eval::{Scores, Tally, draws_interval, mean_interval, paired_gain};

use crate::Cell;

/// Returns the mean; 0 of no values.
pub(crate) fn mean(values: &[f64]) -> f64 {
    tagalong_math::mean(values).unwrap_or(0.0)
}

/// Returns the means of the draws that have any values.
pub(crate) fn means<'a>(draws: impl IntoIterator<Item = &'a Vec<f64>>) -> Vec<f64> {
    draws.into_iter().filter(|values| !values.is_empty()).map(|values| mean(values)).collect()
}

/// Returns the mean of the means of draws, its interval over draws, and the deviation of all
/// values.
pub(crate) fn over_draws(draws: &[Vec<f64>], digits: usize) -> Cell {
    let all = Cell::mean(&draws.concat(), digits);
    // Values of one draw depend on each other, so the interval is that of the means of draws.
    let means = means(draws);
    match mean_interval(&means) {
        Some(interval) => {
            Cell { deviation: all.deviation, ..Cell::estimate(Some(interval), digits) }
        }
        None => Cell { value: all.value.map(|_| mean(&means)), ..all },
    }
}

/// Returns the mean difference of draws to those of a rival, with its interval over draws.
pub(crate) fn difference(rival: &[Vec<f64>], draws: &[Vec<f64>], digits: usize) -> Cell {
    let both = rival.iter().zip(draws).filter(|(a, b)| !a.is_empty() && !b.is_empty());
    let (a, b): (Vec<f64>, Vec<f64>) = both.map(|(a, b)| (mean(a), mean(b))).unzip();
    let gain = paired_gain(&a, &b);
    Cell::estimate(gain.map(|gain| gain.difference), digits)
}

/// Returns a score of the tallies of all draws together, with its interval over draws.
pub(crate) fn pooled(draws: &[&Tally], digits: usize, score: fn(&Scores) -> Option<f64>) -> Cell {
    let figure = |drawn: &[usize]| {
        score(&Tally::combine(drawn.iter().map(|draw| draws[*draw])).scores()).unwrap_or(f64::NAN)
    };
    match draws_interval(draws.len(), figure) {
        Some(interval) => Cell::estimate(Some(interval), digits),
        None => Cell::number(figure(&(0..draws.len()).collect::<Vec<_>>()), digits),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_count_alike_however_long_they_are() {
        let cell = over_draws(&[vec![1.0; 9], vec![3.0], vec![]], 3);
        assert_eq!(cell.value, Some(2.0));
        assert!((cell.deviation.unwrap() - 0.6).abs() < 1e-12);
        assert_eq!(over_draws(&[], 3).value, None);
        let cell =
            difference(&[vec![1.0], vec![2.0, 4.0], vec![]], &[vec![2.0], vec![5.0], vec![9.0]], 3);
        assert_eq!(cell.value, Some(1.5));
    }
}
