//! Thread that sends commands to the wheels.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tagalong::core::{Stamp, WheelSpeeds};
use tagalong::pipeline::{Enable, EnableSwitch, Orders, Permission};

use crate::{BridgeError, threads};

/// Time for which zero commands are sent after the last frame, or after the last time with
/// permission to move, s; then nothing is sent, so that other nodes may drive (the
/// `stop_pub_timeout` of Nav2).
const ZEROS_S: f64 = 2.0;
/// Number of zero commands at the end, and the time between them.
const FAREWELLS: u32 = 5;
const BETWEEN_FAREWELLS: Duration = Duration::from_millis(10);

/// Sends commands to the wheels at a constant rate, from the last orders; zero when these have
/// expired or the switch gives no permission, and zero at the end, even after an error.
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

/// Access to the switch of the wheels for the threads that receive its topics. It waits for no
/// frame.
#[derive(Clone)]
pub struct SwitchHandle {
    shared: Arc<Shared>,
}

impl SwitchHandle {
    /// Returns the time by the clock of the switch.
    pub fn now(&self) -> Duration {
        self.shared.started.elapsed()
    }

    /// Applies an event of the switch that happened at a time, and notifies the wheels at once.
    pub fn take(&self, event: Enable, at: Duration) {
        let mut state = self.shared.lock();
        state.switch.take(event, at);
        // An enable does not require another command.
        state.is_new = event != Enable::On;
        self.shared.changed.notify_all();
    }

    /// Returns the permission to move.
    pub fn permission(&self) -> Permission {
        self.shared.lock().switch.permission(self.now())
    }

    /// Stops the robot and ends the commands: zeros are sent if others were before, then nothing
    /// until [`SwitchHandle::resume`]. The switch latches, so that a resume alone moves nothing.
    pub fn halt(&self, cause: &'static str) {
        let now = self.now();
        let mut state = self.shared.lock();
        state.switch.take(Enable::Fault(cause), now);
        *state = State { orders: None, is_active: false, is_new: true, ..*state };
        self.shared.changed.notify_all();
    }

    /// Allows commands again after [`SwitchHandle::halt`].
    pub fn resume(&self) {
        let mut state = self.shared.lock();
        // The orders of a frame that was being processed at the halt are old.
        *state = State { orders: None, is_active: true, ..*state };
    }

    /// Sets the node that drives.
    pub(crate) fn set_driver(&self, driver: Driver) {
        let mut state = self.shared.lock();
        if state.driver != driver {
            *state = State { driver, is_new: true, ..*state };
            self.shared.changed.notify_all();
        }
    }
}

/// Node that drives the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Driver {
    /// This node.
    #[default]
    Bridge,
    /// Another node, as long as the switch gives permission: until then this node sends nothing.
    Other,
    /// Another node that should have stopped but did not confirm it: zeros are sent in any case.
    Unconfirmed,
}

struct Shared {
    state: Mutex<State>,
    changed: Condvar,
    /// Start of the clock of the switch.
    started: Instant,
}

#[derive(Clone, Copy)]
struct State {
    orders: Option<Orders>,
    switch: EnableSwitch,
    /// Last time at which the switch gave permission.
    permitted: Option<Duration>,
    /// Time at which the last frame was processed.
    frame: Option<Instant>,
    /// True if the orders have not been sent yet.
    is_new: bool,
    /// False after a halt, when no commands are sent.
    is_active: bool,
    driver: Driver,
    quits: bool,
}

impl State {
    /// Returns the command for this time, if any; `since` is the time by the clock of the switch.
    fn command(&self, now: Stamp, since: Duration) -> Option<WheelSpeeds> {
        let granted = self.switch.permission(since).is_granted();
        match self.driver {
            Driver::Unconfirmed => return Some(WheelSpeeds::STOP),
            _ if !self.is_active => return None,
            Driver::Other if granted => return None,
            Driver::Bridge | Driver::Other => {}
        }
        let orders = self.orders.filter(|_| granted);
        let wheels = orders.map_or(WheelSpeeds::STOP, |orders| orders.at(now).wheels);
        let is_recent = self.frame.is_some_and(|at| at.elapsed().as_secs_f64() <= ZEROS_S);
        let drives = self.permitted.is_some_and(|then| {
            since.checked_sub(then).is_none_or(|ago| ago.as_secs_f64() <= ZEROS_S)
        });
        (is_recent && drives || wheels != WheelSpeeds::STOP).then_some(wheels)
    }
}

impl Wheels {
    /// Starts the thread, with a switch that it obeys. `now` returns the time by the clock of the
    /// frames' stamps, `tell` sends wheel speeds and must not block.
    ///
    /// # Errors
    /// [`BridgeError::Thread`].
    pub fn start(
        period: Duration,
        switch: EnableSwitch,
        now: impl Fn() -> Stamp + Send + 'static,
        tell: impl FnMut(WheelSpeeds) + Send + 'static,
    ) -> Result<Self, BridgeError> {
        let state = State {
            orders: None,
            switch,
            permitted: None,
            frame: None,
            is_new: false,
            is_active: true,
            driver: Driver::default(),
            quits: false,
        };
        let state = Mutex::new(state);
        let changed = Condvar::new();
        let shared = Arc::new(Shared { state, changed, started: Instant::now() });
        let theirs = Arc::clone(&shared);
        let thread = threads::start("the wheels", move || theirs.drive(period, now, tell))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Returns access to the switch.
    pub fn switch(&self) -> SwitchHandle {
        SwitchHandle { shared: Arc::clone(&self.shared) }
    }

    /// Sets the orders that are valid until the next frame; `None` is a stop.
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
        // Taken out, because `finish` drops the value, which would quit once more.
        let told = self.thread.take().map(JoinHandle::join);
        told.and_then(Result::ok).unwrap_or_default()
    }
}

impl Drop for Wheels {
    fn drop(&mut self) {
        self.quit();
    }
}

impl CommandCounts {
    fn count(&mut self, wheels: WheelSpeeds) {
        self.commands += 1;
        self.zeros += u64::from(wheels == WheelSpeeds::STOP);
    }
}

/// Sends the zeros at an end, several in case some are lost.
fn say_farewell(told: &mut CommandCounts, tell: &mut impl FnMut(WheelSpeeds)) {
    for _ in 0..FAREWELLS {
        told.count(WheelSpeeds::STOP);
        tell(WheelSpeeds::STOP);
        thread::sleep(BETWEEN_FAREWELLS);
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
        // True if the robot was driven since the last zeros.
        let mut has_driven = false;
        while let Some(state) = self.wait(period) {
            // Not while it is halted, because the final zeros are sent only once.
            has_driven |= state.is_active && state.driver == Driver::Other;
            if let Some(wheels) = state.command(now(), self.started.elapsed()) {
                told.count(wheels);
                tell(wheels);
                has_driven = true;
            } else if has_driven && !state.is_active {
                say_farewell(&mut told, &mut tell);
                has_driven = false;
            }
        }
        if has_driven || self.lock().is_active {
            say_farewell(&mut told, &mut tell);
        }
        told
    }

    /// Waits for new orders, but at most for one period; returns `None` at the end.
    fn wait(&self, period: Duration) -> Option<State> {
        let waited = self
            .changed
            .wait_timeout_while(self.lock(), period, |state| !state.is_new && !state.quits);
        let (mut state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        state.is_new = false;
        let since = self.started.elapsed();
        if state.switch.permission(since).is_granted() {
            state.permitted = Some(since);
        }
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
        start_with(tape, Duration::from_millis(100))
    }

    fn start_with(tape: &Tape, timeout: Duration) -> Wheels {
        let tape = Arc::clone(tape);
        let switch = EnableSwitch::new(timeout);
        let wheels =
            Wheels::start(Duration::from_millis(5), switch, Stamp::default, move |wheels| {
                tape.lock().unwrap().push((Instant::now(), wheels));
            });
        wheels.unwrap()
    }

    /// Waits until so many commands were sent since a time: threads of a busy machine are late.
    fn wait_for(tape: &Tape, since: Instant, count: usize) {
        let end = Instant::now() + Duration::from_secs(5);
        while told_since(tape, since).len() < count && Instant::now() < end {
            thread::sleep(Duration::from_millis(5));
        }
    }

    fn enable(wheels: &Wheels) {
        let switch = wheels.switch();
        [Enable::Reset, Enable::On].into_iter().for_each(|event| switch.take(event, switch.now()));
        thread::sleep(Duration::from_millis(20));
    }

    #[test]
    fn nothing_is_told_without_an_enable_and_zero_once_it_is_gone() {
        let tape = Tape::default();
        let wheels = start(&tape);
        wheels.obey(None);
        thread::sleep(Duration::from_millis(50));
        assert!(tape.lock().unwrap().is_empty(), "another node may drive");
        enable(&wheels);
        wheels.obey(None);
        assert!(wheels.switch().permission().is_granted());
        thread::sleep(Duration::from_millis(250));
        assert_eq!(wheels.switch().permission(), Permission::Expired);
        tape.lock().unwrap().clear();
        thread::sleep(Duration::from_millis(100));
        assert!(!tape.lock().unwrap().is_empty(), "zeros go on");
        drop(wheels);
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
        enable(&wheels);
        let from = Instant::now();
        wheels.obey(None);
        thread::sleep(Duration::from_secs_f64(ZEROS_S + 0.5));
        let last = tape.lock().unwrap().last().map(|(at, _)| at.duration_since(from)).unwrap();
        assert!(tape.lock().unwrap().len() > 20);
        assert!((1.5..ZEROS_S + 0.3).contains(&last.as_secs_f64()), "{last:?}");
        drop(wheels);
    }

    fn told_since(tape: &Tape, then: Instant) -> Vec<WheelSpeeds> {
        let told = tape.lock().unwrap();
        told.iter().filter(|(at, _)| *at >= then).map(|(_, wheels)| *wheels).collect()
    }

    #[test]
    fn a_halt_is_a_stop_and_then_silence_until_a_resume_a_reset_and_a_press() {
        let tape = Tape::default();
        let wheels = start(&tape);
        let switch = wheels.switch();
        enable(&wheels);
        wheels.obey(None);
        thread::sleep(Duration::from_millis(30));
        let halted = Instant::now();
        switch.halt("deactivated");
        thread::sleep(Duration::from_millis(150));
        let stops = told_since(&tape, halted);
        assert!((5..8).contains(&stops.len()), "{stops:?}");
        assert!(stops.iter().all(|wheels| *wheels == WheelSpeeds::STOP));
        assert_eq!(switch.permission(), Permission::Latched("deactivated"));
        let silent = Instant::now();
        enable(&wheels);
        wheels.obey(None);
        thread::sleep(Duration::from_millis(50));
        assert!(told_since(&tape, silent).is_empty(), "halted");
        switch.halt("deactivated");
        switch.resume();
        switch.take(Enable::On, switch.now());
        assert!(!switch.permission().is_granted(), "an enable alone is no reset");
        thread::sleep(Duration::from_millis(150));
        enable(&wheels);
        wheels.obey(None);
        thread::sleep(Duration::from_millis(30));
        assert!(!told_since(&tape, silent).is_empty(), "resumed");
        drop(wheels);
    }

    #[test]
    fn a_halt_before_any_command_and_the_end_after_it_say_nothing() {
        let tape = Tape::default();
        let wheels = start(&tape);
        wheels.switch().halt("deactivated");
        thread::sleep(Duration::from_millis(50));
        assert_eq!(wheels.finish(), CommandCounts::default());
        assert!(tape.lock().unwrap().is_empty());
    }

    #[test]
    fn beside_another_driver_zeros_go_out_only_without_permission_or_confirmation() {
        let tape = Tape::default();
        let timeout = Duration::from_millis(400);
        let wheels = start_with(&tape, timeout);
        let switch = wheels.switch();
        switch.set_driver(Driver::Other);
        enable(&wheels);
        wheels.obey(None);
        thread::sleep(Duration::from_millis(40));
        assert!(tape.lock().unwrap().is_empty(), "the other one drives");
        let halted = Instant::now();
        switch.halt("deactivated");
        wait_for(&tape, halted, FAREWELLS as usize);
        thread::sleep(Duration::from_millis(100));
        assert!(told_since(&tape, halted).len() >= FAREWELLS as usize, "a stop after its drive");
        let silent = Instant::now();
        thread::sleep(Duration::from_millis(50));
        assert!(told_since(&tape, silent).is_empty(), "and then nothing");
        switch.resume();
        thread::sleep(timeout);
        enable(&wheels);
        wheels.obey(None);
        let released = Instant::now();
        switch.take(Enable::Off, switch.now());
        wait_for(&tape, released, 4);
        assert!(told_since(&tape, released).len() > 3, "a stop");
        thread::sleep(Duration::from_secs_f64(ZEROS_S + 0.2));
        let left = Instant::now();
        thread::sleep(Duration::from_millis(40));
        assert!(told_since(&tape, left).is_empty(), "the other one has stopped");
        switch.set_driver(Driver::Unconfirmed);
        wait_for(&tape, left, 4);
        assert!(told_since(&tape, left).len() > 3, "the other one does not confirm its stop");
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
