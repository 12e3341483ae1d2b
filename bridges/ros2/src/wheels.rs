//! Thread that sends commands to the wheels.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tagalong_core::{Stamp, WheelSpeeds};
use tagalong_pipeline::Orders;

/// Duration of zero commands after the last frame, s; then none are sent, so that other nodes may
/// drive (the `stop_pub_timeout` of Nav2).
const ZEROS_S: f64 = 2.0;
/// Number of zero commands at the end, and time between them.
const FAREWELLS: u32 = 5;
const BETWEEN_FAREWELLS: Duration = Duration::from_millis(10);

/// Sends commands to the wheels at a steady rate, from the last orders; zero when these have
/// expired, and zero at the end, also after an error.
pub struct Wheels {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<CommandCounts>>,
}

/// Numbers of commands sent to the wheels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CommandCounts {
    /// Commands in total.
    pub commands: u64,
    /// Commands of zero speed.
    pub zeros: u64,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Clone, Copy, Default)]
struct State {
    orders: Option<Orders>,
    /// Time at which the last frame was processed.
    frame: Option<Instant>,
    /// True if the orders have not been sent yet.
    is_new: bool,
    quits: bool,
}

impl State {
    /// Returns the command for this time, if any.
    fn command(&self, now: Stamp) -> Option<WheelSpeeds> {
        let wheels = self.orders.map_or(WheelSpeeds::STOP, |orders| orders.at(now).wheels);
        let recent = self.frame.is_some_and(|at| at.elapsed().as_secs_f64() <= ZEROS_S);
        (recent || wheels != WheelSpeeds::STOP).then_some(wheels)
    }
}

impl Wheels {
    /// Starts the thread. `now` returns the time by the clock of the frames' stamps, `tell` sends
    /// wheel speeds and must not wait.
    pub fn start(
        period: Duration,
        now: impl Fn() -> Stamp + Send + 'static,
        tell: impl FnMut(WheelSpeeds) + Send + 'static,
    ) -> Self {
        let shared = Arc::new(Shared::default());
        let theirs = Arc::clone(&shared);
        let thread = thread::spawn(move || theirs.drive(period, now, tell));
        Self { shared, thread: Some(thread) }
    }

    /// Sets the orders that hold until the next frame; `None` is a stop.
    pub fn obey(&self, orders: Option<Orders>) {
        let mut state = self.shared.lock();
        *state = State { orders, frame: Some(Instant::now()), is_new: true, ..*state };
        self.shared.changed.notify_all();
    }

    /// Stops the robot and the thread; returns the counts of commands.
    pub fn finish(mut self) -> CommandCounts {
        self.quit()
    }

    fn quit(&mut self) -> CommandCounts {
        self.shared.lock().quits = true;
        self.shared.changed.notify_all();
        // Taken, because `finish` drops the value, which quits once more.
        let told = self.thread.take().map(JoinHandle::join);
        told.and_then(Result::ok).unwrap_or_default()
    }
}

impl Drop for Wheels {
    fn drop(&mut self) {
        self.quit();
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn drive(
        &self,
        period: Duration,
        now: impl Fn() -> Stamp,
        mut tell: impl FnMut(WheelSpeeds),
    ) -> CommandCounts {
        let mut told = CommandCounts::default();
        let mut count_and_tell = |wheels| {
            told.commands += 1;
            told.zeros += u64::from(wheels == WheelSpeeds::STOP);
            tell(wheels);
        };
        while let Some(state) = self.wait(period) {
            state.command(now()).into_iter().for_each(&mut count_and_tell);
        }
        for _ in 0..FAREWELLS {
            count_and_tell(WheelSpeeds::STOP);
            thread::sleep(BETWEEN_FAREWELLS);
        }
        told
    }

    /// Waits for new orders, but no longer than a period; returns `None` at the end.
    fn wait(&self, period: Duration) -> Option<State> {
        let idle = |state: &mut State| !state.is_new && !state.quits;
        let waited = self.changed.wait_timeout_while(self.lock(), period, idle);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.is_new = false;
        (!state.quits).then_some(*state)
    }
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    /// All sent commands with their times.
    type Tape = Arc<Mutex<Vec<(Instant, WheelSpeeds)>>>;

    fn start(tape: &Tape) -> Wheels {
        let tape = Arc::clone(tape);
        let tell = move |wheels| tape.lock().unwrap().push((Instant::now(), wheels));
        Wheels::start(Duration::from_millis(5), Stamp::default, tell)
    }

    #[test]
    fn nothing_is_told_before_the_first_frame_and_zero_at_the_end() {
        let tape = Tape::default();
        let wheels = start(&tape);
        thread::sleep(Duration::from_millis(30));
        assert!(tape.lock().unwrap().is_empty());
        let told = wheels.finish();
        assert_eq!((told.commands, told.zeros), (u64::from(FAREWELLS), u64::from(FAREWELLS)));
        assert_eq!(tape.lock().unwrap().last().map(|(_, wheels)| *wheels), Some(WheelSpeeds::STOP));
    }

    #[test]
    fn a_stop_is_repeated_and_then_left_to_others() {
        let tape = Tape::default();
        let wheels = start(&tape);
        let from = Instant::now();
        wheels.obey(None);
        thread::sleep(Duration::from_secs_f64(ZEROS_S + 0.5));
        let last = tape.lock().unwrap().last().map(|(at, _)| at.duration_since(from)).unwrap();
        assert!(tape.lock().unwrap().len() > 20);
        assert!((1.5..ZEROS_S + 0.3).contains(&last.as_secs_f64()), "{last:?}");
        drop(wheels);
    }

    #[test]
    fn a_panic_on_the_way_ends_in_zero() {
        let tape = Tape::default();
        let result = catch_unwind(AssertUnwindSafe(|| {
            let _wheels = start(&tape);
            std::panic::panic_any("on purpose");
        }));
        assert!(result.is_err());
        assert_eq!(tape.lock().unwrap().len(), FAREWELLS as usize);
    }
}
