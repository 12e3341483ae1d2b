//! Progress of a pass over a log.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Time between two pictures of a spinner.
const TICK: Duration = Duration::from_millis(100);
/// Steps of the bar.
const STEPS: u64 = 1000;

/// Progress bar, visible only where stderr is a terminal.
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

    /// Returns a bar at its beginning, with a word that says which of several passes it is.
    pub fn titled(title: &str) -> Self {
        let bar = ProgressBar::new(STEPS);
        if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent:>3}% {msg} {eta}") {
            bar.set_style(style);
        }
        let title = if title.is_empty() { String::new() } else { format!("{title}: ") };
        Self { bar, title }
    }

    /// Shows what is done, of unknown duration, while it is done.
    pub fn waiting<T>(message: &str, work: impl FnOnce() -> T) -> T {
        let spinner = ProgressBar::new_spinner().with_message(message.to_owned());
        spinner.enable_steady_tick(TICK);
        let done = work();
        spinner.finish_and_clear();
        done
    }

    /// Shows the progress of the run.
    pub fn show(&self, fraction: f64, frame: u64, people: usize) {
        self.tell(fraction, format!("{}frame {frame}, {people} in view", self.title));
    }

    /// Shows the progress of a pass of several pipelines, or of none.
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
