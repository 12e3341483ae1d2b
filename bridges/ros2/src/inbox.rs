//! Queue of messages for the thread that makes frames.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Queue with a few waiting messages of each topic. A slow reader misses the oldest.
#[derive(Debug)]
pub struct Inbox {
    topics: Mutex<BTreeMap<String, Topic>>,
    arrived: Condvar,
    /// Start of the clock for arrivals.
    opened: Instant,
}

/// Message of a topic, with its time of arrival.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// The topic.
    pub topic: String,
    /// Time since the inbox was opened, ns; not 0.
    pub arrival_ns: u64,
    /// The message, in CDR with its encapsulation header.
    pub message: Vec<u8>,
}

#[derive(Debug, Default)]
struct Topic {
    /// Messages with their times of arrival.
    waiting: VecDeque<(u64, Vec<u8>)>,
    traffic: Traffic,
}

impl Default for Inbox {
    fn default() -> Self {
        Self { topics: Mutex::default(), arrived: Condvar::new(), opened: Instant::now() }
    }
}

/// Numbers of received and of dropped messages of a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Messages that arrived.
    pub received: u64,
    /// Messages that were dropped because newer ones arrived before they were read.
    pub dropped: u64,
    /// Messages whose bytes do not match the type of their topic.
    pub malformed: u64,
}

impl Inbox {
    /// Adds a message. At most `room` messages of the same topic are kept; the oldest ones are
    /// dropped.
    pub fn push(&self, topic: &str, message: Vec<u8>, room: usize) {
        let arrival_ns = u64::try_from(self.opened.elapsed().as_nanos()).unwrap_or(u64::MAX).max(1);
        self.with_topic(topic, |Topic { waiting, traffic }| {
            waiting.push_back((arrival_ns, message));
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

    /// Returns all waiting messages by topic, in the order of arrival within each topic; empty if
    /// none arrives within `patience`.
    pub fn take(&self, patience: Duration) -> Vec<Arrival> {
        let waited = self.arrived.wait_timeout_while(self.lock(), patience, |topics| {
            topics.values().all(|topic| topic.waiting.is_empty())
        });
        let (mut topics, _) = waited.unwrap_or_else(PoisonError::into_inner);
        let all = topics.iter_mut().flat_map(|(name, topic)| {
            topic.waiting.drain(..).map(|(arrival_ns, message)| Arrival {
                topic: name.clone(),
                arrival_ns,
                message,
            })
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

/// Returns the messages that hold until the next one on their topic, however old they are: speed limits
/// and static transforms, which are published once.
pub(crate) fn lasting(arrivals: Vec<Arrival>, speed_limit: &str) -> Vec<Arrival> {
    let mut kept = arrivals;
    kept.retain(|Arrival { topic, .. }| topic == speed_limit || topic.ends_with("tf_static"));
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both are published once: a message that arrives while the node is inactive does not come again.
    #[test]
    fn limits_and_static_transforms_outlast_a_rest() {
        let inbox = Inbox::default();
        for topic in ["/image", "/tf", "/tf_static", "/robot1/tf_static", "speed_limit", "reset"] {
            (0..3).for_each(|i| inbox.push(topic, vec![i], 2));
        }
        let kept = lasting(inbox.take(Duration::ZERO), "speed_limit");
        let kept: Vec<(&str, u8)> =
            kept.iter().map(|arrival| (arrival.topic.as_str(), arrival.message[0])).collect();
        let expected = ["/robot1/tf_static", "/tf_static", "speed_limit"];
        assert_eq!(kept, expected.map(|topic| [(topic, 1), (topic, 2)]).concat());
    }

    #[test]
    fn the_oldest_are_dropped_and_counted() {
        let inbox = Inbox::default();
        (0..5).for_each(|i| inbox.push("images", vec![i], 2));
        (0..5).for_each(|i| inbox.push("odometry", vec![i], 64));
        let taken = inbox.take(Duration::ZERO);
        let images: Vec<_> = taken.iter().filter(|arrival| arrival.topic == "images").collect();
        assert_eq!([&images[0].message[..], &images[1].message[..]], [[3], [4]]);
        assert!(images.len() == 2 && images[0].arrival_ns <= images[1].arrival_ns);
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
            let taken = inbox.take(Duration::from_secs(60));
            assert_eq!((taken[0].topic.as_str(), &taken[0].message[..]), ("odometry", &[7][..]));
        });
    }
}
