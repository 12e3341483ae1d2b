use std::collections::VecDeque;

use crate::{Motion, WheelSpeeds, Wheels};

/// No more commands are remembered, however quickly the frames come.
const MOST: usize = 256;

/// The commands that the wheels have not answered to yet, for controllers that
/// steer for where the robot is going to be.
#[derive(Clone, Debug)]
pub struct Sent {
    latency_s: f64,
    /// Commands and for how long each is the newest, s; newest first.
    commands: VecDeque<(WheelSpeeds, f64)>,
}

impl Sent {
    /// None yet; the wheels answer after `latency_s`.
    pub fn new(latency_s: f64) -> Self {
        Self { latency_s, commands: VecDeque::new() }
    }

    /// The newest command is `dt` older than the next one will be.
    pub fn grow_older(&mut self, dt: f64) {
        if let Some((_, held_s)) = self.commands.front_mut() {
            *held_s += dt;
        }
    }

    /// The newest command.
    pub fn add(&mut self, command: WheelSpeeds) {
        self.commands.push_front((command, 0.0));
        self.commands.truncate(MOST);
    }

    /// What the robot is going to do before it answers to the next command, and
    /// forgets what it has done.
    pub fn forecast(&mut self, wheels: &Wheels) -> Motion {
        let mut to_come = Motion::at_rest(0.0);
        let mut known = 0;
        for (command, held_s) in &self.commands {
            let dt = held_s.min(self.latency_s - to_come.dt);
            if to_come.dt >= self.latency_s {
                break;
            }
            to_come = Motion::from_wheels(command.left, command.right, wheels, dt).then(&to_come);
            known += 1;
        }
        self.commands.truncate(known);
        // Before the first command the robot was at rest.
        Motion { dt: self.latency_s, ..to_come }
    }
}
