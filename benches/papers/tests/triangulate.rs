//! `tagalong-papers triangulate`, from a simulated log with webcams to the truth of that log.
#![allow(clippy::unwrap_used, reason = "a test may fail")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use tagalong_log::{Limits, TruthFrame, read_truth, read_truth_lines};

/// Returns a call of the program.
fn papers() -> Command {
    Command::new(env!("CARGO_BIN_EXE_tagalong-papers"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

/// A room in which a person with a green hat walks before four webcams; the robot's own images are
/// too small for anything.
const ROOM: &str = "seed = 3\nduration_s = 26.0\n[room]\nsize_m = [10.0, 5.0]\n[camera]\n\
    kind = \"panorama\"\nwidth = 64\nheight = 64\nrate_hz = 8.0\nheight_m = 1.55\n\
    [robot]\nstart = [5.0, 2.5]\nheading_deg = 30.0\n[[people]]\n\
    path = [[2.0, 1.4], [8.0, 1.2], [8.4, 3.6], [1.8, 3.8], [3.4, 2.4]]\nspeed_mps = 0.7\n\
    start_s = 0.0\nlook = 11\nextras = [\"green-hat\"]\n";

/// The poses of the webcams, with an error of the guess: m and degrees.
fn webcams(off_m: f64, off_deg: f64) -> String {
    let corners = [(0.1, 0.1, 45.0), (9.9, 0.1, 135.0), (9.9, 4.9, 225.0), (0.1, 4.9, 315.0)];
    corners
        .map(|(x, y, heading)| {
            let x = x + off_m;
            let y = y - off_m;
            let heading = heading + off_deg;
            format!("[[webcams]]\nat = [{x}, {y}]\nheading_deg = {heading}\n")
        })
        .concat()
}

fn run(folder: &Path, arguments: &[&str]) -> String {
    let output = papers().current_dir(folder).args(arguments).output().unwrap();
    assert_eq!(code(&output), 0, "{arguments:?}: {}", text(&output.stderr));
    text(&output.stdout)
}

fn heads(frames: &[TruthFrame]) -> Vec<(u64, [f64; 3])> {
    frames
        .iter()
        .filter_map(|frame| {
            let person = frame.people.first().filter(|person| !person.ignore)?;
            Some((frame.stamp_ns, person.head_in_robot_m?))
        })
        .collect()
}

#[test]
fn webcams_make_the_truth_of_a_log() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    fs::write(path.join("hat.toml"), format!("{ROOM}{}", webcams(0.0, 0.0))).unwrap();
    fs::write(path.join("guess.toml"), webcams(0.2, 4.0)).unwrap();
    run(folder.path(), &["simulate", "hat.toml", "-o", "hat.mcap"]);
    let found = run(
        folder.path(),
        &[
            "triangulate",
            "hat.mcap",
            "--cameras",
            "guess.toml",
            "--format",
            "json",
            "-o",
            "hat.csv",
            "--truth",
            "hat.truth.jsonl",
        ],
    );
    let found: serde_json::Value = serde_json::from_str(&found).unwrap();
    let [guessed, calibrated, held_out] =
        ["as_guessed", "calibrated", "held_out"].map(|key| found[key]["mean_cm"].as_f64().unwrap());
    assert!(guessed > 10.0, "{found}");
    assert!(calibrated < 3.0 && held_out < 3.0, "{found}");
    assert_eq!(found["cameras"].as_array().map(Vec::len), Some(4));
    let rows = fs::read_to_string(path.join("hat.csv")).unwrap().lines().count() - 1;
    assert_eq!(found["measured"].as_u64(), Some(rows as u64));

    let measured = read_truth_lines(&path.join("hat.truth.jsonl")).unwrap();
    let drawn = read_truth(&path.join("hat.mcap"), &Limits::default()).unwrap().unwrap();
    let measured = heads(&measured);
    let drawn = heads(&drawn);
    assert!(2 * measured.len() > drawn.len(), "{} of {}", measured.len(), drawn.len());
    for (stamp, place) in &measured {
        let (_, truth) = drawn.iter().find(|(at, _)| at == stamp).unwrap();
        let off = (place[0] - truth[0]).hypot(place[1] - truth[1]);
        assert!(off < 0.1, "{stamp}: {place:?} {truth:?}");
    }

    // With the robot's pose on the command line the result is that of a log with the pose.
    run(
        folder.path(),
        &[
            "triangulate",
            "hat.mcap",
            "--cameras",
            "guess.toml",
            "--robot",
            "5,2.5,30",
            "--truth",
            "said.jsonl",
        ],
    );
    let said = heads(&read_truth_lines(&path.join("said.jsonl")).unwrap());
    assert_eq!(said.len(), measured.len());
    for ((_, a), (_, b)) in said.iter().zip(&measured) {
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-3, "{a:?} {b:?}");
    }

    fs::write(
        path.join("c.toml"),
        "[[detectors]]\nplugin = \"omni-appearance\"\nconfig = { distance = \"analytic\" }\n[filter]\nplugin = \"ekf\"\n",
    )
    .unwrap();
    let plan = run(
        folder.path(),
        &["bench", "plan", "--logs", "hat.mcap", "--configs", "c.toml", "-o", "b"],
    );
    assert!(plan.contains("hat.truth.jsonl"), "{plan}");
    run(folder.path(), &["run", "c.toml", "hat.mcap", "-o", "r"]);
    let scores = run(
        folder.path(),
        &[
            "eval",
            "--truth",
            "hat.truth.jsonl",
            "--tracks",
            "r",
            "--similarity",
            "metres",
            "--format",
            "json",
        ],
    );
    let scores: serde_json::Value = serde_json::from_str(&scores).unwrap();
    assert_eq!(scores["truths"].as_u64(), Some(measured.len() as u64), "{scores}");
}

#[test]
fn a_robot_of_which_nobody_says_where_it_stands_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let output = papers()
        .current_dir(folder.path())
        .args(["triangulate", "no.mcap", "--cameras", "c.toml", "--robot", "here"])
        .output()
        .unwrap();
    assert_eq!(code(&output), 2);
    assert!(text(&output.stderr).contains("5,2.5,90"), "{}", text(&output.stderr));
}

#[test]
fn commands_of_the_product_know_the_printed_plugins_and_its_own_ones_tell_their_failures() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("broken.mcap"), "no log").unwrap();
    fs::write(folder.path().join("c.toml"), webcams(0.0, 0.0)).unwrap();
    let [listed, unknown, broken] = [
        vec!["list"],
        vec!["reproduce", "stereo-smv-ekf", "--format", "json"],
        vec!["triangulate", "broken.mcap", "--cameras", "c.toml"],
    ]
    .map(|words| papers().args(words).current_dir(folder.path()).output().unwrap());
    assert_eq!(code(&listed), 0);
    for plugin in ["ekf", "ekf-as-printed", "arc-follow-as-printed"] {
        assert!(text(&listed.stdout).contains(&format!("{plugin} ")), "{plugin}");
    }
    let told = text(&unknown.stderr);
    let last = told.lines().next_back().unwrap_or_default();
    let error: serde_json::Value = serde_json::from_str(last).unwrap();
    assert!(error["error"].as_str().unwrap().contains("stereo-svm-ekf"), "{told}");
    assert_eq!((code(&unknown), error["exit_code"].as_i64()), (2, Some(2)));
    assert_eq!(code(&broken), 1);
}
