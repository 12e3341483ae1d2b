//! The enable of a simulated robot, and the operator that holds it.

use std::time::Duration;

use tagalong_pipeline::{Enable, EnableSwitch};
use tagalong_sim::{FaultKind, ScheduledFault};

/// Time for which an enable is valid unless it is repeated.
const HOLDS: Duration = Duration::from_millis(500);
/// Time after the stop at which the robot is reset, s.
const RESET_S: f64 = 1.0;
/// Time for which the button is released before it is pressed again, s.
const RELEASED_S: f64 = 1.0;

/// Enable button that gets stuck. The operator holds it from the start. When the fault begins, the
/// robot is switched off and reset, as if the operator released the button, but the button stays
/// pressed. After the fault it is released, and pressed again.
pub(super) struct StuckEnable {
    switch: EnableSwitch,
    fault: ScheduledFault,
    is_stopped: bool,
    is_reset: bool,
}

impl StuckEnable {
    /// Returns the enable of a ride with these faults; `None` if it works normally, because the
    /// operator then holds it all the time.
    pub(super) fn of(faults: &[ScheduledFault]) -> Option<Self> {
        let fault = faults.iter().find(|fault| fault.kind == FaultKind::EnableStuck)?;
        let mut switch = EnableSwitch::new(HOLDS);
        switch.take(Enable::Reset, Duration::ZERO);
        Some(Self { switch, fault: *fault, is_stopped: false, is_reset: false })
    }

    /// Returns true if the robot may move at a time, s, which must not decrease from call to call.
    pub(super) fn is_granted(&mut self, at_s: f64) -> bool {
        let now = Duration::from_secs_f64(at_s.max(0.0));
        let stop_s = self.fault.from_s;
        if !self.is_stopped && at_s >= stop_s {
            self.switch.take(Enable::Off, now);
            self.is_stopped = true;
        }
        if !self.is_reset && at_s >= stop_s + RESET_S {
            self.switch.take(Enable::Reset, now);
            self.is_reset = true;
        }
        let is_released = (self.fault.to_s..self.fault.to_s + RELEASED_S).contains(&at_s);
        if !is_released {
            self.switch.take(Enable::On, now);
        }
        self.switch.permission(now).is_granted()
    }
}

#[cfg(test)]
mod tests {
    use tagalong_sim::{InjectedFault, Scene};

    use super::*;

    /// Returns the tenths of a second in which the robot may move.
    fn granted(fault: InjectedFault) -> Vec<u32> {
        let mut scene = Scene::default();
        scene.faults.inject.push(fault);
        let mut enable = StuckEnable::of(&scene.scheduled_faults()).unwrap();
        (0..100).filter(|tenth| enable.is_granted(f64::from(*tenth) * 0.1)).collect()
    }

    #[test]
    fn a_button_that_sticks_moves_nothing_after_the_reset_until_it_was_released() {
        let stuck = InjectedFault::new(FaultKind::EnableStuck).at(3.0);
        assert_eq!(granted(stuck.clone()), (0..30).collect::<Vec<u32>>());
        let released = granted(stuck.lasting(4.0));
        assert_eq!(released, (0..30).chain(80..100).collect::<Vec<u32>>());
    }

    #[test]
    fn other_faults_leave_the_enable_alone() {
        let mut scene = Scene::default();
        scene.faults.inject.push(InjectedFault::new(FaultKind::WheelsStuck));
        assert!(StuckEnable::of(&scene.scheduled_faults()).is_none());
    }
}
