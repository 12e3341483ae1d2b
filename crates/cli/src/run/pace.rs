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
        let now = Instant::now();
        let due = self.last.map_or(now, |(last, at)| at + between(last, stamp));
        while signals.received().is_none() {
            let left = due.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            thread::sleep(left.min(NAP));
        }
        self.last = Some((stamp, due.max(now)));
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
        let signals = Signals::listen().unwrap();
        let mut pace = Pace::new(true);
        let start = Instant::now();
        for at in [100.0, 100.1, 100.2, 3.0, 3.05] {
            pace.wait_for(stamp(at), &signals);
        }
        let took = start.elapsed().as_secs_f64();
        assert!((0.25..1.0).contains(&took), "{took}");
        assert_eq!(between(stamp(1.0), stamp(1000.0)), LONGEST);
    }

    #[test]
    fn without_a_pace_nothing_waits() {
        let signals = Signals::listen().unwrap();
        let mut pace = Pace::new(false);
        let start = Instant::now();
        for at in [1.0, 100.0] {
            pace.wait_for(stamp(at), &signals);
        }
        assert!(start.elapsed().as_secs_f64() < 0.5);
    }
}
