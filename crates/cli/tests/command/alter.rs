//! `tagalong alter` as a user calls it.

use std::fs;
use std::path::Path;
use std::process::Output;

use tagalong_log::{FrameSource, InputSettings, Inputs, Limits, LogFrame};

use crate::common::{Drawn, code, messages_of, results_of, tagalong, text};

fn alter(folder: &Path, arguments: &[&str]) -> Output {
    tagalong().current_dir(folder).arg("alter").args(arguments).output().unwrap()
}

fn frames(path: &Path) -> Vec<LogFrame> {
    let open = FrameSource::open(path, &InputSettings::default(), &Limits::default(), Inputs::ANY);
    let mut source = open.unwrap();
    std::iter::from_fn(|| source.next_frame()).collect()
}

/// A log of twelve frames with truth.
fn home() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    Drawn::of(12).write(&folder.path().join("walk.mcap"));
    let rows = (1..=12).map(|frame| format!("{frame},1,100,50,80,80\n"));
    let truth = format!("frame,id,ub_x,ub_y,ub_w,ub_h\n{}", rows.collect::<String>());
    fs::write(folder.path().join("walk.people.csv"), truth).unwrap();
    folder
}

#[test]
fn every_third_frame_is_kept_with_its_truth() {
    let folder = home();
    let said = results_of(&alter(folder.path(), &["walk.mcap", "--every", "3"]));
    assert!(said.contains("walk-altered.mcap: 4 frames"), "{said}");
    let all = frames(&folder.path().join("walk.mcap"));
    let kept = frames(&folder.path().join("walk-altered.mcap"));
    assert_eq!(kept.len(), 4);
    for (number, frame) in kept.iter().enumerate() {
        let same = &all[3 * number];
        assert_eq!(frame.frame.stamp, same.frame.stamp);
        assert_eq!(frame.frame.images().colour, same.frame.images().colour, "the same pixels");
        let away =
            frame.frame.camera.robot_from_camera.inverse() * same.frame.camera.robot_from_camera;
        assert!(away.translation.vector.norm() < 1e-9 && away.rotation.angle() < 1e-6, "{away}");
    }
    let truth = fs::read_to_string(folder.path().join("walk-altered.people.csv")).unwrap();
    let numbers: Vec<&str> =
        truth.lines().skip(1).filter_map(|line| line.split(',').next()).collect();
    assert_eq!(numbers, ["1", "2", "3", "4"]);
}

#[test]
fn a_copy_is_written_into_the_current_folder() {
    let folder = home();
    let here = tempfile::tempdir().unwrap();
    let log = folder.path().join("walk.mcap").display().to_string();
    let done = alter(here.path(), &[&log, "--every", "6"]);
    assert_eq!(code(&done), 0, "{}", text(&done.stderr));
    for name in ["walk-altered.mcap", "walk-altered.people.csv"] {
        assert!(here.path().join(name).is_file(), "{name}");
        assert!(!folder.path().join(name).exists(), "{name}");
    }
}

#[test]
fn a_mirrored_log_mirrored_again_is_the_log() {
    let folder = home();
    for (log, copy) in [("walk.mcap", "once.mcap"), ("once.mcap", "twice.mcap")] {
        let done = alter(folder.path(), &[log, "--mirror", "-o", copy]);
        assert_eq!(code(&done), 0, "{}", text(&done.stderr));
    }
    let all = frames(&folder.path().join("walk.mcap"));
    let once = frames(&folder.path().join("once.mcap"));
    let twice = frames(&folder.path().join("twice.mcap"));
    assert_eq!((once.len(), twice.len()), (all.len(), all.len()));
    for (frame, same) in twice.iter().zip(&all) {
        assert_eq!(frame.frame.images().colour, same.frame.images().colour);
    }
    assert_ne!(once[0].frame.images().colour, all[0].frame.images().colour);
    for (name, has_it) in [("once.people.csv", false), ("twice.people.csv", true)] {
        let truth = fs::read_to_string(folder.path().join(name)).unwrap();
        assert_eq!(truth.contains("1,1,100,50,80,80"), has_it, "{name}: {truth}");
    }
}

#[test]
fn the_truth_beside_a_copy_is_replaced_only_when_asked() {
    let folder = home();
    let copy = folder.path().join("other.mcap");
    let truth = copy.with_extension("people.csv");
    fs::write(&truth, "keep me").unwrap();
    let arguments = ["walk.mcap", "--mirror", "-o", "other.mcap"];
    let refused = alter(folder.path(), &arguments);
    assert_eq!(code(&refused), 2, "{}", text(&refused.stderr));
    assert!(text(&refused.stderr).contains("other.people.csv exists"), "{}", text(&refused.stderr));
    assert_eq!(fs::read_to_string(&truth).unwrap(), "keep me");
    assert!(!copy.exists(), "a refused copy leaves nothing behind");
    let done = alter(folder.path(), &[&arguments[..], &["--overwrite"]].concat());
    assert_eq!(code(&done), 0, "{}", text(&done.stderr));
    assert!(fs::read_to_string(&truth).unwrap().starts_with("frame,"));
    // The truth of this name is the log's own.
    let said = messages_of(
        &alter(folder.path(), &["walk.mcap", "--mirror", "-o", "walk.bag", "--overwrite"]),
        2,
    );
    assert!(said.contains("replace the truth itself"), "{said}");
}

#[test]
fn what_cannot_be_altered_is_refused() {
    let folder = home();
    for (arguments, part) in [
        (&["walk.mcap"][..], "nothing to alter"),
        (&["walk.mcap", "--salt", "1.5"], "from 0 to 1"),
        (&["walk.mcap", "--scale-depth", "0"], "above zero"),
        (&["walk.mcap", "--mirror", "-o", "walk.mcap", "--overwrite"], "replace the log itself"),
        (&["walk.mcap", "--mirror", "-o", "./walk.mcap", "--overwrite"], "replace the log itself"),
        (&["walk.mcap", "--mirror", "-o", "walk.people.csv"], "exists"),
    ] {
        let done = alter(folder.path(), arguments);
        assert_eq!(code(&done), 2, "{arguments:?}: {}", text(&done.stderr));
        assert!(text(&done.stderr).contains(part), "{arguments:?}: {}", text(&done.stderr));
    }
}
