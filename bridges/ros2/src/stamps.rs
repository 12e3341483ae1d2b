use std::sync::{Mutex, PoisonError};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use tagalong_core::Stamp;

/// Clock for the age of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ClockSource {
    /// The clock of this machine, which must agree with that of the stamps.
    #[default]
    System,
    /// The stamp of the newest image, plus the time since it arrived: for simulated time, replayed
    /// logs and clocks that disagree. The time of transmission counts as none.
    Arrival,
}

/// Current time by the clock of the stamps.
#[derive(Debug)]
pub(crate) struct StampClock {
    source: ClockSource,
    heard: Mutex<Option<(Stamp, Instant)>>,
}

impl StampClock {
    pub(crate) fn new(source: ClockSource) -> Self {
        Self { source, heard: Mutex::new(None) }
    }

    /// Records the stamp of an image that has just arrived.
    pub(crate) fn hear(&self, stamp: Stamp) {
        *self.heard.lock().unwrap_or_else(PoisonError::into_inner) = Some((stamp, Instant::now()));
    }

    pub(crate) fn now(&self) -> Stamp {
        match self.source {
            ClockSource::System => system(),
            ClockSource::Arrival => self.since_heard(),
        }
    }

    fn since_heard(&self) -> Stamp {
        let heard = *self.heard.lock().unwrap_or_else(PoisonError::into_inner);
        heard.map_or(Stamp::default(), |(stamp, at)| stamp.plus_seconds(at.elapsed().as_secs_f64()))
    }
}

fn system() -> Stamp {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Stamp::from_nanos(u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use std::thread::sleep;
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_time_of_arrival_goes_on_from_the_newest_stamp() {
        let clock = StampClock::new(ClockSource::Arrival);
        assert_eq!(clock.now(), Stamp::default());
        clock.hear(Stamp::from_nanos(5_000_000_000));
        sleep(Duration::from_millis(20));
        let passed_s = clock.now().seconds_since(Stamp::from_nanos(5_000_000_000));
        assert!(passed_s >= 0.02, "{passed_s}");
        clock.hear(Stamp::from_nanos(1_000_000_000));
        assert!(clock.now() < Stamp::from_nanos(5_000_000_000), "a clock may be set back");
    }
}
