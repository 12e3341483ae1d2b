//! Confidence intervals of figures.

use serde::{Deserialize, Deserializer, Serialize};
use statrs::distribution::{Beta, ContinuousCDF, StudentsT};
use statrs::function::erf::erf_inv;

/// Confidence level of all intervals.
pub const CONFIDENCE: f64 = 0.95;

/// Bisections of the interval from 0 to 1, which leave a width of 1e-18.
const HALVINGS: u32 = 60;
/// Draws whose values differ by less than this fraction of the figure count as equal.
const ROUNDING: f64 = 1e-9;

/// An estimate with its confidence interval. A single draw, and draws that all have the same value,
/// contain no information about the spread: the interval then has no ends (minus and plus infinity;
/// `null` in JSON).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Interval {
    /// Point estimate.
    pub estimate: f64,
    /// Lower end.
    #[serde(deserialize_with = "open_below")]
    pub lower: f64,
    /// Upper end.
    #[serde(deserialize_with = "open_above")]
    pub upper: f64,
}

impl Interval {
    /// Returns an estimate with an interval without ends.
    pub const fn open(estimate: f64) -> Self {
        Self { estimate, lower: f64::NEG_INFINITY, upper: f64::INFINITY }
    }

    /// Returns both ends, if there are any.
    pub fn ends(&self) -> Option<[f64; 2]> {
        (self.lower.is_finite() && self.upper.is_finite()).then_some([self.lower, self.upper])
    }

    /// Returns the interval cut to the range of possible values; one without ends is left as it is.
    ///
    /// ```
    /// let interval = tagalong_math::mean_interval(&[0.9, 1.0, 1.0]).unwrap();
    /// assert!(interval.upper > 1.0 && interval.within(0.0, 1.0).upper == 1.0);
    /// ```
    #[must_use]
    pub fn within(self, least: f64, most: f64) -> Self {
        match self.ends() {
            None => self,
            Some([lower, upper]) => {
                Self { lower: lower.max(least), upper: upper.min(most), ..self }
            }
        }
    }

    fn around(estimate: f64, half: f64) -> Self {
        if half <= ROUNDING * estimate.abs() || !half.is_finite() {
            return Self::open(estimate);
        }
        Self { estimate, lower: estimate - half, upper: estimate + half }
    }
}

fn open_below<'de, D: Deserializer<'de>>(end: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(end)?.unwrap_or(f64::NEG_INFINITY))
}

fn open_above<'de, D: Deserializer<'de>>(end: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(end)?.unwrap_or(f64::INFINITY))
}

/// Returns the Wilson score interval of a success rate (Wilson, JASA 1927), which also holds for
/// few trials and for rates of 0 and 1. `None` without trials. The trials have to be independent;
/// [`clustered_share`] is for those that are not.
///
/// `confidence` lies between 0 and 1, exclusive, for example 0.95.
///
/// ```
/// let rate = tagalong_math::wilson(10, 10, 0.95).unwrap();
/// assert_eq!(rate.estimate, 1.0);
/// assert!((rate.lower - 0.7225).abs() < 1e-4);
/// ```
pub fn wilson(successes: u64, trials: u64, confidence: f64) -> Option<Interval> {
    let rate = successes.min(trials) as f64 / trials as f64;
    (trials > 0).then(|| score_interval(rate, trials as f64, confidence))
}

/// Returns the exact upper bound of a rate (Clopper and Pearson, Biometrika 1934): at any higher
/// rate, so few events or fewer have a probability below `1 - confidence`. It is one-sided, for
/// rare events such as contacts, where only the upper end matters. `None` without trials.
///
/// ```
/// let bound = tagalong_math::exact_upper_bound(0, 3000, 0.95).unwrap();
/// assert!((bound - 0.001).abs() < 1e-5, "three thousand without an event: one in a thousand");
/// ```
pub fn exact_upper_bound(events: u64, trials: u64, confidence: f64) -> Option<f64> {
    if trials == 0 {
        return None;
    }
    if events >= trials {
        return Some(1.0);
    }
    let law = Beta::new(events as f64 + 1.0, (trials - events) as f64).ok()?;
    // The library's inverse is inexact for a million trials, but its distribution function is
    // exact.
    let [mut low, mut high] = [0.0, 1.0];
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if law.cdf(middle) < confidence {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}

fn score_interval(estimate: f64, trials: f64, confidence: f64) -> Interval {
    let z = normal_quantile(confidence);
    let shrink = 1.0 + z * z / trials;
    let centre = (estimate + z * z / (2.0 * trials)) / shrink;
    let spread = (estimate * (1.0 - estimate) / trials + z * z / (4.0 * trials * trials)).sqrt();
    let half = z / shrink * spread;
    Interval {
        estimate,
        lower: (centre - half).clamp(0.0, estimate),
        upper: (centre + half).clamp(estimate, 1.0),
    }
}

/// Returns the two-sided quantile of the normal distribution, in standard errors.
fn normal_quantile(confidence: f64) -> f64 {
    std::f64::consts::SQRT_2 * erf_inv(confidence)
}

/// Returns the same quantile of Student's distribution, for a standard error that is itself
/// estimated from a few draws.
fn student_quantile(freedom: usize) -> f64 {
    let law = StudentsT::new(0.0, 1.0, freedom as f64);
    law.map_or(f64::INFINITY, |law| law.inverse_cdf(0.5 + 0.5 * CONFIDENCE))
}

/// Returns the interval of a success rate whose trials come in clusters, each
/// `[successes, trials]`. The frames of a ride resemble each other, so a hundred frames contain
/// less information than a hundred rides. The interval is Wilson's for the number of independent
/// trials that would have the spread seen between the clusters (never more than the actual number),
/// with Student's quantile for the number of clusters (Korn and Graubard, Survey Methodology 1998;
/// Dean and Pagano, J. of Survey Statistics and Methodology 2015). If all trials succeed, or none,
/// the clusters show no spread, and each counts as one trial.
///
/// `None` without trials. With a single cluster of several trials the interval has no ends.
///
/// ```
/// use tagalong_math::{clustered_share, wilson};
/// let alone = clustered_share(&[[1, 1], [0, 1], [1, 1]]).unwrap();
/// assert_eq!(Some(alone), wilson(2, 3, 0.95), "one trial each: independent");
/// let rides = clustered_share(&[[90, 100], [95, 100], [40, 100]]).unwrap();
/// assert!(rides.lower < 0.3, "three rides are not three hundred trials");
/// ```
pub fn clustered_share(clusters: &[[u64; 2]]) -> Option<Interval> {
    let known: Vec<[u64; 2]> = clusters.iter().copied().filter(|[_, of]| *of > 0).collect();
    let [successes, trials] = known.iter().fold([0, 0], |sum, one| [0, 1].map(|k| sum[k] + one[k]));
    if known.iter().all(|[_, of]| *of == 1) {
        return wilson(successes, trials, CONFIDENCE);
    }
    let rate = successes as f64 / trials as f64;
    if known.len() < 2 {
        return Some(Interval::open(rate));
    }
    let worth = independent_trials(&known, rate, trials as f64);
    Some(score_interval(rate, worth, CONFIDENCE))
}

/// Returns the number of independent trials with the same information as these clusters.
fn independent_trials(clusters: &[[u64; 2]], rate: f64, trials: f64) -> f64 {
    let count = clusters.len() as f64;
    if rate <= 0.0 || rate >= 1.0 {
        return count;
    }
    let square = clusters
        .iter()
        .map(|[successes, of]| (*successes as f64 - rate * *of as f64).powi(2))
        .sum::<f64>()
        * count
        / (count - 1.0);
    let alike = (rate * (1.0 - rate) * trials * trials / square).min(trials);
    alike * (normal_quantile(CONFIDENCE) / student_quantile(clusters.len() - 1)).powi(2)
}

/// Returns the interval of a figure that is computed from `draws` draws (or logs, rides, blocks;
/// not frames, because frames of one recording are not independent). `figure` is called with the
/// indices of the draws to use: first with all of them, then with all but one. The changes from
/// leaving one out give the spread (the jackknife: Tukey, Ann. Math. Stat. 1958), and Student's
/// quantile allows for the uncertainty of that spread with few draws. For a mean this is Student's
/// interval.
///
/// In simulations, its 95 % interval covers 95 % of normal and of symmetric bounded differences
/// from 3 draws on; of exponential ones 88 % with 3 to 6 draws and 92 % with 20. A percentile
/// bootstrap covers 75 % of normal ones with 3 draws, and a studentised one can there be unbounded.
/// None of them allows for losses so rare that most small samples contain none.
///
/// `None` without draws or without a finite figure; the interval has no ends with one draw, or with
/// draws of the same value.
///
/// For a figure of all draws together, combine the counts of the draws:
///
/// ```
/// use tagalong_math::draws_interval;
/// // Found and missed people of two runs.
/// let runs = [[8.0, 2.0], [5.0, 0.0]];
/// let recall = |drawn: &[usize]| {
///     let [found, missed] = [0, 1].map(|k| drawn.iter().map(|&i| runs[i][k]).sum::<f64>());
///     found / (found + missed)
/// };
/// let interval = draws_interval(runs.len(), recall).unwrap();
/// assert!((interval.estimate - 13.0 / 15.0).abs() < 1e-12);
/// assert!(interval.lower < 0.0, "two draws say next to nothing");
/// ```
pub fn draws_interval(draws: usize, figure: impl Fn(&[usize]) -> f64) -> Option<Interval> {
    let everything: Vec<usize> = (0..draws).collect();
    let estimate = if draws == 0 { f64::NAN } else { figure(&everything) };
    if !estimate.is_finite() {
        return None;
    }
    if draws == 1 {
        return Some(Interval::open(estimate));
    }
    let mut others = Vec::with_capacity(draws);
    for out in 0..draws {
        let kept: Vec<usize> = everything.iter().copied().filter(|draw| *draw != out).collect();
        others.push(figure(&kept));
    }
    let count = draws as f64;
    let mean = others.iter().sum::<f64>() / count;
    let square = others.iter().map(|other| (other - mean).powi(2)).sum::<f64>();
    let error = (square * (count - 1.0) / count).sqrt();
    Some(Interval::around(estimate, student_quantile(draws - 1) * error))
}

/// Returns the interval of the mean of one value per draw; see [`draws_interval`].
pub fn mean_interval(values: &[f64]) -> Option<Interval> {
    draws_interval(values.len(), |drawn| {
        drawn.iter().map(|&i| values[i]).sum::<f64>() / drawn.len() as f64
    })
}

#[cfg(test)]
mod tests;
