//! Enable switch of a robot: a deadman's switch with a latch.
//!
//! The switch has no clock of its own: it takes events with their times, and says whether the robot
//! may move at a given time. Times are measured from any fixed moment by a monotonic clock.
//!
//! A *press* is an `On` after a release: after an `Off`, or after more time without an `On` than
//! the heartbeat lasts. A reset uses up the press that is held at that moment, so that a stuck
//! button, or a program that repeats `On` for ever, does not move the robot after the reset.
//!
//! ```text
//!            Reset                 press                  On, in time
//!  Latched ────────► Waiting ────────────────► Enabled ───────────────┐
//!     ▲   │             ▲ ▲                       │  ▲                │
//!     │   │ Reset       │ └─────── too late ──────┤  └────────────────┘
//!     │   │ while held  │                         │ Reset while held
//!     │   ▼             │ silence                 ▼
//!     │  NeedsRelease ──┴───────────────── NeedsRelease ◄── On, in time
//!     │
//!     └──────── Off or Fault, in every state
//! ```
//!
//! A switch starts latched, so that a restart of the program clears neither an `Off` nor a fault.

use std::time::Duration;

/// Event at an enable switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Enable {
    /// Lets the robot move for the time of the heartbeat.
    On,
    /// Stops the robot until a reset.
    Off,
    /// Stops the robot until a reset, for this cause.
    Fault(&'static str),
    /// Clears an `Off` and a fault that are not newer. The robot moves only after the next press: an
    /// `On` that goes on from before the reset does not count until it was released.
    Reset,
}

/// Permission to move at a time, or the cause why there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Permission {
    /// The robot may move.
    Granted,
    /// No press since the last reset.
    NotEnabled,
    /// The `On` that is repeated began before the last reset: it must be released and pressed again.
    NeedsRelease,
    /// The last `On` is too old.
    Expired,
    /// Latched for this cause until a reset.
    Latched(&'static str),
}

impl Permission {
    /// Returns true if the robot may move.
    pub fn is_granted(self) -> bool {
        self == Self::Granted
    }

    /// Returns the cause in words.
    pub fn cause(self) -> &'static str {
        match self {
            Self::Granted => "enabled",
            Self::NotEnabled => "not enabled",
            Self::NeedsRelease => "release the enable and press it again",
            Self::Expired => "the enable was not repeated in time",
            Self::Latched(cause) => cause,
        }
    }
}

/// Deadman's switch with a latch: it starts latched, moves only while an `On` is repeated, and stays
/// stopped after an `Off` or a fault until a reset, a release and a press.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnableSwitch {
    timeout: Duration,
    latched: Option<&'static str>,
    /// Time of the last `Off` or fault.
    stopped: Duration,
    /// Time of the last reset that cleared one.
    reset: Duration,
    /// Press that is held: the `On` that are repeated now, or were last.
    press: Option<Press>,
}

/// `On` events of which each came in time after the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Press {
    /// Time of the first `On`.
    first: Duration,
    /// Time of the last `On`.
    last: Duration,
    /// True if a reset came since the first `On`: the press no longer moves the robot.
    spent: bool,
}

impl EnableSwitch {
    /// Longest time for which an `On` may hold.
    pub const CEILING: Duration = Duration::from_secs(1);
    /// Cause of the latch at the start.
    pub const STARTED: &'static str = "started: needs a reset";
    /// Cause of the latch after [`Enable::Off`].
    pub const SWITCHED_OFF: &'static str = "switched off";

    /// Creates a latched switch whose `On` holds for `timeout`, at most [`EnableSwitch::CEILING`].
    pub fn new(timeout: Duration) -> Self {
        let timeout = timeout.min(Self::CEILING);
        Self {
            timeout,
            latched: Some(Self::STARTED),
            stopped: Duration::ZERO,
            reset: Duration::ZERO,
            press: None,
        }
    }

    /// Returns the time for which an `On` holds.
    pub fn timeout(&self) -> Duration {
        self.timeout
    }

    /// Takes in an event.
    pub fn take(&mut self, event: Enable, now: Duration) {
        match event {
            Enable::On => self.repeat(now),
            Enable::Off => {
                self.latch(Self::SWITCHED_OFF, now);
                self.press = None;
            }
            Enable::Fault(cause) => self.latch(cause, now),
            // A reset that was sent before the stop came knew nothing of it.
            Enable::Reset if now < self.stopped => {}
            Enable::Reset => {
                self.latched = None;
                self.reset = self.reset.max(now);
                // A press that began later was made by a hand that knew of the reset.
                if let Some(press) = self.press.as_mut().filter(|press| press.first <= now) {
                    press.spent = true;
                }
            }
        }
    }

    /// Returns the permission at a time.
    pub fn permission(&self, now: Duration) -> Permission {
        if let Some(cause) = self.latched {
            return Permission::Latched(cause);
        }
        let Some(press) = self.press else { return Permission::NotEnabled };
        let is_released = self.is_released(press.last, now);
        if press.spent {
            return if is_released { Permission::NotEnabled } else { Permission::NeedsRelease };
        }
        // A time before the `On` is a mistake of the caller, which must not move a robot.
        if is_released || now < press.last { Permission::Expired } else { Permission::Granted }
    }

    /// Takes in an `On`, which goes on with the press that is held or begins another one.
    fn repeat(&mut self, now: Duration) {
        let held = self.press.filter(|press| !self.is_released(press.last, now));
        // An `On` that was sent before the reset and comes after it knew nothing of it.
        let begun = Press { first: now, last: now, spent: now < self.reset };
        self.press = Some(held.map_or(begun, |held| Press { last: held.last.max(now), ..held }));
    }

    /// Returns true if an `On` at `last` that was not repeated has ended at `now`.
    fn is_released(&self, last: Duration, now: Duration) -> bool {
        // An `On` from before the last one is no release.
        now.checked_sub(last).is_some_and(|silence| silence > self.timeout)
    }

    fn latch(&mut self, cause: &'static str, now: Duration) {
        self.stopped = self.stopped.max(now);
        // The first cause is kept: later ones usually follow from it. But that of the start is none.
        let known = self.latched.filter(|known| *known != Self::STARTED);
        self.latched = Some(known.unwrap_or(cause));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TIMEOUT_MS: u64 = 500;

    fn ms(time: u64) -> Duration {
        Duration::from_millis(time)
    }

    /// Returns the permission at `now` after these events, with their times in ms.
    fn after(events: &[(u64, Enable)], now: u64) -> Permission {
        let mut switch = EnableSwitch::new(ms(TIMEOUT_MS));
        events.iter().for_each(|(at, event)| switch.take(*event, ms(*at)));
        switch.permission(ms(now))
    }

    #[test]
    fn nothing_moves_before_an_enable() {
        assert_eq!(after(&[], 0), Permission::Latched(EnableSwitch::STARTED));
        assert_eq!(after(&[(0, Enable::Reset)], 1), Permission::NotEnabled);
        assert_eq!(after(&[(0, Enable::Reset), (1, Enable::On)], 1), Permission::Granted);
    }

    #[test]
    fn an_enable_expires_unless_it_is_repeated() {
        let start = [(0, Enable::Reset), (0, Enable::On)];
        assert_eq!(after(&start, 500), Permission::Granted);
        assert_eq!(after(&start, 501), Permission::Expired);
        let again = [start[0], start[1], (400, Enable::On)];
        assert_eq!(after(&again, 900), Permission::Granted);
        assert_eq!(after(&again, 901), Permission::Expired);
        assert_eq!(after(&again, 399), Permission::Expired, "a clock that goes back");
    }

    #[test]
    fn an_off_latches_and_a_heartbeat_does_not_clear_it() {
        for cause in [Enable::Off, Enable::Fault("odometry jumped")] {
            let mut events = vec![(0, Enable::Reset), (0, Enable::On), (1, cause), (2, Enable::On)];
            assert!(matches!(after(&events, 2), Permission::Latched(_)), "{cause:?}");
            events.push((3, Enable::Reset));
            assert_eq!(after(&events, 3), Permission::NeedsRelease, "held since before the reset");
            assert_eq!(after(&events, 503), Permission::NotEnabled, "released by silence");
            events.push((503, Enable::On));
            assert_eq!(after(&events, 503), Permission::Granted);
        }
    }

    #[test]
    fn an_enable_that_goes_on_through_a_reset_moves_nothing_until_it_is_released_and_pressed() {
        fn stuck(from: u64, until: u64) -> impl Iterator<Item = (u64, Enable)> {
            (from..until).step_by(100).map(|at| (at, Enable::On))
        }
        let mut events: Vec<(u64, Enable)> = stuck(0, 1000).collect();
        events.push((1000, Enable::Reset));
        events.extend(stuck(1050, 9000));
        assert_eq!(after(&events, 9000), Permission::NeedsRelease);
        assert_eq!(after(&events, 9000).cause(), "release the enable and press it again");
        // A pause that is no longer than the timeout is no release.
        events.push((9450, Enable::On));
        assert_eq!(after(&events, 9450), Permission::NeedsRelease);
        events.push((9951, Enable::On));
        assert_eq!(after(&events, 9951), Permission::Granted, "released and pressed");
        // A reset while the robot moves asks for another press, too.
        events.push((9960, Enable::Reset));
        events.push((9970, Enable::On));
        assert_eq!(after(&events, 9970), Permission::NeedsRelease);
        // An off is a release at once; it latches all the same.
        events.extend([(9980, Enable::Off), (9990, Enable::Reset)]);
        assert_eq!(after(&events, 9990), Permission::NotEnabled);
        events.push((9991, Enable::On));
        assert_eq!(after(&events, 9991), Permission::Granted);
    }

    #[test]
    fn events_count_by_their_times_when_they_come_late() {
        // The reset is taken in after a press that followed it, and before one that it did not know.
        let press_after = [(10, Enable::On), (5, Enable::Reset)];
        assert_eq!(after(&press_after, 10), Permission::Granted);
        let press_before = [(5, Enable::Reset), (4, Enable::On), (6, Enable::On)];
        assert_eq!(after(&press_before, 6), Permission::NeedsRelease);
        // An old `On` is no release.
        let held =
            [(1000, Enable::On), (1001, Enable::Reset), (300, Enable::On), (1002, Enable::On)];
        assert_eq!(after(&held, 1002), Permission::NeedsRelease);
    }

    #[test]
    fn a_reset_that_is_older_than_the_stop_does_not_clear_it() {
        let late = [(0, Enable::Reset), (5, Enable::Off), (4, Enable::Reset), (6, Enable::On)];
        assert_eq!(after(&late, 6), Permission::Latched(EnableSwitch::SWITCHED_OFF));
    }

    #[test]
    fn a_restart_clears_nothing() {
        let restarted = [(0, Enable::On), (100, Enable::On), (200, Enable::On)];
        assert_eq!(after(&restarted, 200), Permission::Latched(EnableSwitch::STARTED));
    }

    #[test]
    fn the_first_cause_is_kept() {
        let causes = [(0, Enable::Fault("odometry jumped")), (1, Enable::Off)];
        assert_eq!(after(&causes, 1), Permission::Latched("odometry jumped"));
        assert_eq!(after(&causes, 1).cause(), "odometry jumped");
    }

    #[test]
    fn no_setting_makes_an_enable_last() {
        let mut switch = EnableSwitch::new(Duration::MAX);
        switch.take(Enable::Reset, ms(0));
        switch.take(Enable::On, ms(0));
        assert!(switch.permission(ms(1000)).is_granted());
        assert!(!switch.permission(ms(1001)).is_granted());
    }

    fn any_event() -> impl Strategy<Value = Enable> {
        prop_oneof![
            6 => Just(Enable::On),
            1 => Just(Enable::Off),
            1 => Just(Enable::Fault("odometry jumped")),
            2 => Just(Enable::Reset),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4_000, ..ProptestConfig::default() })]

        /// The permission follows from the list of events alone: the last one that is no `On` is a
        /// reset, an `On` after it is a press, which no `On` came before in time unless an off lies
        /// between, and all since are repeated in time.
        #[test]
        fn the_robot_moves_for_a_press_after_a_reset_and_for_nothing_else(
            events in prop::collection::vec((0..700_u64, any_event()), 0..50),
            wait in 0..1200_u64,
        ) {
            let mut now = 0;
            let timed: Vec<(u64, Enable)> = events
                .into_iter()
                .map(|(passed, event)| {
                    now += passed;
                    (now, event)
                })
                .collect();
            let now = now + wait;
            let last = timed.iter().rposition(|(_, event)| *event != Enable::On);
            let after_reset = match last {
                Some(at) if timed[at].1 == Enable::Reset => at + 1..timed.len(),
                _ => 0..0,
            };
            let is_pressed = after_reset.clone().any(|at| {
                let earlier = timed[..at].iter().rev();
                let held = earlier.take_while(|(_, event)| *event != Enable::Off);
                let mut ons = held.filter(|(_, event)| *event == Enable::On);
                ons.all(|(then, _)| timed[at].0 - then > TIMEOUT_MS)
            });
            let newest = after_reset.last().map(|at| timed[at].0);
            let is_young = newest.is_some_and(|at| now - at <= TIMEOUT_MS);
            prop_assert_eq!(after(&timed, now).is_granted(), is_pressed && is_young);
        }
    }
}
