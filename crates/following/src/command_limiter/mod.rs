//! Limiter of the commands: every command of the controller passes it on the way to the wheels.
//!
//! It does not depend on the source of the wish. It lets the robot move only while frames arrive, a
//! target is followed or searched for and the path is free; it limits the speed, the turn rate, and the
//! acceleration and the jerk of both, and keeps the curvature as far as these allow; each command carries its reason and the time until
//! which it is valid.
//!
//! Without a target the robot slows down within the limits. Emergencies stop the wheels at once: a
//! fault, a missing sensor, a pause of the frames, a jump of the clock, an expired command, an
//! obstacle nearer than the robot can stop.

mod collision_monitor;
mod obstacle_memory;
mod ramp;
mod settings;
mod sources;

pub(crate) use collision_monitor::Ahead;
pub(crate) use obstacle_memory::ObstacleMemory;
pub use settings::{CollisionMonitorSettings, CommandLimiterSettings, ObstacleSource};
pub use sources::{SourceKind, SourceSettings};

use std::time::{Duration, Instant};

use ramp::{Axis, AxisLimits};
use tagalong_core::{Command, DiffDrive, EgoMotion, Reason, Stamp, Twist, WheelSpeeds};

use crate::{Base, RobotSettings};

/// Longest time over which the robot may have changed its speed, s. A pause of frames must not
/// allow a large step of the speed.
const LONGEST_STEP_S: f64 = 0.2;
/// Speeds below this are standing still, m/s.
const STILL_MPS: f64 = 1e-6;
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
    /// True if the sensors of obstacles are there, or the config does without them.
    pub(crate) sighted: bool,
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
        let stop = |reason| Command {
            twist: Twist::STOP,
            wheels: WheelSpeeds::STOP,
            stamp: now,
            valid_until: now.plus_seconds(self.valid_s),
            reason,
        };
        let is_young = since_frame.as_secs_f64() <= self.valid_s;
        match self.last {
            _ if self.fault.is_some() => stop(Reason::Fault),
            None => stop(Reason::Settling),
            Some(last) if is_young && self.is_near(last.stamp, now) && now <= last.valid_until => {
                last
            }
            Some(_) => stop(Reason::Expired),
        }
    }

    fn is_near(&self, stamp: Stamp, now: Stamp) -> bool {
        stamp <= now.plus_seconds(self.valid_s)
    }
}

/// Limiter of the commands; see the [module](self).
pub(crate) struct CommandLimiter {
    settings: CommandLimiterSettings,
    monitor: CollisionMonitorSettings,
    robot: RobotSettings,
    wheels: DiffDrive,
    max_speed_mps: f64,
    /// Largest speed that another program allows, m/s.
    allowed_mps: f64,
    last: Option<Command>,
    /// Motion of the last command.
    motion: Motion,
    fault: Option<&'static str>,
    /// Time of the last command.
    made: Instant,
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
    pub(crate) fn new(
        settings: CommandLimiterSettings,
        monitor: CollisionMonitorSettings,
        robot: RobotSettings,
    ) -> Self {
        Self {
            settings,
            monitor,
            wheels: robot.wheels(),
            max_speed_mps: robot.max_speed_mps,
            robot,
            allowed_mps: f64::INFINITY,
            last: None,
            motion: Motion::default(),
            fault: None,
            made: Instant::now(),
        }
    }

    /// Returns the command for a frame. `look` returns the nearest obstacle in the corridor along
    /// an arc of a given curvature, and is called only where the robot may move; it returns `None`
    /// for a robot with neither depth nor laser.
    pub(crate) fn limit(
        &mut self,
        wish: &Wish,
        look: impl FnOnce(&CollisionMonitorSettings, f64) -> Option<Ahead>,
    ) -> Command {
        let (motion, reason) = match self.must_stop(wish) {
            Some(reason) => (Motion::default(), reason),
            None => self.limited(wish, look),
        };
        self.motion = motion;
        let wheels = self.in_reach(motion.twist());
        let valid_until = wish.stamp.plus_seconds(self.settings.valid_s);
        let twist = self.wheels.twist(wheels);
        let command = Command { twist, wheels, stamp: wish.stamp, valid_until, reason };
        // Stops are remembered, too: the ramp of the next command starts from this one.
        self.last = Some(command);
        self.made = Instant::now();
        command
    }

    /// Returns the command state that holds until the next frame.
    pub(crate) fn orders(&self) -> Orders {
        Orders {
            last: self.last,
            fault: self.fault,
            valid_s: self.settings.valid_s,
            made: self.made,
        }
    }

    /// Latches a fault if the odometry moved faster than the robot can.
    pub(crate) fn check_odometry(&mut self, motion: &EgoMotion) {
        let travel = motion.forward.hypot(motion.left);
        // At least 50 ms: over a shorter time, small odometry errors would look like high speeds.
        if travel > self.settings.max_odometry_mps * motion.dt.max(0.05) {
            self.latch("odometry jumped");
        }
    }

    /// Limits the speed to this, m/s, beside all other limits.
    pub(crate) fn allow_speed(&mut self, most_mps: f64) {
        // A limit that is no number is a mistake of another program, which must not drive faster.
        self.allowed_mps = if most_mps >= 0.0 { most_mps } else { 0.0 };
    }

    /// Returns the settings of the obstacle corridor.
    pub(crate) fn monitor(&self) -> &CollisionMonitorSettings {
        &self.monitor
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
        (self.last, self.motion) = (None, Motion::default());
    }

    /// Returns the reason for an emergency stop, if there is one: the wheels stop at once.
    fn must_stop(&self, wish: &Wish) -> Option<Reason> {
        let Wish { wheels, sighted, settled, pause_s, .. } = wish;
        let in_time = *pause_s <= self.settings.stop_after_s;
        // The order is that of severity: a fault outranks every passing state.
        if self.fault.is_some() {
            Some(Reason::Fault)
        } else if !settled {
            Some(Reason::Settling)
        } else if !in_time {
            Some(Reason::Stalled)
        } else if !sighted {
            Some(Reason::Blind)
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
        look: impl FnOnce(&CollisionMonitorSettings, f64) -> Option<Ahead>,
    ) -> (Motion, Reason) {
        let (before, dt) = self.before(wish.stamp);
        let (wanted, why, is_capped) = self.wanted(wish);
        let next = self.ramped(&before, wanted, dt);
        let reason = match next.twist() {
            twist if wish.aim == Aim::Nobody && twist != Twist::STOP => Reason::Stopping,
            twist if twist == wanted || is_capped => why,
            _ => Reason::Limited,
        };
        // A turn in place stays in place, and the corridor shows nothing behind the robot.
        if next.forward.speed <= STILL_MPS {
            return (next, reason);
        }
        match look(&self.monitor, curvature(next.twist())) {
            Some(Ahead::Blind) => (Motion::default(), Reason::Blind),
            Some(Ahead::Something(at_m)) => {
                let slower = self.before_obstacle(&before, next, wanted, at_m, dt);
                slower.unwrap_or((next, reason))
            }
            Some(Ahead::Free) | None => (next, reason),
        }
    }

    /// Returns the motion before an obstacle at a distance, if it is slower than `next`.
    fn before_obstacle(
        &self,
        before: &Motion,
        next: Motion,
        wanted: Twist,
        at_m: f64,
        dt: f64,
    ) -> Option<(Motion, Reason)> {
        let room_m = at_m - self.monitor.stop_m;
        let (gentle, most) =
            (self.settings.gentle_within(room_m), self.settings.speed_within(room_m));
        if most <= STILL_MPS {
            // Turning stays allowed: it may free the path.
            let turn = self.turned(before, wanted.angular_rps, &Axis::default(), dt);
            return Some((Motion { forward: Axis::default(), turn }, Reason::Blocked));
        }
        if next.forward.speed <= gentle {
            return None;
        }
        let target = wanted.scaled((gentle / wanted.linear_mps.max(gentle)).min(1.0));
        let slower = self.ramped(before, target, dt);
        if slower.forward.speed <= most {
            return Some((slower, Reason::Obstacle));
        }
        // An emergency brakes harder than the limits of deceleration and jerk allow, and stays on the
        // arc that was looked along where it brakes so hard that the turn cannot follow.
        let forward = before.forward.braked(most, dt, &self.forward_limits());
        let brakes_hard = most < before.forward.speed - self.settings.max_decel_mps2 * dt;
        let turn = match brakes_hard {
            true => Axis { speed: next.turn.speed * most / next.forward.speed, accel: 0.0 },
            false => self.turned(before, slower.turn.speed, &forward, dt),
        };
        Some((Motion { forward, turn }, Reason::Obstacle))
    }

    /// Returns the motion that is aimed at, within the limits of the drive and those of a doubt or of
    /// late frames, its reason, and true if a doubt or late frames limit it.
    fn wanted(&self, wish: &Wish) -> (Twist, Reason, bool) {
        if wish.aim == Aim::Nobody {
            return (Twist::STOP, Reason::NoTarget, false);
        }
        let (wanted, as_wished) = self.within_drive(wish.wheels);
        let reason = if as_wished { wish.aim.reason() } else { Reason::Limited };
        let is_late = wish.pause_s > self.settings.slow_after_s;
        let half = is_late || wish.aim != Aim::Person;
        let cap = if half { 0.5 } else { 1.0 } * self.max_speed_mps;
        let speed = wanted.linear_mps.abs();
        if speed <= cap.min(self.allowed_mps) {
            return (wanted, reason, false);
        }
        let why = match () {
            () if self.allowed_mps < cap => Reason::Limited,
            () if is_late => Reason::Slow,
            () => wish.aim.reason(),
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
        let twist = match self.settings.reverse {
            false if twist.linear_mps < 0.0 => Twist { linear_mps: 0.0, ..twist },
            _ => twist,
        };
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
        let turn = match arc.linear_mps.abs() > STILL_MPS {
            true => arc.angular_rps * (forward.speed / arc.linear_mps).clamp(0.0, 1.0),
            false => wanted.angular_rps,
        };
        Motion { forward, turn: self.turned(before, turn, &forward, dt) }
    }

    /// Moves the turn rate towards `turn` as far as its limits and the base allow at this speed.
    fn turned(&self, before: &Motion, turn: f64, forward: &Axis, dt: f64) -> Axis {
        let (limits, peak) = (self.turn_limits(), forward.peak(&self.forward_limits()));
        let most = self.robot.turn_at(peak).min(self.settings.max_turn_radps);
        let turn = before.turn.track(turn.clamp(-most, most), dt, &limits, most);
        if self.robot.base != Base::Ackermann {
            return turn;
        }
        // Steered wheels turn no faster than they roll, however suddenly they slow down.
        let most = self.robot.turn_at(forward.speed);
        match turn.speed.abs() <= most {
            true => turn,
            false => Axis { speed: most.copysign(turn.speed), accel: 0.0 },
        }
    }

    /// Returns the wheel speeds of a motion: scaled to the limit of the faster wheel, on the same arc,
    /// or, for a holonomic base, with both parts limited on their own.
    fn in_reach(&self, twist: Twist) -> WheelSpeeds {
        let most = self.max_speed_mps;
        if self.robot.base == Base::Holonomic {
            let (speed, turn) = (most, self.settings.max_turn_radps);
            let forward = twist.linear_mps.clamp(-speed, speed);
            return self.wheels.wheels(Twist::new(forward, twist.angular_rps.clamp(-turn, turn)));
        }
        let WheelSpeeds { left, right } = self.wheels.wheels(twist);
        let scale = most / left.abs().max(right.abs()).max(most);
        // The clamp removes the rounding error of the scale.
        let limit = |speed: f64| (speed * scale).clamp(-most, most);
        WheelSpeeds { left: limit(left), right: limit(right) }
    }
}

#[cfg(test)]
mod tests;
