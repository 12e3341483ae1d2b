//! Enable switch of a robot: a deadman's switch with a latch.
//!
//! Values in, values out: events with their times go in, and the permission to move at a time comes
//! out. Times are measured from any fixed moment by a clock that only goes forward.
//!
//! ```text
//!            Reset                    On                   On, in time
//!  Latched ────────► Waiting ────────────────► Enabled ───────────────┐
//!     ▲                 ▲                         │  ▲                │
//!     │                 └──────── too late ───────┘  └────────────────┘
//!     └──────── Off or Fault, in every state
//! ```
//!
//! A switch starts latched, so that a restart of the program clears neither an `Off` nor a fault.

use std::time::Duration;

/// Event at an enable switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Enable {
    /// Lets the robot move for the time of the heartbeat.
    On,
    /// Stops the robot until a reset.
    Off,
    /// Stops the robot until a reset, for this cause.
    Fault(&'static str),
    /// Clears an `Off` and a fault that are not newer. The robot moves only after the next `On`.
    Reset,
}

/// Permission to move at a time, or the cause why there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Permission {
    /// The robot may move.
    Granted,
    /// No `On` since the last reset.
    NotEnabled,
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
            Self::Expired => "the enable was not repeated in time",
            Self::Latched(cause) => cause,
        }
    }
}

/// Deadman's switch with a latch: it starts latched, moves only while an `On` is repeated, and stays
/// stopped after an `Off` or a fault until a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnableSwitch {
    timeout: Duration,
    latched: Option<&'static str>,
    /// Time of the last `Off` or fault.
    stopped: Duration,
    /// Time of the last `On` since the last reset.
    enabled: Option<Duration>,
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
        Self { timeout, latched: Some(Self::STARTED), stopped: Duration::ZERO, enabled: None }
    }

    /// Takes in an event.
    pub fn take(&mut self, event: Enable, now: Duration) {
        match event {
            // A switch that is latched does not remember it either: after the reset the robot moves
            // only for an `On` that is newer.
            Enable::On if self.latched.is_none() => self.enabled = Some(now),
            Enable::On => {}
            Enable::Off => self.latch(Self::SWITCHED_OFF, now),
            Enable::Fault(cause) => self.latch(cause, now),
            // A reset that was sent before the stop came knew nothing of it.
            Enable::Reset if now < self.stopped => {}
            Enable::Reset => (self.latched, self.enabled) = (None, None),
        }
    }

    /// Returns the permission at a time.
    pub fn permission(&self, now: Duration) -> Permission {
        match (self.latched, self.enabled) {
            (Some(cause), _) => Permission::Latched(cause),
            (None, None) => Permission::NotEnabled,
            // A time before the `On` is a mistake of the caller, which must not move a robot.
            (None, Some(then)) => match now.checked_sub(then) {
                Some(age) if age <= self.timeout => Permission::Granted,
                _ => Permission::Expired,
            },
        }
    }

    fn latch(&mut self, cause: &'static str, now: Duration) {
        self.stopped = self.stopped.max(now);
        // The first cause is kept: later ones usually follow from it. But that of the start is none.
        let known = self.latched.filter(|known| *known != Self::STARTED);
        (self.latched, self.enabled) = (Some(known.unwrap_or(cause)), None);
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
            let off = [(0, Enable::Reset), (0, Enable::On), (1, cause), (2, Enable::On)];
            assert!(matches!(after(&off, 2), Permission::Latched(_)), "{cause:?}");
            let mut reset = off.to_vec();
            reset.push((3, Enable::Reset));
            assert_eq!(after(&reset, 3), Permission::NotEnabled, "an older enable is forgotten");
            reset.push((4, Enable::On));
            assert_eq!(after(&reset, 4), Permission::Granted);
        }
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
        /// reset, and an `On` after it is young enough.
        #[test]
        fn the_robot_moves_for_a_young_enable_after_a_reset_and_for_nothing_else(
            events in prop::collection::vec((0..400_u64, any_event()), 0..50),
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
            let is_reset = last.is_some_and(|at| timed[at].1 == Enable::Reset);
            let newest = timed.last().filter(|(_, event)| *event == Enable::On);
            let is_young = newest.is_some_and(|(at, _)| now - at <= TIMEOUT_MS);
            prop_assert_eq!(after(&timed, now).is_granted(), is_reset && is_young);
        }
    }
}
