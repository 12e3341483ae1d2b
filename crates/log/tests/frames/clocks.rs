//! Odometry and transforms whose stamps are those of another clock, or rounded.

use tagalong_log::StampSource;
use tagalong_log::msgs::Pose;

use super::*;

/// Frames of each log, ten a second.
const FRAMES: u32 = 40;

/// Returns the pose of a robot that drives ahead at half a metre per second.
fn driven(t: f64) -> Isometry3<f64> {
    Isometry3::translation(0.5 * t, 0.0, 0.0)
}

/// Writes frames ten times a second, and with `write` all else twenty times a second.
fn ride(mut log: LogWriter, write: impl Fn(&mut LogWriter, f64)) -> SavedLog {
    for tick in 0..2 * FRAMES {
        let t = 0.05 * f64::from(tick);
        write(&mut log, t);
        if tick % 2 == 0 {
            log.colour(at(t));
        }
    }
    log.save()
}

fn settings(stamps: StampSource) -> InputSettings {
    InputSettings { stamps, ..InputSettings::default() }
}

/// Checks that the robot drives in the frames of a log that is read with the times of recording.
fn assert_cured(saved: &SavedLog, name: &str) {
    let mut source = saved.open(&settings(StampSource::Recording), Inputs::ANY).unwrap();
    let found = frames(&mut source);
    assert_eq!(found.len(), FRAMES as usize, "{name}");
    assert!(found.iter().all(|found| !found.odom_stale), "{name}: {:?}", source.notes());
    let last = found.last().unwrap();
    let t = last.frame.stamp.seconds_since(at(0.0));
    assert!((last.odom_from_robot.translation.x - 0.5 * t).abs() < 1e-6, "{name}");
}

/// Checks that a log has odometry that is not used for this reason, and that the times of recording
/// cure it.
fn assert_unused(saved: &SavedLog, name: &str, why: &str) {
    let mut source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
    assert!(source.lacks_usable_odometry(), "{name} {why}: {:?}", source.notes());
    let found = frames(&mut source);
    assert_eq!(found.len(), FRAMES as usize, "{name}");
    assert!(found.iter().all(|found| found.odom_from_robot.translation.x == 0.0), "{name}");
    let told: Vec<&String> =
        source.notes().iter().filter(|note| note.starts_with(&format!("{name} is not"))).collect();
    let [told] = told[..] else { panic!("{name}: {:?}", source.notes()) };
    assert!(told.contains(why) && told.contains("`--stamps recording`"), "{told}");
    assert_eq!(count(&source, "odometry_gap_frames"), 0, "{name}");
    assert_cured(saved, name);
}

#[test]
fn transforms_of_another_clock_are_no_odometry() {
    for (stamp_of, why) in [
        ((|t| Stamp::default().plus_seconds(10.0 + t)) as fn(f64) -> Stamp, "1699999990.0 s earl"),
        (|_| Stamp::default(), "1700000000.0 s earlier, by another clock"),
        (|t| at(t + 3600.0), "3600.0 s later, by another clock"),
        (|t| at(t.floor()), "rounded to whole seconds"),
        (|t| at(t - 1.5), "all 1.50 s or more earlier"),
    ] {
        let saved = ride(started(), |log, t| {
            log.moving_of(at(t), ("odom", "base_link"), stamp_of(t), &driven(t));
        });
        assert_unused(&saved, "tf (odom to base_link)", why);
    }
}

#[test]
fn stamps_of_localisation_may_lie_ahead() {
    let saved = ride(started(), |log, t| {
        log.moving_of(at(t), ("odom", "base_link"), at(t), &driven(t));
        log.moving_of(at(t), ("map", "odom"), at(t + 0.9), &Isometry3::identity());
    });
    let input = InputSettings { odom_frame: "map".into(), ..InputSettings::default() };
    let source = saved.open(&input, Inputs::ANY).unwrap();
    assert!(source.has_odometry() && !source.lacks_usable_odometry());
}

#[test]
fn poses_in_another_frame_than_that_of_odometry_are_told() {
    for (parent, is_told) in [("world", true), ("odom", false)] {
        let saved = ride(started(), |log, t| {
            log.moving_of(at(t), (parent, "base_link"), at(t), &driven(t));
        });
        let source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        assert_eq!(source.has_odometry(), !is_told, "{parent}");
        let notes = source.notes();
        let told = notes.iter().any(|note| note.contains("`odom_frame = \"world\"`"));
        assert_eq!(told, is_told, "{notes:?}");
        let input = InputSettings { odom_frame: parent.into(), ..InputSettings::default() };
        assert!(saved.open(&input, Inputs::ANY).unwrap().has_odometry(), "{parent}");
    }
}

/// Writes odometry in time, and corrections by localisation late.
fn with_late_corrections(log: &mut LogWriter, t: f64) {
    log.moving_of(at(t), ("odom", "base_link"), at(t), &driven(t));
    log.moving_of(at(t), ("map", "odom"), at(t - 1.5), &Isometry3::identity());
}

/// Writes odometry that is late after half a second.
fn late_at_times(log: &mut LogWriter, t: f64) {
    let late_s = if t < 0.5 { 0.0 } else { 1.5 };
    log.moving_of(at(t), ("odom", "base_link"), at(t - late_s), &driven(t - late_s));
}

#[test]
fn transforms_are_no_other_clock_unless_all_of_them_are_late() {
    type Write = fn(&mut LogWriter, f64);
    let writers: [(&str, Write); 2] = [("map", with_late_corrections), ("odom", late_at_times)];
    for (odom_frame, write) in writers {
        let input = InputSettings { odom_frame: odom_frame.into(), ..InputSettings::default() };
        let source = ride(started(), write).open(&input, Inputs::ANY).unwrap();
        assert!(!source.lacks_usable_odometry(), "{odom_frame}: {:?}", source.notes());
    }
}

#[test]
fn a_mount_in_tf_of_another_clock_is_told_with_the_remedy() {
    for (offset_s, why) in [(-1.7e9, "1700000000.0 s earlier"), (3600.0, "3600.0 s later")] {
        let mut log = LogWriter::plain();
        log.info(INFO, "colour", &camera(16, 12, 14.0));
        let saved = ride(log, |log, t| {
            log.odometry_of(at(t), at(t), Pose::from(&driven(t)));
            let stamp = at(t).plus_seconds(offset_s);
            log.moving_of(at(t), ("base_link", "colour"), stamp, &level_pose());
        });
        let mut source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        assert_eq!(frames(&mut source).len(), 0);
        let told = source.notes().iter().find(|note| note.starts_with("no camera pose")).unwrap();
        assert!(told.contains("the transform base_link to colour") && told.contains(why), "{told}");
        assert!(told.contains("`--stamps recording`"), "{told}");
        assert_cured(&saved, why);
    }
}

#[test]
fn rounded_and_shifted_stamps_of_odometry_are_told() {
    for (stamp_of, why) in [
        ((|t| t.floor()) as fn(f64) -> f64, "rounded to whole seconds"),
        (|t| t.floor() + 0.2, "those of several messages"),
        (|t| t + 0.9, "0.90 s later"),
        (|t| t + 1.5, "1.50 s later"),
        (|t| t - 1.5, "1.50 s earlier"),
        (|_| 1.0, "never change"),
    ] {
        let saved = ride(started(), |log, t| {
            log.odometry_of(at(t), at(stamp_of(t)), Pose::from(&driven(t)));
        });
        assert_unused(&saved, "/odom", why);
    }
}

#[test]
fn delays_of_images_and_of_computed_odometry_are_no_other_clock() {
    // Images that are recorded 0.8 s after they are taken, and odometry at once.
    let mut log = started();
    for tick in 0..40 {
        let t = 0.1 * f64::from(tick);
        log.odometry(at(t), 0.5 * t, 0.0);
        let data = vec![0; 16 * 12 * 3];
        let image = Image::packed(Header::new(at(t - 0.8), "colour"), "rgb8", 16, 12, &data);
        log.message("/camera/color/image_raw", at(t), &image);
    }
    let (source, _saved) = open(log, Inputs::ANY);
    assert!(source.has_odometry(), "{:?}", source.notes());
    // Odometry that comes 0.7 s late with right stamps, and a clock of the recording that is late.
    for (written_s, late_s) in [(0.0, 0.7), (-5.0, 0.0)] {
        let mut log = started();
        for tick in 0..40 {
            let t = 0.1 * f64::from(tick);
            let data = vec![tick as u8; 16 * 12 * 3];
            let image = Image::packed(Header::new(at(t), "colour"), "rgb8", 16, 12, &data);
            log.message("/camera/color/image_raw", at(t + written_s), &image);
            let stamp = at(t - late_s);
            log.odometry_of(at(t + written_s), stamp, Pose::from(&driven(t - late_s)));
        }
        let (source, _saved) = open(log, Inputs::ANY);
        assert!(source.has_odometry(), "{:?}", source.notes());
    }
}

#[test]
fn the_next_odometry_is_taken_where_the_clock_of_the_best_is_another() {
    for (best, next) in [("/odometry/filtered", "/odom"), ("/odom", "/wheel/odom")] {
        let saved = ride(started(), |log, t| {
            let simulated = Stamp::default().plus_seconds(10.0 + t);
            log.odometry_on(best, at(t), simulated, Pose::from(&driven(9.0)));
            log.odometry_on(next, at(t), at(t), Pose::from(&driven(t)));
        });
        let mut source = saved.open(&InputSettings::default(), Inputs::ANY).unwrap();
        assert_eq!(source.facts().odometry_topic.as_deref(), Some(next));
        assert!(!source.lacks_usable_odometry());
        let found = frames(&mut source);
        let last = found.last().unwrap();
        assert!((last.odom_from_robot.translation.x - 1.95).abs() < 1e-6);
        let entry = source.account().topics.iter().find(|entry| entry.topic == best).unwrap();
        let told = entry.to_string();
        assert!(told.contains("by another clock") && told.contains("--stamps recording"), "{told}");
        assert_eq!(entry.could_be, None);
        // A topic that the settings name is obeyed, and no other is taken.
        let input = InputSettings { odometry_topic: Some(best.into()), ..InputSettings::default() };
        let source = saved.open(&input, Inputs::ANY).unwrap();
        assert!(source.lacks_usable_odometry());
        let entry = source.account().topics.iter().find(|entry| entry.topic == next).unwrap();
        assert!(entry.to_string().contains(&format!("`odometry_topic` names {best}")), "{entry}");
    }
}
