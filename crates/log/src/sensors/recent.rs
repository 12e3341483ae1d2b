//! The last messages of a sensor that is not synchronised with the images: a frame takes the
//! message nearest in time.

use std::collections::VecDeque;

use tagalong_core::Stamp;

use crate::msgs::LaserScan;
use crate::pairing::Payload;

/// Maximum time between a message and an image, s.
pub(crate) const NEAR_S: f64 = 0.25;

/// A message with a time.
pub(super) trait Stamped {
    fn stamp(&self) -> Stamp;
}

impl Stamped for LaserScan {
    fn stamp(&self) -> Stamp {
        self.header.stamp()
    }
}

impl Stamped for Payload {
    fn stamp(&self) -> Stamp {
        self.stamp
    }
}

/// The last messages, at most `MOST`, in the order of arrival.
pub(super) struct Recent<T, const MOST: usize>(VecDeque<T>);

impl<T, const MOST: usize> Default for Recent<T, MOST> {
    fn default() -> Self {
        Self(VecDeque::new())
    }
}

impl<T: Stamped, const MOST: usize> Recent<T, MOST> {
    /// Adds a message, and drops the oldest one if the buffer is full.
    pub(super) fn push(&mut self, message: T) {
        self.0.push_back(message);
        if self.0.len() > MOST {
            self.0.pop_front();
        }
    }

    /// Returns the message nearest to an image in time, if it is near enough.
    pub(super) fn near(&self, image: Stamp) -> Option<&T> {
        let aged = self.0.iter().map(|it| (it.stamp().seconds_since(image).abs(), it));
        let (off_s, nearest) = aged.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
        (off_s <= NEAR_S).then_some(nearest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msgs::Header;

    #[test]
    fn the_nearest_message_counts_and_one_of_long_ago_does_not() {
        let mut recent = Recent::<Payload, 64>::default();
        for i in 0..100 {
            let stamp = Stamp::default().plus_seconds(0.1 * f64::from(i));
            recent.push(Payload::new(Header::new(stamp, "lidar"), &[]));
        }
        // Those of long ago are dropped, and later on it is silent.
        for (seconds, expected) in [(7.03, Some(7.0)), (9.99, Some(9.9)), (1.0, None), (12.0, None)]
        {
            let found = recent.near(Stamp::default().plus_seconds(seconds));
            let stamp = expected.map(|seconds| Stamp::default().plus_seconds(seconds));
            assert_eq!(found.map(|message| message.stamp), stamp, "{seconds} s");
        }
    }
}
