//! Comparison of the commands with the odometry: whether the base obeys, and with which latency.
//!
//! The latency of the base is the delay at which its motion is most similar to the commands of the
//! last seconds, if these changed enough. A motion is explained if it lies between the slowest and
//! the fastest command that were in force within the longest delay. A motion that is not explained
//! for some time is not the commanded one: the wheels are stuck or slip, the base does not stop, or
//! something else drives it.
//!
//! Slow commands are within the tolerance of that comparison. Therefore odometry that does not
//! change at all during commands to move, however slow, is also a fault: it repeats itself, or the
//! wheels are stuck.

use std::collections::VecDeque;

use tagalong_core::{Command, EgoMotion, Stamp, Twist};

/// Longest delay that is looked for, s, and the step between delays.
const LONGEST_S: f64 = 1.5;
const STEP_S: f64 = 0.05;
/// Time for which motions are compared, s.
const COMPARED_S: f64 = 3.0;
/// Time for which commands are kept, s.
const KEPT_S: f64 = LONGEST_S + COMPARED_S;
/// Time for which a measured delay counts, s.
const RECENT_S: f64 = 10.0;
/// Time without an explanation after which the base does not obey, s.
const PATIENCE_S: f64 = 0.5;
/// Change of the commands from which on a delay can be seen: their standard deviation, m/s.
const CHANGE_MPS: f64 = 0.08;
/// Part of the error without a delay that must be left with the best one: odometry has noise.
const BETTER: f64 = 0.5;
/// Tolerance of speed, m/s, and turn rate, rad/s, and as a fraction of them.
const SPEED_MPS: f64 = 0.12;
const TURN_RPS: f64 = 0.35;
const FRACTION: f64 = 0.2;
/// Speed, m/s, and turn rate, rad/s, of a command from which on each base moves: less may not overcome
/// its friction.
const MOVES_MPS: f64 = 0.03;
const MOVES_RPS: f64 = 0.1;
/// Speed, m/s, and turn rate, rad/s, of the odometry up to which it stands still.
const STILL_MPS: f64 = 0.005;
const STILL_RPS: f64 = 0.01;
/// Time of commands to move through which the odometry may stand still, s.
const STILL_S: f64 = 2.0;
/// Shortest time over which a speed is measured, s.
const SHORTEST_S: f64 = 0.01;

/// Judgement of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Response {
    /// The base does what it is commanded after at most this time, s.
    Within(f64),
    /// It does something else.
    NotObeyed,
    /// The odometry stands still through commands to move.
    Still,
}

/// Commands of the last seconds beside the motion of the robot.
#[derive(Clone, Debug, Default)]
pub(super) struct ResponseCheck {
    is_driving: bool,
    /// Commands with their stamps and the end of their validity, oldest first.
    commands: VecDeque<Command>,
    /// Speeds of the last frames, with the middle of the time over which they were measured, m/s.
    motions: VecDeque<(Stamp, f64)>,
    /// Delays that were measured, with their stamps.
    delays: VecDeque<(Stamp, f64)>,
    unexplained_s: f64,
    /// Time of commands to move through which the odometry has stood still, s.
    still_s: f64,
}

impl ResponseCheck {
    /// Tells whether the base executes the commands from now on.
    pub(super) fn set_driving(&mut self, is_driving: bool) {
        if is_driving != self.is_driving {
            self.clear();
        }
        self.is_driving = is_driving;
    }

    /// Forgets the commands, but not how late the wheels respond: they do so too after a pause, or
    /// when the enable is pressed again.
    pub(super) fn clear(&mut self) {
        let delays = std::mem::take(&mut self.delays);
        *self = Self { is_driving: self.is_driving, delays, ..Self::default() };
    }

    /// Forgets all but the delays up to `most_s`, after a person has checked the robot: a longer one
    /// was a fault, and would be one again at once.
    pub(super) fn arm(&mut self, most_s: f64) {
        self.clear();
        self.delays.retain(|(_, delay_s)| *delay_s <= most_s);
    }

    /// Ends the newest command: the base was told to stop then.
    pub(super) fn withdraw(&mut self, at: Stamp) {
        if let Some(last) = self.commands.back_mut() {
            last.valid_until = last.valid_until.min(at);
        }
    }

    /// Adds the newest command.
    pub(super) fn add(&mut self, command: &Command) {
        fn oldest(commands: &VecDeque<Command>) -> Option<Stamp> {
            commands.front().map(|first| first.stamp)
        }

        if !self.is_driving {
            return;
        }
        // After a jump of the clock the older commands tell nothing.
        if self.commands.back().is_some_and(|last| last.stamp > command.stamp) {
            self.clear();
        }
        self.commands.push_back(*command);
        while oldest(&self.commands).is_some_and(|at| command.stamp.seconds_since(at) > KEPT_S) {
            self.commands.pop_front();
        }
    }

    /// Compares the motion up to a frame with the commands before it.
    pub(super) fn update(&mut self, now: Stamp, motion: &EgoMotion) -> Response {
        let since = self.commands.front().map_or(0.0, |first| now.seconds_since(first.stamp));
        // Commands from before the first one are not known.
        // Positive comparisons, so that a time that is no number is not compared.
        let is_comparable = since >= LONGEST_S && motion.dt >= SHORTEST_S;
        if !(self.is_driving && is_comparable) {
            return Response::Within(self.largest_delay_s(now));
        }
        let measured = Twist::new(motion.forward / motion.dt, motion.turn / motion.dt);
        self.motions.push_back((now.plus_seconds(-0.5 * motion.dt), measured.linear_mps));
        while self.motions.front().is_some_and(|(at, _)| now.seconds_since(*at) > COMPARED_S) {
            self.motions.pop_front();
        }
        if self.is_explained(now, motion.dt, measured) {
            self.unexplained_s = 0.0;
        } else {
            self.unexplained_s += motion.dt;
        }
        if self.unexplained_s > PATIENCE_S {
            return Response::NotObeyed;
        }
        self.add_standing(now, motion.dt, measured);
        if self.still_s > STILL_S {
            return Response::Still;
        }
        if let Some(delay_s) = self.likeliest_delay_s() {
            self.delays.push_back((now, delay_s));
        }
        Response::Within(self.largest_delay_s(now))
    }

    /// Adds a step in which the odometry moved or stood still.
    fn add_standing(&mut self, now: Stamp, dt_s: f64, measured: Twist) {
        let stands =
            measured.linear_mps.abs() <= STILL_MPS && measured.angular_rps.abs() <= STILL_RPS;
        if !stands {
            self.still_s = 0.0;
            return;
        }
        // Even a base with the longest delay has executed this command by now.
        let wanted = self.twist_at(now.plus_seconds(-LONGEST_S));
        if wanted.linear_mps.abs() >= MOVES_MPS || wanted.angular_rps.abs() >= MOVES_RPS {
            self.still_s += dt_s;
        }
    }

    /// Returns the command that was in force at a time; a stop without one.
    fn twist_at(&self, then: Stamp) -> Twist {
        let last = self.commands.iter().rev().find(|command| command.stamp <= then);
        let in_force = last.filter(|command| then <= command.valid_until);
        in_force.map_or(Twist::STOP, |command| command.twist)
    }

    /// Returns true if the motion lies between the commands within the longest delay.
    fn is_explained(&self, now: Stamp, dt_s: f64, measured: Twist) -> bool {
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
            if now.seconds_since(until) - dt_s > LONGEST_S {
                break;
            }
            until = command.stamp;
        }
        speed.holds(measured.linear_mps, SPEED_MPS) && turn.holds(measured.angular_rps, TURN_RPS)
    }

    /// Returns the delay by which the commands resemble the motion most; `None` if they changed too
    /// little to tell.
    fn likeliest_delay_s(&self) -> Option<f64> {
        let count = self.motions.len() as f64;
        let first = self.commands.front()?.stamp;
        // Each delay is compared on the same motions.
        if !self.motions.iter().all(|(at, _)| at.seconds_since(first) >= LONGEST_S) {
            return None;
        }
        let mean = self.motions.iter().map(|(_, speed)| speed).sum::<f64>() / count;
        let spread = self.motions.iter().map(|(_, speed)| (speed - mean).powi(2)).sum::<f64>();
        if spread < CHANGE_MPS * CHANGE_MPS * count {
            return None;
        }
        let mut best = (f64::INFINITY, 0.0);
        let mut at_once = f64::INFINITY;
        for step in 0..=(LONGEST_S / STEP_S) as usize {
            let delay_s = step as f64 * STEP_S;
            let error = self.error_at(delay_s);
            if step == 0 {
                at_once = error;
            }
            if error < best.0 {
                best = (error, delay_s);
            }
        }
        Some(if best.0 < BETTER * at_once { best.1 } else { 0.0 })
    }

    /// Returns the sum of the squared differences between the motions and the commands before them.
    fn error_at(&self, delay_s: f64) -> f64 {
        let mut commands = self.commands.iter().peekable();
        let mut command = commands.next();
        let mut error = 0.0;
        for (at, speed) in &self.motions {
            let then = at.plus_seconds(-delay_s);
            while let Some(next) = commands.next_if(|next| next.stamp <= then) {
                command = Some(next);
            }
            let in_force = command.filter(|command| then <= command.valid_until);
            let wanted = in_force.map_or(0.0, |command| command.twist.linear_mps);
            error += (speed - wanted).powi(2);
        }
        error
    }

    /// Returns the largest delay that was measured lately, s. Time in which the base does not execute
    /// the commands does not count, nor that of another clock.
    fn largest_delay_s(&mut self, now: Stamp) -> f64 {
        for (at, _) in &mut self.delays {
            if !self.is_driving || *at > now {
                *at = now;
            }
        }
        while self.delays.front().is_some_and(|(at, _)| now.seconds_since(*at) > RECENT_S) {
            self.delays.pop_front();
        }
        self.delays.iter().map(|(_, delay_s)| *delay_s).fold(0.0, f64::max)
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
            check.add(&Command::new(
                twist,
                WheelSpeeds::STOP,
                stamp(frame),
                stamp(frame).plus_seconds(0.25),
                Reason::Follow,
            ));
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
        assert!(
            last.iter().all(|response| matches!(response, Response::Within(s) if *s < 0.1)),
            "{last:?}"
        );
    }

    #[test]
    fn a_delay_is_measured() {
        for (frames, delay_s) in [(6, 0.31), (12, 0.69), (20, 1.19)] {
            let all = judged(300, stop_and_go, late(frames));
            let Response::Within(found_s) = all[290] else { panic!("{frames}: {all:?}") };
            // The tolerance and the frames in a row hide up to a fifth of a second.
            assert!(
                (delay_s - 0.25..delay_s + 0.05).contains(&found_s),
                "{frames} frames: {found_s}"
            );
        }
    }

    /// Each press of the enable begins the comparison anew; the wheels are as late as before.
    #[test]
    fn a_delay_outlasts_a_pause_and_a_reset() {
        let mut check = ResponseCheck::default();
        check.set_driving(true);
        let drove = late(12);
        for frame in 0..300 {
            let motion = EgoMotion { forward: drove(frame) * DT_S, ..EgoMotion::at_rest(DT_S) };
            check.update(stamp(frame), &motion);
            let at = stamp(frame);
            let twist = Twist::new(stop_and_go(frame), 0.0);
            let until = at.plus_seconds(0.25);
            check.add(&Command::new(twist, WheelSpeeds::STOP, at, until, Reason::Follow));
        }
        let Response::Within(measured_s) = check.update(stamp(300), &EgoMotion::at_rest(DT_S))
        else {
            panic!("it obeys")
        };
        assert!(measured_s > 0.4, "{measured_s}");
        check.set_driving(false);
        for frame in 301..900 {
            let waiting = check.update(stamp(frame), &EgoMotion::at_rest(DT_S));
            assert_eq!(waiting, Response::Within(measured_s), "{frame}");
        }
        check.set_driving(true);
        let again = check.update(stamp(900), &EgoMotion::at_rest(DT_S));
        assert_eq!(again, Response::Within(measured_s));
        let before = check.update(stamp(500), &EgoMotion::at_rest(DT_S));
        assert_eq!(before, Response::Within(measured_s), "after a step of the clock");
        check.arm(1.0);
        let reset = check.update(stamp(501), &EgoMotion::at_rest(DT_S));
        assert_eq!(reset, Response::Within(measured_s), "after a reset");
        let later = check.update(stamp(501 + 170), &EgoMotion::at_rest(DT_S));
        assert_eq!(later, Response::Within(0.0), "ten seconds of driving later");
    }

    #[test]
    fn what_made_the_base_a_fault_is_forgotten_by_the_reset() {
        let mut check = ResponseCheck { is_driving: true, ..ResponseCheck::default() };
        check.delays.extend([(stamp(0), 0.6), (stamp(1), 1.2)]);
        check.arm(1.0);
        assert_eq!(check.update(stamp(2), &EgoMotion::at_rest(DT_S)), Response::Within(0.6));
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

    /// For the longest delay after the first command, one from before it may still be executed.
    #[test]
    fn what_may_be_of_commands_before_the_first_is_not_compared() {
        let driven = judged(40, |_| 0.0, |_| 0.5);
        assert_eq!(driven[..24], [Response::Within(0.0); 24], "1.5 s");
        let first = driven.iter().position(|response| *response == Response::NotObeyed);
        assert_eq!(first, Some(32), "after more than half a second");
    }

    #[test]
    fn odometry_that_stands_still_while_the_robot_creeps_is_told() {
        let creeping = judged(150, |_| 0.06, |_| 0.0);
        let first = creeping.iter().position(|response| *response == Response::Still);
        let first_s = first.map(|frame| frame as f64 * DT_S);
        assert!(first_s.is_some_and(|at_s| (3.5..3.8).contains(&at_s)), "{first_s:?}");
        let short_stops = judged(150, |frame| if frame % 8 < 6 { 0.06 } else { 0.0 }, |_| 0.0);
        assert!(short_stops.contains(&Response::Still));
        for (told_mps, drove_mps) in [(0.06, 0.06), (0.0, 0.0), (0.01, 0.0), (0.06, 0.02)] {
            let all = judged(150, |_| told_mps, |_| drove_mps);
            assert!(!all.contains(&Response::Still), "{told_mps} {drove_mps}");
        }
    }

    #[test]
    fn the_end_of_a_command_is_a_command_to_stand() {
        // Frames cease: from 0.25 s after the last one the robot stands.
        let mut check = ResponseCheck::default();
        check.set_driving(true);
        for frame in 0..40 {
            let motion = EgoMotion { forward: 0.5 * DT_S, ..EgoMotion::at_rest(DT_S) };
            check.update(stamp(frame), &motion);
            let command = Command::new(
                Twist::new(0.5, 0.0),
                WheelSpeeds::STOP,
                stamp(frame),
                stamp(frame).plus_seconds(0.25),
                Reason::Follow,
            );
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
