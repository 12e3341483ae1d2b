//! Progress of a pass over a log.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::outcome::say;
use tagalong_math::counted;

/// Time between two frames of a spinner.
const TICK: Duration = Duration::from_millis(100);
/// Number of steps of the bar.
const STEPS: u64 = 1000;

/// Progress bar, which is visible only if stderr is a terminal.
pub struct Progress {
    bar: ProgressBar,
    title: String,
}

impl Default for Progress {
    fn default() -> Self {
        Self::new()
    }
}

impl Progress {
    /// Returns a bar at its beginning.
    pub fn new() -> Self {
        Self::titled("")
    }

    /// Returns a bar at its beginning, with a title that distinguishes several passes.
    pub fn titled(title: &str) -> Self {
        let bar = ProgressBar::new(STEPS);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent:>3}% {msg} {eta}") {
            bar.set_style(style);
        }
        let title = if title.is_empty() { String::new() } else { format!("{title}: ") };
        Self { bar, title }
    }

    /// Shows a message with a spinner while work of unknown duration is done.
    pub fn waiting<T>(message: &str, work: impl FnOnce() -> T) -> T {
        let spinner = ProgressBar::new_spinner().with_message(message.to_owned());
        let (ends, ended) = channel();
        let done = thread::scope(|scope| {
            if !spinner.is_hidden() {
                let spinner = &spinner;
                // If a thread cannot be started, the spinner does not turn, but the work continues.
                let _ =
                    thread::Builder::new().spawn_scoped(scope, move || turn_until(&ended, spinner));
            }
            // Dropped at the end of the work, even after a panic.
            let _ends: Sender<()> = ends;
            work()
        });
        spinner.finish_and_clear();
        done
    }

    /// Shows the progress of the run.
    pub fn show(&self, fraction: f64, frame: u64, people: usize) {
        self.tell(fraction, format!("{}frame {frame}, {people} in view", self.title));
    }

    /// Shows the progress of a pass with several pipelines, or with none.
    pub fn advance(&self, fraction: f64, frame: u64) {
        self.tell(fraction, format!("{}frame {frame}", self.title));
    }

    fn tell(&self, fraction: f64, message: String) {
        self.bar.set_position((fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
        self.bar.set_message(message);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Turns a spinner until the other end of the channel is dropped.
fn turn_until(ended: &Receiver<()>, spinner: &ProgressBar) {
    while ended.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
        spinner.tick();
    }
}

/// Duration from which on a forecast is reported.
const LONG: Duration = Duration::from_secs(60);

/// Forecast of the time of many tasks, reported once, even if no bar is visible.
pub struct Forecast {
    total: u64,
    kind: &'static str,
    done: AtomicU64,
    start: Instant,
    /// Number of tasks done when the forecast was last considered.
    told: AtomicU64,
}

impl Forecast {
    /// Starts a forecast, and reports the number of tasks.
    pub fn new(total: usize, kind: &'static str) -> Self {
        if total > 1 {
            say(&format!("{total} {kind}"));
        }
        let done = AtomicU64::new(0);
        let told = AtomicU64::new(0);
        Self { total: total as u64, kind, done, start: Instant::now(), told }
    }

    /// Notes that a task is done. After one in twenty it reports how long all of them will take, if
    /// that is more than a minute.
    pub fn advance(&self) {
        self.advance_by(1);
    }

    /// Notes that this number of tasks ended together: their time is that of all of them.
    pub fn advance_by(&self, count: usize) {
        if let Some(sentence) = self.sentence_after(count, self.start.elapsed()) {
            say(&sentence);
        }
    }

    /// Counts tasks, and returns the forecast if it is due.
    fn sentence_after(&self, count: usize, took: Duration) -> Option<String> {
        let done = self.done.fetch_add(count as u64, Ordering::Relaxed) + count as u64;
        let due = self.total.div_ceil(20).max(1);
        if done < due || self.told.swap(done, Ordering::Relaxed) > 0 {
            return None;
        }
        sentence(done, self.total, took, self.kind)
    }
}

/// Returns the forecast in words; `None` for less than a minute.
fn sentence(done: u64, total: u64, took: Duration, kind: &str) -> Option<String> {
    let left = took.mul_f64(total.saturating_sub(done) as f64 / done.max(1) as f64);
    let minutes = counted((left.as_secs_f64() / 60.0).ceil() as u64, "minute");
    let seconds = took.as_secs_f64();
    (left >= LONG)
        .then(|| format!("{done} of {total} {kind} took {seconds:.0} s: about {minutes} more"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_work_is_told_beforehand_and_a_short_one_is_not() {
        fn after(seconds: u64) -> Option<String> {
            sentence(20, 384, Duration::from_secs(seconds), "tasks")
        }

        assert_eq!(after(33).unwrap(), "20 of 384 tasks took 33 s: about 11 minutes more");
        assert_eq!(after(3), None);
        assert_eq!(after(6).unwrap(), "20 of 384 tasks took 6 s: about 2 minutes more");
        assert_eq!(sentence(1, 1, Duration::from_secs(900), "tasks"), None);
    }

    #[test]
    fn tasks_that_end_together_took_their_time_together() {
        // One pass over a log for 12 of 24 tasks: as long again, not 23 times as long.
        let forecast = Forecast::new(24, "tasks");
        let told = forecast.sentence_after(12, Duration::from_secs(60));
        assert_eq!(told.as_deref(), Some("12 of 24 tasks took 60 s: about 1 minute more"));
        assert_eq!(forecast.sentence_after(12, Duration::from_secs(900)), None, "told once");
        assert_eq!(Forecast::new(24, "tasks").sentence_after(12, Duration::from_secs(26)), None);
    }
}
