//! Comparison of the commands with the odometry: does the base do what it is commanded, and how late?
//!
//! The motion of a frame is explained by a delay if it lies between the slowest and the fastest command
//! that were in force within this delay. The smallest such delay is the latency of the base as far as it
//! can be seen; a motion that no delay explains is not the one that was commanded: wheels that are
//! stuck or slip, a base that does not stop, or another driver.

use std::collections::VecDeque;

use tagalong_core::{Command, EgoMotion, Stamp, Twist};

/// Longest delay that is looked for, s.
const LONGEST_S: f64 = 1.5;
/// Time for which commands are kept, s.
const KEPT_S: f64 = 2.0;
/// Time over which the largest delay counts, s.
const RECENT_S: f64 = 3.0;
/// Time without an explanation after which the base does not obey, s.
const PATIENCE_S: f64 = 0.5;
/// Frames in a row that a delay must be seen: odometry has noise.
const IN_A_ROW: usize = 3;
/// Tolerance of speed, m/s, and turn rate, rad/s, and as a fraction of them.
const SPEED_MPS: f64 = 0.12;
const TURN_RPS: f64 = 0.35;
const FRACTION: f64 = 0.2;
/// Shortest time over which a speed is measured, s.
const SHORTEST_S: f64 = 0.01;

/// Judgement of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Response {
    /// The base does what it is commanded after at most this time, s.
    Within(f64),
    /// It does something else.
    NotObeyed,
}

/// Commands of the last seconds beside the motion of the robot.
#[derive(Clone, Debug, Default)]
pub(super) struct ResponseCheck {
    is_driving: bool,
    /// Commands with their stamps and the end of their validity, oldest first.
    commands: VecDeque<Command>,
    /// Delays of the last frames, with their stamps.
    delays: VecDeque<(Stamp, f64)>,
    unexplained_s: f64,
}

impl ResponseCheck {
    /// Tells whether the base executes the commands from now on.
    pub(super) fn set_driving(&mut self, is_driving: bool) {
        if is_driving != self.is_driving {
            self.clear();
        }
        self.is_driving = is_driving;
    }

    /// Forgets the commands.
    pub(super) fn clear(&mut self) {
        *self = Self { is_driving: self.is_driving, ..Self::default() };
    }

    /// Adds the newest command.
    pub(super) fn add(&mut self, command: &Command) {
        if !self.is_driving {
            return;
        }
        // After a jump of the clock the older commands tell nothing.
        if self.commands.back().is_some_and(|last| last.stamp > command.stamp) {
            self.clear();
        }
        self.commands.push_back(*command);
        let oldest = |commands: &VecDeque<Command>| commands.front().map(|first| first.stamp);
        while oldest(&self.commands).is_some_and(|at| command.stamp.seconds_since(at) > KEPT_S) {
            self.commands.pop_front();
        }
    }

    /// Compares the motion up to a frame with the commands before it.
    pub(super) fn update(&mut self, now: Stamp, motion: &EgoMotion) -> Response {
        let since = self.commands.front().map_or(0.0, |first| now.seconds_since(first.stamp));
        // Commands from before the first one are not known.
        if !self.is_driving || since < LONGEST_S || !(motion.dt >= SHORTEST_S) {
            return Response::Within(self.largest_delay_s(now));
        }
        let measured = Twist::new(motion.forward / motion.dt, motion.turn / motion.dt);
        match self.delay_s(now, motion.dt, measured) {
            Some(delay_s) => {
                self.unexplained_s = 0.0;
                self.delays.push_back((now, delay_s));
            }
            None => self.unexplained_s += motion.dt,
        }
        if self.unexplained_s > PATIENCE_S {
            return Response::NotObeyed;
        }
        Response::Within(self.largest_delay_s(now))
    }

    /// Returns the smallest delay that explains a motion.
    fn delay_s(&self, now: Stamp, dt_s: f64, measured: Twist) -> Option<f64> {
        let mut speed = Envelope::default();
        let mut turn = Envelope::default();
        let mut until = now;
        for command in self.commands.iter().rev() {
            // Between its end and the next command the robot was told to stand.
            if until > command.valid_until {
                speed.add(0.0);
                turn.add(0.0);
            }
            speed.add(command.twist.linear_mps);
            turn.add(command.twist.angular_rps);
            let age_s = now.seconds_since(until) - dt_s;
            until = command.stamp;
            if speed.holds(measured.linear_mps, SPEED_MPS)
                && turn.holds(measured.angular_rps, TURN_RPS)
            {
                return Some(age_s.max(0.0));
            }
            if age_s > LONGEST_S {
                return None;
            }
        }
        None
    }

    /// Returns the largest delay of the last seconds that was seen several times in a row, s.
    fn largest_delay_s(&mut self, now: Stamp) -> f64 {
        while self.delays.front().is_some_and(|(at, _)| now.seconds_since(*at) > RECENT_S) {
            self.delays.pop_front();
        }
        let mut largest_s = 0.0_f64;
        let delays: Vec<f64> = self.delays.iter().map(|(_, delay_s)| *delay_s).collect();
        for row in delays.windows(IN_A_ROW) {
            largest_s = largest_s.max(row.iter().copied().fold(f64::INFINITY, f64::min));
        }
        largest_s
    }
}

/// Range of the commands.
#[derive(Clone, Copy, Debug)]
struct Envelope {
    least: f64,
    most: f64,
}

impl Default for Envelope {
    fn default() -> Self {
        Self { least: f64::INFINITY, most: f64::NEG_INFINITY }
    }
}

impl Envelope {
    fn add(&mut self, value: f64) {
        self.least = self.least.min(value);
        self.most = self.most.max(value);
    }

    fn holds(&self, value: f64, tolerance: f64) -> bool {
        let off = tolerance + FRACTION * self.least.abs().max(self.most.abs());
        self.least - off <= value && value <= self.most + off
    }
}

#[cfg(test)]
mod tests {
    use tagalong_core::{Reason, WheelSpeeds};

    use super::*;

    const DT_S: f64 = 0.0625;

    fn stamp(frame: usize) -> Stamp {
        Stamp::from_nanos(5_000_000_000).plus_seconds(frame as f64 * DT_S)
    }

    /// Returns the judgements of frames in which the robot was commanded, and drove, these speeds.
    fn judged(
        frames: usize,
        told: impl Fn(usize) -> f64,
        drove: impl Fn(usize) -> f64,
    ) -> Vec<Response> {
        let mut check = ResponseCheck::default();
        check.set_driving(true);
        let mut responses = Vec::new();
        for frame in 0..frames {
            let motion = EgoMotion { forward: drove(frame) * DT_S, ..EgoMotion::at_rest(DT_S) };
            responses.push(check.update(stamp(frame), &motion));
            let twist = Twist::new(told(frame), 0.0);
            check.add(&Command {
                twist,
                wheels: WheelSpeeds::STOP,
                stamp: stamp(frame),
                valid_until: stamp(frame).plus_seconds(0.25),
                reason: Reason::Follow,
            });
        }
        responses
    }

    /// Goes and stands, in turn, each for two seconds.
    fn stop_and_go(frame: usize) -> f64 {
        if (frame / 32).is_multiple_of(2) { 0.0 } else { 0.6 }
    }

    fn late(frames: usize) -> impl Fn(usize) -> f64 {
        move |frame| frame.checked_sub(frames).map_or(0.0, stop_and_go)
    }

    #[test]
    fn a_base_that_obeys_at_once_has_no_delay() {
        let last = judged(200, stop_and_go, late(1));
        assert!(last.iter().all(|response| *response == Response::Within(0.0)), "{last:?}");
    }

    #[test]
    fn a_delay_is_measured() {
        for (frames, delay_s) in [(6, 0.3), (12, 0.7), (20, 1.2)] {
            let all = judged(300, stop_and_go, late(frames));
            let Response::Within(found_s) = all[290] else { panic!("{frames}: {all:?}") };
            // The tolerance and the frames in a row hide up to a fifth of a second.
            assert!(
                (delay_s - 0.25..delay_s + 0.05).contains(&found_s),
                "{frames} frames: {found_s}"
            );
        }
    }

    #[test]
    fn wheels_that_are_stuck_and_a_base_that_goes_on_do_not_obey() {
        let stuck = judged(150, |_| 0.5, |_| 0.0);
        let first = stuck.iter().position(|response| *response == Response::NotObeyed);
        assert!(first.is_some_and(|frame| frame < 40), "{first:?}");
        let runaway = judged(150, |_| 0.0, |frame| if frame > 60 { 0.5 } else { 0.0 });
        let first = runaway.iter().position(|response| *response == Response::NotObeyed);
        assert!(first.is_some_and(|frame| (60..75).contains(&frame)), "{first:?}");
    }

    #[test]
    fn the_end_of_a_command_is_a_command_to_stand() {
        // Frames cease: from 0.25 s after the last one the robot stands.
        let mut check = ResponseCheck::default();
        check.set_driving(true);
        for frame in 0..40 {
            let motion = EgoMotion { forward: 0.5 * DT_S, ..EgoMotion::at_rest(DT_S) };
            check.update(stamp(frame), &motion);
            let command = Command {
                twist: Twist::new(0.5, 0.0),
                wheels: WheelSpeeds::STOP,
                stamp: stamp(frame),
                valid_until: stamp(frame).plus_seconds(0.25),
                reason: Reason::Follow,
            };
            check.add(&command);
        }
        let paused = check.update(stamp(52), &EgoMotion::at_rest(12.0 * DT_S));
        assert_eq!(paused, Response::Within(0.0));
    }

    #[test]
    fn commands_that_nobody_executes_are_not_compared() {
        let mut check = ResponseCheck::default();
        for frame in 0..100 {
            let motion = EgoMotion { forward: 0.9 * DT_S, ..EgoMotion::at_rest(DT_S) };
            assert_eq!(check.update(stamp(frame), &motion), Response::Within(0.0));
        }
    }
}
