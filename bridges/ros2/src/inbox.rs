//! Queue of messages for the thread that makes frames.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Waiting messages, a few of each topic. A slow reader misses the oldest.
#[derive(Debug, Default)]
pub struct Inbox {
    topics: Mutex<BTreeMap<String, Topic>>,
    arrived: Condvar,
}

#[derive(Debug, Default)]
struct Topic {
    waiting: VecDeque<Vec<u8>>,
    traffic: Traffic,
}

/// Numbers of received and of dropped messages of a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Messages that arrived.
    pub received: u64,
    /// Messages that were dropped because newer ones arrived before they were read.
    pub dropped: u64,
    /// Messages whose bytes are not of the type that their topic states.
    pub malformed: u64,
}

impl Inbox {
    /// Adds a message; of the same topic, `room` are kept and the oldest dropped.
    pub fn push(&self, topic: &str, message: Vec<u8>, room: usize) {
        self.with_topic(topic, |Topic { waiting, traffic }| {
            waiting.push_back(message);
            traffic.received += 1;
            while waiting.len() > room {
                waiting.pop_front();
                traffic.dropped += 1;
            }
        });
        self.arrived.notify_all();
    }

    /// Counts a message that cannot be decoded.
    pub fn count_malformed(&self, topic: &str) {
        self.with_topic(topic, |topic| topic.traffic.malformed += 1);
    }

    fn with_topic(&self, name: &str, change: impl FnOnce(&mut Topic)) {
        let mut topics = self.lock();
        // `entry` would allocate the name for each message.
        if !topics.contains_key(name) {
            topics.insert(name.to_owned(), Topic::default());
        }
        topics.get_mut(name).map(change);
    }

    /// Returns all waiting messages by topic, in the order of arrival within a topic; empty if none
    /// arrives within `patience`.
    pub fn take(&self, patience: Duration) -> Vec<(String, Vec<u8>)> {
        let empty = |topics: &mut BTreeMap<String, Topic>| {
            topics.values().all(|topic| topic.waiting.is_empty())
        };
        let waited = self.arrived.wait_timeout_while(self.lock(), patience, empty);
        let (mut topics, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let all = topics.iter_mut().flat_map(|(name, topic)| {
            topic.waiting.drain(..).map(|message| (name.clone(), message))
        });
        all.collect()
    }

    /// Returns the message counts since the start, by topic.
    pub fn traffic(&self) -> BTreeMap<String, Traffic> {
        self.lock().iter().map(|(name, topic)| (name.clone(), topic.traffic)).collect()
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Topic>> {
        self.topics.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_are_dropped_and_counted() {
        let inbox = Inbox::default();
        (0..5).for_each(|i| inbox.push("images", vec![i], 2));
        (0..5).for_each(|i| inbox.push("odometry", vec![i], 64));
        let taken = inbox.take(Duration::ZERO);
        let images: Vec<_> = taken.iter().filter(|(topic, _)| topic == "images").collect();
        assert_eq!(images, [&("images".into(), vec![3]), &("images".into(), vec![4])]);
        assert_eq!(taken.len(), 7);
        assert_eq!(inbox.traffic()["images"], Traffic { received: 5, dropped: 3, malformed: 0 });
        assert!(inbox.take(Duration::from_millis(1)).is_empty());
    }

    #[test]
    fn malformed_messages_are_counted_and_wake_no_reader() {
        let inbox = Inbox::default();
        (0..2).for_each(|_| inbox.count_malformed("odometry"));
        assert!(inbox.take(Duration::ZERO).is_empty());
        assert_eq!(inbox.traffic()["odometry"].malformed, 2);
    }

    #[test]
    fn whoever_waits_is_woken() {
        let inbox = Inbox::default();
        std::thread::scope(|scope| {
            scope.spawn(|| inbox.push("odometry", vec![7], 64));
            assert_eq!(inbox.take(Duration::from_secs(60)), [("odometry".into(), vec![7])]);
        });
    }
}
