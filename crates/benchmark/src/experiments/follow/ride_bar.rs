use std::sync::atomic::{AtomicU64, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use tagalong_app::progress::Forecast;

/// Steps of the bar per simulated second.
const STEPS_PER_S: f64 = 10.0;

/// Progress of many rides, by simulated time: a bar if stderr is a terminal, and a forecast in
/// words for long runs.
pub struct RidesBar {
    bar: ProgressBar,
    forecast: Forecast,
    rides: u64,
    done: AtomicU64,
}

/// Progress of one of these rides.
pub struct RideBar {
    bar: ProgressBar,
    steps: u64,
    shown: u64,
}

fn steps(time_s: f64) -> u64 {
    (time_s * STEPS_PER_S).round() as u64
}

impl RidesBar {
    /// Creates a bar for rides of these durations, s.
    pub fn new(durations_s: impl Iterator<Item = f64>) -> Self {
        let durations: Vec<u64> = durations_s.map(steps).collect();
        let rides = durations.len() as u64;
        let bar = ProgressBar::new(durations.iter().sum());
        let template = "{wide_bar} {percent:>3}% {msg} {eta}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(format!("0 of {rides} rides"));
        let forecast = Forecast::new(durations.len(), "rides");
        Self { bar, forecast, rides, done: AtomicU64::new(0) }
    }

    /// Returns the progress of one ride of this duration, s.
    pub fn of_ride(&self, duration_s: f64) -> RideBar {
        RideBar { bar: self.bar.clone(), steps: steps(duration_s), shown: 0 }
    }

    /// Notes that a ride is done.
    pub fn advance(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        self.bar.set_message(format!("{done} of {} rides", self.rides));
        self.forecast.advance();
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl RideBar {
    /// Shows the time since the start of the ride, s.
    pub fn show(&mut self, at_s: f64) {
        let now = steps(at_s).min(self.steps);
        if now > self.shown {
            self.bar.inc(now - self.shown);
            self.shown = now;
        }
    }
}

impl Drop for RideBar {
    fn drop(&mut self) {
        // A ride that ended early is done as well.
        self.bar.inc(self.steps.saturating_sub(self.shown));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rides_add_up_to_the_whole_bar_also_where_one_ends_early() {
        let bar = RidesBar::new([20.0, 10.0].into_iter());
        let mut long = bar.of_ride(20.0);
        long.show(5.0);
        long.show(5.02);
        assert_eq!((bar.bar.position(), bar.bar.length()), (50, Some(300)));
        drop(long);
        let mut short = bar.of_ride(10.0);
        short.show(99.0);
        drop(short);
        assert_eq!(bar.bar.position(), 300);
    }
}
