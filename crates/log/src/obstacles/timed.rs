use std::collections::VecDeque;

use tagalong_core::Stamp;

/// Step back of the clock beyond which it has jumped, s.
const CLOCK_JUMP_S: f64 = 1.0;
/// Maximum number of stored readings.
const MAX_READINGS: usize = 1024;
/// Maximum number of stored bytes, unless a few readings alone exceed it.
const MAX_BYTES: usize = 40 << 20;
/// Number of readings that are stored whatever their size.
const MIN_READINGS: usize = 4;

/// Reading of a source with its time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Timed<T> {
    pub(super) stamp: Stamp,
    /// Index in the order of arrival, from 1.
    pub(super) number: u64,
    /// Size in memory, bytes.
    bytes: usize,
    pub(super) value: T,
}

/// Newest readings of a source, sorted by stamp.
#[derive(Debug)]
pub(super) struct Readings<T> {
    readings: VecDeque<Timed<T>>,
    bytes: usize,
    arrived: u64,
}

impl<T> Default for Readings<T> {
    fn default() -> Self {
        Self { readings: VecDeque::new(), bytes: 0, arrived: 0 }
    }
}

impl<T> Readings<T> {
    /// Adds a reading. If the clock has jumped back, the old readings are removed.
    pub(super) fn push(&mut self, stamp: Stamp, bytes: usize, value: T) {
        let newest = self.readings.back().map_or(stamp, |newest| newest.stamp);
        if newest.seconds_since(stamp) > CLOCK_JUMP_S {
            self.readings.clear();
            self.bytes = 0;
        }
        self.arrived += 1;
        self.bytes += bytes;
        // Inserted after those of the same stamp, so that the last to arrive counts as the newest.
        let place = self.readings.partition_point(|old| old.stamp <= stamp);
        self.readings.insert(place, Timed { stamp, number: self.arrived, bytes, value });
        while self.is_overfull() {
            self.drop_oldest();
        }
    }

    fn is_overfull(&self) -> bool {
        let count = self.readings.len();
        count > MAX_READINGS || count > MIN_READINGS && self.bytes > MAX_BYTES
    }

    fn drop_oldest(&mut self) {
        let bytes = self.readings.pop_front().map_or(0, |dropped| dropped.bytes);
        self.bytes -= bytes;
    }

    /// Yields the readings up to this time.
    pub(super) fn until(&self, latest: Stamp) -> impl Iterator<Item = &Timed<T>> {
        self.readings.iter().take_while(move |reading| reading.stamp <= latest)
    }

    /// Returns the newest reading up to this time, and drops those before it.
    pub(super) fn newest_until(&mut self, latest: Stamp) -> Option<&Timed<T>> {
        let count = self.until(latest).count();
        (1..count).for_each(|_| self.drop_oldest());
        self.readings.front().filter(|_| count > 0)
    }

    /// Returns the newest reading.
    pub(super) fn newest(&self) -> Option<&T> {
        self.readings.back().map(|reading| &reading.value)
    }

    /// Returns the stamp of the first reading.
    pub(super) fn first_stamp(&self) -> Option<Stamp> {
        self.readings.front().map(|reading| reading.stamp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Stamp {
        Stamp::default().plus_seconds(seconds)
    }

    fn read(stamps: &[f64]) -> Readings<f64> {
        let mut readings = Readings::default();
        stamps.iter().for_each(|stamp| readings.push(at(*stamp), 8, *stamp));
        readings
    }

    #[test]
    fn the_newest_until_a_time_counts_in_any_order_of_arrival() {
        let mut readings = read(&[1.0, 1.2, 1.1, 1.3]);
        assert_eq!(readings.newest_until(at(0.9)), None);
        assert_eq!(readings.newest_until(at(1.15)).map(|found| found.value), Some(1.1));
        assert_eq!(readings.first_stamp(), Some(at(1.1)), "older ones are dropped");
        assert_eq!(readings.newest_until(at(9.0)).map(|found| found.value), Some(1.3));
        assert_eq!(readings.newest_until(at(9.5)).map(|found| found.value), Some(1.3));
    }

    #[test]
    fn a_clock_that_jumps_back_begins_anew() {
        let mut readings = read(&[100.0, 3700.0, 100.1]);
        assert_eq!(readings.until(at(9999.0)).count(), 1);
        assert_eq!(readings.newest_until(at(100.2)).map(|found| found.value), Some(100.1));
    }

    #[test]
    fn memory_is_bounded() {
        let mut readings = Readings::default();
        for tick in 0..5000 {
            readings.push(at(0.01 * f64::from(tick)), 1, tick);
        }
        assert_eq!(readings.readings.len(), MAX_READINGS);
        let mut readings = Readings::default();
        for tick in 0..20 {
            readings.push(at(f64::from(tick)), 5 << 20, tick);
        }
        assert_eq!((readings.readings.len(), readings.bytes), (8, 40 << 20));
    }
}
