//! Gate of a topic that lets the robot move: it accepts a single publisher, and only messages that
//! are recent by the clock of their publisher.
//!
//! With two programs on one enable topic, neither could stop the robot: if the operator of one lets
//! go, the other program keeps it moving. A message that was delayed, in a queue or by a network
//! outage, shows nothing about the operator's hand now.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use ros2_client::{Gid, MessageInfo};
use tagalong::core::Stamp;

/// Origin of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Origin {
    /// Identity of the publisher.
    pub(crate) publisher: Gid,
    /// Time at which the message was published, by the clock of its machine; `None` if the
    /// middleware does not report it, and the time of arrival counts.
    pub(crate) published: Option<Stamp>,
}

impl From<&MessageInfo> for Origin {
    fn from(info: &MessageInfo) -> Self {
        let nanos = info.source_timestamp().and_then(|time| u64::try_from(time.to_nanos()).ok());
        Self { publisher: info.publisher_gid(), published: nanos.map(Stamp::from_nanos) }
    }
}

/// Reason why a message does not count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Unfit {
    /// The topic has more than one publisher.
    Contested,
    /// Age of the message by the clock of its publisher, s; negative if that clock is ahead of this
    /// machine's.
    Untimely(f64),
}

/// Gate of one topic.
#[derive(Debug)]
pub(crate) struct Gate {
    lifespan: Duration,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Number of discovered publishers.
    discovered: usize,
    /// Publisher of the last message, with its time of arrival.
    last: Option<(Gid, Instant)>,
    untimely: u64,
    /// Age of the first untimely message that was not reported yet, s.
    untold_s: Option<f64>,
    /// True if the last message was untimely.
    is_untimely: bool,
}

impl Gate {
    /// Creates a gate for messages that count for `lifespan` after their publication.
    pub(crate) fn new(lifespan: Duration) -> Self {
        Self { lifespan, state: Mutex::default() }
    }

    /// Returns the age of a message that counts; `now` and `clock` are its time of arrival.
    ///
    /// # Errors
    /// [`Unfit`] for a message that does not count.
    pub(crate) fn admit(
        &self,
        origin: Origin,
        now: Instant,
        clock: Stamp,
    ) -> Result<Duration, Unfit> {
        let mut state = self.lock();
        let before = state.last.replace((origin.publisher, now));
        let is_other = before.is_some_and(|(publisher, at)| {
            publisher != origin.publisher && now.saturating_duration_since(at) <= self.lifespan
        });
        if state.discovered > 1 || is_other {
            return Err(Unfit::Contested);
        }
        let age_s = origin.published.map_or(0.0, |published| clock.seconds_since(published));
        let lifespan_s = self.lifespan.as_secs_f64();
        // If it is ahead by more than that, nothing is known about its true age.
        if !(-lifespan_s..=lifespan_s).contains(&age_s) {
            if !state.is_untimely {
                state.untold_s = Some(age_s);
            }
            state.untimely += 1;
            state.is_untimely = true;
            return Err(Unfit::Untimely(age_s));
        }
        state.is_untimely = false;
        Ok(Duration::from_secs_f64(age_s.max(0.0)))
    }

    /// Sets the number of discovered publishers.
    pub(crate) fn set_discovered(&self, publishers: usize) {
        self.lock().discovered = publishers;
    }

    /// Returns the number of discovered publishers.
    pub(crate) fn discovered(&self) -> usize {
        self.lock().discovered
    }

    /// Returns the number of messages that were ignored because of their age.
    pub(crate) fn untimely(&self) -> u64 {
        self.lock().untimely
    }

    /// Returns the age of an untimely message, s, once for each series of them.
    pub(crate) fn take_untold(&self) -> Option<f64> {
        self.lock().untold_s.take()
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIFESPAN: Duration = Duration::from_millis(500);

    fn origin(publisher: u8, published_ms: u64) -> Origin {
        let published = Some(Stamp::from_nanos(published_ms * 1_000_000));
        Origin { publisher: Gid::from([publisher; 16]), published }
    }

    fn clock(ms: u64) -> Stamp {
        Stamp::from_nanos(ms * 1_000_000)
    }

    #[test]
    fn a_message_counts_by_the_time_of_its_publisher() {
        let gate = Gate::new(LIFESPAN);
        let now = Instant::now();
        for (published_ms, age) in [
            (8_700, Ok(Duration::from_millis(300))),
            (8_500, Ok(LIFESPAN)),
            (8_499, Err(Unfit::Untimely(0.501))),
            (1_000, Err(Unfit::Untimely(8.0))),
        ] {
            assert_eq!(gate.admit(origin(1, published_ms), now, clock(9_000)), age);
        }
        assert_eq!(
            (gate.untimely(), gate.take_untold(), gate.take_untold()),
            (2, Some(0.501), None)
        );
        let [little, much] = [9_400, 9_600].map(|ms| gate.admit(origin(1, ms), now, clock(9_000)));
        assert_eq!(little, Ok(Duration::ZERO), "clocks differ a little");
        assert!(matches!(much, Err(Unfit::Untimely(age_s)) if age_s < -0.5), "clocks differ");
        assert!(gate.take_untold().is_some_and(|age_s| age_s < -0.5));
        let unknown = Origin { published: None, ..origin(1, 0) };
        assert_eq!(gate.admit(unknown, now, clock(9_000)), Ok(Duration::ZERO), "by arrival");
    }

    #[test]
    fn two_publishers_close_the_gate_by_their_messages_or_by_discovery() {
        let gate = Gate::new(LIFESPAN);
        let start = Instant::now();
        // A publisher that takes over later is a hand of its own. Where two are discovered, no
        // message counts, though the other is silent.
        for (publisher, after_ms, discovered, is_fit) in [
            (1, 0, None, true),
            (2, 400, None, false),
            (1, 500, None, false),
            (1, 600, None, true),
            (2, 1_200, None, true),
            (2, 1_300, Some(2), false),
            (2, 1_400, Some(1), true),
        ] {
            if let Some(discovered) = discovered {
                gate.set_discovered(discovered);
            }
            let now = start + Duration::from_millis(after_ms);
            let admitted = gate.admit(origin(publisher, 9_000), now, clock(9_000));
            assert_eq!(admitted.is_ok(), is_fit, "{after_ms}");
            assert!(is_fit || admitted == Err(Unfit::Contested), "{after_ms}: {admitted:?}");
        }
    }
}
