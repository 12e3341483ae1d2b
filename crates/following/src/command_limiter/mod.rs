//! Command limiter: every command of the controller passes it on the way to the wheels.
//!
//! It does not depend on the source of the requested command. It lets the robot move only while
//! frames arrive, a target is followed or searched for, and the path is free. It limits the speed,
//! the turn rate, and the acceleration and jerk of both, and keeps the curvature as far as these
//! limits allow. Each command carries its reason and the time until which it is valid.
//!
//! Without a target the robot slows down within the limits. An emergency stops the wheels at once:
//! a fault, a missing sensor, a gap between frames, a jump of the clock, an expired command, or an
//! obstacle nearer than the stopping distance.

mod ramp;
mod response;
mod settings;

pub use settings::CommandLimiterSettings;
pub(crate) use settings::at_least;

use std::time::{Duration, Instant};

use ramp::{Axis, AxisLimits};
use response::{Response, ResponseCheck};
use tagalong_core::{
    Command, DiffDrive, Frame, MAX_CAMERA_POSE_AGE_S, Reason, Stamp, Twist, WheelSpeeds,
};

use crate::collision_monitor::{Allowance, Braking, Path};
use crate::{Base, OdometrySource, RobotSettings};

/// Delay of the wheels, in reaction times, beyond which it is a fault.
const LATEST: f64 = 2.0;
/// Longest time over which the robot may have changed its speed, s. A pause of frames must not
/// allow a large step of the speed.
const LONGEST_STEP_S: f64 = 0.2;
/// Speeds below this are standing still, m/s.
const STILL_MPS: f64 = 1e-6;
/// Turn rates below this are standing still, rad/s.
const STILL_RPS: f64 = 1e-6;
/// Wheel speed beyond that of any robot, m/s; differences of much larger ones overflow.
const BEYOND_MPS: f64 = 1e6;

/// Wish of a controller, with the facts that the command limiter needs about the frame.
#[derive(Clone, Debug)]
pub(crate) struct Wish {
    /// Wheel speeds of the wish; any numbers, also NaN and infinite ones.
    pub(crate) wheels: WheelSpeeds,
    /// Stamp of the frame.
    pub(crate) stamp: Stamp,
    /// Purpose of the motion.
    pub(crate) aim: Aim,
    /// Reason for which the sensors do not let the robot move, if there is one.
    pub(crate) stop: Option<Reason>,
    /// Factor of the speed that the sensors allow, with its reason, if it is limited.
    pub(crate) slowdown: Option<(f64, Reason)>,
    /// True if enough frames came since the start or a jump.
    pub(crate) settled: bool,
    /// Time since the previous frame, s.
    pub(crate) pause_s: f64,
}

/// Purpose of the robot's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Aim {
    /// No purpose: the robot stands.
    Nobody,
    /// Follow the target.
    Person,
    /// Follow a track that may not be the person: at half speed.
    Perhaps,
    /// Find the person again, at half speed.
    Search,
}

impl Aim {
    /// Returns the reason for an ordinary command.
    fn reason(self) -> Reason {
        match self {
            Self::Nobody => Reason::NoTarget,
            Self::Person => Reason::Follow,
            Self::Perhaps => Reason::Unsure,
            Self::Search => Reason::Search,
        }
    }
}

/// Command that is in force until the next frame: the last one until it expires, zero after that,
/// after a fault and before the first frame.
///
/// It is a copy, so that the thread that drives the wheels need not wait for one that still
/// processes a frame, and stops the wheels if that one never ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orders {
    last: Option<Command>,
    /// True if a frame ended the last command before its time.
    is_withdrawn: bool,
    fault: Option<&'static str>,
    valid_s: f64,
    /// Time at which the frame of the last command was processed. Stamps tell nothing of a sensor
    /// that repeats itself, and a clock may be set back; this one never goes back.
    made: Instant,
}

impl Orders {
    /// Returns the command in force at a time, by the clock of the frames' stamps. A command with a
    /// stamp further ahead than the validity of a command is ignored: clocks that disagree must not
    /// make it last longer.
    ///
    /// Whatever the stamps say, a command ends when its validity has passed on the monotonic clock
    /// since its frame was processed: images that are heard again, or a clock that stands still, do
    /// not make it last.
    pub fn at(&self, now: Stamp) -> Command {
        self.after(now, self.made.elapsed())
    }

    /// Returns the command in force as [`Orders::at`], in simulated time: `since_frame` is the time
    /// since the last frame that led to a command.
    pub fn after(&self, now: Stamp, since_frame: Duration) -> Command {
        let is_young = since_frame.as_secs_f64() <= self.valid_s;
        let reason = match self.last {
            _ if self.fault.is_some() => Reason::Fault,
            None => Reason::Settling,
            Some(_) if self.is_withdrawn => Reason::Expired,
            Some(last) if is_young && self.is_near(last.stamp, now) && now <= last.valid_until => {
                return last;
            }
            Some(_) => Reason::Expired,
        };
        let until = now.plus_seconds(self.valid_s);
        Command::new(Twist::STOP, WheelSpeeds::STOP, now, until, reason)
    }

    fn is_near(&self, stamp: Stamp, now: Stamp) -> bool {
        stamp <= now.plus_seconds(self.valid_s)
    }
}

/// Limiter of the commands; see the [module](self).
pub(crate) struct CommandLimiter {
    settings: CommandLimiterSettings,
    robot: RobotSettings,
    wheels: DiffDrive,
    max_speed_mps: f64,
    /// Largest speed that another program allows, m/s.
    allowed_mps: f64,
    last: Option<Command>,
    /// True if a frame ended the last command before its time.
    is_withdrawn: bool,
    /// Motion of the last command.
    motion: Motion,
    fault: Option<&'static str>,
    /// Time of the last command.
    made: Instant,
    response: ResponseCheck,
    /// True while the base executes the commands.
    is_driving: bool,
    /// Time from an image to wheels that move accordingly, s: the set one, or the measured one if that
    /// is longer.
    reaction_s: f64,
    /// Reason for which time or motion do not let the robot move, if there is one.
    late: Option<Reason>,
    /// True if the odometry is not as young as it should be.
    is_odometry_old: bool,
}

/// Motion of a command, with the accelerations that led to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Motion {
    forward: Axis,
    turn: Axis,
}

impl Motion {
    fn twist(&self) -> Twist {
        Twist::new(self.forward.speed, self.turn.speed)
    }
}

/// Returns the curvature, 1/m; 0 for a turn in place.
fn curvature(twist: Twist) -> f64 {
    if twist.linear_mps.abs() > STILL_MPS { twist.angular_rps / twist.linear_mps } else { 0.0 }
}

impl CommandLimiter {
    pub(crate) fn new(settings: CommandLimiterSettings, robot: RobotSettings) -> Self {
        Self {
            reaction_s: settings.reaction_s,
            settings,
            wheels: robot.wheels(),
            max_speed_mps: robot.max_speed_mps,
            robot,
            allowed_mps: f64::INFINITY,
            last: None,
            is_withdrawn: false,
            motion: Motion::default(),
            fault: None,
            made: Instant::now(),
            response: ResponseCheck::default(),
            is_driving: false,
            late: None,
            is_odometry_old: false,
        }
    }

    /// Returns the command for a frame. `look` returns the largest speeds, up to a given one, that the
    /// collision monitor allows on a path; it is asked wherever the robot may move.
    pub(crate) fn limit(
        &mut self,
        wish: &Wish,
        look: impl FnMut(Path, f64, &Braking) -> Allowance,
    ) -> Command {
        let (motion, reason) = match self.must_stop(wish) {
            Some(reason) => (Motion::default(), reason),
            None => self.limited(wish, look),
        };
        self.motion = motion;
        let wheels = self.in_reach(motion.twist());
        let valid_until = wish.stamp.plus_seconds(self.settings.valid_s);
        let twist = self.wheels.twist(wheels);
        let command = Command::new(twist, wheels, wish.stamp, valid_until, reason);
        // Stops are remembered, too: the ramp of the next command starts from this one.
        self.response.add(&command);
        self.last = Some(command);
        self.is_withdrawn = false;
        self.made = Instant::now();
        command
    }

    /// Ends the last command at the time of a frame that leads to none: the wheels stop, and the next
    /// command starts from there.
    pub(crate) fn withdraw(&mut self, at: Stamp) {
        self.motion = Motion::default();
        self.is_withdrawn = true;
        self.response.withdraw(at);
    }

    /// Returns the command state that holds until the next frame.
    pub(crate) fn orders(&self) -> Orders {
        Orders {
            last: self.last,
            is_withdrawn: self.is_withdrawn,
            fault: self.fault,
            valid_s: self.settings.valid_s,
            made: self.made,
        }
    }

    /// Judges the odometry of a frame, the pose of its camera, and how late images and wheels are. Latches a fault if the
    /// odometry moved faster than the robot can, or the robot does not move as it was commanded.
    pub(crate) fn check_motion(&mut self, frame: &Frame) {
        let motion = &frame.motion;
        let travel = motion.forward.hypot(motion.left);
        // At least 50 ms: over a shorter time, small odometry errors would look like high speeds.
        let dt_s = motion.dt.max(0.05);
        let is_too_far = travel > self.settings.max_odometry_mps * dt_s;
        let is_turned = motion.turn.abs() > self.settings.max_odometry_radps * dt_s;
        if is_too_far || motion.turn.is_finite() && is_turned {
            self.latch("odometry jumped");
        }
        self.late = None;
        self.is_odometry_old = false;
        if self.robot.odometry == OdometrySource::Required {
            // Positive comparisons, so that a number that is none is no odometry.
            let is_number = travel.is_finite() && motion.turn.is_finite();
            if !(is_number && frame.odometry_age_s <= self.settings.stop_after_s) {
                self.late = Some(Reason::Odometry);
            }
            self.is_odometry_old = frame.odometry_age_s > self.settings.slow_after_s;
        }
        let is_placed = frame.camera_pose_age_s <= MAX_CAMERA_POSE_AGE_S;
        if !is_placed {
            self.late = self.late.or(Some(Reason::CameraPose));
        }
        let image_s = frame.latency_s.unwrap_or(0.0);
        let is_in_time = image_s <= self.settings.reaction_s;
        if !is_in_time {
            self.late = self.late.or(Some(Reason::Late));
        }
        match self.response.update(frame.stamp, motion) {
            Response::Within(wheels_s) => {
                // A thing that comes up right after an image is in the next one.
                let answered_s =
                    if wheels_s > 0.0 { image_s + motion.dt + wheels_s } else { image_s };
                self.reaction_s = self.settings.reaction_s.max(answered_s);
                if wheels_s > LATEST * self.settings.reaction_s {
                    self.latch("the base responds too late to its commands");
                }
            }
            Response::NotObeyed => self.latch("the base does not move as it is commanded"),
            Response::Still => {
                self.latch("the odometry stands still while the robot is commanded to move");
            }
        }
    }

    /// Tells whether the base executes the commands: only then are they compared with the odometry. A
    /// base that begins to execute them starts from rest, whatever the commands before were.
    pub(crate) fn set_driving(&mut self, is_driving: bool) {
        if is_driving && !self.is_driving {
            self.motion = Motion::default();
        }
        self.is_driving = is_driving;
        self.response.set_driving(is_driving && self.settings.check_response);
    }

    /// Limits the speed to this, m/s, beside all other limits.
    pub(crate) fn allow_speed(&mut self, most_mps: f64) {
        // A limit that is no number is a mistake of another program, which must not drive faster.
        self.allowed_mps = if most_mps >= 0.0 { most_mps } else { 0.0 };
    }

    /// Returns the time for which a sensor may be silent, s.
    pub(crate) fn patience_s(&self) -> f64 {
        self.settings.stop_after_s
    }

    /// Stops the robot until it is armed again.
    pub(crate) fn latch(&mut self, why: &'static str) {
        // The first cause is kept: later faults usually follow from it.
        self.fault.get_or_insert(why);
    }

    /// Returns the cause of a latched fault.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        self.fault
    }

    /// Clears the fault, after a person has checked the robot.
    pub(crate) fn arm(&mut self) {
        self.fault = None;
        self.last = None;
        self.is_withdrawn = false;
        self.motion = Motion::default();
        self.response.arm(LATEST * self.settings.reaction_s);
    }

    /// Returns the reason for an emergency stop, if there is one: the wheels stop at once.
    fn must_stop(&self, wish: &Wish) -> Option<Reason> {
        let Wish { wheels, stop, settled, pause_s, .. } = wish;
        let in_time = *pause_s <= self.settings.stop_after_s;
        // The order is that of severity: a fault outranks every passing state.
        if self.fault.is_some() {
            Some(Reason::Fault)
        } else if !settled {
            Some(Reason::Settling)
        } else if !in_time {
            Some(Reason::Stalled)
        } else if self.late.or(*stop).is_some() {
            self.late.or(*stop)
        } else if !(wheels.left.is_finite() && wheels.right.is_finite()) {
            Some(Reason::NotFinite)
        } else {
            None
        }
    }

    /// Returns the motion after which the command of this frame comes, and the time that it has to
    /// change it, s.
    fn before(&self, now: Stamp) -> (Motion, f64) {
        let Some(last) = self.last else { return (Motion::default(), LONGEST_STEP_S) };
        // Stamps may stand still or step back; both allow no change of speed.
        let dt = now.seconds_since(last.stamp).clamp(0.0, LONGEST_STEP_S);
        // An expired command was followed by a stop.
        let holds = now <= last.valid_until;
        (if holds { self.motion } else { Motion::default() }, dt)
    }

    fn limited(
        &self,
        wish: &Wish,
        mut look: impl FnMut(Path, f64, &Braking) -> Allowance,
    ) -> (Motion, Reason) {
        let (before, dt) = self.before(wish.stamp);
        let (wanted, why, is_capped) = self.wanted(wish);
        let next = self.ramped(&before, wanted, dt);
        let reason = match next.twist() {
            twist if wish.aim == Aim::Nobody && twist != Twist::STOP => Reason::Stopping,
            twist if twist == wanted || is_capped => why,
            _ => Reason::Limited,
        };
        let speed = next.forward.speed.abs();
        if speed <= STILL_MPS {
            return self.turn_in_place(&before, next, reason, dt, look);
        }
        let backwards = next.forward.speed < 0.0;
        let path = Path::Arc { curvature: curvature(next.twist()), backwards };
        let allowed = look(path, speed, &self.settings.braking(self.reaction_s, dt));
        if allowed.most <= STILL_MPS {
            let stopped = Axis::default();
            // Turning stays allowed where it is free: it may free the path.
            let turn = self.turned(&before, wanted.angular_rps, &stopped, dt);
            let still = Motion { forward: stopped, turn };
            return self.turn_in_place(&before, still, allowed.stops, dt, look);
        }
        match self.slower(&before, next, wanted, &allowed, dt) {
            Some(slower) => (slower, allowed.slower),
            None => (next, reason),
        }
    }

    /// Limits a turn in place.
    fn turn_in_place(
        &self,
        before: &Motion,
        next: Motion,
        reason: Reason,
        dt: f64,
        mut look: impl FnMut(Path, f64, &Braking) -> Allowance,
    ) -> (Motion, Reason) {
        let speed = next.turn.speed.abs();
        if speed <= STILL_RPS {
            return (next, reason);
        }
        let path = Path::Turn { left: next.turn.speed > 0.0 };
        let allowed = look(path, speed, &self.settings.turn_braking(self.reaction_s, dt));
        if allowed.most <= STILL_RPS {
            return (Motion::default(), allowed.stops);
        }
        if speed <= allowed.gentle {
            return (next, reason);
        }
        let gentle =
            self.turned(before, allowed.gentle.copysign(next.turn.speed), &next.forward, dt);
        let turn = if gentle.speed.abs() <= allowed.most {
            gentle
        } else {
            let most = allowed.most.copysign(next.turn.speed);
            before.turn.braked(most, dt, &self.turn_limits())
        };
        // Where the way ahead is blocked, that is what stops the robot.
        let why = if reason.moves() { allowed.slower } else { reason };
        (Motion { turn, ..next }, why)
    }

    /// Returns the motion within what is allowed on the path, if it is slower than `next`.
    fn slower(
        &self,
        before: &Motion,
        next: Motion,
        wanted: Twist,
        allowed: &Allowance,
        dt: f64,
    ) -> Option<Motion> {
        let speed = next.forward.speed.abs();
        if speed <= allowed.gentle {
            return None;
        }
        let part = (allowed.gentle / wanted.linear_mps.abs().max(allowed.gentle)).min(1.0);
        let slower = self.ramped(before, wanted.scaled(part), dt);
        if slower.forward.speed.abs() <= allowed.most {
            return Some(slower);
        }
        // An emergency brakes harder than the limits of deceleration and jerk allow, and stays on the
        // arc that was looked along where it brakes so hard that the turn cannot follow.
        let most = allowed.most.copysign(next.forward.speed);
        let forward = before.forward.braked(most, dt, &self.forward_limits());
        let brakes_hard =
            allowed.most < before.forward.speed.abs() - self.settings.max_decel_mps2 * dt;
        let turn = if brakes_hard {
            Axis { speed: next.turn.speed * allowed.most / speed, accel: 0.0 }
        } else {
            self.turned(before, slower.turn.speed, &forward, dt)
        };
        Some(Motion { forward, turn })
    }

    /// Returns the motion that is aimed at, within the limits of the drive and those of a doubt or of
    /// late frames, its reason, and true if a doubt or late frames limit it.
    fn wanted(&self, wish: &Wish) -> (Twist, Reason, bool) {
        if wish.aim == Aim::Nobody {
            return (Twist::STOP, Reason::NoTarget, false);
        }
        let (wanted, as_wished) = self.within_drive(wish.wheels);
        let reason = if as_wished { wish.aim.reason() } else { Reason::Limited };
        let (wanted, reason) = match wish.slowdown {
            Some((ratio, why)) => (wanted.scaled(ratio), why),
            None => (wanted, reason),
        };
        let is_late = wish.pause_s > self.settings.slow_after_s
            || self.is_odometry_old
            || self.reaction_s > self.settings.reaction_s;
        let half = is_late || wish.aim != Aim::Person;
        let cap = if half { 0.5 } else { 1.0 } * self.max_speed_mps;
        // Wheels that respond late make the robot slower in the same measure.
        let cap = cap * (self.settings.reaction_s / self.reaction_s).min(1.0);
        let speed = wanted.linear_mps.abs();
        if speed <= cap.min(self.allowed_mps) {
            return (wanted, reason, wish.slowdown.is_some());
        }
        let why = if self.allowed_mps < cap {
            Reason::Limited
        } else if is_late {
            Reason::Slow
        } else {
            wish.aim.reason()
        };
        let cap = cap.min(self.allowed_mps);
        (wanted.scaled(cap / speed), why, true)
    }

    /// Limits the wheel speeds to the drive and the turn rate, on the same arc where the base can drive
    /// it, and returns whether they are as wished.
    fn within_drive(&self, wheels: WheelSpeeds) -> (Twist, bool) {
        let fastest = wheels.left.abs().max(wheels.right.abs());
        let scale = BEYOND_MPS / fastest.max(BEYOND_MPS);
        let twist = self
            .wheels
            .twist(WheelSpeeds { left: wheels.left * scale, right: wheels.right * scale });
        let twist = self.wheels.twist(self.in_reach(twist));
        let is_refused = twist.linear_mps < 0.0 && !self.settings.reverse;
        let twist = if is_refused { Twist { linear_mps: 0.0, ..twist } } else { twist };
        let limit = self.settings.max_turn_radps;
        // Forward speed and turn rate shrink by the same factor, which keeps the curvature.
        let mut slower = twist.scaled(limit / twist.angular_rps.abs().max(limit));
        if self.robot.base == Base::Ackermann {
            let most = slower.linear_mps.abs() / self.robot.min_turn_radius_m;
            slower.angular_rps = slower.angular_rps.clamp(-most, most);
        }
        let WheelSpeeds { left, right } = self.wheels.wheels(slower);
        let as_wished = (left - wheels.left).abs() + (right - wheels.right).abs() < STILL_MPS;
        (slower, as_wished)
    }

    fn forward_limits(&self) -> AxisLimits {
        let CommandLimiterSettings { max_accel_mps2, max_decel_mps2, max_jerk_mps3, .. } =
            self.settings;
        AxisLimits { accel: max_accel_mps2, decel: max_decel_mps2, jerk: max_jerk_mps3 }
    }

    fn turn_limits(&self) -> AxisLimits {
        let CommandLimiterSettings { max_turn_accel_radps2: most, max_turn_jerk_radps3, .. } =
            self.settings;
        AxisLimits { accel: most, decel: most, jerk: max_turn_jerk_radps3 }
    }

    /// Moves the speed towards the wish as far as the limits allow, on the wished arc as far as those
    /// of the turn allow.
    fn ramped(&self, before: &Motion, wanted: Twist, dt: f64) -> Motion {
        // The turn that is under way takes its part of the speed of the outer wheel.
        let rim = match self.robot.base {
            Base::Holonomic => 0.0,
            _ => self.wheels.half_separation_m * before.turn.peak(&self.turn_limits()),
        };
        let most = self.max_speed_mps - rim;
        let target = wanted.linear_mps.clamp(-most.max(0.0), most.max(0.0));
        let forward = before.forward.track(target, dt, &self.forward_limits(), target.abs());
        // A robot that stops stays on the arc that it drives.
        let arc = if wanted == Twist::STOP { before.twist() } else { wanted };
        let turn = if arc.linear_mps.abs() > STILL_MPS {
            arc.angular_rps * (forward.speed / arc.linear_mps).clamp(0.0, 1.0)
        } else {
            wanted.angular_rps
        };
        Motion { forward, turn: self.turned(before, turn, &forward, dt) }
    }

    /// Moves the turn rate towards `turn` as far as its limits and the base allow at this speed.
    fn turned(&self, before: &Motion, turn: f64, forward: &Axis, dt: f64) -> Axis {
        let limits = self.turn_limits();
        let peak = forward.peak(&self.forward_limits());
        let most = self.robot.turn_at(peak).min(self.settings.max_turn_radps);
        let turn = before.turn.track(turn.clamp(-most, most), dt, &limits, most);
        if self.robot.base != Base::Ackermann {
            return turn;
        }
        // Steered wheels turn no faster than they roll, however suddenly they slow down.
        let most = self.robot.turn_at(forward.speed);
        if turn.speed.abs() <= most {
            turn
        } else {
            Axis { speed: most.copysign(turn.speed), accel: 0.0 }
        }
    }

    /// Returns the wheel speeds of a motion: scaled to the limit of the faster wheel, on the same arc,
    /// or, for a holonomic base, with both parts limited on their own.
    fn in_reach(&self, twist: Twist) -> WheelSpeeds {
        let most = self.max_speed_mps;
        if self.robot.base == Base::Holonomic {
            let speed = most;
            let turn = self.settings.max_turn_radps;
            let forward = twist.linear_mps.clamp(-speed, speed);
            return self.wheels.wheels(Twist::new(forward, twist.angular_rps.clamp(-turn, turn)));
        }
        let WheelSpeeds { left, right } = self.wheels.wheels(twist);
        let scale = most / left.abs().max(right.abs()).max(most);
        // The clamp removes the rounding error of the scale.
        let [left, right] = [left, right].map(|speed| (speed * scale).clamp(-most, most));
        WheelSpeeds { left, right }
    }
}

#[cfg(test)]
mod tests;
