//! Cameras that change on the way: frames of images, and mounts in tf_static.

use super::*;

/// Returns the numbers of the frames with a changed calibration.
fn changed(found: &[LogFrame]) -> Vec<u64> {
    let changed = found.iter().filter(|found| found.frame.calibration_changed);
    changed.map(|found| found.frame.index).collect()
}

fn notes_with(source: &FrameSource, part: &str) -> Vec<String> {
    source.notes().iter().filter(|note| note.contains(part)).cloned().collect()
}

/// Writes ten frames of colour and depth, of which the sixth has these frame ids.
fn with_frames(colour: &str, depth: &str) -> (FrameSource, SavedLog) {
    let mut log = started();
    log.fixed("base_link", "other", &Isometry3::translation(0.0, 0.0, 0.5));
    for i in 0..10 {
        let stamp = at(0.1 * f64::from(i));
        let (colour, depth) = if i == 5 { (colour, depth) } else { ("colour", "colour") };
        log.colour_from(stamp, colour);
        log.depth(stamp.plus_seconds(0.008), depth, 2.0);
    }
    open(log, DEPTH)
}

#[test]
fn c1_an_image_of_another_frame_id_is_held_as_a_changed_calibration() {
    for (colour, depth, topic) in [
        ("colour", "other", "/camera/depth/image_raw"),
        ("other", "other", "/camera/color/image_raw"),
    ] {
        let (mut source, _saved) = with_frames(colour, depth);
        let found = frames(&mut source);
        assert_eq!(changed(&found), [6, 7, 8, 9, 10], "{topic}");
        assert!(source.data_lost());
        let told = notes_with(&source, "frame_id");
        let told = told.first().map_or("", String::as_str);
        let expected =
            format!("{topic}: the frame_id changes from `colour` to `other` at 17000000");
        assert!(told.starts_with(&expected), "{told}");
    }
    let (mut source, _saved) = with_frames("/colour", "colour");
    assert!(changed(&frames(&mut source)).is_empty(), "a slash is no other frame");
    assert_eq!(count(&source, "frame_id_changes"), 0);
}

/// Writes ten frames, with a second static transform of the camera before the sixth.
fn with_mount(second: &Isometry3<f64>) -> (FrameSource, SavedLog) {
    let mut log = started();
    for i in 0..10 {
        let stamp = at(0.1 * f64::from(i));
        if i == 5 {
            log.fixed_at(stamp, "base_link", "colour", second);
        }
        log.colour(stamp);
    }
    open(log, Inputs::ANY)
}

#[test]
fn c1_a_camera_that_moves_in_tf_static_is_held_as_a_changed_calibration() {
    let lifted = Isometry3::translation(0.0, 0.0, 0.25) * level_pose();
    let turned = Isometry3::rotation(Vector3::new(0.0, 0.0, 0.01)) * level_pose();
    for (second, text) in [(lifted, "0.000, 0.000, 1.450 m"), (turned, "-89.4 degrees")] {
        let (mut source, _saved) = with_mount(&second);
        let found = frames(&mut source);
        assert_eq!(changed(&found), [5, 6, 7, 8, 9, 10], "from the newest image on");
        let first = found[0].frame.camera.robot_from_camera;
        assert!((first.translation.z - 1.2).abs() < 1e-9, "the first mount comes first");
        assert_eq!(found[9].frame.camera.robot_from_camera, first, "and is used throughout");
        assert!(source.data_lost());
        let [told] = &notes_with(&source, "tf_static moves")[..] else { panic!("one sentence") };
        let (from, to) = told.split_once(" to ").unwrap();
        assert!(from.contains("`colour` in `base_link`"), "{told}");
        assert!(from.contains("0.000, 0.000, 1.200 m") && to.contains(text), "{told}");
    }
}

#[test]
fn a_static_transform_that_comes_again_is_no_change() {
    let hair = Isometry3::new(Vector3::new(0.0, 0.0005, 0.0), Vector3::new(0.0, 0.0, 0.001));
    for second in [level_pose(), hair * level_pose()] {
        let (mut source, _saved) = with_mount(&second);
        assert!(changed(&frames(&mut source)).is_empty());
        assert_eq!(count(&source, "mount_changes"), 0);
        assert!(!source.data_lost());
    }
}

#[test]
fn a_mount_that_is_set_right_before_the_first_image_is_no_change() {
    let mut log = started();
    let right = Isometry3::translation(0.0, 0.0, 0.25) * level_pose();
    log.fixed("base_link", "colour", &right);
    (0..5).for_each(|i| log.colour(at(0.1 * f64::from(i))));
    let (mut source, _saved) = open(log, Inputs::ANY);
    let found = frames(&mut source);
    assert!(changed(&found).is_empty());
    assert!(found.iter().all(|found| found.frame.camera_pose_age_s == 0.0), "static");
    assert!((found[0].frame.camera.height_m() - 1.45).abs() < 1e-9);
}

#[test]
fn a_camera_on_a_joint_may_move() {
    let mut log = LogWriter::plain();
    log.info(INFO, "colour", &camera(16, 12, 14.0));
    log.fixed("head", "colour", &level_pose());
    for i in 0..10 {
        let stamp = at(0.1 * f64::from(i));
        let turned = Isometry3::rotation(Vector3::new(0.0, 0.0, 0.05 * f64::from(i)));
        log.moving("base_link", "head", stamp, &turned);
        log.fixed_at(stamp, "head", "colour", &level_pose());
        log.colour(stamp);
    }
    let (mut source, _saved) = open(log, Inputs::ANY);
    let found = frames(&mut source);
    assert_eq!((found.len(), changed(&found).len()), (10, 0));
    let first = found[0].frame.camera.robot_from_camera;
    let last = found[9].frame.camera.robot_from_camera;
    assert!((first.rotation.angle_to(&last.rotation) - 0.45).abs() < 1e-6);
    assert!(found.iter().all(|found| found.frame.camera_pose_age_s < 0.11));
    assert!(!source.data_lost(), "{:?}", source.notes());
}

#[test]
fn a_change_stays_after_a_jump_of_the_clock() {
    let mut log = started();
    for i in 0..20 {
        // The clock jumps back by a minute after the change.
        let t = if i < 10 { 100.0 + 0.1 * f64::from(i) } else { 40.0 + 0.1 * f64::from(i) };
        log.colour_from(at(t), if i == 5 { "other" } else { "colour" });
    }
    let (mut source, _saved) = open(log, Inputs::ANY);
    let found = frames(&mut source);
    assert_eq!(found.len(), 20);
    assert!(found[10..].iter().all(|found| found.frame.calibration_changed));
}

#[test]
fn c1_a_calibration_of_depth_that_changes_marks_the_frames_after_it() {
    let mut log = LogWriter::plain();
    log.fixed("base_link", "depth", &level_pose());
    for i in 0..10 {
        let stamp = at(0.1 * f64::from(i));
        let info = info_of("depth", &camera(16, 12, if i < 6 { 14.0 } else { 20.0 }));
        let header = Header::new(stamp, "depth");
        log.message("/camera/depth/camera_info", stamp, &CameraInfo { header, ..info });
        log.depth(stamp, "depth", 3.0);
    }
    let (mut source, _saved) = open(log, Inputs::ANY);
    assert_eq!(changed(&frames(&mut source)), [7, 8, 9, 10]);
    let told = notes_with(&source, "/camera/depth/camera_info: the calibration changes");
    assert_eq!(told.len(), 1, "{:?}", source.notes());
}

/// Writes ten frames of colour, of which some have this calibration without focal lengths.
fn with_blank(blank: &CameraInfo, is_blank: impl Fn(u32) -> bool) -> (FrameSource, SavedLog) {
    let mut log = LogWriter::plain();
    log.fixed("base_link", "colour", &level_pose());
    for i in 0..10 {
        let stamp = at(0.1 * f64::from(i));
        let info = info_of("colour", &camera(16, 12, 14.0));
        let info = if is_blank(i) { blank.clone() } else { info };
        let header = Header::new(stamp, "colour");
        log.message(INFO, stamp, &CameraInfo { header, ..info });
        log.colour(stamp);
    }
    open(log, Inputs::ANY)
}

#[test]
fn calibrations_without_focal_lengths_say_nothing() {
    let zeros = CameraInfo { width: 16, height: 12, ..CameraInfo::default() };
    let mut ones = zeros.clone();
    ones.k[8] = 1.0;
    ones.p[10] = 1.0;
    for blank in [zeros, ones] {
        for is_late in [true, false] {
            let (mut source, _saved) = with_blank(&blank, |i| (i < 5) == is_late);
            let found = frames(&mut source);
            assert_eq!((found.len(), changed(&found).len()), (10, 0), "{:?}", source.notes());
            assert!((found[0].frame.camera.focal_px() - 14.0).abs() < 1e-9);
            assert!(!source.data_lost(), "{:?}", source.notes());
        }
    }
}

#[test]
fn a_mount_that_is_on_tf_once_is_held_and_told() {
    let mut log = LogWriter::plain();
    log.info(INFO, "colour", &camera(16, 12, 14.0));
    log.moving("base_link", "colour", at(0.0), &level_pose());
    (0..20).for_each(|i| log.colour(at(f64::from(i) * 0.1)));
    let (mut source, _saved) = open(log, Inputs::ANY);
    let found = frames(&mut source);
    let ages: Vec<f64> = found.iter().map(|found| found.frame.camera_pose_age_s).collect();
    assert_eq!(ages.len(), 20);
    // A robot that is steered by the frames stops: the pose that is held is old.
    assert!((ages[19] - 1.9).abs() < 1e-6 && ages[3] < 0.31, "{ages:?}");
    let held = count(&source, "frames_without_camera_pose");
    assert!((10..20).contains(&held), "{held}");
    let told = source.notes().iter().find(|note| note.contains("no pose of the camera")).unwrap();
    assert!(told.contains("the last known one") && told.contains("/tf_static"), "{told}");
}
