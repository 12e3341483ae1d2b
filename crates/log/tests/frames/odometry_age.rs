//! Age of the odometry of a frame: what is silent, invalid or stamped wrongly does not make it young.

use tagalong_log::msgs::{Odometry, Point, Pose, Quaternion};

use super::*;

/// Time at which the odometry of a log goes wrong, s.
const WRONG_AT_S: f64 = 2.0;

/// Writes a ride of 4 s with frames ten times a second. Odometry comes thirty times a second, valid
/// until [`WRONG_AT_S`], and from then on as `wrong` gives stamp and pose; `None` is silence.
fn ride(wrong: impl Fn(f64) -> Option<(f64, Pose)>) -> (Vec<LogFrame>, FrameSource, SavedLog) {
    let mut log = started();
    for tick in 0..120 {
        let t = f64::from(tick) / 30.0;
        let reading = if t < WRONG_AT_S { Some((t, driven(t))) } else { wrong(t) };
        if let Some((stamp, pose)) = reading {
            log.odometry_of(at(t), at(stamp), pose);
        }
        if tick % 3 == 0 {
            log.colour(at(t));
        }
    }
    let (mut source, saved) = open(log, Inputs::ANY);
    (frames(&mut source), source, saved)
}

/// Returns the pose of a robot that drives ahead at half a metre per second.
fn driven(t: f64) -> Pose {
    Pose::from(&Isometry3::translation(0.5 * t, 0.0, 0.0))
}

/// Checks that odometry is young while it is valid, and its true age after that.
fn assert_ages(found: &[LogFrame]) {
    assert_eq!(found.len(), 40);
    for found in found {
        let t = found.frame.stamp.seconds_since(at(0.0));
        let last_s = WRONG_AT_S - 1.0 / 30.0;
        let expected_s = (t - last_s).max(0.0);
        let age_s = found.frame.odometry_age_s;
        assert!((age_s - expected_s).abs() < 1e-6, "{age_s} at {t}, not {expected_s}");
    }
}

#[test]
fn t7_odometry_between_readings_has_no_age() {
    let (found, source, _saved) = ride(|t| Some((t, driven(t))));
    assert!(found.iter().all(|found| found.frame.odometry_age_s == 0.0));
    assert_eq!(count(&source, "odometry_ahead_frames"), 0);
}

#[test]
fn t7_silent_odometry_grows_old() {
    let (found, ..) = ride(|_| None);
    assert_ages(&found);
}

#[test]
fn t7_poses_that_are_no_numbers_are_no_odometry() {
    let position = Point { x: f64::NAN, y: 0.0, z: 0.0 };
    let (found, source, _saved) = ride(|t| Some((t, Pose { position, ..driven(t) })));
    assert_ages(&found);
    assert_eq!(count(&source, "odometry_invalid"), 60);
}

#[test]
fn t7_a_quaternion_of_zeros_is_no_odometry() {
    let orientation = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 0.0 };
    let (found, source, _saved) = ride(|t| Some((t, Pose { orientation, ..driven(t) })));
    assert_ages(&found);
    assert_eq!(count(&source, "odometry_invalid"), 60);
}

#[test]
fn t7_stamps_that_stand_still_do_not_make_odometry_young() {
    let last_s = WRONG_AT_S - 1.0 / 30.0;
    let (found, ..) = ride(|t| Some((last_s, driven(t))));
    assert_ages(&found);
}

#[test]
fn t7_stamps_an_hour_ahead_do_not_make_odometry_young() {
    let (found, source, _saved) = ride(|t| Some((t + 3600.0, driven(t))));
    // Readings of the new time push those of the old one out of memory.
    let late = found.iter().filter(|found| found.frame.stamp > at(WRONG_AT_S + 0.1));
    assert!(late.clone().count() > 15);
    assert!(late.clone().all(|found| found.frame.odometry_age_s > 0.1), "{:?}", source.notes());
    assert!(late.clone().all(|found| found.odom_stale));
    assert!(count(&source, "odometry_ahead_frames") >= 20);
    let told = source.notes().iter().filter(|note| note.contains("odometry is stamped 3600."));
    assert_eq!(told.count(), 1, "{:?}", source.notes());
}

#[test]
fn odometry_that_never_delivers_is_infinitely_old() {
    let mut log = started();
    for tick in 0..10 {
        let t = 0.1 * f64::from(tick);
        let position = Point { x: f64::NAN, y: 0.0, z: 0.0 };
        log.odometry_of(at(t), at(t), Pose { position, ..driven(t) });
        log.colour(at(t));
    }
    let (mut source, _saved) = open(log, Inputs::ANY);
    assert!(source.has_odometry());
    assert!(frames(&mut source).iter().all(|found| found.frame.odometry_age_s == f64::INFINITY));
    let (mut source, _saved) = run_of(&[0.1, 0.2, 0.3]);
    assert!(!source.has_odometry());
    assert!(frames(&mut source).iter().all(|found| found.frame.odometry_age_s == f64::INFINITY));
}

#[test]
fn transforms_age_as_odometry_does() {
    let mut log = started();
    for tick in 0..40 {
        let t = 0.1 * f64::from(tick);
        if t < WRONG_AT_S {
            let pose = Isometry3::translation(0.5 * t, 0.0, 0.0);
            log.moving("odom", "base_link", at(t), &pose);
        }
        log.colour(at(t - 0.05));
    }
    let (mut source, _saved) = open(log, Inputs::ANY);
    for found in frames(&mut source) {
        let t = found.frame.stamp.seconds_since(at(0.0));
        // The first frame is before the first transform.
        let expected_s = if t < 0.0 { 0.05 } else { (t - 1.9).max(0.0) };
        let age_s = found.frame.odometry_age_s;
        assert!((age_s - expected_s).abs() < 1e-6, "{age_s} at {t}, not {expected_s}");
    }
}

#[test]
fn a_static_transform_is_no_odometry() {
    let mut log = started();
    log.fixed("odom", "base_link", &Isometry3::identity());
    log.colour(at(0.1));
    let (mut source, _saved) = open(log, Inputs::ANY);
    assert_eq!(frames(&mut source)[0].frame.odometry_age_s, f64::INFINITY);
}

#[test]
fn a_parent_and_a_child_that_are_exchanged_are_told() {
    for (parent, child, is_told) in [
        ("odom", "base_link", false),
        ("base_link", "odom", true),
        ("base_footprint", "map", true),
        ("/robot1/base_link", "/robot1/odom", true),
        ("map", "odom", false),
        ("base_link", "imu_link", false),
        ("camera_link", "odom", false),
        ("odom", "", false),
    ] {
        let mut log = started();
        for index in 0..4 {
            let t = 0.1 * f64::from(index);
            let mut odometry =
                Odometry { header: Header::new(at(t), parent), ..Odometry::default() };
            odometry.child_frame_id = child.into();
            odometry.pose.pose = driven(t);
            log.message("/odom", at(t), &odometry);
            log.colour(at(t));
        }
        let (source, _saved) = open(log, Inputs::ANY);
        let words = format!("/odom has the frame_id `{parent}`");
        let note = source.notes().iter().find(|note| note.starts_with(&words));
        assert_eq!(note.is_some(), is_told, "{parent} {child}: {:?}", source.notes());
        let count = source.counters().get("odometry_with_exchanged_frames").copied();
        assert_eq!(count.unwrap_or(0), u64::from(is_told), "{parent} {child}");
        if let Some(note) = note {
            let remedy = format!("let the driver write `{child}` as frame_id and `{parent}`");
            assert!(note.contains(&remedy), "{note}");
        }
    }
}
