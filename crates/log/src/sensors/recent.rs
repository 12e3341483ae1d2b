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
pub(super) struct Recent<T, const MOST: usize> {
    messages: VecDeque<T>,
    /// Number of messages from before the last step back of their clock.
    outdated: usize,
    /// True from a jump of the clock of the frames on until the first frame after it.
    has_jumped: bool,
}

impl<T, const MOST: usize> Default for Recent<T, MOST> {
    fn default() -> Self {
        Self { messages: VecDeque::new(), outdated: 0, has_jumped: false }
    }
}

impl<T: Stamped, const MOST: usize> Recent<T, MOST> {
    /// Adds a message, and drops the oldest one if the buffer is full.
    pub(super) fn push(&mut self, message: T) {
        let stamp = message.stamp();
        if self.messages.back().is_some_and(|last| last.stamp().seconds_since(stamp) > NEAR_S) {
            self.outdated = self.messages.len();
        }
        self.messages.push_back(message);
        if self.messages.len() > MOST {
            self.messages.pop_front();
            self.outdated = self.outdated.saturating_sub(1);
        }
    }

    /// Marks that the clock of the frames has jumped back. Frames from before may still come.
    pub(super) fn set_aside(&mut self) {
        self.has_jumped = true;
    }

    /// Drops the messages from before a jump of the clock: the stamps of new frames come near theirs
    /// once more. Those that came since their own clock stepped back are kept.
    pub(super) fn restore(&mut self) {
        if !std::mem::take(&mut self.has_jumped) {
            return;
        }
        let count = if self.outdated > 0 { self.outdated } else { self.messages.len() };
        self.messages.drain(..count);
        self.outdated = 0;
    }

    /// Returns the message nearest to an image in time, if it is near enough.
    pub(super) fn near(&self, image: Stamp) -> Option<&T> {
        let aged = self.messages.iter().map(|it| (it.stamp().seconds_since(image).abs(), it));
        let (off_s, nearest) = aged.min_by(|(a, _), (b, _)| a.total_cmp(b))?;
        (off_s <= NEAR_S).then_some(nearest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::msgs::Header;

    fn push(recent: &mut Recent<Payload, 64>, seconds: f64, frame: &str) {
        let stamp = Stamp::default().plus_seconds(seconds);
        recent.push(Payload::new(Header::new(stamp, frame), &[]));
    }

    fn frame_near(recent: &Recent<Payload, 64>, seconds: f64) -> Option<&str> {
        let found = recent.near(Stamp::default().plus_seconds(seconds));
        found.map(|message| message.frame_id.as_str())
    }

    #[test]
    fn after_a_jump_of_the_clock_old_messages_are_not_near_again() {
        for has_new in [false, true] {
            let mut recent = Recent::<Payload, 64>::default();
            (0..40).for_each(|i| push(&mut recent, 10.0 + 0.1 * f64::from(i), "old"));
            if has_new {
                (0..3).for_each(|i| push(&mut recent, 11.0 + 0.1 * f64::from(i), "new"));
            }
            recent.restore();
            assert_eq!(frame_near(&recent, 13.9), Some("old"), "nothing has jumped");
            recent.set_aside();
            assert_eq!(frame_near(&recent, 13.9), Some("old"), "an earlier frame may come");
            recent.restore();
            assert_eq!(frame_near(&recent, 11.0), has_new.then_some("new"));
            assert_eq!(frame_near(&recent, 13.9), None);
            push(&mut recent, 11.3, "new");
            assert_eq!(frame_near(&recent, 11.3), Some("new"));
        }
    }

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
