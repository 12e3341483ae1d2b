//! Faults in the middle of a ride: the robot stands soon after each of them, whatever it was doing.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failing test may panic")]

use std::path::Path;

use tagalong_core::Reason;
use tagalong_sim::{FaultKind, InjectedFault, Scene, Variant};
use tagalong_trials::{Contender, Ride, RideJudge, Tick};

/// Start of the fault, s.
const AT_S: f64 = 5.0;
/// Speed below which the robot stands, m/s.
const STANDS_MPS: f64 = 0.02;

/// Returns a ride of `follow-depth` after a person walking ahead along a room, with a fault in its middle.
fn ride(kind: FaultKind) -> Ride {
    ride_of("configs", "follow-depth", kind)
}

/// Returns such a ride of a config in a folder of the repository.
fn ride_of(folder: &str, config: &str, kind: FaultKind) -> Ride {
    let walk = Variant::default()
        .with("duration_s", 11.0)
        .with("camera.rate_hz", 15.0)
        .with("people.0.path", "[[3.0, 2.0], [10.5, 2.4]]")
        .with("people.0.speed_mps", 0.7)
        .with("people.0.start_s", 1.0)
        .with("room.clutter", 6)
        .with("laser", "{}");
    let mut scene = Scene::parse_with(include_str!("../scenes/small-room.toml"), &walk).unwrap();
    scene.faults.inject.push(InjectedFault::new(kind).at(AT_S));
    scene.check_faults().unwrap();
    let registry = tagalong_catalog::registry();
    let configs = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder);
    let text = std::fs::read_to_string(configs.join(config).with_extension("toml")).unwrap();
    let contender = Contender { folder: configs, ..Contender::new(config, text) };
    Ride::new(&scene, &contender, &registry, &mut ()).unwrap()
}

/// Asserts that the robot drove before the fault, stands from `within_s` after it on, and says why.
fn assert_stands(kind: FaultKind, within_s: f64, reasons: &[Reason]) {
    assert_ride_stands(&ride(kind), kind, within_s, reasons);
}

/// Asserts the same of a ride.
fn assert_ride_stands(ride: &Ride, kind: FaultKind, within_s: f64, reasons: &[Reason]) {
    let before = ride.ticks.iter().filter(|tick| (AT_S - 1.0..AT_S).contains(&tick.at_s));
    let drove = before.map(|tick| tick.speed_mps).fold(0.0, f64::max);
    assert!(drove > 0.3, "{kind:?}: it drives before the fault, {drove}");
    let after: Vec<_> = ride.ticks.iter().filter(|tick| tick.at_s > AT_S + within_s).collect();
    assert!(after.len() > 50, "{kind:?}");
    let moving = after.iter().find(|tick| tick.body_mps() > STANDS_MPS);
    assert!(moving.is_none(), "{kind:?}: {moving:?}");
    let told: Vec<Reason> = after.iter().filter_map(|tick| tick.reason).collect();
    assert!(told.iter().any(|reason| reasons.contains(reason)), "{kind:?}: {:?}", told.first());
    let contact =
        ride.ticks.iter().any(|tick| tick.clearance.people_m.min(tick.clearance.things_m) <= 0.0);
    assert!(!contact, "{kind:?}: no contact");
}

#[test]
fn s1_a_camera_that_freezes_or_goes_dark_stops_the_robot() {
    for kind in [FaultKind::FreezeDepth, FaultKind::FreezeAll] {
        assert_stands(kind, 1.0, &[Reason::Frozen]);
    }
    for kind in [FaultKind::BlankDepth, FaultKind::SaturateDepth] {
        assert_stands(kind, 0.8, &[Reason::Blind]);
    }
    assert_stands(FaultKind::DarkColumns, 1.2, &[Reason::Unknown]);
}

/// The track of a frozen picture stays where the person was, and the person walks on.
#[test]
fn a_frozen_camera_makes_nobody_a_wrong_person() {
    let ridden = RideJudge::default().judge(&ride(FaultKind::FreezeDepth));
    assert!(ridden.right_s > 3.0, "{ridden:?}");
    assert_eq!((ridden.wrong_s, ridden.longest_wrong_s), (0.0, 0.0));
    assert!(ridden.right_s < 9.0, "nor is the person followed: {ridden:?}");
}

#[test]
fn t8_images_that_cease_come_again_or_come_late_stop_the_robot() {
    for kind in [FaultKind::Drop, FaultKind::Resend] {
        assert_stands(kind, 1.0, &[Reason::Expired]);
    }
    assert_stands(FaultKind::Delay, 3.0, &[Reason::Late, Reason::Expired]);
}

#[test]
fn t8_a_scanner_that_freezes_falls_silent_or_says_nothing_ahead_stops_the_robot() {
    assert_stands(FaultKind::FreezeLaser, 1.0, &[Reason::Frozen]);
    assert_stands(FaultKind::DropLaser, 1.3, &[Reason::Silent]);
    assert_stands(FaultKind::LaserInvalid, 1.2, &[Reason::Unknown, Reason::Frozen]);
    assert_stands(FaultKind::LaserNear, 1.2, &[Reason::Unknown, Reason::Blocked]);
}

#[test]
fn t7_odometry_that_is_silent_broken_or_stands_still_stops_the_robot() {
    for kind in [FaultKind::OdometrySilent, FaultKind::NanOdometry, FaultKind::OdometryLateStamps] {
        assert_stands(kind, 1.4, &[Reason::Odometry]);
    }
}

/// Values that stand still are those of a base that does not obey, at any speed. Without the distance
/// from people, because things that stand seem to come nearer then, and stop the robot before.
#[test]
fn t7_odometry_whose_values_stand_still_is_a_fault() {
    let kind = FaultKind::OdometryFrozen;
    let ride = ride_of("benches/papers/configs", "follow-depth-near", kind);
    assert_ride_stands(&ride, kind, 4.6, &[Reason::Fault]);
}

#[test]
fn t7_odometry_whose_values_stand_still_stops_the_robot() {
    assert_stands(FaultKind::OdometryFrozen, 4.6, &[Reason::Fault, Reason::TooClose]);
}

#[test]
fn c1_a_calibration_or_a_mount_that_changes_stops_the_robot() {
    for kind in [FaultKind::CalibrationChanged, FaultKind::MountMoved] {
        assert_stands(kind, 0.8, &[Reason::Fault]);
    }
}

#[test]
fn t1_a_clock_that_is_set_back_stops_the_robot() {
    let ride = ride(FaultKind::ClockBack);
    let just_after = ride.ticks.iter().filter(|tick| (AT_S + 0.6..AT_S + 0.8).contains(&tick.at_s));
    let fastest = just_after.map(|tick| tick.body_mps()).fold(0.0, f64::max);
    assert!(fastest < 0.3, "{fastest}");
}

/// The robot is switched off and, a second later, reset; the button is held all the time.
#[test]
fn an_enable_that_sticks_does_not_move_the_robot_after_a_reset() {
    let ride = ride(FaultKind::EnableStuck);
    let fastest = |from_s: f64, to_s: f64| {
        let between = ride.ticks.iter().filter(|tick| (from_s..to_s).contains(&tick.at_s));
        between.map(Tick::body_mps).fold(0.0, f64::max)
    };
    assert!(fastest(AT_S - 1.0, AT_S) > 0.3, "it drives before");
    assert!(fastest(AT_S + 1.5, 11.0) < STANDS_MPS, "{}", fastest(AT_S + 1.5, 11.0));
}

#[test]
fn wheels_that_are_stuck_are_a_fault() {
    let ride = ride(FaultKind::WheelsStuck);
    let fault = ride.ticks.iter().find(|tick| tick.reason == Some(Reason::Fault));
    let at_s = fault.map(|tick| tick.at_s);
    assert!(at_s.is_some_and(|at_s| at_s < AT_S + 5.0), "{at_s:?}");
}
