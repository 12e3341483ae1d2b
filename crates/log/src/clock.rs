//! Times of the messages from one source: their stamps, and the times at which they were recorded.

use tagalong_core::Stamp;
use tagalong_math::{median, percentile};

/// Duration over which messages with the same stamp are recorded beyond which the stamp cannot be
/// right for each of them, s.
const COARSE_S: f64 = 0.3;
/// Minimum number of messages for measuring a lag.
const LEAST_MESSAGES: usize = 5;
/// Maximum spread of a constant lag, s, between the tenth and the ninetieth percentile.
const CONSTANT_S: f64 = 0.2;
/// Time by which stamps are later than their recording beyond which their clock is not that of the
/// recording, s.
pub(crate) const FUTURE_S: f64 = 0.25;
/// Delay of stamps behind those of other messages beyond which their clock is another one, s. Messages
/// that are computed may come late by less, with right stamps.
pub(crate) const DELAY_S: f64 = 1.0;
/// Nanoseconds of a second.
const SECOND_NS: u64 = 1_000_000_000;

/// Ranges of the stamps and of the recording times of a topic, or of one transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Times {
    /// Earliest and latest stamp.
    pub(crate) first: Stamp,
    pub(crate) last: Stamp,
    /// Earliest and latest recording time.
    pub(crate) first_recorded: Stamp,
    pub(crate) last_recorded: Stamp,
    /// Number of runs of messages with the same stamp.
    runs: u64,
    /// Number of those that were recorded over more than [`COARSE_S`].
    coarse_runs: u64,
    /// True if all stamps are whole seconds.
    is_whole: bool,
    /// Stamp of the last run, and the recording time of its first message.
    run: (Stamp, Stamp),
    is_run_coarse: bool,
    /// Difference of stamp minus recording time of the message with the least delay, s.
    latest_lag_s: f64,
}

impl Times {
    /// Creates the times of one message.
    pub(crate) fn new(stamp: Stamp, recorded: Stamp) -> Self {
        Self {
            first: stamp,
            last: stamp,
            first_recorded: recorded,
            last_recorded: recorded,
            runs: 1,
            coarse_runs: 0,
            is_whole: stamp.nanos().is_multiple_of(SECOND_NS),
            run: (stamp, recorded),
            is_run_coarse: false,
            latest_lag_s: stamp.seconds_since(recorded),
        }
    }

    /// Returns the times of messages in the order of recording; `None` without messages.
    pub(crate) fn of(stamps: &[Stamp], recorded: &[Stamp]) -> Option<Self> {
        let mut times: Option<Self> = None;
        for (stamp, recorded) in stamps.iter().zip(recorded) {
            match &mut times {
                Some(times) => times.add(*stamp, *recorded),
                None => times = Some(Self::new(*stamp, *recorded)),
            }
        }
        times
    }

    /// Adds the next message.
    pub(crate) fn add(&mut self, stamp: Stamp, recorded: Stamp) {
        self.first = self.first.min(stamp);
        self.last = self.last.max(stamp);
        self.first_recorded = self.first_recorded.min(recorded);
        self.last_recorded = self.last_recorded.max(recorded);
        self.latest_lag_s = self.latest_lag_s.max(stamp.seconds_since(recorded));
        self.is_whole &= stamp.nanos().is_multiple_of(SECOND_NS);
        if stamp != self.run.0 {
            self.runs += 1;
            self.run = (stamp, recorded);
            self.is_run_coarse = false;
        }
        if !self.is_run_coarse && recorded.seconds_since(self.run.1) > COARSE_S {
            self.coarse_runs += 1;
            self.is_run_coarse = true;
        }
    }

    /// Returns the times with the recording times in place of the stamps.
    pub(crate) fn as_recorded(&self) -> Self {
        let mut times = Self::new(self.first_recorded, self.first_recorded);
        times.add(self.last_recorded, self.last_recorded);
        times
    }

    /// Returns the largest difference of stamp minus recording time, s; `None` if there are few
    /// messages.
    pub(crate) fn latest_lag_s(&self) -> Option<f64> {
        (self.runs >= LEAST_MESSAGES as u64).then_some(self.latest_lag_s)
    }

    /// Returns true if most stamps are shared by messages of many times.
    pub(crate) fn are_coarse(&self) -> bool {
        2 * self.coarse_runs > self.runs
    }

    /// Returns true if the stamps are whole seconds, shared by messages of many times.
    pub(crate) fn are_whole_seconds(&self) -> bool {
        self.is_whole && self.are_coarse()
    }
}

/// Returns the difference of stamp minus recording time, s, which is negative by the delay of the
/// messages; `None` if it varies, or if there are few messages.
pub(crate) fn constant_lag_s(stamps: &[Stamp], recorded: &[Stamp]) -> Option<f64> {
    let both = stamps.iter().zip(recorded);
    let lags_s: Vec<f64> = both.map(|(stamp, recorded)| stamp.seconds_since(*recorded)).collect();
    let spread_s = percentile(&lags_s, 0.9)? - percentile(&lags_s, 0.1)?;
    let is_constant = lags_s.len() >= LEAST_MESSAGES && spread_s <= CONSTANT_S;
    median(lags_s).filter(|_| is_constant)
}

/// Returns the time by which the stamps of second messages are later than those of first ones, s, from
/// the times by which each are later than their recording, if those show that the two have different
/// clocks: second messages with stamps of the future have, because none is recorded before its capture.
/// Where no stamps agree (`are_apart`), first ones of the future show it, too, and so does a delay that no
/// camera has. Where they agree, the second ones may have been computed later.
pub(crate) fn other_clock_s(of_first_s: f64, of_second_s: f64, are_apart: bool) -> Option<f64> {
    let off_s = of_second_s - of_first_s;
    let is_ahead = off_s > FUTURE_S && of_second_s > FUTURE_S && of_first_s < FUTURE_S;
    let is_behind = off_s < -FUTURE_S && of_first_s > FUTURE_S && of_second_s < FUTURE_S;
    let is_other = is_ahead || are_apart && (is_behind || off_s.abs() > DELAY_S);
    is_other.then_some(off_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: &[f64]) -> Vec<Stamp> {
        seconds.iter().map(|s| Stamp::default().plus_seconds(100.0 + s)).collect()
    }

    #[test]
    fn stamps_of_whole_seconds_are_told_from_those_that_come_once_a_second() {
        let recorded = at(&[0.0, 0.4, 0.8, 1.2, 1.6, 2.0]);
        let rounded = Times::of(&at(&[0.0, 0.0, 0.0, 1.0, 1.0, 2.0]), &recorded).unwrap();
        assert!(rounded.are_whole_seconds());
        assert!(!rounded.as_recorded().are_coarse());
        assert_eq!(rounded.as_recorded().last, recorded[5]);
        let tenths = Times::of(&at(&[0.1, 0.1, 0.1, 1.1, 1.1, 2.1]), &recorded).unwrap();
        assert!(tenths.are_coarse() && !tenths.are_whole_seconds());
        let slow = Times::of(&at(&[0.0, 1.0, 2.0]), &at(&[0.01, 1.01, 2.01])).unwrap();
        assert!(!slow.are_coarse());
        // Two publishers of the same odometry.
        let twice = Times::of(&at(&[0.0, 0.0, 1.0, 1.0]), &at(&[0.01, 0.02, 1.01, 1.02])).unwrap();
        assert!(!twice.are_coarse());
        assert_eq!(Times::of(&[], &[]), None);
    }

    #[test]
    fn a_clock_is_another_one_by_stamps_of_the_future_or_a_delay_without_pairs() {
        for (of_first_s, of_second_s, are_apart, is_other) in [
            (-0.02, 0.3, false, true),
            (0.3, -0.02, true, true),
            (0.3, -0.02, false, false),
            (-0.02, -0.4, true, false),
            (-0.02, -5.0, true, true),
            (-0.02, -5.0, false, false),
            (3600.3, 3600.0, false, false),
            (0.2, 0.3, true, false),
        ] {
            let off_s = other_clock_s(of_first_s, of_second_s, are_apart);
            assert_eq!(off_s, is_other.then_some(of_second_s - of_first_s));
        }
    }

    #[test]
    fn a_lag_is_the_median_where_it_is_constant() {
        let recorded = at(&[0.0, 0.1, 0.2, 0.3, 0.4]);
        let lag_s = constant_lag_s(&at(&[0.9, 1.0, 1.1, 1.2, 1.3]), &recorded);
        assert!((lag_s.unwrap() - 0.9).abs() < 1e-6);
        assert_eq!(constant_lag_s(&at(&[0.9, 1.0, 1.1, 2.2, 2.3]), &recorded), None);
        assert_eq!(constant_lag_s(&at(&[0.9, 1.0]), &recorded), None);
        let many = Times::of(&at(&[-1.5, -1.4, -1.0, -1.2, -1.1]), &recorded).unwrap();
        assert!((many.latest_lag_s().unwrap() + 1.2).abs() < 1e-6);
        let few = Times::of(&at(&[-1.5, -1.4]), &recorded).unwrap();
        assert_eq!(few.latest_lag_s(), None);
    }
}
