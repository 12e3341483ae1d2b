//! `tagalong bench` with tracks of other programs, and with what is known of the rooms of logs.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Output;

use serde_json::Value;

use crate::common::{Drawn, code, own_plugin, results_of, text};

/// Two logs with truth, of 24 and 9 frames, and a config.
fn home() -> tempfile::TempDir {
    let home = tempfile::tempdir().expect("it is there");
    fs::create_dir(home.path().join("logs")).expect("it is there");
    for (name, frames) in [("long", 24), ("short", 9)] {
        Drawn::of(frames).write(&home.path().join(format!("logs/{name}.mcap")));
        let truth = home.path().join(format!("logs/{name}.people.csv"));
        fs::write(truth, crate::common::people(frames)).expect("it is there");
    }
    crate::common::config(home.path(), "");
    home
}

fn bench(home: &Path, arguments: &[&str]) -> Output {
    let given = ["bench", "--configs", "nearest.toml", "-o", "out"];
    own_plugin().current_dir(home).args(given).args(arguments).output().expect("it is there")
}

/// Returns the true boxes as MOTChallenge tracks, each as high as `aspect` says.
fn tracks(frames: u64, aspect: f64) -> String {
    let mut out = String::new();
    for line in crate::common::people(frames).lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let side: f64 = cells[4].parse().expect("it is there");
        let [frame, left, top] = [cells[0], cells[2], cells[3]];
        let _ = writeln!(out, "{frame},7,{left},{top},{side},{},0.9,-1,-1,-1", side * aspect);
    }
    out
}

fn write_tracks(home: &Path, name: &str, aspect: f64) {
    fs::create_dir_all(home.join("byte")).expect("it is there");
    fs::write(home.join(format!("byte/{name}")), tracks(24, aspect)).expect("it is there");
}

fn report(home: &Path) -> Value {
    serde_json::from_slice(&fs::read(home.join("out/report.json")).expect("it is there"))
        .expect("it is there")
}

#[test]
fn tracks_of_another_program_are_scored_beside_the_pipelines() {
    let home = home();
    write_tracks(home.path(), "long.txt", 1.0);
    let arguments = ["--logs-dir", "logs", "--tracks", "byte=byte", "--timing"];
    let said = results_of(&bench(home.path(), &arguments));
    let row = said
        .lines()
        .find(|line| line.starts_with("byte") && line.contains(" long "))
        .expect("it is there");
    assert!(row.contains("1.000"), "{said}");
    assert!(said.contains("skipped: byte on short: there is no short.txt"), "{said}");
    let page = fs::read_to_string(home.path().join("out/report.html")).expect("it is there");
    assert!(page.contains("byte"), "the page names it");
    let tasks = report(home.path())["tasks"].clone();
    let own = tasks
        .as_array()
        .expect("it is there")
        .iter()
        .find(|t| t["pipeline"] == "byte" && t["log"] == "long");
    let own = own.expect("it is there");
    assert_eq!(
        (own["image"]["FP"].as_u64(), own["missed"].as_array().map(Vec::len)),
        (Some(0), Some(0))
    );
    // The times are those of the pipeline alone.
    let times = fs::read(home.path().join("out/timings.json")).expect("it is there");
    let times: Value = serde_json::from_slice(&times).expect("it is there");
    assert_eq!(times["tasks"].as_object().map(serde_json::Map::len), Some(2));
    let again = text(&bench(home.path(), &arguments).stderr);
    assert!(again.contains("0 tasks run; 3 had results"), "{again}");
    // Other tracks are another task.
    write_tracks(home.path(), "long.txt", 0.8);
    let changed = text(&bench(home.path(), &arguments).stderr);
    assert!(changed.contains("1 task run; 2 had results"), "{changed}");
}

#[test]
fn tracks_of_whole_people_are_compared_by_their_upper_bodies_and_misses_are_listed() {
    let home = home();
    write_tracks(home.path(), "long.csv", 1.7 / 0.57);
    let said =
        results_of(&bench(home.path(), &["--logs", "logs/long.mcap", "--tracks", "byte=byte"]));
    assert!(
        said.contains("byte on long: nothing matches, and the boxes of the tracks are 3.0 times"),
        "{said}"
    );
    let row = said.lines().find(|line| line.starts_with("byte")).expect("it is there");
    let hota: f64 =
        row.split_whitespace().nth(3).expect("it is there").parse().expect("it is there");
    assert!(hota > 0.8, "{said}");
    fs::write(home.path().join("byte/long.csv"), "1,7,0,0,9,9,0.9,-1,-1,-1\n")
        .expect("it is there");
    bench(home.path(), &["--logs", "logs/long.mcap", "--tracks", "byte=byte"]);
    let tasks = report(home.path())["tasks"].clone();
    let own = tasks
        .as_array()
        .expect("it is there")
        .iter()
        .find(|t| t["pipeline"] == "byte")
        .expect("it is there")
        .clone();
    assert_eq!(own["missed"].as_array().map(Vec::len), Some(24), "{own}");
}

#[test]
fn tracks_that_cannot_be_read_fail_their_task_alone_and_a_folder_that_is_not_there_all() {
    let home = home();
    fs::create_dir(home.path().join("byte")).expect("it is there");
    fs::write(home.path().join("byte/long.txt"), "frame,id,x,y,w,h\n1,1,1,1,9,9\n")
        .expect("it is there");
    let output = bench(home.path(), &["--logs-dir", "logs", "--tracks", "byte=byte"]);
    assert_eq!(code(&output), 1);
    let said = text(&output.stdout);
    assert!(said.contains("line 1: is a header: remove it"), "{said}");
    let output = bench(home.path(), &["--logs-dir", "logs", "--tracks", "byte=none"]);
    assert_eq!(code(&output), 2);
    assert!(text(&output.stderr).contains("none is no folder"), "{}", text(&output.stderr));
}

#[test]
fn rooms_say_which_logs_are_single_frames_and_which_are_not_independent() {
    let home = home();
    let rooms = "folder = 'logs'\n[rooms.A]\nlogs = ['long.mcap', 'short.mcap']\n\
                 unjudged = { long = [1, 2, 3] }\n";
    fs::write(home.path().join("rooms.toml"), rooms).expect("it is there");
    let said = results_of(&bench(home.path(), &["--rooms", "rooms.toml"]));
    assert!(said.contains("note: long and short are of one room (A)"), "{said}");
    let tasks = report(home.path())["tasks"].clone();
    let truths = [0, 1].map(|at| tasks[at]["image"]["truths"].as_u64());
    assert_eq!(truths, [Some(21), Some(9)], "three are not judged");
    let single = rooms.replace("unjudged", "single_frames = true\nunjudged");
    fs::write(home.path().join("rooms.toml"), single).expect("it is there");
    let output = bench(home.path(), &["--rooms", "rooms.toml", "--logs", "logs/short.mcap"]);
    let said = results_of(&output);
    let row: Vec<&str> = said
        .lines()
        .find(|l| l.starts_with("nearest"))
        .expect("it is there")
        .split_whitespace()
        .collect();
    assert_eq!((row[1], row[3]), ("short", "-"), "{said}");
    let report = report(home.path());
    let figures = &report["summary"]["pipelines"][0]["figures"];
    assert!(figures["image.IDSW"].is_null() && !figures["image.DetA"].is_null(), "{figures}");
}

#[test]
fn recorded_boxes_of_each_log_are_found_by_its_name_and_one_file_for_several_is_noted() {
    let home = home();
    for (name, frames) in [("long", 24), ("short", 9)] {
        fs::write(home.path().join(format!("{name}.txt")), tracks(frames, 1.0))
            .expect("it is there");
    }
    let config = fs::read_to_string(
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/recorded.toml"),
    );
    let config =
        config.expect("it is there").replace("{ min_score", "{ path = '{log}.txt', min_score");
    fs::write(home.path().join("own.toml"), &config).expect("it is there");
    fs::write(home.path().join("one.toml"), config.replace("{log}", "long")).expect("it is there");
    let arguments =
        ["bench", "--logs-dir", "logs", "-o", "out", "--configs", "own.toml", "one.toml"];
    let output = crate::common::tagalong()
        .current_dir(home.path())
        .args(arguments)
        .output()
        .expect("it is there");
    let said = text(&output.stderr);
    assert_eq!(code(&output), 0, "{said}");
    assert_eq!(said.matches("for all 2 logs").count(), 1, "{said}");
    assert!(said.contains("note: one takes the boxes of long.txt for all 2 logs"), "{said}");
    let tasks = report(home.path())["tasks"].clone();
    let own =
        tasks.as_array().expect("it is there").iter().filter(|task| task["pipeline"] == "own");
    let found: Vec<f64> =
        own.map(|task| task["image"]["recall"].as_f64().expect("it is there")).collect();
    assert!(found.len() == 2 && found.iter().all(|recall| *recall > 0.7), "{found:?}");
    // So does a run.
    let arguments = ["run", "own.toml", "logs/short.mcap", "-o", "run"];
    let output = crate::common::tagalong()
        .current_dir(home.path())
        .args(arguments)
        .output()
        .expect("it is there");
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
}

/// Returns the number of boxes beside a log that count, without those of frames that are not judged.
fn boxes_of(log: &Path, unjudged: &[i64]) -> usize {
    let annotated = log.with_extension("people.csv");
    if annotated.is_file() {
        let text = fs::read_to_string(annotated).expect("it is there");
        let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let ignore = lines
            .next()
            .expect("it is there")
            .iter()
            .position(|name| *name == "ignore")
            .expect("it is there");
        return lines.filter(|cells| cells[ignore] == "0").count();
    }
    let text = fs::read_to_string(log.with_extension("boxes.csv")).expect("it is there");
    let frames = text.lines().map(|line| {
        line.split(',').next().expect("it is there").parse::<i64>().expect("it is there")
    });
    frames.filter(|frame| !unjudged.contains(frame)).count()
}

#[test]
fn the_readme_says_how_much_real_data_is_behind_its_table() {
    let Some(folder) = tagalong_conformance::testdata::find("logs") else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let rooms: toml::Table = fs::read_to_string(root.join("benches/rooms.toml"))
        .expect("it is there")
        .parse()
        .expect("it is there");
    let mut logs = 0;
    let mut frames = 0;
    let mut boxes = 0;
    // The streets of room S have no depth, and no place in the table.
    for room in ["A", "B", "C", "D"].map(|name| &rooms["rooms"][name]) {
        for name in room["logs"].as_array().expect("it is there") {
            let log = folder.join(name.as_str().expect("it is there"));
            let stem = log.file_stem().expect("it is there").to_str().expect("it is there");
            let unjudged = room.get("unjudged").and_then(|logs| logs.get(stem)?.as_array());
            let unjudged = unjudged.map_or_else(Vec::new, |frames| frames.clone());
            let unjudged: Vec<i64> = unjudged.iter().filter_map(toml::Value::as_integer).collect();
            let mut inspect = crate::common::tagalong();
            let about = crate::common::json(
                &inspect
                    .arg("inspect")
                    .arg(&log)
                    .args(["--format", "json"])
                    .output()
                    .expect("it is there"),
            );
            let topics = about["topics"].as_array().expect("it is there");
            let colour = topics.iter().find(|t| t["topic"] == "/camera/color/image_raw/compressed");
            frames += colour.expect("it is there")["count"].as_u64().expect("it is there");
            boxes += boxes_of(&log, &unjudged);
            logs += 1;
        }
    }
    let told = format!("Means over 4 rooms: {logs} real logs, {frames} frames, {boxes} boxes,");
    let readme = fs::read_to_string(root.join("README.md")).expect("it is there");
    assert!(readme.contains(&told), "README.md lacks `{told}`");
}
