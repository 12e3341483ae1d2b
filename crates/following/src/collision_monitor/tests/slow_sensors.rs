//! Sensors that are slower than the frames, that fall silent, and that repeat themselves.

use super::*;

/// Frames for each scan of a scanner of 5 Hz beside a camera of 30 Hz.
const FRAMES_A_SCAN: usize = 6;
const PERIOD_S: f64 = 1.0 / 30.0;

/// Stamp and content of the newest scan, by the number of the frame.
struct Scanned {
    stamp: fn(usize) -> usize,
    content: fn(usize) -> usize,
}

/// A new scan with each sixth frame.
const SLOW: Scanned = Scanned { stamp: last_turn, content: last_turn };
/// The same scan with a new stamp, with each sixth frame.
const REPEATED: Scanned = Scanned { stamp: last_turn, content: |_| 0 };
/// The same scan with the same stamp.
const SILENT: Scanned = Scanned { stamp: |_| 0, content: |_| 0 };

fn last_turn(frame: usize) -> usize {
    frame - frame % FRAMES_A_SCAN
}

fn stamp_of(frame: usize) -> Stamp {
    Stamp::default().plus_seconds(frame as f64 * PERIOD_S)
}

/// Returns the reasons to stand in two seconds of frames with depth, beside a scanner: that of the
/// frames, or a further source.
fn reasons(scanned: &Scanned, is_further: bool) -> Vec<Option<Reason>> {
    let settings = if is_further {
        with_source(SourceKind::Scan)
    } else {
        CollisionMonitorSettings::default()
    };
    let mut monitor = monitor_of(settings);
    let mut reasons = Vec::new();
    for index in 0..60 {
        let stamp = stamp_of((scanned.stamp)(index));
        let scan = scan_at((scanned.content)(index), 0.0, 0.0, |_| None);
        let depth = Arc::new(depth_at(index, 0.0, 0.0));
        let images = Images { depth: Some(depth), ..Images::default() };
        let motion = EgoMotion::at_rest(PERIOD_S);
        let here = stamp_of(index);
        let frame = Frame::new(index as u64, here, Arc::new(camera()), motion, images);
        let frame = if is_further {
            let mut reading = reading(stamp, ObstacleData::Scan(scan));
            reading.age_s = here.seconds_since(stamp);
            frame.with_sensor(ObstacleReadings(Arc::new([reading])))
        } else {
            frame.with_laser(Some(scan.with_stamp(stamp)))
        };
        monitor.update(&frame, &motion, &[], None);
        reasons.push(monitor.stop_reason(0.5));
    }
    reasons
}

#[test]
fn a_scanner_slower_than_the_camera_does_not_stop_the_robot() {
    for is_further in [false, true] {
        let reasons = reasons(&SLOW, is_further);
        assert!(reasons.iter().all(Option::is_none), "{is_further} {reasons:?}");
    }
}

#[test]
fn the_same_scan_with_new_stamps_is_frozen() {
    for is_further in [false, true] {
        let reasons = reasons(&REPEATED, is_further);
        let first = reasons.iter().position(Option::is_some);
        assert_eq!(first, Some(4 * FRAMES_A_SCAN), "{is_further}");
        assert_eq!(reasons[59], Some(Reason::Frozen), "{is_further}");
    }
}

#[test]
fn the_same_scan_with_its_old_stamp_is_silence() {
    for is_further in [false, true] {
        let reasons = reasons(&SILENT, is_further);
        let first = reasons.iter().position(Option::is_some);
        assert!(first.is_some_and(|frame| (15..18).contains(&frame)), "{is_further} {first:?}");
        assert_eq!(reasons[59], Some(Reason::Silent), "{is_further}");
    }
}

/// A camera near the floor that looks ahead.
fn low_camera() -> Arc<Camera> {
    let lens = Pinhole { fx: 80.0, fy: 80.0, cx: 79.5, cy: 59.5, distortion: Distortion::None };
    Arc::new(Camera::mounted(lens, 160, 120, 0.3, 0.0, 0.0))
}

/// Returns a frame with depth of the room, and a further depth image of a wall at a distance, or none.
fn beside(index: usize, motion: EgoMotion, further_m: Option<f32>) -> Frame {
    let frame = frame(index, motion, Some(depth_at(index, 0.0, 0.0)), None);
    let Some(further_m) = further_m else { return frame };
    let camera = low_camera();
    let image = DepthImage::from_fn(160, 120, |u, v| {
        let falls = 0.3 - camera.back_project(Point2::new(u as f64, v as f64), 1.0).z;
        let floor_m = if falls > 0.0 { (0.3 / falls) as f32 } else { f32::INFINITY };
        floor_m.min(further_m) + noise(index, 160 * v + u)
    });
    let data = ObstacleData::Depth { image: Arc::new(image), camera };
    let reading = reading(frame.stamp, data);
    frame.with_sensor(ObstacleReadings(Arc::new([reading])))
}

#[test]
fn a_further_camera_that_misses_frames_keeps_its_obstacles_where_they_are() {
    let mut monitor = monitor_of(with_source(SourceKind::Depth));
    // Shorter than a second: nothing is remembered yet.
    for index in 0..5 {
        let frame = beside(index, EgoMotion::at_rest(0.1), Some(1.5));
        monitor.update(&frame, &frame.motion, &[], None);
    }
    let far = speed(&monitor);
    let on = EgoMotion { forward: 0.25, ..EgoMotion::at_rest(0.1) };
    for index in 5..7 {
        let frame = beside(index, on, None);
        monitor.update(&frame, &on, &[], None);
    }
    let near = speed(&monitor);
    assert!(far > 0.8 && near < 0.6, "{far} {near}");
    assert_eq!(monitor.stop_reason(0.5), None, "within its timeout");
}

/// A thing that is seen in each other frame stands after a second, as one that is seen in each.
#[test]
fn an_obstacle_of_a_slow_camera_is_remembered() {
    let mut monitor = monitor_of(with_source(SourceKind::Depth));
    for index in 0..14 {
        let frame = beside(index, EgoMotion::at_rest(0.1), (index % 2 == 0).then_some(1.3));
        monitor.update(&frame, &frame.motion, &[], None);
    }
    let seen = speed(&monitor);
    // Behind the robot, out of view.
    let around = EgoMotion { turn: std::f64::consts::PI, ..EgoMotion::at_rest(0.1) };
    let frame = beside(14, around, Some(9.0));
    monitor.update(&frame, &around, &[], None);
    assert_eq!(speed(&monitor), f64::INFINITY);
    let back = Path::Arc { curvature: 0.0, backwards: true };
    let remembered = monitor.allowance(back, 0.9, &BRAKING).most;
    assert!(seen < 0.85 && (remembered - seen).abs() < 0.1, "{seen} {remembered}");
}

#[test]
fn a_further_camera_without_readings_is_blind() {
    let mut monitor = monitor_of(with_source(SourceKind::Depth));
    for index in 0..2 {
        let frame = beside(index, EgoMotion::at_rest(0.1), Some(3.0));
        monitor.update(&frame, &frame.motion, &[], None);
    }
    assert_eq!(monitor.stop_reason(0.5), None);
    let image = Arc::new(DepthImage::from_fn(160, 120, |_, _| f32::NAN));
    let data = ObstacleData::Depth { image, camera: low_camera() };
    let frame = frame(2, EgoMotion::at_rest(0.1), Some(depth_at(2, 0.0, 0.0)), None);
    let reading = reading(frame.stamp, data);
    let frame = frame.with_sensor(ObstacleReadings(Arc::new([reading])));
    monitor.update(&frame, &frame.motion, &[], None);
    assert_eq!(monitor.stop_reason(0.5), Some(Reason::Blind));
}

/// Returns the reason to stand after frames with the same picture, in each of which the robot drives so
/// far by its odometry.
fn same_picture(
    monitor: &mut CollisionMonitor,
    frames: std::ops::Range<usize>,
    forward_m: f64,
) -> Option<Reason> {
    for index in frames {
        let motion = EgoMotion { forward: forward_m, ..EgoMotion::at_rest(0.1) };
        let frame = frame(index, motion, Some(depth_at(index, 0.0, 0.0)), None);
        monitor.update(&frame, &motion, &[], None);
    }
    monitor.stop_reason(0.5)
}

#[test]
fn a_sensor_that_contradicted_the_odometry_stays_frozen_until_the_robot_is_armed() {
    let mut monitor = monitor();
    assert_eq!(same_picture(&mut monitor, 0..20, 0.05), Some(Reason::Frozen));
    monitor.clear();
    let after_jump = same_picture(&mut monitor, 20..40, 0.0);
    assert_eq!(after_jump, Some(Reason::Frozen), "after a jump of the clock");
    monitor.arm();
    assert_eq!(same_picture(&mut monitor, 40..60, 0.0), None);
}

/// Returns the reason to stand after frames of depth that goes on, beside pictures whose grey value at
/// one place is this one by the number of the frame; the rest has two values, or one.
fn beside_picture(
    monitor: &mut CollisionMonitor,
    grey: impl Fn(usize) -> u8,
    is_of_one_value: bool,
) -> Option<Reason> {
    for index in 0..6 {
        let colour = RgbImage::from_fn(160, 120, |u, v| match (u, v) {
            (40, 39) => [grey(index), 0, 9],
            (80, _) if !is_of_one_value => [200, 0, 9],
            _ => [grey(0), 0, 9],
        });
        let images = Images {
            colour: Some(Arc::new(colour)),
            depth: Some(Arc::new(depth_at(index, 0.0, 0.0))),
            ..Images::default()
        };
        let stamp = Stamp::default().plus_seconds(index as f64 * 0.1);
        let motion = EgoMotion::at_rest(0.1);
        let frame = Frame::new(index as u64, stamp, Arc::new(camera()), motion, images);
        monitor.update(&frame, &motion, &[], None);
    }
    monitor.stop_reason(0.5)
}

/// People are detected, verified and known again by colour: where it stands still, they are not where
/// they seem to be, though depth goes on.
#[test]
fn the_same_colour_image_again_is_frozen_and_darkness_is_not() {
    let mut frozen = monitor();
    assert_eq!(beside_picture(&mut frozen, |_| 7, false), Some(Reason::Frozen));
    assert_eq!(frozen.frozen_sensor(), Some(("the colour image".into(), false)));
    assert!(frozen.shows_past());
    assert_eq!(beside_picture(&mut monitor(), |index| index as u8, false), None, "with noise");
    assert_eq!(beside_picture(&mut monitor(), |_| 0, true), None, "in the dark");
    frozen.arm();
    assert_eq!(frozen.frozen_sensor(), None);
    let noiseless =
        CollisionMonitorSettings { noiseless: true, ..CollisionMonitorSettings::default() };
    assert_eq!(beside_picture(&mut monitor_of(noiseless), |_| 7, false), None, "as it is said");
}

/// The newest scan of before the jump says nothing of now, also where it comes again with each frame.
#[test]
fn after_a_jump_of_the_clock_a_scanner_is_silent_until_its_next_scan() {
    let mut monitor = monitor();
    let mut reasons = Vec::new();
    for index in 0..12 {
        if index == 4 {
            monitor.clear();
        }
        let turn = if index < 8 { 0 } else { index };
        let stamp = Stamp::default().plus_seconds(turn as f64 * 0.1);
        let scan = scan_at(turn, 0.0, 0.0, |_| None).with_stamp(stamp);
        let depth = Some(depth_at(index, 0.0, 0.0));
        let frame = frame(index, EgoMotion::at_rest(0.1), depth, Some(scan));
        monitor.update(&frame, &frame.motion, &[], None);
        reasons.push(monitor.stop_reason(0.5));
    }
    let expected = [[None; 4], [Some(Reason::Silent); 4], [None; 4]].concat();
    assert_eq!(reasons, expected);
}

/// A topic that is announced or named, but on which nothing is ever published, is no free way.
#[test]
fn a_sensor_that_is_read_and_never_delivers_is_silent() {
    for (expected, reason) in [
        (Inputs::NONE, None),
        (Inputs::NONE.accept(Input::Laser), Some(Reason::Silent)),
        (Inputs::NONE.accept(Input::Depth), None),
    ] {
        let mut monitor = monitor();
        for index in 0..3 {
            let depth = Some(depth_at(index, 0.0, 0.0));
            let frame = frame(index, EgoMotion::at_rest(0.1), depth, None).with_expected(expected);
            monitor.update(&frame, &frame.motion, &[], None);
        }
        assert_eq!(monitor.stop_reason(0.5), reason, "{expected:?}");
    }
    let expected = Inputs::NONE.accept(Input::Depth);
    let mut monitor = monitor();
    for index in 0..3 {
        let scan = Some(scan_at(index, 0.0, 0.0, |_| None));
        let frame = frame(index, EgoMotion::at_rest(0.1), None, scan).with_expected(expected);
        monitor.update(&frame, &frame.motion, &[], None);
    }
    assert_eq!(monitor.stop_reason(0.5), Some(Reason::Silent), "the camera");
}

/// A level scanner above `top_m` sees none of what could be in the way: alone it is no eye, and beside a
/// camera it does not say that a dark part of its image is free.
#[test]
fn a_scanner_above_the_robot_does_not_see_the_way() {
    for (height_m, nods_rad, range_m, reason) in [
        (1.4, 0.0, 5.0, None),
        (1.9, 0.0, 5.0, Some(Reason::Blind)),
        (1.9, 0.0, f64::INFINITY, Some(Reason::Blind)),
        (1.9, 0.3, 5.0, None),
        (1.9, 0.3, f64::INFINITY, None),
    ] {
        let mut monitor = monitor();
        for index in 0..3 {
            let scan = scan_of(nodding(height_m, nods_rad), [range_m; 360]);
            let frame = frame(index, EgoMotion::at_rest(0.1), None, Some(scan));
            monitor.update(&frame, &frame.motion, &[], None);
        }
        assert_eq!(monitor.stop_reason(0.5), reason, "{height_m} m {nods_rad} rad {range_m} m");
    }
    let settings = CollisionMonitorSettings::default();
    for (height_m, looks) in [(1.4, true), (1.9, false)] {
        let empty = LaserScan::of_points(Vec::new()).with_scanner(nodding(height_m, 0.0));
        assert_eq!(Coverage::of_scan(&settings, &empty, 0.3).looks(), looks, "{height_m} m");
    }
}

#[test]
fn a_further_scanner_that_never_delivers_is_silent() {
    let mut monitor = monitor();
    let mut reasons = Vec::new();
    for index in 0..4 {
        let further = (index == 3).then(|| scan_at(index, 0.0, 0.0, |_| None));
        let depth = Some(depth_at(index, 0.0, 0.0));
        let frame = frame(index, EgoMotion::at_rest(0.1), depth, None)
            .with_sensor(FurtherScans(Arc::new([further])));
        monitor.update(&frame, &frame.motion, &[], None);
        reasons.push(monitor.stop_reason(0.5));
    }
    assert_eq!(reasons, [Some(Reason::Silent), Some(Reason::Silent), Some(Reason::Silent), None]);
}
