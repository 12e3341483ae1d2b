use std::fmt;

/// Point in time: nanoseconds since the epoch of the log.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Debug)]
pub struct Stamp(u64);

impl Stamp {
    /// Creates a stamp from nanoseconds.
    pub const fn from_nanos(nanos: u64) -> Self {
        Self(nanos)
    }

    /// Returns the nanoseconds since the epoch.
    pub const fn nanos(self) -> u64 {
        self.0
    }

    /// Seconds from `earlier` to `self`; negative when `self` is the earlier one.
    ///
    /// ```
    /// use tagalong_core::Stamp;
    /// let (a, b) = (Stamp::from_nanos(1_000_000_000), Stamp::from_nanos(1_250_000_000));
    /// assert_eq!(b.seconds_since(a), 0.25);
    /// assert_eq!(a.seconds_since(b), -0.25);
    /// ```
    pub fn seconds_since(self, earlier: Self) -> f64 {
        (i128::from(self.0) - i128::from(earlier.0)) as f64 * 1e-9
    }

    /// Returns the stamp `seconds` later (earlier if negative), saturating at both ends.
    pub fn plus_seconds(self, seconds: f64) -> Self {
        // The sum may leave the range of `u64` on both sides.
        let nanos = i128::from(self.0) + (seconds * 1e9) as i128;
        Self(nanos.clamp(0, i128::from(u64::MAX)) as u64)
    }
}

impl fmt::Display for Stamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:09}", self.0 / 1_000_000_000, self.0 % 1_000_000_000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seconds_are_added_and_taken_away_and_end_at_the_ends() {
        let stamp = Stamp::from_nanos(2_000_000_000);
        assert_eq!(stamp.plus_seconds(0.5).nanos(), 2_500_000_000);
        assert_eq!(stamp.plus_seconds(-1.5).nanos(), 500_000_000);
        assert_eq!(stamp.plus_seconds(-9.0), Stamp::default());
        assert_eq!(stamp.plus_seconds(1e12).nanos(), u64::MAX);
    }

    #[test]
    fn the_time_between_stamps_has_a_sign() {
        let [early, late] = [1_000_000_000, 1_250_000_000].map(Stamp::from_nanos);
        assert_eq!((late.seconds_since(early), early.seconds_since(late)), (0.25, -0.25));
    }

    #[test]
    fn stamps_are_shown_in_seconds_to_the_nanosecond() {
        assert_eq!(Stamp::from_nanos(12_000_000_345).to_string(), "12.000000345");
    }
}
