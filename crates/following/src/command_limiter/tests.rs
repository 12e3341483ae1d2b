use nalgebra::Isometry3;
use tagalong_core::{EgoMotion, Sensors};
use tagalong_geometry::Camera;

use std::cell::Cell;

use super::*;

mod properties;

const DRIVE: DiffDrive = DiffDrive { half_separation_m: 0.167, slip: 0.02 };
const MAX_MPS: f64 = 0.9;
const PERIOD_S: f64 = 0.1;

/// Returns settings without a limit of the jerk, so that speeds are plain numbers.
fn abrupt() -> CommandLimiterSettings {
    CommandLimiterSettings {
        max_jerk_mps3: 1e15,
        max_turn_jerk_radps3: 1e15,
        ..CommandLimiterSettings::default()
    }
}

fn limiter_of(settings: CommandLimiterSettings) -> CommandLimiter {
    CommandLimiter::new(settings, RobotSettings::default())
}

/// Returns a command limiter of another base, with a least radius of 0.8 m.
fn limiter_on(base: Base) -> CommandLimiter {
    let robot = RobotSettings { base, min_turn_radius_m: 0.8, ..RobotSettings::default() };
    let settings = CommandLimiterSettings::default();
    CommandLimiter::new(settings, robot)
}

fn limiter() -> CommandLimiter {
    limiter_of(abrupt())
}

fn wish(frame: u64, left: f64, right: f64) -> Wish {
    Wish {
        wheels: WheelSpeeds { left, right },
        stamp: Stamp::from_nanos(frame * 100_000_000),
        aim: Aim::Person,
        stop: None,
        slowdown: None,
        settled: true,
        pause_s: PERIOD_S,
    }
}

/// Distance that is left before an obstacle, m.
const STOP_M: f64 = 0.4;

/// Result of a look along the arc of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Ahead {
    Free,
    /// An obstacle at this distance, m.
    Something(f64),
}

fn free(_: Path, _: f64, _: &Braking) -> Allowance {
    Allowance::FREE
}

/// Returns the look at what is ahead; a turn in place is free.
fn look(ahead: Ahead) -> impl Fn(Path, f64, &Braking) -> Allowance {
    move |path, _, braking| match (ahead, path) {
        (Ahead::Something(at_m), Path::Arc { .. }) => {
            let room_m = at_m - STOP_M;
            Allowance {
                gentle: braking.speed_within(room_m, braking.reaction_s + braking.rise_s),
                most: braking.speed_within(room_m, braking.reaction_s),
                ..Allowance::FREE
            }
        }
        _ => Allowance::FREE,
    }
}

fn something(at_m: f64) -> impl Fn(Path, f64, &Braking) -> Allowance {
    look(Ahead::Something(at_m))
}

/// A frame in which the robot has moved.
fn moved(motion: EgoMotion) -> Frame {
    let blind = Camera::blind(Isometry3::identity()).into();
    Frame::of_sensors(1, Stamp::from_nanos(1), blind, motion, Sensors::default())
}

/// A command limiter after enough frames to reach the wished speed.
fn at_speed(left: f64, right: f64) -> (CommandLimiter, Command) {
    let mut limiter = limiter();
    let commands: Vec<Command> =
        (1..40).map(|frame| limiter.limit(&wish(frame, left, right), free)).collect();
    (limiter, commands[38])
}

#[test]
fn a_modest_wish_comes_true() {
    let (_, command) = at_speed(0.3, 0.4);
    assert_eq!(command.reason, Reason::Follow);
    assert!((command.wheels.left - 0.3).abs() < 1e-9 && (command.wheels.right - 0.4).abs() < 1e-9);
}

#[test]
fn a_wish_at_the_very_limit_is_not_limited() {
    let mut limiter = limiter();
    let wish = wish(1, 0.3, 0.3);
    limiter.allowed_mps = limiter.within_drive(wish.wheels).0.linear_mps;
    let (twist, reason, is_limited) = limiter.wanted(&wish);
    assert_eq!((twist.linear_mps, reason), (limiter.allowed_mps, Reason::Follow));
    assert!(!is_limited);
}

#[test]
fn too_fast_a_wish_keeps_its_curvature() {
    let (_, command) = at_speed(1.0, 2.0);
    let WheelSpeeds { left, right } = command.wheels;
    assert_eq!(command.reason, Reason::Limited);
    assert!((right / left - 2.0).abs() < 1e-9 && right <= MAX_MPS, "{command:?}");
}

#[test]
fn speed_grows_no_faster_than_it_may() {
    let mut limiter = limiter();
    let first = limiter.limit(&wish(1, 0.9, 0.9), free).wheels.left;
    let second = limiter.limit(&wish(2, 0.9, 0.9), free).wheels.left;
    assert!((second - first - 0.5 * PERIOD_S).abs() < 1e-9, "{first} {second}");
    let (mut limiter, _) = at_speed(0.8, 0.8);
    let slower = limiter.limit(&wish(40, 0.1, 0.1), free).wheels.left;
    assert!((slower - (0.8 - 1.0 * PERIOD_S)).abs() < 1e-9, "{slower}");
}

/// Before the enable no command is executed, however fast they are.
#[test]
fn a_base_that_begins_to_execute_the_commands_starts_from_rest() {
    let (mut limiter, unheard) = at_speed(0.8, 0.8);
    assert!(unheard.wheels.left > 0.79, "{unheard:?}");
    let mut before = 0.0;
    for frame in 40..45 {
        limiter.set_driving(true);
        let speed = limiter.limit(&wish(frame, 0.8, 0.8), free).wheels.left;
        assert!((speed - before - 0.5 * PERIOD_S).abs() < 1e-9, "{frame}: {before} {speed}");
        before = speed;
    }
}

#[test]
fn each_emergency_stops_at_once() {
    type Change = fn(Wish) -> Wish;
    let stops: [(Reason, Change); 4] = [
        (Reason::Blind, |wish| Wish { stop: Some(Reason::Blind), ..wish }),
        (Reason::Settling, |wish| Wish { settled: false, ..wish }),
        (Reason::Stalled, |wish| Wish { pause_s: 0.6, ..wish }),
        (Reason::NotFinite, |wish| Wish {
            wheels: WheelSpeeds { left: f64::NAN, right: 0.1 },
            ..wish
        }),
    ];
    for (reason, change) in stops {
        let (mut limiter, _) = at_speed(0.8, 0.8);
        let command = limiter.limit(&change(wish(40, 0.8, 0.8)), free);
        assert_eq!((command.wheels, command.reason), (WheelSpeeds::STOP, reason));
    }
}

/// Returns the commands of so many further frames, each with this wish but for the stamp.
fn go_on(limiter: &mut CommandLimiter, wished: &Wish, frames: u64) -> Vec<Command> {
    let mut commands = Vec::new();
    for frame in 40..40 + frames {
        let next = Wish { stamp: wish(frame, 0.0, 0.0).stamp, ..wished.clone() };
        commands.push(limiter.limit(&next, free));
    }
    commands
}

#[test]
fn without_a_target_the_robot_slows_down_within_its_limits() {
    let (mut limiter, _) = at_speed(0.8, 0.8);
    let commands = go_on(&mut limiter, &Wish { aim: Aim::Nobody, ..wish(0, 0.8, 0.8) }, 9);
    for (command, speed) in commands.iter().zip([0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1]) {
        assert_eq!(command.reason, Reason::Stopping);
        assert!((command.wheels.left - speed).abs() < 1e-9, "{command:?}");
    }
    assert_eq!((commands[8].wheels, commands[8].reason), (WheelSpeeds::STOP, Reason::NoTarget));
}

#[test]
fn a_robot_that_stops_stays_on_its_arc() {
    let (mut limiter, before) = at_speed(0.4, 0.8);
    let curve = curvature(before.twist);
    let commands = go_on(&mut limiter, &Wish { aim: Aim::Nobody, ..wish(0, 0.0, 0.0) }, 5);
    for command in commands {
        assert!((curvature(command.twist) - curve).abs() < 1e-9, "{command:?}");
    }
}

#[test]
fn late_frames_halve_the_speed_within_the_limits() {
    let (mut limiter, _) = at_speed(0.8, 0.8);
    let late = Wish { pause_s: 0.3, ..wish(40, 0.8, 0.8) };
    let commands = go_on(&mut limiter, &late, 5);
    assert!(commands.iter().all(|command| command.reason == Reason::Slow), "{commands:?}");
    assert!((commands[0].wheels.left - 0.7).abs() < 1e-9, "{commands:?}");
    assert!((commands[4].wheels.left - 0.45).abs() < 1e-9, "{commands:?}");
}

#[test]
fn whoever_may_be_the_wrong_one_is_followed_at_half_speed() {
    for (aim, reason) in [(Aim::Perhaps, Reason::Unsure), (Aim::Search, Reason::Search)] {
        let (mut limiter, _) = at_speed(0.8, 0.8);
        let commands = go_on(&mut limiter, &Wish { aim, ..wish(0, 0.8, 0.8) }, 5);
        assert!(commands.iter().all(|command| command.reason == reason), "{commands:?}");
        assert!((commands[4].wheels.left - 0.45).abs() < 1e-9, "{commands:?}");
        for (frame, reason) in [(45, Reason::Limited), (46, reason)] {
            let slow = Wish { aim, ..wish(frame, 0.3, 0.3) };
            assert_eq!(limiter.limit(&slow, free).reason, reason);
        }
    }
}

#[test]
fn an_expired_command_was_a_stop_from_which_the_robot_starts_anew() {
    let (mut limiter, command) = at_speed(0.8, 0.8);
    let late = Wish { stamp: command.stamp.plus_seconds(0.3), ..wish(0, 0.8, 0.8) };
    assert!((limiter.limit(&late, free).wheels.left - 0.1).abs() < 1e-9);
}

#[test]
fn the_turn_rate_changes_no_faster_than_it_may() {
    let (mut limiter, _) = at_speed(0.0, 0.0);
    let wishes = go_on(&mut limiter, &wish(0, -0.2, 0.2), 5);
    for (command, turn) in wishes.iter().zip([0.4, 0.8, 0.2 / 0.167, 0.2 / 0.167]) {
        assert!((command.twist.angular_rps - turn).abs() < 1e-9, "{command:?}");
    }
    let back = limiter.limit(&wish(45, 0.2, -0.2), free);
    assert!((back.twist.angular_rps - (0.2 / 0.167 - 0.4)).abs() < 1e-9, "{back:?}");
}

#[test]
fn a_holonomic_base_drives_and_turns_at_full_speed_at_once() {
    let mut limiter = limiter_on(Base::Holonomic);
    let wheels = DRIVE.wheels(Twist::new(0.9, 1.5));
    let commands =
        (1..60).map(|frame| limiter.limit(&wish(frame, wheels.left, wheels.right), free));
    let last = commands.last().unwrap();
    assert!((last.twist.linear_mps - 0.9).abs() < 1e-9, "{last:?}");
    assert!((last.twist.angular_rps - 1.5).abs() < 1e-9, "{last:?}");
    assert_eq!(last.reason, Reason::Follow);
}

#[test]
fn a_base_that_steers_like_a_car_turns_by_its_radius_and_not_on_the_spot() {
    let mut limiter = limiter_on(Base::Ackermann);
    let spot = limiter.limit(&wish(1, -0.3, 0.3), free);
    assert_eq!((spot.wheels, spot.reason), (WheelSpeeds::STOP, Reason::Limited));
    let commands = (2..60).map(|frame| limiter.limit(&wish(frame, 0.1, 0.5), free));
    let last = commands.last().unwrap();
    assert!((last.twist.linear_mps - 0.3).abs() < 1e-9, "{last:?}");
    assert!((last.twist.angular_rps - 0.3 / 0.8).abs() < 1e-9, "{last:?}");
    let blocked = limiter.limit(&wish(60, 0.1, 0.5), something(0.1));
    assert_eq!((blocked.wheels, blocked.reason), (WheelSpeeds::STOP, Reason::Blocked));
}

#[test]
fn the_speed_that_a_planner_allows_holds_within_the_limits_of_the_robot() {
    let (mut limiter, _) = at_speed(0.8, 0.8);
    limiter.allow_speed(0.5);
    let commands = go_on(&mut limiter, &wish(0, 0.8, 0.8), 6);
    assert!((commands[0].twist.linear_mps - 0.7).abs() < 1e-9, "no leap: {commands:?}");
    assert!((commands[5].twist.linear_mps - 0.5).abs() < 1e-9, "{commands:?}");
    assert_eq!(commands[5].reason, Reason::Limited);
    for wrong in [-1.0, f64::NAN] {
        limiter.allow_speed(wrong);
        assert_eq!(limiter.allowed_mps, 0.0);
    }
    limiter.allow_speed(f64::INFINITY);
    let last = (46..90).map(|frame| limiter.limit(&wish(frame, 0.8, 0.8), free)).last().unwrap();
    assert!((last.twist.linear_mps - 0.8).abs() < 1e-9, "{last:?}");
}

/// A robot that drives at a wall brakes early enough to do so within the limit of the jerk.
#[test]
fn before_a_wall_the_robot_stops_without_an_emergency() {
    for period_s in [0.03, 0.1] {
        let mut limiter = limiter_of(CommandLimiterSettings::default());
        let mut tape = Motion::default();
        let mut place_m = 0.0;
        let mut speeds = Vec::new();
        for frame in 1..600_u32 {
            let stamp = Stamp::from_nanos(1_000_000_000).plus_seconds(f64::from(frame) * period_s);
            // In steps of a centimetre, as the corridor tells it.
            let at_m = ((6.0_f64 - place_m) * 100.0).floor() / 100.0;
            let wish = Wish { stamp, pause_s: period_s, ..wish(0, 0.9, 0.9) };
            let command = limiter.limit(&wish, something(at_m));
            let change = (limiter.motion.forward.accel - tape.forward.accel).abs();
            let longest_s = if frame == 1 { LONGEST_STEP_S } else { period_s };
            // A robot that creeps follows the centimetres of the corridor.
            if command.twist.linear_mps > 0.1 {
                // Stamps are whole nanoseconds.
                assert!(change <= 5.0 * longest_s + 1e-6, "{frame} {at_m} {command:?} {tape:?}");
            }
            tape = limiter.motion;
            place_m += command.twist.linear_mps * period_s;
            speeds.push(command.twist.linear_mps);
        }
        assert!(speeds.contains(&0.9), "it has reached its full speed");
        assert!((0.4..0.5).contains(&(6.0 - place_m)), "{place_m}");
    }
}

#[test]
fn an_obstacle_slows_and_then_stops() {
    fn speed(at_m: f64) -> Command {
        let (mut limiter, _) = at_speed(0.8, 0.8);
        limiter.limit(&wish(40, 0.8, 0.8), something(at_m))
    }

    assert_eq!(speed(2.5).reason, Reason::Follow);
    let near = speed(0.6);
    assert_eq!(near.reason, Reason::Obstacle);
    assert!((near.wheels.left - (0.65_f64.sqrt() - 0.5)).abs() < 1e-9, "{near:?}");
    assert_eq!((speed(0.39).wheels, speed(0.39).reason), (WheelSpeeds::STOP, Reason::Blocked));
}

#[test]
fn before_an_obstacle_the_robot_may_still_turn_in_place() {
    let mut limiter = limiter();
    let command = limiter.limit(&wish(1, 0.1, 0.3), something(0.1));
    assert_eq!(command.reason, Reason::Blocked);
    assert!(command.wheels.left < 0.0 && command.wheels.left == -command.wheels.right);
}

#[test]
fn backwards_only_where_it_is_allowed() {
    let (_, command) = at_speed(-0.4, -0.2);
    assert!((command.wheels.left + command.wheels.right).abs() < 1e-9, "{command:?}");
    let settings = CommandLimiterSettings { reverse: true, ..abrupt() };
    let mut limiter = limiter_of(settings);
    let back = (1..40).map(|frame| limiter.limit(&wish(frame, -0.4, -0.2), free)).last();
    assert!((back.unwrap().wheels.left + 0.4).abs() < 1e-9);
}

#[test]
fn commands_expire() {
    let (moving, command) = at_speed(0.5, 0.5);
    let [later, too_late, earlier, too_early] = [0.2, 0.3, -0.2, -0.3]
        .map(|seconds| moving.orders().at(command.stamp.plus_seconds(seconds)));
    let [young, old] =
        [249, 251].map(|ms| moving.orders().after(command.stamp, Duration::from_millis(ms)));
    for order in [later, earlier, young] {
        assert_eq!(order, command);
    }
    for order in [too_late, too_early, old] {
        assert_eq!((order.wheels, order.reason), (WheelSpeeds::STOP, Reason::Expired));
    }
    let nothing_yet = limiter().orders().at(Stamp::from_nanos(5));
    assert_eq!(nothing_yet.wheels, WheelSpeeds::STOP);
}

#[test]
fn a_withdrawn_command_is_a_stop_from_which_the_robot_starts_anew() {
    let (mut limiter, command) = at_speed(0.8, 0.8);
    let soon = command.stamp.plus_seconds(0.1);
    limiter.withdraw(soon);
    for at in [command.stamp, soon] {
        let order = limiter.orders().at(at);
        assert_eq!((order.wheels, order.reason), (WheelSpeeds::STOP, Reason::Expired));
    }
    let next = Wish { stamp: command.stamp.plus_seconds(0.2), ..wish(0, 0.8, 0.8) };
    let started = limiter.limit(&next, free);
    assert!((0.01..0.11).contains(&started.wheels.left), "{started:?}");
    assert_eq!(limiter.orders().at(started.stamp), started);
}

#[test]
fn a_jump_of_odometry_lasts_until_armed() {
    let (mut limiter, command) = at_speed(0.5, 0.5);
    limiter.check_motion(&moved(EgoMotion { forward: 2.0, ..EgoMotion::at_rest(0.1) }));
    assert_eq!(limiter.orders().at(command.stamp).reason, Reason::Fault);
    for frame in 40..60 {
        let command = limiter.limit(&wish(frame, 0.5, 0.5), free);
        assert_eq!((command.wheels, command.reason), (WheelSpeeds::STOP, Reason::Fault));
    }
    assert_eq!(limiter.fault(), Some("odometry jumped"));
    limiter.arm();
    assert!(limiter.limit(&wish(60, 0.5, 0.5), free).wheels.left > 0.0);
}

#[test]
fn a_turn_faster_than_any_robot_is_a_jump_of_odometry() {
    for (turn_rad, dt_s, is_jump) in
        [(0.64, 0.1, true), (-3.0, 0.1, true), (0.62, 0.1, false), (0.3, 0.01, false)]
    {
        let (mut limiter, _) = at_speed(0.5, 0.5);
        limiter.check_motion(&moved(EgoMotion { turn: turn_rad, ..EgoMotion::at_rest(dt_s) }));
        let fault = is_jump.then_some("odometry jumped");
        assert_eq!(limiter.fault(), fault, "{turn_rad} rad in {dt_s} s");
    }
}

#[test]
fn stopping_takes_what_physics_says() {
    let settings = CommandLimiterSettings { margin_m: 0.0, ..CommandLimiterSettings::default() };
    assert!((settings.stopping_m(0.9) - 0.945).abs() < 1e-9, "with the rise of the deceleration");
    let settings = CommandLimiterSettings { margin_m: 0.0, ..abrupt() };
    assert!((settings.stopping_m(0.9) - 0.855).abs() < 1e-9);
}

#[test]
fn who_turns_too_fast_turns_slower_on_the_same_arc() {
    let (_, command) = at_speed(-0.9, 0.9);
    let rim = 1.5 * DRIVE.half_separation_m;
    assert_eq!(command.reason, Reason::Limited);
    assert!((command.wheels.right - rim).abs() < 1e-9, "{command:?}");
    assert!((command.wheels.left + rim).abs() < 1e-9, "{command:?}");
    let (_, bend) = at_speed(0.1, 0.9);
    let WheelSpeeds { left, right } = bend.wheels;
    assert!((right / left - 9.0).abs() < 1e-9, "{bend:?}");
    assert!((right - left - 2.0 * rim).abs() < 1e-9, "{bend:?}");
}

#[test]
fn while_it_speeds_up_the_robot_is_on_the_arc_that_was_wished_for() {
    let mut limiter = limiter();
    for frame in 1..6 {
        let command = limiter.limit(&wish(frame, 0.4, 0.8), free);
        let WheelSpeeds { left, right } = command.wheels;
        assert!((right / left - 2.0).abs() < 1e-9, "{command:?}");
        assert_eq!(command.reason, Reason::Limited);
    }
}

#[test]
fn each_path_is_looked_along_whatever_its_kind() {
    let arc = asked_way(abrupt(), 0.3, 0.4);
    let Some((Path::Arc { curvature, backwards: false }, speed)) = arc else {
        panic!("an arc ahead");
    };
    assert!((curvature - 0.05 / DRIVE.half_separation_m / 0.35).abs() < 1e-9, "{curvature}");
    assert!((speed - 0.1).abs() < 1e-9, "the speed of this step: {speed}");
    let turn = asked_way(abrupt(), -0.2, 0.2).map(|(path, _)| path);
    assert_eq!(turn, Some(Path::Turn { left: true }));
    let reverse = CommandLimiterSettings { reverse: true, ..abrupt() };
    let back = asked_way(reverse, -0.2, -0.2).map(|(path, _)| path);
    assert!(matches!(back, Some(Path::Arc { backwards: true, .. })), "{back:?}");
    assert_eq!(asked_way(abrupt(), 0.0, 0.0), None, "a robot that stands sweeps nothing");
}

/// Returns the path and the speed that a limiter asks about for a wish.
fn asked_way(settings: CommandLimiterSettings, left: f64, right: f64) -> Option<(Path, f64)> {
    let asked = Cell::new(None);
    limiter_of(settings).limit(&wish(1, left, right), |path, speed, _| {
        asked.set(Some((path, speed)));
        Allowance::FREE
    });
    asked.get()
}

#[test]
fn a_turn_that_is_not_free_is_slower_or_none() {
    let [free, slower, none] = [9.0, 0.5, 0.0].map(|most| {
        let mut limiter = limiter();
        let commands = (1..40).map(|frame| {
            limiter.limit(&wish(frame, -0.2, 0.2), |path, _, _| match path {
                Path::Turn { .. } => Allowance { gentle: most, most, ..Allowance::FREE },
                Path::Arc { .. } => Allowance::FREE,
            })
        });
        commands.last().unwrap()
    });
    assert!((free.twist.angular_rps - 0.2 / 0.167).abs() < 1e-9);
    assert!((slower.twist.angular_rps - 0.5).abs() < 1e-9, "{slower:?}");
    assert_eq!(slower.reason, Reason::Obstacle);
    assert_eq!((none.wheels, none.reason), (WheelSpeeds::STOP, Reason::Blocked));
}

#[test]
fn odometry_that_is_old_or_no_number_and_late_images_stop() {
    fn reason(frame: Frame) -> (Reason, bool) {
        let (mut limiter, _) = at_speed(0.8, 0.8);
        limiter.check_motion(&frame);
        let command = limiter.limit(&wish(40, 0.8, 0.8), free);
        (command.reason, command.wheels == WheelSpeeds::STOP)
    }

    fn still() -> Frame {
        moved(EgoMotion::at_rest(0.1))
    }

    assert_eq!(reason(still()), (Reason::Follow, false));
    assert_eq!(reason(still().with_odometry_age(0.3)), (Reason::Slow, false));
    for age_s in [0.51, f64::INFINITY, f64::NAN] {
        assert_eq!(reason(still().with_odometry_age(age_s)), (Reason::Odometry, true), "{age_s}");
    }
    for broken in [f64::NAN, f64::NEG_INFINITY] {
        let turned = moved(EgoMotion { turn: broken, ..EgoMotion::at_rest(0.1) });
        assert_eq!(reason(turned), (Reason::Odometry, true));
    }
    assert_eq!(reason(still().with_camera_pose_age(1.4)), (Reason::Follow, false));
    for age_s in [1.6, f64::INFINITY, f64::NAN] {
        let frame = still().with_camera_pose_age(age_s);
        assert_eq!(reason(frame), (Reason::CameraPose, true), "{age_s}");
    }
    assert_eq!(reason(still().with_latency(Some(0.2))), (Reason::Follow, false));
    for latency_s in [0.51, f64::NAN] {
        let late = still().with_latency(Some(latency_s));
        assert_eq!(reason(late), (Reason::Late, true), "{latency_s}");
    }
}

/// Drives with a wish of `wished_mps`, less every other one and a half seconds, on a base that responds
/// so many frames late, or not at all; returns the limiter and the last command.
fn driven(wished_mps: f64, frames: u64, late: Option<usize>) -> (CommandLimiter, Command) {
    let mut limiter = limiter();
    limiter.set_driving(true);
    let mut commands: Vec<Command> = Vec::new();
    for index in 1..=frames {
        let sent = late.and_then(|late| commands.len().checked_sub(1 + late));
        let mps = sent.map_or(0.0, |sent| commands[sent].twist.linear_mps);
        let motion = EgoMotion { forward: mps * PERIOD_S, ..EgoMotion::at_rest(PERIOD_S) };
        // A delay shows only while the speed changes.
        let part = if index / 15 % 2 == 0 { 1.0 } else { 0.5 };
        let wish = wish(index, part * wished_mps, part * wished_mps);
        let mut frame = moved(motion);
        frame.stamp = wish.stamp;
        limiter.check_motion(&frame);
        commands.push(limiter.limit(&wish, free));
    }
    let last = commands[commands.len() - 1];
    (limiter, last)
}

#[test]
fn a_base_that_does_not_do_as_it_is_told_is_a_fault() {
    let (obeys, command) = driven(0.8, 74, Some(0));
    assert_eq!((obeys.fault(), command.reason), (None, Reason::Follow));
    let (stuck, command) = driven(0.8, 60, None);
    assert_eq!(stuck.fault(), Some("the base does not move as it is commanded"));
    assert_eq!((command.reason, command.wheels), (Reason::Fault, WheelSpeeds::STOP));
    // So slow that noise explains it for a while.
    let (creeping, command) = driven(0.08, 100, None);
    assert_eq!(
        creeping.fault(),
        Some("the odometry stands still while the robot is commanded to move")
    );
    assert_eq!(command.reason, Reason::Fault);
}

#[test]
fn a_base_that_responds_late_is_slower_and_one_that_is_much_too_late_is_a_fault() {
    let (late, command) = driven(0.8, 74, Some(5));
    assert_eq!(late.fault(), None);
    assert!(late.reaction_s > 0.55, "{}", late.reaction_s);
    assert!(command.twist.linear_mps < 0.46, "{command:?}");
    assert_eq!(command.reason, Reason::Slow);
    let (too_late, _) = driven(0.8, 74, Some(12));
    assert_eq!(too_late.fault(), Some("the base responds too late to its commands"));
}

#[test]
fn of_several_limits_the_lowest_holds_and_is_named() {
    for (aim, pause_s, at_m, reason, percent, why) in [
        (Aim::Perhaps, 0.1, 2.0, Reason::Unsure, 70.0, "half speed"),
        (Aim::Perhaps, 0.3, 2.0, Reason::Slow, 70.0, "and not a quarter"),
        (Aim::Perhaps, 0.1, 0.45, Reason::Obstacle, 9.0, "an obstacle before half speed"),
        (Aim::Person, 0.1, 0.7, Reason::Obstacle, 42.0, "an obstacle"),
        (Aim::Person, 0.25, 2.0, Reason::Follow, 80.0, "just in time"),
        (Aim::Person, 0.5, 2.0, Reason::Slow, 70.0, "just not stopped"),
    ] {
        let (mut limiter, _) = at_speed(0.8, 0.8);
        let wish = Wish { aim, pause_s, ..wish(40, 0.8, 0.8) };
        let command = limiter.limit(&wish, something(at_m));
        let found = (command.reason, (command.wheels.left * 100.0).round());
        assert_eq!(found, (reason, percent), "{why}");
    }
}

#[test]
fn a_pause_gives_no_licence_for_a_leap() {
    let (mut limiter, _) = at_speed(0.1, 0.1);
    let late = Wish { stamp: Stamp::from_nanos(4_900_000_000), ..wish(0, 0.9, 0.9) };
    let command = limiter.limit(&late, free);
    assert!((command.wheels.left - (0.5 * LONGEST_STEP_S)).abs() < 1e-9, "{command:?}");
}

#[test]
fn backwards_it_speeds_up_and_slows_down_as_it_does_ahead() {
    let settings = CommandLimiterSettings { reverse: true, ..abrupt() };
    let mut limiter = limiter_of(settings);
    for (frame, wished, expected) in
        [(1, -0.9, -0.1), (2, -0.9, -0.15), (3, -0.9, -0.2), (4, 0.0, -0.1)]
    {
        let found = limiter.limit(&wish(frame, wished, wished), free).wheels.left;
        assert!((found - expected).abs() < 1e-9, "{frame}: {found}");
    }
}

#[test]
fn commands_say_until_when_they_hold_and_what_they_answer_to() {
    let (_, command) = at_speed(0.5, 0.5);
    assert_eq!(command.stamp, wish(39, 0.0, 0.0).stamp);
    assert_eq!(command.valid_until, command.stamp.plus_seconds(0.25));
}

#[test]
fn odometry_may_be_as_fast_as_the_setting_says_in_all_directions() {
    fn is_fault(forward: f64, left: f64, dt: f64) -> bool {
        let mut limiter = limiter();
        limiter.check_motion(&moved(EgoMotion { forward, left, ..EgoMotion::at_rest(dt) }));
        limiter.fault().is_some()
    }

    assert!(!is_fault(0.29, 0.0, 0.1) && is_fault(0.31, 0.0, 0.1), "3 m/s");
    assert!(!is_fault(0.0, -0.29, 0.1) && is_fault(0.0, -0.31, 0.1) && is_fault(-0.31, 0.0, 0.1));
    assert!(!is_fault(0.2, 0.2, 0.1) && is_fault(0.22, 0.22, 0.1), "both at once");
    assert!(!is_fault(0.14, 0.0, 0.0) && is_fault(0.16, 0.0, 0.0), "stamps are never so exact");
}

#[test]
fn the_first_fault_is_told_and_after_it_the_robot_starts_anew() {
    let (mut limiter, _) = at_speed(0.8, 0.8);
    limiter.latch("a button");
    limiter.latch("odometry jumped");
    assert_eq!(limiter.fault(), Some("a button"));
    limiter.arm();
    assert_eq!((limiter.fault(), limiter.orders().last), (None, None));
    let command = limiter.limit(&wish(41, 0.8, 0.8), free);
    assert!((command.wheels.left - 0.5 * LONGEST_STEP_S).abs() < 1e-9, "{command:?}");
}

#[test]
fn a_wish_of_either_wheel_that_is_no_number_stops() {
    for (left, right) in [(0.1, f64::NAN), (f64::INFINITY, 0.1), (0.1, f64::NEG_INFINITY)] {
        let (mut limiter, _) = at_speed(0.5, 0.5);
        let command = limiter.limit(&wish(40, left, right), free);
        assert_eq!((command.wheels, command.reason), (WheelSpeeds::STOP, Reason::NotFinite));
    }
}

#[test]
fn stopping_takes_reaction_braking_and_a_margin() {
    let settings = CommandLimiterSettings {
        reaction_s: 0.4,
        max_decel_mps2: 2.0,
        max_jerk_mps3: 10.0,
        margin_m: 0.25,
        ..CommandLimiterSettings::default()
    };
    assert!((settings.stopping_m(2.0) - (0.8 + 0.2 + 1.0 + 0.25)).abs() < 1e-12);
}

#[test]
fn in_the_slowdown_polygon_the_robot_drives_and_turns_at_a_part_of_its_speed() {
    let mut limiter = limiter();
    let slower = Wish { slowdown: Some((0.5, Reason::Obstacle)), ..wish(0, 0.8, 0.6) };
    let commands = go_on(&mut limiter, &slower, 30);
    let Command { twist, reason, .. } = commands[29];
    let wished = DRIVE.twist(WheelSpeeds { left: 0.8, right: 0.6 });
    assert!((twist.linear_mps - 0.5 * wished.linear_mps).abs() < 1e-6, "{twist:?}");
    assert!((twist.angular_rps - 0.5 * wished.angular_rps).abs() < 1e-6, "{twist:?}");
    assert_eq!(reason, Reason::Obstacle);
}
