use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tagalong::core::Stamp;

/// Number of first arrivals that are stored: those of a few streams during a frame that takes
/// seconds.
const ARRIVALS: usize = 512;
/// Maximum time for which [`ClockSource::Arrival`] continues after the newest frame; longer than
/// any command is valid, and short enough that a paused simulation resumes soon after its pause.
const LEAD: Duration = Duration::from_secs(1);

/// Clock for the age of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ClockSource {
    /// The clock of this machine, which must agree with that of the stamps.
    #[default]
    System,
    /// The stamp of the newest frame, plus the time since its image first arrived, at most a second:
    /// for simulated time, replayed logs and clocks that disagree. The time of transmission counts as
    /// none.
    Arrival,
}

/// Current time by the clock of the stamps, which never goes back.
///
/// Only a frame with a newer stamp than all before sets the clock of [`ClockSource::Arrival`]: an
/// image that is repeated, that is older, or that makes no frame, has no effect.
#[derive(Debug)]
pub(crate) struct StampClock {
    source: ClockSource,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Stamps of images with their first times of arrival, oldest arrival first.
    arrivals: VecDeque<(Stamp, Instant)>,
    /// Newest stamp of a frame, with the first arrival of its image.
    frame: Option<(Stamp, Instant)>,
    /// Latest time that was returned.
    latest: Stamp,
}

/// Timing of a frame that has just been made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameTiming {
    /// Time from the capture to now, s: by the clock of this machine, or from the first arrival of the
    /// image with [`ClockSource::Arrival`].
    pub(crate) latency_s: f64,
    /// Time by which the stamp is older than that of an earlier frame, s; 0 if it is newer.
    pub(crate) back_s: f64,
}

impl StampClock {
    pub(crate) fn new(source: ClockSource) -> Self {
        Self { source, state: Mutex::default() }
    }

    /// Records the arrival of an image. Of images with the same stamp, only the first counts.
    pub(crate) fn record_arrival(&self, stamp: Stamp) {
        let mut state = self.lock();
        if state.arrival(stamp).is_none() {
            state.arrivals.push_back((stamp, Instant::now()));
        }
        if state.arrivals.len() > ARRIVALS {
            state.arrivals.pop_front();
        }
    }

    /// Records that a frame was made from an image; returns its timing.
    pub(crate) fn record_frame(&self, stamp: Stamp) -> FrameTiming {
        let mut state = self.lock();
        let arrival = state.arrival(stamp).unwrap_or_else(Instant::now);
        let newest = state.frame.map(|(newest, _)| newest);
        if newest.is_none_or(|newest| stamp > newest) {
            state.frame = Some((stamp, arrival));
        }
        let latency_s = match self.source {
            ClockSource::System => state.now(self.source).seconds_since(stamp),
            ClockSource::Arrival => arrival.elapsed().as_secs_f64(),
        };
        let back_s = newest.map_or(0.0, |newest| newest.seconds_since(stamp).max(0.0));
        FrameTiming { latency_s, back_s }
    }

    pub(crate) fn now(&self) -> Stamp {
        self.lock().now(self.source)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// Returns the first arrival of an image with this stamp.
    fn arrival(&self, stamp: Stamp) -> Option<Instant> {
        // The newest are queried most often.
        self.arrivals.iter().rev().find(|(known, _)| *known == stamp).map(|(_, at)| *at)
    }

    fn now(&mut self, source: ClockSource) -> Stamp {
        let now = match source {
            ClockSource::System => system_time(),
            ClockSource::Arrival => self.since_frame(),
        };
        // If the clock went back, commands would be valid for longer.
        self.latest = self.latest.max(now);
        self.latest
    }

    fn since_frame(&self) -> Stamp {
        self.frame.map_or(Stamp::default(), |(stamp, at)| {
            stamp.plus_seconds(at.elapsed().min(LEAD).as_secs_f64())
        })
    }
}

/// Returns the time of this machine's clock.
pub(crate) fn system_time() -> Stamp {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Stamp::from_nanos(u64::try_from(since.as_nanos()).unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use std::thread::sleep;

    use super::*;

    fn at_s(seconds: u64) -> Stamp {
        Stamp::from_nanos(seconds * 1_000_000_000)
    }

    fn arrive_and_make(clock: &StampClock, stamp: Stamp) -> FrameTiming {
        clock.record_arrival(stamp);
        clock.record_frame(stamp)
    }

    #[test]
    fn the_time_of_arrival_goes_on_from_the_newest_frame() {
        let clock = StampClock::new(ClockSource::Arrival);
        assert_eq!(clock.now(), Stamp::default());
        clock.record_arrival(at_s(5));
        sleep(Duration::from_millis(20));
        assert_eq!(clock.now(), Stamp::default(), "an image that made no frame yet");
        let timing = clock.record_frame(at_s(5));
        assert!(timing.latency_s >= 0.02, "from the arrival: {timing:?}");
        let passed_s = clock.now().seconds_since(at_s(5));
        assert!(passed_s >= 0.02, "{passed_s}");
    }

    #[test]
    fn an_image_that_is_sent_again_changes_no_time() {
        let clock = StampClock::new(ClockSource::Arrival);
        arrive_and_make(&clock, at_s(5));
        sleep(Duration::from_millis(30));
        clock.record_arrival(at_s(5));
        assert!(clock.now().seconds_since(at_s(5)) >= 0.03);
        let again = arrive_and_make(&clock, at_s(5));
        assert!(again.latency_s >= 0.03 && again.back_s == 0.0, "{again:?}");
        assert!(clock.now().seconds_since(at_s(5)) >= 0.03);
    }

    #[test]
    fn the_clock_never_goes_back() {
        for source in [ClockSource::Arrival, ClockSource::System] {
            let clock = StampClock::new(source);
            arrive_and_make(&clock, at_s(5));
            let before = clock.now();
            clock.record_arrival(at_s(1));
            assert!(clock.now() >= before, "{source:?}: an old image");
            assert_eq!(clock.record_frame(at_s(1)).back_s, 4.0);
            assert!(clock.now() >= before, "{source:?}: a frame of an old image");
            sleep(Duration::from_millis(20));
            assert!(clock.now().seconds_since(before) >= 0.02, "{source:?}: nor does it stand");
        }
        // A simulation at half the speed: each frame is older than the time that has passed.
        let clock = StampClock::new(ClockSource::Arrival);
        let mut before = Stamp::default();
        for frame in 0..5 {
            arrive_and_make(&clock, Stamp::from_nanos(frame * 10_000_000));
            assert!(clock.now() >= before);
            sleep(Duration::from_millis(20));
            before = clock.now();
        }
        assert!(before.seconds_since(Stamp::from_nanos(40_000_000)) < 0.2, "it does not run away");
    }

    #[test]
    fn the_time_of_arrival_waits_for_a_paused_simulation() {
        let clock = StampClock::new(ClockSource::Arrival);
        clock.lock().frame = Instant::now().checked_sub(10 * LEAD).map(|at| (at_s(5), at));
        assert_eq!(clock.now(), at_s(6));
    }

    #[test]
    fn the_latency_is_the_age_by_the_clock_of_this_machine() {
        let clock = StampClock::new(ClockSource::System);
        let timing = arrive_and_make(&clock, system_time().plus_seconds(-0.3));
        assert!((0.3..0.5).contains(&timing.latency_s), "{timing:?}");
    }
}
