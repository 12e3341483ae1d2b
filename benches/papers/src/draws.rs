//! Figures of several draws of a scene, with their intervals over draws.

use statrs::distribution::{ContinuousCDF, StudentsT};
use tagalong_eval::{Scores, Tally, draws_interval, mean_interval};
use tagalong_math::{Gain, mean_and_deviation, paired_gain};
use tagalong_report::Cell;

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
    Cell::estimate(paired(rival, draws).map(|gain| gain.difference), digits)
}

/// Returns the mean difference of draws to those of a rival, with its p-value; `None` without a draw
/// in which both have values.
pub(crate) fn paired(rival: &[Vec<f64>], draws: &[Vec<f64>]) -> Option<Gain> {
    let both = rival.iter().zip(draws).filter(|(a, b)| !a.is_empty() && !b.is_empty());
    let (a, b): (Vec<f64>, Vec<f64>) = both.map(|(a, b)| (mean(a), mean(b))).unzip();
    paired_gain(&a, &b)
}

/// Returns the two-sided p-value of Student's t-test of two samples with the same variance, which
/// takes all values to be independent; `None` for fewer than two values or without spread.
pub(crate) fn unpaired_p(a: &[f64], b: &[f64]) -> Option<f64> {
    let (mean_a, deviation_a) = mean_and_deviation(a)?;
    let (mean_b, deviation_b) = mean_and_deviation(b)?;
    let freedom = (a.len() + b.len()).checked_sub(2).filter(|freedom| *freedom > 0)? as f64;
    let squares = deviation_a.powi(2) * a.len() as f64 + deviation_b.powi(2) * b.len() as f64;
    let error = (squares / freedom * (1.0 / a.len() as f64 + 1.0 / b.len() as f64)).sqrt();
    if error <= 0.0 {
        return None;
    }
    let t = (mean_a - mean_b) / error;
    Some(2.0 * StudentsT::new(0.0, 1.0, freedom).ok()?.sf(t.abs()))
}

/// Returns the p-values of draws against those of a rival: of [`unpaired_p`] over all values, and of
/// the differences of [`paired`] draws. Empty where there is none.
pub(crate) fn p_values(rival: &[Vec<f64>], draws: &[Vec<f64>]) -> [Cell; 2] {
    let unpaired = unpaired_p(&rival.concat(), &draws.concat());
    let paired = paired(rival, draws).map(|gain| gain.p_value);
    [unpaired, paired].map(|p| Cell::number(p.unwrap_or(f64::NAN), 3))
}

/// Returns a score of the tallies of all draws together, with its interval over draws.
pub(crate) fn pooled(draws: &[&Tally], digits: usize, score: fn(&Scores) -> Option<f64>) -> Cell {
    let interval =
        draws_interval(draws.len(), |drawn| score_of(drawn.iter().map(|draw| draws[*draw]), score));
    match interval {
        Some(interval) => Cell::estimate(Some(interval), digits),
        None => Cell::number(score_of(draws.iter().copied(), score), digits),
    }
}

/// Returns a score of tallies taken together; NaN if they have none.
fn score_of<'a>(
    tallies: impl Iterator<Item = &'a Tally>,
    score: fn(&Scores) -> Option<f64>,
) -> f64 {
    score(&Tally::combine(tallies).scores()).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// t = -2.5949 with seven degrees of freedom; p by numerical integration of the density.
    #[test]
    fn the_unpaired_test_is_that_of_student() {
        let p = unpaired_p(&[1.0, 2.0, 3.0, 4.0], &[3.0, 4.0, 6.0, 7.0, 8.0]).unwrap();
        assert!((p - 0.035_687).abs() < 1e-5, "{p}");
        assert_eq!(unpaired_p(&[1.0], &[1.0]), None);
        assert_eq!(unpaired_p(&[1.0, 1.0], &[1.0, 1.0]), None);
    }

    fn eight_rooms(shift: f64) -> Vec<Vec<f64>> {
        (0..8).map(|room| vec![f64::from(room) + shift, f64::from(room) + shift + 1.0]).collect()
    }

    /// The own model is better in each of eight rooms, by as much as the values of a room differ.
    #[test]
    fn p_values_are_of_all_values_and_of_pairs_of_draws() {
        let general = eight_rooms(0.0);
        let own = eight_rooms(-0.5);
        let [unpaired, paired] = p_values(&general, &own).map(|cell| cell.value.unwrap());
        let all = unpaired_p(&general.concat(), &own.concat()).unwrap();
        assert!(
            (unpaired - all).abs() < 1e-12 && unpaired > 0.1,
            "rooms differ by more: {unpaired}"
        );
        assert!((paired - 2.0 / 256.0).abs() < 1e-9, "all signs agree: {paired}");
        assert_eq!(p_values(&[], &[]).map(|cell| cell.value), [None, None]);
    }

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
