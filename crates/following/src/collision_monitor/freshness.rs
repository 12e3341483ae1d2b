//! Age of the newest reading of a sensor.

use tagalong_core::Stamp;

/// Newest reading of a sensor: which one it is, and its age. A reading that stands in several frames
/// is one reading.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Freshness {
    stamp: Option<Stamp>,
    /// True if the last frame had a reading, new or not.
    delivers: bool,
    /// Time since the newest reading, s; `None` before the first one.
    age_s: Option<f64>,
}

impl Freshness {
    /// Takes in the stamp and the age, s, of the reading of a frame, `dt_s` after the frame before.
    /// Returns true for a new reading.
    pub(super) fn update(&mut self, reading: Option<(Stamp, f64)>, dt_s: f64) -> bool {
        self.delivers = reading.is_some();
        let fresh = reading.filter(|(stamp, _)| self.stamp != Some(*stamp));
        if let Some((stamp, age_s)) = fresh {
            self.stamp = Some(stamp);
            self.age_s = Some(age_s);
        } else {
            self.age_s = self.age_s.map(|age_s| age_s + dt_s.max(0.0));
        }
        fresh.is_some()
    }

    /// Takes a sensor that is read, but has not delivered yet, as silent.
    pub(super) fn expect(&mut self) {
        self.age_s.get_or_insert(f64::INFINITY);
    }

    /// Takes the newest reading as infinitely old, because what it showed is forgotten: the same reading
    /// again is not new.
    pub(super) fn clear(&mut self) {
        self.age_s = self.age_s.map(|_| f64::INFINITY);
    }

    /// Returns true if the last frame had a reading, new or not.
    pub(super) fn delivers(self) -> bool {
        self.delivers
    }

    /// Returns true if the sensor once delivered, or is expected to, and its newest reading is older than `patience_s`.
    pub(super) fn is_silent(self, patience_s: f64) -> bool {
        // Positive comparison, so that an age that is no number counts as silence.
        self.age_s.is_some_and(|age_s| {
            let is_young = age_s <= patience_s;
            !is_young
        })
    }

    /// Returns true if the sensor never delivered.
    pub(super) fn is_unknown(self) -> bool {
        self.age_s.is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Stamp {
        Stamp::default().plus_seconds(seconds)
    }

    #[test]
    fn a_reading_that_comes_again_is_not_new_and_grows_old() {
        let mut freshness = Freshness::default();
        assert!(freshness.is_unknown() && !freshness.is_silent(0.5));
        assert!(freshness.update(Some((at(1.0), 0.1)), 0.2));
        for _ in 0..2 {
            assert!(!freshness.update(Some((at(1.0), 0.1)), 0.2));
        }
        assert!(freshness.delivers() && !freshness.is_silent(0.55));
        assert!(!freshness.update(None, 0.2));
        assert!(!freshness.delivers() && freshness.is_silent(0.55));
        assert!(freshness.update(Some((at(1.8), 0.0)), 0.2) && !freshness.is_silent(0.0));
    }

    #[test]
    fn an_age_that_is_no_number_is_silence() {
        let mut freshness = Freshness::default();
        freshness.update(Some((at(1.0), f64::NAN)), 0.1);
        assert!(freshness.is_silent(5.0));
    }
}
