//! The library on logs: its examples, damaged logs, and mistakes in a config.

#![allow(clippy::unwrap_used, reason = "a broken test may stop loudly")]

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use tagalong::prelude::*;
use tagalong_simulate::sample;
use tempfile::TempDir;

/// A folder with `people.mcap`, in which the examples run.
static FOLDER: LazyLock<TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    sample::write(&folder.path().join("people.mcap")).unwrap();
    folder
});

fn people() -> PathBuf {
    FOLDER.path().join("people.mcap")
}

/// Returns the confirmed tracks of a log, as text.
fn tracks(log: &Path, pipeline: &mut Pipeline) -> Result<Vec<String>> {
    let mut lines = Vec::new();
    for frame in Log::open(log)?.frames(pipeline)? {
        let report = pipeline.step(&frame?)?;
        let confirmed = report.tracks.iter().filter(|track| track.confirmed);
        lines.extend(confirmed.map(|track| format!("{} {}", track.id, track.position)));
    }
    Ok(lines)
}

/// Runs an example, which cargo has built beside this test, and returns the lines that it prints.
fn run(example: &str) -> Vec<String> {
    let here = env::current_exe().unwrap();
    let built = here.ancestors().nth(2).unwrap().join("examples").join(example);
    let ended = Command::new(&built).current_dir(FOLDER.path()).output();
    let ended = ended.unwrap_or_else(|error| panic!("cannot run {}: {error}", built.display()));
    assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    String::from_utf8(ended.stdout).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn the_examples_find_the_people() {
    let people = run("log_to_tracks");
    assert!(people.iter().any(|line| line.starts_with("1 at ")), "{people:?}");
    let driven = run("follow");
    assert!(driven.iter().any(|line| line.starts_with("track ")), "{driven:?}");
    let person = run("own_arrays");
    assert!(person.last().is_some_and(|line| line.contains(" 1 at 2.5")), "{person:?}");
    let nearest = run("own_detector");
    assert!(nearest.last().is_some_and(|line| line.contains(" 1 at 2.")), "{nearest:?}");
    let by_radar = run("own_sensor");
    assert!(by_radar.iter().any(|line| line.starts_with("2.9 s: 1 at 2.3")), "{by_radar:?}");
}

#[test]
fn a_log_gives_the_same_tracks_each_time() {
    fn run() -> Vec<String> {
        tracks(&people(), &mut Pipeline::builtin("depth-ekf").unwrap()).unwrap()
    }

    let first = run();
    assert!(first.len() > 20, "{}", first.len());
    assert_eq!(first, run());
}

#[test]
fn the_input_of_the_config_reaches_the_reader() {
    assert!(frames_with("").unwrap() > 20);
    let shown = frames_with("depth_topic = \"/none\"").unwrap_err().to_string();
    assert!(shown.contains("/none") && shown.contains("present:"), "{shown}");
    let shown = frames_with("depth_topik = \"/none\"").unwrap_err().to_string();
    assert!(shown.contains("config.toml:3:1: ") && shown.contains("`depth_topic`"), "{shown}");
    let of_wrong_kind = "depth_topic = \"/camera/color/camera_info\"";
    let shown = frames_with(of_wrong_kind).unwrap_err().to_string();
    assert!(shown.contains("config.toml:3:15: "), "the line of a topic of a wrong kind: {shown}");
}

/// The number of frames with this line in the `[input]` of the config.
fn frames_with(line: &str) -> Result<usize> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipeline/configs");
    let registry = builtin_registry();
    let config = format!("extends = \"depth-ekf.toml\"\n[input]\n{line}\n");
    let pipeline = Pipeline::builder(&registry).folder(&folder).from_toml(&config)?;
    Log::open(people())?.frames(&pipeline).map(|frames| frames.count())
}

#[test]
fn the_frames_of_a_damaged_log_end_with_an_error_unless_the_loss_is_accepted() {
    let whole = fs::read(people()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.mcap");
    fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let mut pipeline = Pipeline::builtin("depth-ekf").unwrap();
    let frames = Log::open(&cut).unwrap().frames(&pipeline).unwrap();
    let mut intact = 0;
    let mut errors = Vec::new();
    for frame in frames {
        match frame.and_then(|frame| Ok(pipeline.step(&frame)?)) {
            Ok(_) => intact += 1,
            Err(error) => errors.push(error),
        }
    }
    assert!(intact > 5, "{intact} frames");
    assert!(matches!(&errors[..], [Error::Damaged { .. }]), "{errors:?}");
    let accepted = Log::open(&cut).unwrap().frames(&pipeline).unwrap().accept_loss();
    assert_eq!(accepted.filter(Result::is_err).count(), 0);
}

#[test]
fn what_is_not_there_is_named() {
    let missing = Log::open("none.mcap").unwrap_err().to_string();
    assert!(missing.contains("cannot open `none.mcap`"), "{missing}");
    let unknown = Pipeline::builtin("depth-verifed").map(drop).unwrap_err().to_string();
    assert!(unknown.contains("did you mean `depth-verified`?"), "{unknown}");
}
