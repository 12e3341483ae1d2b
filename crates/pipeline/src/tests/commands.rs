//! Faults on the way to the wheels: each leads to zero within the frame in which it is seen or,
//! without a frame, within the validity of a command.

use nalgebra::Point3;
use tagalong_core::{Command, EgoMotion, Frame, Images, Reason, Stamp, Track, WheelSpeeds};

use super::doubles::{PLAIN, World, camera, frame, hall, person, scored, with_eyes};
use crate::{LockState, Pipeline};

/// A pipeline that has followed a person for two seconds.
fn driving(how: &str) -> (World, Pipeline) {
    let world = World::of((0..60).map(|_| vec![scored(5.0, person(3.0, 0.0))]));
    let config = format!("{PLAIN}\n[controller]\nplugin = 'drive'\nconfig = {{ how = '{how}' }}\n");
    let mut pipeline = world.pipeline(&config);
    for index in 1..=20 {
        pipeline.step(frame(index, index as f64 * 0.1)).unwrap();
    }
    assert!(is_moving(&pipeline.command_at(frame(20, 2.0).stamp).unwrap()));
    (world, pipeline)
}

fn is_moving(command: &Command) -> bool {
    command.wheels != WheelSpeeds::STOP
}

fn after(index: u64, t_s: f64, motion: EgoMotion) -> Frame {
    let stamp = frame(index, t_s).stamp;
    with_eyes(Frame::new(index, stamp, std::sync::Arc::new(camera()), motion, Images::default()))
}

/// The command for a frame that comes that much later.
fn paused(pause_s: f64) -> (Pipeline, Command) {
    let (_, mut pipeline) = driving("");
    let report = pipeline.step(after(21, 2.0 + pause_s, EgoMotion::at_rest(pause_s))).unwrap();
    (pipeline, report.command.unwrap())
}

#[test]
fn t7_a_gap_of_the_odometry_stops_and_a_jump_is_a_fault_at_once() {
    let (_, mut pipeline) = driving("");
    let jump = EgoMotion { forward: 2.0, ..EgoMotion::at_rest(0.1) };
    let command = pipeline.step(after(21, 2.1, jump)).unwrap().command.unwrap();
    assert_eq!((command.wheels, command.reason), (WheelSpeeds::STOP, Reason::Fault));
    assert_eq!(pipeline.fault(), Some("odometry jumped"));
    let later = pipeline.step(frame(22, 2.2)).unwrap().command.unwrap();
    assert_eq!(later.reason, Reason::Fault, "it lasts");
    pipeline.arm();
    assert!(is_moving(&pipeline.step(frame(23, 2.3)).unwrap().command.unwrap()));
    assert!(!is_moving(&paused(1.0).1));
}

#[test]
fn t7_a_jump_that_the_frame_source_has_seen_is_a_fault_at_this_very_frame() {
    let (_, mut pipeline) = driving("");
    let jumped = after(21, 2.1, EgoMotion::at_rest(0.1)).with_odometry_jump(true);
    let command = pipeline.step(&jumped).unwrap().command.unwrap();
    assert_eq!((command.wheels, command.reason), (WheelSpeeds::STOP, Reason::Fault));
    assert_eq!(pipeline.fault(), Some("odometry jumped"));
}

#[test]
fn c1_another_calibration_freezes_the_tracks_and_holds_the_robot() {
    fn place(track: &Track) -> Point3<f64> {
        track.estimate.person.position
    }

    let (world, mut pipeline) = driving("");
    let before = pipeline.step(frame(21, 2.1)).unwrap().tracks;
    let asked = world.asked.lock().unwrap().len();
    // The robot was moving: 0.2 m ahead, and a quarter of a turn to the left.
    let turn = std::f64::consts::FRAC_PI_2;
    let motion = EgoMotion { forward: 0.2, turn, ..EgoMotion::at_rest(0.1) };
    let report = pipeline.step(after(22, 2.2, motion).with_changed_calibration(true)).unwrap();
    let held = &report.tracks[0];
    let was = &before[0];
    assert_eq!((held.id, held.seen, held.confirmed), (was.id, false, true));
    // Where it was on the floor: now 2.8 m to the right.
    assert!((place(held) - Point3::new(0.0, -2.8, 1.6)).norm() < 1e-9, "{held:?}");
    assert_eq!(report.funnel.count("frame: calibration changed"), 1);
    let command = report.command.unwrap();
    assert_eq!((command.wheels, command.reason), (WheelSpeeds::STOP, Reason::Fault));
    assert_eq!(pipeline.fault(), Some("the calibration changed"));
    // Neither arming nor frames that say nothing of it let go.
    pipeline.arm();
    for index in 23..40 {
        let report = pipeline.step(frame(index, index as f64 * 0.1)).unwrap();
        assert!((place(&report.tracks[0]) - place(held)).norm() < 1e-9);
        assert_eq!(report.command.unwrap().reason, Reason::Fault, "{index}");
        assert_eq!(report.funnel.count("frame: calibration changed"), 1);
    }
    assert_eq!(world.asked.lock().unwrap().len(), asked, "no plugin gets such a frame");
    let reset = pipeline.step(frame(40, 99.0)).unwrap();
    assert_eq!((reset.tracks.len(), reset.ended), (0, vec![held.id]), "nothing lasts over a jump");
}

/// A person steps in from beside the camera, and is in no image.
#[test]
fn who_is_in_the_laser_scan_alone_is_not_driven_into() {
    let (_, mut pipeline) = driving("");
    let shins = [Point3::new(0.5, 0.3, 0.2), Point3::new(0.5, 0.15, 0.2)];
    for (index, laser, reason) in [(21, &shins[..], Reason::TooClose), (22, &[], Reason::Limited)] {
        let frame = frame(index, index as f64 * 0.1).with_laser(Some(hall(index, laser)));
        let report = pipeline.step(&frame).unwrap();
        let command = report.command.unwrap();
        assert_eq!(command.reason, reason, "{index}");
        let is_seen = report.obstacles.iter().any(|o| o.at.x == 0.5 && o.at.y == 0.15);
        assert_eq!(is_seen, !laser.is_empty(), "{:?}", report.obstacles);
        let WheelSpeeds { left, right } = command.wheels;
        assert_eq!(left + right > 1e-9, laser.is_empty(), "turning is allowed: {command:?}");
    }
}

#[test]
fn t8_a_stall_halves_the_speed_then_stops_then_loses_the_person() {
    let (_, slow) = paused(0.3);
    assert_eq!(slow.reason, Reason::Slow);
    assert!(slow.wheels.left + slow.wheels.right <= 0.9 + 1e-9, "half speed: {slow:?}");
    let (_, stopped) = paused(0.6);
    assert_eq!((stopped.wheels, stopped.reason), (WheelSpeeds::STOP, Reason::Stalled));
    let (world, mut pipeline) = driving("");
    world.show(0, 21, vec![]);
    let lost = pipeline.step(after(21, 4.2, EgoMotion::at_rest(2.2))).unwrap();
    assert_eq!(lost.lock.unwrap().state, LockState::Lost);
}

#[test]
fn t8_without_frames_commands_expire_by_themselves() {
    let (_, pipeline) = driving("");
    let [moving, expired] =
        [2.2, 2.3].map(|t_s| pipeline.command_at(frame(20, t_s).stamp).unwrap());
    assert!(is_moving(&moving));
    assert_eq!((expired.wheels, expired.reason), (WheelSpeeds::STOP, Reason::Expired));
}

#[test]
fn s5_a_person_who_is_replaced_while_hidden_is_not_silently_swapped() {
    let (world, mut pipeline) = driving("");
    let mut other = scored(5.0, person(3.0, 0.0));
    other.position.z = 1.9;
    for index in 21..=30 {
        world.show(0, index, vec![]);
    }
    for index in 31..=60 {
        world.show(0, index, vec![other.clone()]);
    }
    for index in 21..=60 {
        let report = pipeline.step(frame(index, index as f64 * 0.1)).unwrap();
        if index > 45 {
            assert_eq!((report.target, report.lock.unwrap().state), (None, LockState::Lost));
        }
    }
}

#[test]
fn s6_whoever_jumps_or_stands_anywhere_gets_commands_within_the_limits() {
    for (x, y) in [(0.0, 0.0), (-3.0, 0.0), (0.3, 0.0), (20.0, 0.0), (3.0, 5.0), (-0.01, 1e-9)] {
        let (world, mut pipeline) = driving("");
        for index in 21..=40 {
            world.show(0, index, vec![scored(5.0, person(x, y))]);
            let command = pipeline.step(frame(index, index as f64 * 0.1)).unwrap().command.unwrap();
            let WheelSpeeds { left, right } = command.wheels;
            assert!(left.abs() <= 0.9 && right.abs() <= 0.9, "{x} {y} {command:?}");
            assert!(left + right >= -1e-9, "backwards: {x} {y} {command:?}");
        }
    }
}

#[test]
fn a_robot_that_is_disarmed_stands_until_it_is_armed() {
    fn moves_at(pipeline: &mut Pipeline, i: u64) -> bool {
        is_moving(&pipeline.step(frame(i, i as f64 * 0.1)).unwrap().command.unwrap())
    }

    // Each frame is shown: a pause would reset the clock.
    fn moves(pipeline: &mut Pipeline, frames: std::ops::RangeInclusive<u64>) -> bool {
        frames.filter(|i| moves_at(pipeline, *i)).count() > 0
    }

    let world = World::of((0..60).map(|_| vec![scored(5.0, person(3.0, 0.0))]));
    let config = format!("{PLAIN}\n[controller]\nplugin = 'drive'\n");
    let mut pipeline = world.pipeline(&config);
    assert!(moves(&mut pipeline, 1..=20));
    pipeline.disarm("a button");
    assert_eq!(pipeline.fault(), Some("a button"));
    assert!(!moves(&mut pipeline, 21..=40));
    pipeline.arm();
    assert!(moves(&mut pipeline, 41..=60));
}

#[test]
fn p1_a_plugin_that_panics_stops_the_robot_in_the_same_tick() {
    let world = World::of((0..30).map(|_| vec![scored(5.0, person(3.0, 0.0))]));
    for (of, config) in [
        ("drive", "[controller]\nplugin = 'drive'\nconfig = { how = 'panic at 21' }"),
        (
            "choosy",
            "[controller]\nplugin = 'drive'\n[[verifiers]]\nplugin = 'choosy'\nconfig = { how = 'panic at 21' }",
        ),
    ] {
        let mut pipeline = world.pipeline(&format!("{PLAIN}\n{config}\n"));
        (1..=20).for_each(|i| drop(pipeline.step(frame(i, i as f64 * 0.1)).unwrap()));
        let now: Stamp = frame(21, 2.1).stamp;
        assert!(is_moving(&pipeline.command_at(now).unwrap()));
        let error = pipeline.step(frame(21, 2.1)).unwrap_err().to_string();
        assert!(error.starts_with(&format!("frame 21: `{of}` panicked")), "{error}");
        let command = pipeline.command_at(now).unwrap();
        assert_eq!((command.wheels, command.reason), (WheelSpeeds::STOP, Reason::Fault));
        pipeline.arm();
        assert!(!is_moving(&pipeline.command_at(now).unwrap()), "no restart of a broken pipeline");
    }
}

#[test]
fn the_cause_of_a_stop_by_a_fault_is_the_one_that_was_latched_first() {
    let world = World::of((0..60).map(|_| vec![scored(5.0, person(3.0, 0.0))]));
    let mut pipeline = world.pipeline(&format!("{PLAIN}\n[controller]\nplugin = 'drive'\n"));
    let mut causes = Vec::new();
    for i in 1..=40 {
        if i == 21 {
            pipeline.disarm("a button");
        }
        let mut frame = frame(i, i as f64 * 0.1);
        frame.odometry_jumped = i == 30;
        let report = pipeline.step(frame).unwrap();
        causes.push(report.cause.map(|cause| cause.to_string()).unwrap_or_default());
    }
    assert!(causes[..20].iter().all(String::is_empty), "{causes:?}");
    assert!(causes[20..].iter().all(|cause| cause == "a button"), "{causes:?}");
}

/// Ten minutes at fifteen frames a second.
#[test]
fn s3_without_people_there_is_no_track_and_every_command_is_zero() {
    let world = World::of([]);
    let config = format!("{PLAIN}\n[controller]\nplugin = 'drive'\n");
    let mut pipeline = world.pipeline(&config);
    for index in 1..=9000 {
        let report = pipeline.step(frame(index, index as f64 / 15.0)).unwrap();
        assert!(report.tracks.is_empty(), "{index}");
        assert_eq!(report.command.unwrap().wheels, WheelSpeeds::STOP, "{index}");
    }
}

#[test]
fn s4_of_a_crowd_so_many_are_tracked_as_the_limit_says_and_the_target_stays_or_is_lost() {
    let (world, mut pipeline) = driving("");
    let target = pipeline.step(frame(21, 2.1)).unwrap().target.unwrap();
    let mut all = vec![scored(5.0, person(3.0, 0.0))];
    for i in 0..300_u32 {
        let ahead_m = 1.5 + 0.8 * f64::from(i / 20);
        all.push(scored(4.0, person(ahead_m, -8.0 + 0.8 * f64::from(i % 20))));
    }
    for index in 22..=40 {
        world.show(0, index, all.clone());
        let report = pipeline.step(frame(index, index as f64 * 0.1)).unwrap();
        assert!(report.tracks.len() <= 256, "{}", report.tracks.len());
        let is_lost = report.lock.unwrap().state == LockState::Lost;
        assert!(report.target == Some(target) || is_lost, "{index}: {:?}", report.target);
        let WheelSpeeds { left, right } = report.command.unwrap().wheels;
        assert!(left.abs() <= 0.9 && right.abs() <= 0.9, "{left} {right}");
    }
}
