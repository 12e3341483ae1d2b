use std::thread;
use std::time::{Duration, Instant};

use tagalong_app::signals::Signals;
use tagalong_core::Stamp;

/// Longest sleep between two looks for a signal.
const NAP: Duration = Duration::from_millis(50);

/// Longest pause in a log that is waited for.
const LONGEST: Duration = Duration::from_secs(5);

/// Pace of frames: as fast as they can be worked on, or as they were recorded.
pub struct Pace {
    real: bool,
    last: Option<(Stamp, Instant)>,
}

impl Pace {
    /// Returns the pace of the recording if `real`.
    pub fn new(real: bool) -> Self {
        Self { real, last: None }
    }

    /// Waits until a frame is due, or a signal comes. A log that is slower than the pipeline is
    /// held back, a pipeline that is late does not catch up.
    pub fn wait_for(&mut self, stamp: Stamp, signals: &Signals) {
        if !self.real {
            return;
        }
        let due = self.due(stamp, Instant::now());
        while signals.received().is_none() {
            let left = due.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            thread::sleep(left.min(NAP));
        }
    }

    /// Returns when a frame that is there now is due.
    fn due(&mut self, stamp: Stamp, now: Instant) -> Instant {
        let due = self.last.map_or(now, |(last, at)| at + between(last, stamp)).max(now);
        self.last = Some((stamp, due));
        due
    }
}

/// Returns the time from one stamp to the next; none where the clock jumps back.
fn between(last: Stamp, next: Stamp) -> Duration {
    let seconds = next.seconds_since(last).max(0.0);
    Duration::try_from_secs_f64(seconds).unwrap_or_default().min(LONGEST)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamp(seconds: f64) -> Stamp {
        Stamp::from_nanos((seconds * 1e9) as u64)
    }

    #[test]
    fn frames_come_as_they_were_recorded_and_jumps_cost_no_time() {
        let mut pace = Pace::new(true);
        let start = Instant::now();
        let stamps = [100.0, 100.1, 100.2, 3.0, 3.05];
        // The first frame is late for none: each is there as soon as the one before was worked on.
        let mut now = start;
        for (at, expected_s) in stamps.into_iter().zip([0.0, 0.1, 0.2, 0.2, 0.25]) {
            now = pace.due(stamp(at), now);
            let due_s = (now - start).as_secs_f64();
            assert!((due_s - expected_s).abs() < 1e-6, "{at}: {due_s}");
        }
        assert_eq!(between(stamp(1.0), stamp(1000.0)), LONGEST);
    }

    #[test]
    fn a_pipeline_that_is_late_does_not_catch_up() {
        let mut pace = Pace::new(true);
        let start = Instant::now();
        let late = start + Duration::from_millis(700);
        assert_eq!(pace.due(stamp(1.0), start), start);
        assert_eq!(pace.due(stamp(1.1), late), late);
        assert_eq!(pace.due(stamp(1.2), late), late + between(stamp(1.1), stamp(1.2)));
    }

    #[test]
    fn a_frame_is_waited_for() {
        let signals = Signals::listen().unwrap();
        let mut pace = Pace::new(true);
        let start = Instant::now();
        pace.wait_for(stamp(1.0), &signals);
        pace.wait_for(stamp(1.08), &signals);
        assert!(start.elapsed() >= Duration::from_millis(80), "longer than a nap");
    }

    #[test]
    fn without_a_pace_nothing_waits() {
        let signals = Signals::listen().unwrap();
        let mut pace = Pace::new(false);
        pace.wait_for(stamp(1.0), &signals);
        assert!(pace.last.is_none(), "no frame is due after another");
    }
}
