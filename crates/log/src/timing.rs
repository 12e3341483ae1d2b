//! Regularity of images, and time offsets between those of two topics, from their stamps.

use serde::Serialize;
use tagalong_core::Stamp;
use tagalong_math::median;

/// Statistics of the stamps of one topic, in the order of arrival.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Timing {
    /// Median of the forward steps, s.
    pub median_period_s: f64,
    /// Longest forward step, s.
    pub longest_gap_s: f64,
    /// Number of backward steps.
    pub steps_back: usize,
    /// Longest backward step, s.
    pub longest_step_back_s: f64,
    /// Number of stamps equal to the previous one.
    pub repeated: usize,
}

impl Timing {
    /// Computes the statistics; `None` if no stamp is later than the previous one.
    pub fn of(stamps: &[Stamp]) -> Option<Self> {
        let steps: Vec<f64> = stamps.windows(2).map(|w| w[1].seconds_since(w[0])).collect();
        Some(Self {
            median_period_s: median(steps.iter().copied().filter(|step| *step > 0.0))?,
            longest_gap_s: steps.iter().copied().fold(0.0, f64::max),
            steps_back: steps.iter().filter(|step| **step < 0.0).count(),
            // Adding 0 turns a negative zero into a positive one.
            longest_step_back_s: -steps.iter().copied().fold(0.0, f64::min) + 0.0,
            repeated: steps.iter().filter(|step| **step == 0.0).count(),
        })
    }
}

/// Time offset of the images of a second topic from those of the first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Skew {
    /// Median of second minus first over neighbouring images, s.
    pub median_s: f64,
    /// Fraction of the first topic's images that have an image of the second topic within the
    /// tolerance.
    pub paired: f64,
    /// Time by which the second topic's stamps are later than those of the first, s, if the recording
    /// times show that the two have different clocks.
    pub clock_s: Option<f64>,
}

impl Skew {
    /// Computes the offset between the images of two topics; `None` if either has none.
    pub fn between(first: &[Stamp], second: &[Stamp], tolerance_s: f64) -> Option<Self> {
        let mut second = second.to_vec();
        second.sort();
        let offsets: Vec<f64> = first.iter().filter_map(|at| nearest(&second, *at)).collect();
        let paired = offsets.iter().filter(|offset| offset.abs() <= tolerance_s).count();
        Some(Self {
            median_s: median(offsets.iter().copied())?,
            paired: paired as f64 / offsets.len() as f64,
            clock_s: None,
        })
    }

    /// Returns the words for a second topic of images with another clock; `None` if nothing shows that.
    pub fn other_clock(&self) -> Option<String> {
        self.clock_s.map(|off_s| clock_words(off_s, "colour images"))
    }
}

/// Returns the words for stamps that are later by a time, s, than those of other messages, as the
/// recording times show.
pub(crate) fn clock_words(off_s: f64, others: &str) -> String {
    let side = if off_s > 0.0 { "later" } else { "earlier" };
    format!(
        "compared by the times of recording, its stamps are {:.2} s {side} than those of the {others}: \
         another clock",
        off_s.abs()
    )
}

/// Returns the offset from a given time to the nearest of sorted stamps, s.
pub(crate) fn nearest(sorted: &[Stamp], at: Stamp) -> Option<f64> {
    let after = sorted.partition_point(|stamp| *stamp < at);
    let around = &sorted[after.saturating_sub(1)..(after + 1).min(sorted.len())];
    around.iter().map(|s| s.seconds_since(at)).min_by(|a, b| a.abs().total_cmp(&b.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: &[u64]) -> Vec<Stamp> {
        millis.iter().map(|m| Stamp::from_nanos(m * 1_000_000)).collect()
    }

    #[test]
    fn gaps_steps_back_and_repetitions_are_told() {
        let timing = Timing::of(&at(&[0, 100, 200, 200, 1200, 700, 800])).unwrap();
        assert!((timing.median_period_s - 0.1).abs() < 1e-9);
        assert!((timing.longest_gap_s - 1.0).abs() < 1e-9);
        assert!((timing.longest_step_back_s - 0.5).abs() < 1e-9);
        assert_eq!((timing.steps_back, timing.repeated), (1, 1));
        assert_eq!(Timing::of(&at(&[5])), None);
        assert_eq!(Timing::of(&at(&[5, 5])), None);
    }

    #[test]
    fn skew_is_that_of_the_nearest_image() {
        let skew = Skew::between(&at(&[0, 100, 200, 300]), &at(&[308, 8, 108]), 0.03).unwrap();
        assert!((skew.median_s - 0.008).abs() < 1e-9, "{skew:?}");
        assert_eq!(skew.paired, 0.75);
        assert_eq!(Skew::between(&[], &at(&[1]), 0.03), None);
        assert_eq!(Skew::between(&at(&[1]), &[], 0.03), None);
    }
}
