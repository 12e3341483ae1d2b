//! Times of the stages of a pipeline.

use std::collections::BTreeMap;

use serde::Serialize;

/// Name of the sum over the stages of a frame.
pub const WHOLE_FRAME: &str = "whole frame";

/// Resolution of times, ms.
const SHORTEST_MS: f64 = 1e-3;

/// Ratio between the ends of a bin: figures are accurate to 1 %.
const RATIO: f64 = 1.02;

/// Number of bins, up to about an hour.
const BINS: usize = 1120;

/// Times of the stages, in memory that does not grow with the log.
#[derive(Default)]
pub struct Timings {
    stages: BTreeMap<String, Histogram>,
}

struct Histogram {
    counts: Vec<u64>,
    sum_ms: f64,
    max_ms: f64,
}

/// Times of one stage.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StageTimes {
    /// Number of measured frames.
    pub frames: u64,
    /// Median, ms.
    pub p50_ms: f64,
    /// 95th percentile, ms.
    pub p95_ms: f64,
    /// 99th percentile, ms.
    pub p99_ms: f64,
    /// Mean, ms.
    pub mean_ms: f64,
    /// Slowest frame, ms.
    pub max_ms: f64,
}

impl Timings {
    /// Adds one measurement.
    pub fn add(&mut self, stage: &str, ms: f64) {
        if !self.stages.contains_key(stage) {
            self.stages.insert(stage.to_owned(), Histogram::new());
        }
        if let Some(histogram) = self.stages.get_mut(stage) {
            histogram.add(ms);
        }
    }

    /// Adds the stages of a frame, and their sum as [`WHOLE_FRAME`].
    pub fn add_frame(&mut self, stages: &[(&'static str, f64)]) {
        stages.iter().for_each(|(stage, ms)| self.add(stage, *ms));
        self.add(WHOLE_FRAME, stages.iter().map(|(_, ms)| ms).sum());
    }

    /// Returns the times, by stage.
    pub fn summary(&self) -> BTreeMap<&str, StageTimes> {
        self.stages.iter().map(|(name, h)| (name.as_str(), h.summary())).collect()
    }
}

/// Returns a sentence about a pipeline that takes longer for a frame than the time to the next one,
/// in wall time; `None` if it keeps up, or if either time is not known.
pub fn too_slow(frame_ms: f64, period_ms: f64) -> Option<String> {
    let is_slow = period_ms > 0.0 && frame_ms > period_ms && frame_ms.is_finite();
    is_slow.then(|| {
        format!(
            "on this computer {} of {} frames per second ({frame_ms:.0} ms of wall time each, one \
             arrives every {period_ms:.0} ms): live, the others are skipped",
            per_second(frame_ms),
            per_second(period_ms)
        )
    })
}

/// Returns a rate in words; an integer from ten on.
fn per_second(ms: f64) -> String {
    let hz = 1e3 / ms;
    if hz < 9.95 { format!("{hz:.1}") } else { format!("{hz:.0}") }
}

impl Histogram {
    fn new() -> Self {
        Self { counts: vec![0; BINS], sum_ms: 0.0, max_ms: 0.0 }
    }

    fn add(&mut self, ms: f64) {
        // Logarithmic bins have the same relative error for all durations.
        let bin = (ms / SHORTEST_MS).max(1.0).ln() / RATIO.ln();
        self.counts[(bin as usize).min(BINS - 1)] += 1;
        self.sum_ms += ms;
        self.max_ms = self.max_ms.max(ms);
    }

    fn summary(&self) -> StageTimes {
        let frames: u64 = self.counts.iter().sum();
        StageTimes {
            frames,
            p50_ms: rounded(self.quantile(frames, 0.50)),
            p95_ms: rounded(self.quantile(frames, 0.95)),
            p99_ms: rounded(self.quantile(frames, 0.99)),
            mean_ms: rounded(self.sum_ms / frames.max(1) as f64),
            max_ms: rounded(self.max_ms),
        }
    }

    /// Returns the middle of the bin that contains the quantile.
    fn quantile(&self, frames: u64, fraction: f64) -> f64 {
        let rank = (fraction * frames as f64).ceil() as u64;
        let mut seen = 0;
        for (bin, count) in self.counts.iter().enumerate() {
            seen += count;
            if seen >= rank {
                // The middle of the last bin may exceed all times.
                return (SHORTEST_MS * RATIO.powf(bin as f64 + 0.5)).min(self.max_ms);
            }
        }
        0.0
    }
}

fn rounded(ms: f64) -> f64 {
    (ms * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn quantiles_are_right_to_a_few_percent(
            mut times in proptest::collection::vec(0.002..5000.0f64, 1..300),
        ) {
            let mut timings = Timings::default();
            times.iter().for_each(|ms| timings.add("stage", *ms));
            let told = timings.summary()["stage"].clone();
            times.sort_by(f64::total_cmp);
            for (share, told_ms) in [(0.5, told.p50_ms), (0.95, told.p95_ms), (0.99, told.p99_ms)] {
                let exact_ms = times[(share * times.len() as f64).ceil() as usize - 1];
                prop_assert!((told_ms / exact_ms - 1.0).abs() < 0.05, "{told:?} {exact_ms}");
            }
            prop_assert!(told.p50_ms <= told.p99_ms && told.p99_ms <= told.max_ms, "{told:?}");
            prop_assert_eq!(told.frames, times.len() as u64);
        }
    }

    #[test]
    fn a_frame_takes_as_long_as_its_stages() {
        let mut timings = Timings::default();
        timings.add_frame(&[("track", 1.0), ("update", 2.5)]);
        let summary = timings.summary();
        assert_eq!((summary[WHOLE_FRAME].max_ms, summary["update"].max_ms), (3.5, 2.5));
    }

    #[test]
    fn a_pipeline_that_is_slower_than_the_log_is_told_with_both_rates() {
        let told = too_slow(512.0, 40.0).expect("a slow one");
        assert!(
            told.starts_with("on this computer 2.0 of 25 frames per second (512 ms of"),
            "{told}"
        );
        for (frame_ms, period_ms) in [(40.0, 40.0), (10.0, 40.0), (10.0, 0.0), (f64::NAN, 40.0)] {
            assert_eq!(too_slow(frame_ms, period_ms), None);
        }
    }

    #[test]
    fn odd_times_are_harmless() {
        let mut timings = Timings::default();
        [0.0, -1.0, 1e300].iter().for_each(|ms| timings.add("stage", *ms));
        assert_eq!(timings.summary()["stage"].frames, 3);
    }
}
