//! The statistic of all times that stand beside those of other programs. `benches/peers/timing.py`
//! is the same for theirs; a test holds both against each other.

use std::hint::black_box;

use cpu_time::ThreadTime;
use tagalong_math::median;

/// Least processor time of a sample: asking the clock takes 0.2 us.
const SAMPLE_US: f64 = 100.0;
/// Processor time that all samples take together.
const BUDGET_US: f64 = 200_000.0;
const SAMPLES: std::ops::RangeInclusive<usize> = 5..=101;

/// Number of samples, and of calls in each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Samples, an odd number.
    pub samples: usize,
    /// Calls of a sample, which lasts 100 us or more.
    pub calls: usize,
}

impl Plan {
    /// Plans samples of a call that takes this long, us.
    pub fn of(call_us: f64) -> Self {
        let call_us = call_us.max(1e-3);
        let calls = (SAMPLE_US / call_us).ceil().max(1.0);
        let samples = (BUDGET_US / (calls * call_us)) as usize;
        let samples = samples.clamp(*SAMPLES.start(), *SAMPLES.end());
        Self { samples: samples | 1, calls: calls as usize }
    }
}

/// Returns the time that stands in the table for these samples, us: their median.
pub fn statistic_us(samples_us: &[f64]) -> f64 {
    median(samples_us.iter().copied()).unwrap_or(f64::NAN)
}

/// Returns the median processor time of a call on this thread, us.
pub fn median_us<T>(mut call: impl FnMut() -> T) -> f64 {
    // The first calls fetch code and memory.
    time_us(1, &mut call);
    let plan = Plan::of(time_us(3, &mut call));
    let samples: Vec<f64> = (0..plan.samples).map(|_| time_us(plan.calls, &mut call)).collect();
    statistic_us(&samples)
}

/// Returns the processor time of one of so many calls, us.
fn time_us<T>(calls: usize, call: &mut impl FnMut() -> T) -> f64 {
    let start = ThreadTime::now();
    for _ in 0..calls {
        black_box(call());
    }
    1e6 * start.elapsed().as_secs_f64() / calls as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_fast_call_does_not_move_the_time() {
        assert_eq!(statistic_us(&[2.0, 0.1, 2.0, 2.1, 9.0]), 2.0);
    }

    #[test]
    fn short_calls_are_timed_together_and_long_ones_seldom() {
        assert_eq!(Plan::of(0.2), Plan { samples: 101, calls: 500 });
        assert_eq!(Plan::of(5_000.0), Plan { samples: 41, calls: 1 });
        assert_eq!(Plan::of(1e6), Plan { samples: 5, calls: 1 });
    }

    #[test]
    fn every_call_of_a_sample_is_made() {
        let mut calls = 0_u32;
        let us = median_us(|| calls += 1);
        assert!(calls > 1000 && us.is_finite(), "{calls} calls of {us} us");
    }
}
