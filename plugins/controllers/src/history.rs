use std::collections::VecDeque;

use tagalong_core::{DiffDrive, EgoMotion, WheelSpeeds};

/// Largest number of remembered commands, at any frame rate.
const MOST: usize = 256;

/// Commands that the wheels have not executed yet, for controllers that compensate for latency.
#[derive(Clone, Debug)]
pub struct CommandHistory {
    latency_s: f64,
    /// Commands and the time for which each is the newest, s; newest first.
    commands: VecDeque<(WheelSpeeds, f64)>,
}

impl CommandHistory {
    /// Creates an empty history; the wheels respond after `latency_s`.
    pub fn new(latency_s: f64) -> Self {
        Self { latency_s, commands: VecDeque::new() }
    }

    /// Adds `dt` to the time for which the newest command has been the newest.
    pub fn age(&mut self, dt: f64) {
        if let Some((_, held_s)) = self.commands.front_mut() {
            *held_s += dt;
        }
    }

    /// Adds the newest command.
    pub fn add(&mut self, command: WheelSpeeds) {
        self.commands.push_front((command, 0.0));
        self.commands.truncate(MOST);
    }

    /// Returns the predicted motion of the robot until it responds to the next command, and
    /// discards the commands that have been executed.
    pub fn forecast(&mut self, wheels: &DiffDrive) -> EgoMotion {
        let mut to_come = EgoMotion::at_rest(0.0);
        let mut known = 0;
        // Commands are stored newest first, so each older one is prepended to the motion so far.
        for (command, held_s) in &self.commands {
            // Of the oldest pending command only the rest of the latency is still to be driven.
            let dt = held_s.min(self.latency_s - to_come.dt);
            if to_come.dt >= self.latency_s {
                break;
            }
            to_come =
                EgoMotion::from_wheels(command.left, command.right, wheels, dt).then(&to_come);
            known += 1;
        }
        self.commands.truncate(known);
        // Before the first command the robot was at rest.
        EgoMotion { dt: self.latency_s, ..to_come }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHEELS: DiffDrive = DiffDrive { half_separation_m: 0.2, slip: 0.0 };

    fn ahead(speed: f64) -> WheelSpeeds {
        WheelSpeeds { left: speed, right: speed }
    }

    /// Builds a history of commands that were each held for a tenth of a second, oldest first.
    fn history(latency_s: f64, speeds: &[f64]) -> CommandHistory {
        let mut history = CommandHistory::new(latency_s);
        for speed in speeds {
            history.add(ahead(*speed));
            history.age(0.1);
        }
        history
    }

    #[test]
    fn what_the_wheels_have_not_answered_to_is_still_to_come() {
        for (latency_s, forward) in [(0.0, 0.0), (0.1, 0.03), (0.15, 0.04), (0.3, 0.06)] {
            let motion = history(latency_s, &[0.1, 0.2, 0.3]).forecast(&WHEELS);
            assert!((motion.forward - forward).abs() < 1e-12, "{latency_s} s: {motion:?}");
            assert_eq!(motion.dt, latency_s);
        }
    }

    #[test]
    fn before_the_first_command_the_robot_was_at_rest() {
        let motion = history(0.5, &[0.4]).forecast(&WHEELS);
        assert!((motion.forward - 0.04).abs() < 1e-12, "{motion:?}");
        assert_eq!(CommandHistory::new(0.3).forecast(&WHEELS), EgoMotion::at_rest(0.3));
    }

    /// The robot drives forward, then turns on the spot: the order determines its position.
    #[test]
    fn older_commands_are_driven_first() {
        let mut history = history(0.2, &[1.0]);
        history.add(WheelSpeeds { left: -0.2, right: 0.2 });
        history.age(0.1);
        let motion = history.forecast(&WHEELS);
        assert!((motion.forward - 0.1).abs() < 1e-12 && motion.left.abs() < 1e-12, "{motion:?}");
        assert!((motion.turn - 0.1).abs() < 1e-12, "{motion:?}");
    }

    #[test]
    fn what_has_been_driven_is_forgotten_and_no_more_than_so_many_are_kept() {
        let mut long = history(0.2, &[0.1; 50]);
        long.forecast(&WHEELS);
        assert_eq!(long.commands.len(), 2);
        assert_eq!(history(1e3, &[0.1; MOST + 9]).commands.len(), MOST);
    }
}
