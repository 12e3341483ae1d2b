//! Tests whether differences can be due to chance.

use serde::{Deserialize, Serialize};

use crate::intervals::{CONFIDENCE, Interval, mean_interval};
use crate::random::{RandomSource, SplitMix64};

/// Up to this number of differences all sign patterns are counted, ...
const EXACT_UP_TO: usize = 20;
/// ... and beyond it this many random patterns are drawn. One random word has the signs of 64
/// differences.
const PATTERNS: usize = 99_999;
/// Sums that are equal except for rounding count as equal.
const ROUNDING: f64 = 1e-9;

/// Result of a paired comparison.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Gain {
    /// Mean of the differences and its interval.
    pub difference: Interval,
    /// Two-sided probability of a difference at least this large if there were none.
    pub p_value: f64,
}

/// Returns how much better `b` is than `a`, both scored on the same draws: the mean difference with
/// its interval ([`mean_interval`]) and its p-value ([`sign_flip`]). Pairing removes the
/// differences between the draws themselves. `None` if the lists are empty, differ in length or
/// contain NaN.
///
/// ```
/// let gain = tagalong_math::paired_gain(&[0.5, 0.2, 0.7], &[0.6, 0.4, 0.8]).unwrap();
/// assert!((gain.difference.estimate - 0.4 / 3.0).abs() < 1e-12);
/// assert_eq!(gain.p_value, 0.25, "three draws cannot say more");
/// ```
pub fn paired_gain(a: &[f64], b: &[f64]) -> Option<Gain> {
    let differences: Vec<f64> = a.iter().zip(b).map(|(a, b)| b - a).collect();
    let difference = mean_interval(&differences).filter(|_| a.len() == b.len())?;
    Some(Gain { difference, p_value: sign_flip(&differences)? })
}

/// Returns true if a p-value is significant at the confidence level of the intervals. With fewer
/// than six draws it never is: 2 of 2^5 patterns are 6 %. After a correction it takes more
/// ([`draws_needed`]).
pub fn is_significant(p_value: f64) -> bool {
    p_value < 1.0 - CONFIDENCE
}

/// Returns the minimum number of draws with which a difference can be significant by [`sign_flip`]
/// when this number of comparisons is corrected by [`holm`]: the smallest p-value has to stay below
/// the level after it is multiplied by the number of comparisons.
///
/// ```
/// assert_eq!([1, 3, 6].map(tagalong_math::draws_needed), [6, 7, 8]);
/// ```
pub fn draws_needed(comparisons: usize) -> usize {
    // Beyond the exact test the smallest p-value is 1 in 100,000, as with about 17 draws.
    let mut draws = 1;
    while draws < EXACT_UP_TO && !is_significant(least_p_value(draws) * comparisons as f64) {
        draws += 1;
    }
    draws
}

/// Returns the p-value if all of the draws differ in the same direction: only that sign pattern and
/// its opposite are as far from zero.
fn least_p_value(draws: usize) -> f64 {
    2.0 / (1u64 << draws) as f64
}

/// Returns the two-sided p-value of the hypothesis that differences are distributed symmetrically
/// about zero (the sign-flip permutation test: Fisher, 1935, section 21): the fraction of all 2^n
/// sign patterns whose sum is at least as far from zero. It is exact for up to 20 differences; for
/// more it is estimated from 99,999 random patterns and the observed one (Phipson and Smyth, 2010).
/// `None` without differences, or with NaN among them.
///
/// ```
/// assert_eq!(tagalong_math::sign_flip(&[0.1, 0.2]), Some(0.5));
/// assert_eq!(tagalong_math::sign_flip(&[0.1; 6]), Some(2.0 / 64.0));
/// ```
pub fn sign_flip(differences: &[f64]) -> Option<f64> {
    let mut sizes: Vec<f64> = differences.iter().map(|d| d.abs()).collect();
    let all = sizes.iter().sum::<f64>();
    if differences.is_empty() || !all.is_finite() {
        return None;
    }
    let bar = differences.iter().sum::<f64>().abs() - ROUNDING * all;
    // With the largest first, the rest of a sum soon no longer affects the result.
    sizes.sort_by(|a, b| b.total_cmp(a));
    if sizes.len() <= EXACT_UP_TO {
        return Some(patterns_beyond(&sizes, 0.0, bar) / (1u64 << sizes.len()) as f64);
    }
    let mut random = SplitMix64::new(1);
    let beyond = (0..PATTERNS).filter(|_| drawn_sum(&sizes, &mut random).abs() >= bar).count();
    Some((beyond + 1) as f64 / (PATTERNS + 1) as f64)
}

/// Returns the number of sign patterns of `rest` that bring `sum` to at least `bar`.
fn patterns_beyond(rest: &[f64], sum: f64, bar: f64) -> f64 {
    let left = rest.iter().sum::<f64>();
    match rest.split_first() {
        _ if sum.abs() - left >= bar => (1u64 << rest.len()) as f64,
        Some((first, rest)) if sum.abs() + left >= bar => {
            patterns_beyond(rest, sum + first, bar) + patterns_beyond(rest, sum - first, bar)
        }
        _ => 0.0,
    }
}

fn drawn_sum(sizes: &[f64], random: &mut SplitMix64) -> f64 {
    sizes
        .chunks(u64::BITS as usize)
        .map(|sizes| {
            let signs = random.next_u64();
            let sizes = sizes.iter().enumerate();
            sizes.map(|(bit, size)| if signs >> bit & 1 == 0 { *size } else { -size }).sum::<f64>()
        })
        .sum()
}

/// Returns the p-values of several comparisons, corrected for their number, in their order (Holm,
/// Scand. J. Statist. 1979): of twenty comparisons, one is below 0.05 by chance. A single one stays
/// as it is.
///
/// ```
/// assert_eq!(tagalong_math::holm(&[0.03, 0.01, 0.2]), [0.06, 0.03, 0.2]);
/// ```
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|a, b| p_values[*a].total_cmp(&p_values[*b]));
    let mut corrected = vec![1.0; p_values.len()];
    let mut least = 0.0_f64;
    for (rank, at) in order.into_iter().enumerate() {
        least = least.max((p_values.len() - rank) as f64 * p_values[at]).min(1.0);
        corrected[at] = least;
    }
    corrected
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// All patterns, one by one.
    fn counted(differences: &[f64]) -> f64 {
        let observed = differences.iter().sum::<f64>().abs();
        let patterns = 1u32 << differences.len();
        let mut beyond = 0;
        for signs in 0..patterns {
            let all = differences.iter().enumerate();
            let sum: f64 = all.map(|(i, d)| if signs >> i & 1 == 0 { *d } else { -d }).sum();
            beyond += u32::from(sum.abs() >= observed - 1e-9);
        }
        f64::from(beyond) / f64::from(patterns)
    }

    proptest! {
        #[test]
        fn every_pattern_of_signs_is_counted(
            tenths in prop::collection::vec(-30i32..30, 1..11),
        ) {
            let differences: Vec<f64> = tenths.iter().map(|t| 0.1 * f64::from(*t)).collect();
            prop_assert_eq!(sign_flip(&differences), Some(counted(&differences)));
        }
    }

    #[test]
    fn the_test_has_the_value_of_a_published_example() {
        // Darwin's maize as in Fisher (1935, section 21): 863 of 32768 patterns are as
        // large on one side, so 1726 in all.
        let eighths = [49, -67, 8, 16, 6, 23, 28, 41, 14, 29, 56, 24, 75, 60, -48];
        let p = sign_flip(&eighths.map(f64::from)).unwrap();
        assert!((p - 1726.0 / 32768.0).abs() < 1e-12, "{p}");
    }

    #[test]
    fn drawn_patterns_agree_with_all_of_them_and_never_say_zero() {
        fn uniform(random: &mut SplitMix64) -> f64 {
            random.positive_uniform() - 0.3
        }

        let mut random = SplitMix64::new(5);
        let many: Vec<f64> = (0..20).map(|_| uniform(&mut random)).collect();
        let exact = sign_flip(&many).unwrap();
        let one_more: Vec<f64> = many.iter().copied().chain([0.0]).collect();
        let drawn = sign_flip(&one_more).unwrap();
        assert!(exact > 0.001 && exact < 0.2, "{exact}");
        assert!((drawn - exact).abs() < 4.0 * (exact / PATTERNS as f64).sqrt(), "{drawn} {exact}");
        assert_eq!(sign_flip(&[1.0; 100]), Some(1e-5));
        // Of 70 that all count one half is in the second word.
        let halves: Vec<f64> = (0..70).map(|i| if i % 2 == 0 { 1.0 } else { -1.0 }).collect();
        assert_eq!(sign_flip(&halves), Some(1.0));
        let two = sign_flip(&[0.0; 64].into_iter().chain([1.0, 1.0]).collect::<Vec<_>>()).unwrap();
        assert!((two - 0.5).abs() < 0.01, "{two}");
    }

    #[test]
    fn without_a_difference_chance_explains_everything() {
        let gain = paired_gain(&[0.1, 0.5, 0.4], &[0.1, 0.5, 0.4]).unwrap();
        assert_eq!(gain, Gain { difference: Interval::open(0.0), p_value: 1.0 });
        assert_eq!(paired_gain(&[], &[]), None);
        assert_eq!(paired_gain(&[1.0], &[]), None);
        assert_eq!(paired_gain(&[1.0], &[1.0, 2.0]), None);
        assert_eq!(paired_gain(&[1.0], &[f64::NAN]), None);
    }

    #[test]
    fn below_six_draws_nothing_is_significant() {
        fn same_way(draws: usize) -> f64 {
            sign_flip(&vec![0.1; draws]).unwrap()
        }

        assert!((1..6).all(|draws| !is_significant(same_way(draws))));
        assert!(is_significant(same_way(6)));
    }

    #[test]
    fn a_correction_takes_as_many_draws_as_are_said_to_be_needed() {
        for comparisons in 1..60 {
            let needed = draws_needed(comparisons);
            for (draws, can_be) in [(needed - 1, false), (needed, true)] {
                let p_value = sign_flip(&vec![0.1; draws]).expect("draws");
                let corrected = holm(&vec![p_value; comparisons]);
                assert_eq!(is_significant(corrected[0]), can_be, "{draws} of {comparisons}");
            }
        }
    }

    #[test]
    fn the_test_is_wrong_no_more_often_than_it_says() {
        let mut random = SplitMix64::new(11);
        for draws in [6, 9, 15] {
            let mut wrong = 0;
            for _ in 0..1000 {
                let differences: Vec<f64> = (0..draws).map(|_| random.normal()).collect();
                wrong += usize::from(is_significant(sign_flip(&differences).unwrap()));
            }
            assert!((10..=65).contains(&wrong), "{wrong} of 1000 with {draws} draws");
        }
    }

    #[test]
    fn corrected_values_keep_their_order_and_stay_below_one() {
        assert_eq!(holm(&[0.04]), [0.04]);
        assert_eq!(holm(&[0.5, 0.6, 0.02]), [1.0, 1.0, 0.06]);
        assert_eq!(holm(&[0.02, 0.021]), [0.04, 0.04], "a larger one is not less");
        assert_eq!(holm(&[]), [] as [f64; 0]);
    }
}
