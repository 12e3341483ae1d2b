//! `tagalong blur` as a user calls it.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Output;

use tagalong_core::Stamp;
use tagalong_log::msgs::{Header, Image, decode};
use tagalong_log::write::MessageLog;
use tagalong_log::{Limits, LogWalker};

use crate::common::{Drawn, code, messages_of, own_plugin, results_of, tagalong, text};

const COLOUR: &str = "/camera/color/image_raw";

/// A log with a second camera, and a run over it.
fn home() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let drawn = folder.path().join("drawn.mcap");
    Drawn::of(12).write(&drawn);
    let mut log = MessageLog::create(&folder.path().join("walk.mcap")).unwrap();
    let mut walker = LogWalker::open(&drawn, &Limits::default()).unwrap();
    while let Some(message) = walker.next() {
        log.copy(&message).unwrap();
    }
    let at = Stamp::from_nanos(1_700_000_000_000_000_000);
    let rear = Image::packed(Header::new(at, "rear"), "rgb8", 1, 1, &[1, 2, 3]);
    log.send("/rear/image_raw", at, &rear).unwrap();
    log.finish().unwrap();
    crate::common::config(folder.path(), "[input]\ncolour_topic = '/camera/color/image_raw'\n");
    let mut run = own_plugin();
    run.current_dir(folder.path()).args(["run", "nearest.toml", "walk.mcap", "-o", "out"]);
    let run = run.output().unwrap();
    assert!(run.status.success(), "{}", text(&run.stderr));
    folder
}

fn blur(folder: &Path, arguments: &[&str]) -> Output {
    tagalong().current_dir(folder).arg("blur").args(arguments).output().unwrap()
}

/// Times and bytes of the messages of each topic.
fn messages(path: &Path) -> BTreeMap<String, Vec<(u64, Vec<u8>)>> {
    let mut all: BTreeMap<String, Vec<(u64, Vec<u8>)>> = BTreeMap::new();
    let mut walker = LogWalker::open(path, &Limits::default()).unwrap();
    while let Some(message) = walker.next() {
        let of = all.entry(message.channel.topic.clone()).or_default();
        of.push((message.log_time, message.data.to_vec()));
    }
    all
}

#[test]
fn heads_are_blurred_and_all_else_is_as_it_was() {
    let folder = home();
    let said = results_of(&blur(folder.path(), &["walk.mcap", "--run", "out"]));
    assert!(said.contains("left out: 1 message of /rear/image_raw"), "{said}");
    assert!(said.contains("look through the copy"), "{said}");
    let mut before = messages(&folder.path().join("walk.mcap"));
    let mut after = messages(&folder.path().join("walk-blurred.mcap"));
    assert!(before.remove("/rear/image_raw").is_some());
    let images = [before.remove(COLOUR).unwrap(), after.remove(COLOUR).unwrap()];
    assert!(before == after, "{:?} {:?}", before.keys(), after.keys());
    assert_eq!((images[0].len(), images[1].len()), (12, 12));
    for ((time, before), (copied, after)) in images[0].iter().zip(&images[1]) {
        assert_eq!(time, copied);
        let before: Image<'_> = decode(before).unwrap();
        let after: Image<'_> = decode(after).unwrap();
        assert_eq!((before.header.stamp(), before.width), (after.header.stamp(), after.width));
        // The crown is in row 40; below it the walker has one colour, which blurring leaves.
        for (row, is_changed) in [(38, true), (39, true), (30, false), (80, false)] {
            let bytes = row * 480..(row + 1) * 480;
            assert_eq!(before.data[bytes.clone()] != after.data[bytes], is_changed, "row {row}");
        }
    }
}

#[test]
fn without_a_run_one_is_made_and_removed() {
    let folder = home();
    let done = blur(folder.path(), &["walk.mcap", "-o", "copy.mcap"]);
    assert!([0, 3].contains(&code(&done)), "{}", text(&done.stderr));
    let copy = messages(&folder.path().join("copy.mcap"));
    assert_eq!(copy["/camera/depth/image_raw"].len(), 12);
    assert!(!folder.path().join("copy.blur-run").exists());
    assert!(text(&done.stdout).contains("of 12 images"), "{}", text(&done.stdout));
}

#[test]
fn the_log_itself_a_copy_that_exists_and_the_run_of_another_log_are_refused() {
    let folder = home();
    let said =
        messages_of(&blur(folder.path(), &["walk.mcap", "-o", "walk.mcap", "--overwrite"]), 2);
    assert!(said.contains("would replace the log"), "{said}");
    let exists = blur(folder.path(), &["walk.mcap", "-o", "drawn.mcap"]);
    assert_eq!(code(&exists), 2);
    assert!(text(&exists.stderr).contains("--overwrite"));
    let said = messages_of(&blur(folder.path(), &["drawn.mcap", "--run", "out"]), 2);
    assert!(said.contains("is a run over walk.mcap"), "{said}");
}
