//! Intervals: how far a figure can be trusted.

use serde::{Deserialize, Serialize};
use statrs::function::erf::erf_inv;

/// A figure and the interval in which it lies with some confidence.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Interval {
    /// The figure itself.
    pub estimate: f64,
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

/// The Wilson score interval of a success rate (Wilson, JASA 1927): sensible
/// for few trials and for rates of 0 and 1. Nothing without trials.
///
/// `confidence` lies between 0 and 1, both excluded, for example 0.95.
///
/// ```
/// let rate = tagalong_eval::wilson(10, 10, 0.95).unwrap();
/// assert_eq!(rate.estimate, 1.0);
/// assert!((rate.lower - 0.7225).abs() < 1e-4);
/// ```
pub fn wilson(successes: u64, trials: u64, confidence: f64) -> Option<Interval> {
    if trials == 0 {
        return None;
    }
    let n = trials as f64;
    let estimate = successes.min(trials) as f64 / n;
    let z = std::f64::consts::SQRT_2 * erf_inv(confidence);
    let shrink = 1.0 + z * z / n;
    let centre = (estimate + z * z / (2.0 * n)) / shrink;
    let spread = (estimate * (1.0 - estimate) / n + z * z / (4.0 * n * n)).sqrt();
    let half = z / shrink * spread;
    Some(Interval {
        estimate,
        lower: (centre - half).clamp(0.0, estimate),
        upper: (centre + half).clamp(estimate, 1.0),
    })
}

/// The value below which a fraction of the values lies, interpolated between
/// neighbours (as numpy's default); nothing without values.
pub fn percentile(values: &[f64], fraction: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let at = fraction.clamp(0.0, 1.0) * last as f64;
    let below = at.floor() as usize;
    let above = (below + 1).min(last);
    Some(sorted[below] + (at - below as f64) * (sorted[above] - sorted[below]))
}

/// Settings of the bootstrap.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bootstrap {
    /// How many samples are drawn.
    pub samples: usize,
    /// Confidence of the interval, between 0 and 1.
    pub confidence: f64,
    /// Seed; the same seed gives the same interval.
    pub seed: u64,
}

impl Default for Bootstrap {
    fn default() -> Self {
        Self { samples: 10_000, confidence: 0.95, seed: 1 }
    }
}

impl Bootstrap {
    /// Percentile interval of a figure that is computed from `sequences`
    /// sequences: `figure` is called with the indices of those drawn (with
    /// replacement; Efron and Tibshirani, 1993, chapter 13). Sequences are
    /// drawn, not frames, because frames of one recording are not independent.
    /// Nothing without sequences, samples or a finite figure.
    ///
    /// For a figure of all sequences together combine its own tallies:
    ///
    /// ```
    /// use tagalong_eval::{Bootstrap, Clear};
    /// let runs = [Clear { tp: 8, fn_: 2, ..Clear::default() }, Clear { tp: 5, ..Clear::default() }];
    /// let mota = |drawn: &[usize]| Clear::combine(drawn.iter().map(|&i| &runs[i])).mota();
    /// let interval = Bootstrap::default().interval(runs.len(), mota).unwrap();
    /// assert!((interval.estimate - 13.0 / 15.0).abs() < 1e-12);
    /// assert_eq!((interval.lower, interval.upper), (0.8, 1.0));
    /// ```
    pub fn interval(&self, sequences: usize, figure: impl Fn(&[usize]) -> f64) -> Option<Interval> {
        let drawn = self.draw(sequences, &figure);
        let tail = 0.5 * (1.0 - self.confidence);
        let everything: Vec<usize> = (0..sequences).collect();
        let lower = percentile(&drawn, tail)?;
        let upper = percentile(&drawn, 1.0 - tail)?;
        let estimate = figure(&everything);
        estimate.is_finite().then_some(Interval { estimate, lower, upper })
    }

    /// How much better `b` is than `a`, both scored on the same sequences: the
    /// mean difference, its interval, and how probable it is that there is none
    /// (two-sided). Drawing pairs removes what the sequences themselves differ in.
    /// Nothing if the lists are empty or of different length.
    ///
    /// ```
    /// use tagalong_eval::Bootstrap;
    /// let gain = Bootstrap::default().paired(&[0.5, 0.2, 0.7], &[0.6, 0.3, 0.8]).unwrap();
    /// assert!((gain.difference.estimate - 0.1).abs() < 1e-12);
    /// assert!(gain.difference.lower > 0.0);
    /// ```
    pub fn paired(&self, a: &[f64], b: &[f64]) -> Option<Gain> {
        if a.len() != b.len() {
            return None;
        }
        let mean =
            |drawn: &[usize]| drawn.iter().map(|&i| b[i] - a[i]).sum::<f64>() / drawn.len() as f64;
        let difference = self.interval(a.len(), mean)?;
        Some(Gain { difference, p_value: self.p_value(&self.draw(a.len(), &mean)) })
    }

    /// Twice the smaller tail beyond zero, never quite zero itself.
    fn p_value(&self, drawn: &[f64]) -> f64 {
        let not_above = drawn.iter().filter(|&&d| d <= 0.0).count();
        let not_below = drawn.iter().filter(|&&d| d >= 0.0).count();
        let tail = (not_above.min(not_below) + 1) as f64 / (drawn.len() + 1) as f64;
        (2.0 * tail).min(1.0)
    }

    fn draw(&self, sequences: usize, figure: &impl Fn(&[usize]) -> f64) -> Vec<f64> {
        if sequences == 0 {
            return Vec::new();
        }
        let mut random = SplitMix(self.seed);
        let mut drawn = vec![0; sequences];
        let mut sample = || {
            drawn.fill_with(|| random.below(sequences as u64) as usize);
            figure(&drawn)
        };
        (0..self.samples).map(|_| sample()).filter(|value| value.is_finite()).collect()
    }
}

/// The outcome of a paired comparison.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Gain {
    /// Mean of the differences and its interval.
    pub difference: Interval,
    /// Two-sided probability of such a difference if there were none.
    pub p_value: f64,
}

/// SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): small, seeded, the same everywhere.
struct SplitMix(u64);

impl SplitMix {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// Uniform in `0..bound`; the remainder's bias is below 2^-32 for any
    /// number of sequences that fits into memory.
    fn below(&mut self, bound: u64) -> u64 {
        ((u128::from(self.next()) * u128::from(bound)) >> 64) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_generator_gives_the_published_stream() {
        let mut random = SplitMix(1_234_567);
        let stream: Vec<u64> = (0..3).map(|_| random.next()).collect();
        assert_eq!(
            stream,
            [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]
        );
    }

    #[test]
    fn percentiles_interpolate() {
        assert_eq!(percentile(&[3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(percentile(&[0.0, 10.0], 0.95), Some(9.5));
        assert_eq!(percentile(&[], 0.5), None);
    }

    #[test]
    fn no_difference_is_not_significant() {
        let gain = Bootstrap::default().paired(&[0.1, 0.5, 0.4], &[0.1, 0.5, 0.4]).unwrap();
        assert_eq!(gain.difference, Interval { estimate: 0.0, lower: 0.0, upper: 0.0 });
        assert_eq!(gain.p_value, 1.0);
        assert_eq!(Bootstrap::default().paired(&[], &[]), None);
        assert_eq!(Bootstrap::default().paired(&[1.0], &[]), None);
    }

    #[test]
    fn another_seed_draws_otherwise_and_the_same_seed_alike() {
        let values = [0.1, 0.9, 0.3, 0.5, 0.2];
        let mean = |drawn: &[usize]| drawn.iter().map(|&i| values[i]).sum::<f64>() / 5.0;
        let with = |seed| Bootstrap { seed, samples: 51, ..Default::default() }.interval(5, mean);
        assert_eq!(with(1), with(1));
        assert_ne!(with(1), with(2));
    }

    #[test]
    fn wilson_agrees_with_its_published_example() {
        // Newcombe (1998), table I: 81 of 263 and 0 of 20.
        let rate = wilson(81, 263, 0.95).unwrap();
        assert!((rate.lower - 0.2553).abs() < 5e-5 && (rate.upper - 0.3662).abs() < 5e-5);
        let none = wilson(0, 20, 0.95).unwrap();
        assert!(none.lower == 0.0 && (none.upper - 0.1611).abs() < 5e-5);
        assert_eq!(wilson(0, 0, 0.95), None);
    }
}
