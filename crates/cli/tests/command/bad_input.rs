//! Every command with every kind of bad input, and users' mistakes: one clear message with the problem
//! and the remedy, and the right exit code: 1 for data that cannot be used, 2 for settings and outputs
//! that cannot.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::common::{
    Drawn, code, config, messages_of, own_plugin, people, tagalong, text, unread, write,
};

/// Content in place of a valid file. Opening a pipe without a writer would wait for ever; the sparse
/// file has gigabytes.
const BAD_FILES: [&str; 6] =
    ["missing.EXT", "words.EXT", "empty.EXT", "folder.EXT", "pipe.EXT", "sparse.EXT"];

/// Commands with a place for a file, its extension, and the exit code where the file is bad.
const FILES: [(&str, &str, i32); 15] = [
    ("run nearest.toml FILE -o out", "mcap", 1),
    ("run FILE good.mcap -o out", "toml", 2),
    ("check nearest.toml FILE", "mcap", 1),
    ("check FILE", "toml", 2),
    ("inspect FILE", "mcap", 1),
    ("inspect good.mcap --config FILE", "toml", 2),
    ("doctor nearest.toml FILE", "mcap", 1),
    ("doctor FILE good.mcap", "toml", 2),
    ("bench --configs nearest.toml --logs FILE -o out", "mcap", 1),
    ("bench --configs FILE --logs good.mcap -o out", "toml", 2),
    ("eval --truth good.boxes.csv --tracks FILE", "csv", 1),
    ("eval --truth FILE --tracks good.boxes.csv", "csv", 1),
    ("simulate FILE -o out.mcap", "toml", 2),
    ("follow steered.toml FILE", "toml", 2),
    ("trials FILE --seeds 1 --configs nearest.toml", "toml", 2),
];

/// Empty files that are valid: settings without keys are defaults, and tracks may be empty.
const FINE: [&str; 6] = [
    "inspect good.mcap --config empty.toml",
    "eval --truth good.boxes.csv --tracks empty.csv",
    "eval --truth empty.csv --tracks good.boxes.csv",
    "simulate empty.toml -o out.mcap",
    "follow steered.toml empty.toml",
    "trials empty.toml --seeds 1 --configs nearest.toml",
];

/// Other mistakes: command, exit code, and parts of the message.
const OTHERS: [(&str, i32, &[&str]); 54] = [
    ("run nearest.toml no-depth.mcap -o out", 1, &["depth"]),
    ("check nearest.toml no-depth.mcap", 1, &["depth"]),
    ("run typo.toml good.mcap -o out", 2, &["typo.toml:4", "did you mean `roles`"]),
    ("check typo.toml", 2, &["typo.toml:4"]),
    ("doctor typo.toml good.mcap", 2, &["typo.toml:4"]),
    ("bench --configs typo.toml --logs good.mcap -o out", 2, &["typo.toml:4"]),
    ("simulate scene-typo.toml -o out.mcap", 2, &["scene-typo.toml:"]),
    ("trials scene-typo.toml --seeds 1 --configs nearest.toml", 2, &["scene-typo.toml:"]),
    ("run nearest.toml good.mcap -o old.bag/x", 2, &["old.bag"]),
    ("doctor nearest.toml good.mcap -o old.bag/x", 2, &["old.bag"]),
    ("demo -o old.bag/x", 2, &["old.bag"]),
    ("simulate scene.toml -o old.bag/x.mcap", 2, &["old.bag"]),
    ("import images photos -o old.bag/x.mcap", 2, &["old.bag"]),
    ("bench --configs nearest.toml --logs good.mcap -o old.bag/x", 2, &["old.bag"]),
    ("run nearest.toml good.mcap -o full", 2, &["--overwrite"]),
    ("doctor nearest.toml good.mcap -o full", 2, &["--overwrite"]),
    ("demo -o full", 2, &["--overwrite"]),
    ("simulate scene.toml -o good.mcap", 2, &["--overwrite"]),
    ("import images photos -o good.mcap", 2, &["--overwrite"]),
    ("config nearest-thin", 2, &["nearest-thing", "pipeline"]),
    ("train svm-pitch", 2, &["svm-patch"]),
    ("import tmu folder.csv", 2, &["tum"]),
    ("run steered.toml good.mcap", 1, &["odometry = \"none\"` in [robot]"]),
    ("run steered.toml good.mcap", 1, &["`tagalong run good.mcap` tracks its people without"]),
    ("check steered.toml good.mcap", 1, &["odometry = \"none\"` in [robot]"]),
    ("check sparse-model.toml", 2, &["at most 67108864 are read"]),
    ("check pipe-model.toml", 2, &["is a pipe or a device"]),
    ("import images cut -o out.mcap", 1, &["cut/1.png"]),
    ("import images photos --fps 1e300", 2, &["at most 10000"]),
    ("import images photos --focal 1e30", 2, &["at most 1000000"]),
    ("check fast.toml", 2, &["must lie between 0.05 and 0.9, not 50"]),
    ("rum a b", 2, &["rum", "run"]),
    ("run a b --overly", 2, &["--overlay"]),
    ("run a b --threads 0", 2, &["--threads"]),
    ("run colour-net good.mcap", 2, &["`colour-net` runs", "neural network"]),
    ("bench --configs nearest.toml --logs-dir none -o out", 1, &["cannot read none"]),
    ("run neerest.toml good.mcap", 2, &["did you mean", "nearest.toml"]),
    ("run full good.mcap", 2, &["full is a directory"]),
    ("run empty.toml good.mcap", 2, &["empty.toml", "filter"]),
    ("run words.toml good.mcap", 2, &["words.toml:1:"]),
    ("run extends.toml good.mcap", 2, &["extends.toml:1:11", "secret.env", "ends in .toml"]),
    (
        "eval --truth stamps.txt --tracks stamps.txt",
        1,
        &["stamps.txt, line 2: frame 1700000000", "up to 1000000"],
    ),
    ("run plugin.toml good.mcap", 2, &["plugin.toml:3", "nearest-thing"]),
    ("check deep.toml", 2, &["deep.toml:"]),
    ("run input.toml good.mcap", 2, &["depth_tropic", "depth_topic"]),
    ("run output.toml good.mcap", 2, &["report_unseen_s"]),
    ("run nearest.toml goood.mcap", 1, &["no such file", "did you mean `good.mcap`"]),
    ("run good.mpac", 2, &["did you mean the log", "good.mcap"]),
    ("run nearest.toml logs", 1, &["directory", "inside.mcap"]),
    ("run nearest.toml old.bag", 1, &["rosbag fix"]),
    ("inspect bag.db3", 1, &["bag.db3", "the database is damaged or cut off"]),
    ("run nearest.toml good.mcap -o old.bag", 2, &["not a directory"]),
    ("run nearest.toml good.mcap -o good.mcap --overwrite", 2, &["good.mcap"]),
    (
        "run nearest.toml logs/inside.mcap -o logs --overwrite",
        2,
        &["logs/inside.mcap", "another directory"],
    ),
];

fn lay_out(home: &Path) {
    Drawn::of(3).write(&home.join("good.mcap"));
    Drawn { depth: false, ..Drawn::of(3) }.write(&home.join("no-depth.mcap"));
    config(home, "");
    write(home, "good.people.csv", &people(3));
    write(home, "good.boxes.csv", "1,1,10,10,20,40,1,1,1\n2,1,11,10,20,40,1,1,1\n");
    for extension in ["mcap", "toml", "csv"] {
        write(
            home,
            &format!("words.{extension}"),
            "these are only words, and a good lot of them\n",
        );
        write(home, &format!("empty.{extension}"), "");
        fs::create_dir_all(home.join(format!("folder.{extension}"))).unwrap();
        let pipe = Command::new("mkfifo").arg(home.join(format!("pipe.{extension}"))).status();
        assert!(pipe.unwrap().success());
        let sparse = fs::File::create(home.join(format!("sparse.{extension}"))).unwrap();
        sparse.set_len(3 << 30).unwrap();
    }
    let fine = fs::read_to_string(home.join("nearest.toml")).unwrap();
    for kind in ["sparse", "pipe"] {
        let verifier = "[[verifiers]]\nplugin = \"body-net\"\n";
        let model = format!("{verifier}config = {{ model = \"{kind}.toml\" }}\n");
        write(home, &format!("{kind}-model.toml"), &(fine.clone() + "\n" + &model));
    }
    let steered = format!("{fine}\n[controller]\nplugin = \"arc-follow\"\n");
    write(home, "steered.toml", &steered);
    write(home, "fast.toml", &format!("robot.max_speed_mps = 50.0\n{steered}"));
    write(home, "typo.toml", &fine.replace("roles = ", "rolls = "));
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/scenes");
    let scene = fs::read_to_string(scenes.join("sample.toml")).unwrap();
    write(home, "scene.toml", &scene);
    write(home, "scene-typo.toml", &scene.replace("duration_s", "durations"));
    write(home, "plugin.toml", &fine.replace("nearest-thing", "nearest-think"));
    write(home, "input.toml", &format!("{fine}\n[input]\ndepth_tropic = \"/d\"\n"));
    write(home, "output.toml", &format!("{fine}\n[output]\nreport_unseen_s = -1.0\n"));
    write(home, "deep.toml", &format!("{fine}config = {{ max_depth_m = \"far\" }}\n"));
    write(home, "extends.toml", "extends = 'secret.env'\n");
    write(home, "secret.env", "SEED = 'abc'\n");
    write(home, "stamps.txt", "1,1,0,0,9,9,1,1,1\n1700000000,1,0,0,9,9,1,1,1\n");
    write(home, "old.bag", "#ROSBAG V1.2\n");
    write(home, "bag.db3", "SQLite format 3\0");
    fs::create_dir_all(home.join("logs")).unwrap();
    Drawn::of(2).write(&home.join("logs/inside.mcap"));
    // Two different logs in a folder are not the parts of one.
    write(home, "logs/other.mcap", "x");
    fs::create_dir_all(home.join("full")).unwrap();
    write(home, "full/precious.txt", "keep me");
    fs::create_dir_all(home.join("photos")).unwrap();
    image::RgbImage::new(8, 8).save(home.join("photos/1.png")).unwrap();
    let whole = fs::read(home.join("photos/1.png")).unwrap();
    fs::create_dir_all(home.join("cut")).unwrap();
    fs::write(home.join("cut/1.png"), &whole[..whole.len() - 20]).unwrap();
}

/// Runs a command; returns a description of its wrong answer, if it is wrong.
fn complaint(home: &Path, line: &str, expected: i32, says: &[&str]) -> Option<String> {
    let output = own_plugin().args(line.split(' ')).current_dir(home).output().unwrap();
    let told = text(&output.stderr);
    let ended = output.status.code();
    let wrong = if ended != Some(expected) {
        format!("exit code {ended:?} instead of {expected}")
    } else if let Some(part) = says.iter().find(|part| !told.contains(**part)) {
        format!("no `{part}`")
    } else if ["panicked", "internal error", "backtrace"].iter().any(|word| told.contains(word)) {
        "a stack trace".into()
    } else if told.lines().count() > 40 || !told.contains("error: ") {
        "not one clear message".into()
    } else {
        return None;
    };
    Some(format!("tagalong {line}: {wrong}:\n{told}"))
}

#[test]
fn every_command_answers_bad_input_with_a_clear_message() {
    let home = tempfile::tempdir().unwrap();
    lay_out(home.path());
    let mut complaints = Vec::new();
    for (template, extension, expected) in FILES {
        for file in BAD_FILES {
            let file = file.replace("EXT", extension);
            let line = template.replace("FILE", &file);
            if FINE.contains(&line.as_str()) {
                continue;
            }
            complaints.extend(complaint(home.path(), &line, expected, &[&file]));
        }
    }
    for (line, expected, says) in OTHERS {
        complaints.extend(complaint(home.path(), line, expected, says));
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
    assert_eq!(fs::read(home.path().join("full/precious.txt")).unwrap(), b"keep me");
    assert!(fs::metadata(home.path().join("good.mcap")).unwrap().len() > 1000);
    let left: Vec<_> =
        ["out", "out.mcap", "runs"].iter().filter(|n| home.path().join(n).exists()).collect();
    assert!(left.is_empty(), "refused commands left {left:?}");
}

/// The last line on stderr is the error, whoever found it.
#[test]
fn errors_are_json_where_the_output_is() {
    let home = tempfile::tempdir().unwrap();
    lay_out(home.path());
    let lines = [
        ("check typo.toml --format json", 2, "typo.toml:4"),
        ("inspect words.mcap --format=json", 1, "words.mcap"),
        ("inspect --format json", 2, "<LOG>"),
    ];
    for (line, expected, says) in lines {
        let output = own_plugin().args(line.split(' ')).current_dir(home.path()).output().unwrap();
        assert_eq!(code(&output), expected, "{line}");
        let told = text(&output.stderr);
        let last = told.lines().next_back().unwrap_or_default();
        let error: serde_json::Value = serde_json::from_str(last).unwrap();
        assert!(error["error"].as_str().unwrap().contains(says), "{line}: {told}");
        assert_eq!(error["exit_code"], expected, "{line}");
    }
    let output = own_plugin().args(["list", "--help", "--format", "json"]).output().unwrap();
    assert_eq!(code(&output), 0);
}

/// `| head -1` ends a command quietly, for all output.
#[test]
fn a_closed_pipe_is_a_quiet_end_for_every_command_that_prints() {
    let home = tempfile::tempdir().unwrap();
    lay_out(home.path());
    let lines = [
        "list",
        "list --format json",
        "config pipeline",
        "inspect good.mcap",
        "check nearest.toml",
        "doctor nearest.toml good.mcap",
        "eval --truth good.people.csv --tracks good.people.csv",
        "--help",
    ];
    for line in lines {
        let output = unread(own_plugin().args(line.split(' ')).current_dir(home.path()));
        let told = text(&output.stderr);
        assert!(!told.contains("roken pipe") && !told.contains("panic"), "{line}: {told}");
        assert!(told.is_empty() || line != "config pipeline", "{told}");
        assert!([0, 3].contains(&code(&output)) || line.starts_with("eval"), "{line}: {told}");
    }
}

/// Output for programs is JSON and nothing else.
#[test]
fn json_is_printed_by_every_command_that_prints_data() {
    let home = tempfile::tempdir().unwrap();
    lay_out(home.path());
    let lines = [
        "list",
        "inspect good.mcap",
        "check nearest.toml good.mcap",
        "config ekf",
        "doctor nearest.toml good.mcap",
        "run nearest.toml good.mcap -o json-out",
        "simulate scene.toml -o json.mcap",
    ];
    for line in lines {
        let mut command = own_plugin();
        command.args(line.split(' ')).args(["--format", "json"]).current_dir(home.path());
        let output = command.output().unwrap();
        let read = serde_json::from_slice::<serde_json::Value>(&output.stdout);
        assert!(read.is_ok(), "{line}: {}{}", text(&output.stdout), text(&output.stderr));
    }
}

/// A log that ends too early is worked on, and the exit code tells.
#[test]
fn lost_data_is_an_exit_code_of_every_command_that_reads_a_log() {
    let home = tempfile::tempdir().unwrap();
    lay_out(home.path());
    Drawn::of(40).write(&home.path().join("whole.mcap"));
    let whole = fs::read(home.path().join("whole.mcap")).unwrap();
    fs::write(home.path().join("short.mcap"), &whole[..whole.len() * 2 / 3]).unwrap();
    for (log, expected) in [("whole.mcap", 0), ("short.mcap", 3)] {
        let lines = ["inspect LOG", "check nearest.toml LOG", "run nearest.toml LOG --overwrite"];
        for line in lines.map(|line| line.replace("LOG", log)) {
            let output =
                own_plugin().args(line.split(' ')).current_dir(home.path()).output().unwrap();
            assert_eq!(code(&output), expected, "{line}: {}", text(&output.stderr));
        }
    }
}

#[test]
fn without_a_command_the_usage_is_told() {
    let said = messages_of(&tagalong().output().unwrap(), 2);
    assert!(said.contains("Usage"), "{said}");
}

#[test]
fn help_is_there_for_every_command() {
    for command in ["run", "list", "config", "check", "inspect"] {
        let output = tagalong().args([command, "--help"]).output().unwrap();
        assert_eq!(code(&output), 0);
        assert!(text(&output.stdout).contains("Example"), "{command}");
    }
}

#[test]
fn a_detector_without_a_model_is_a_failure_with_the_key_to_set() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(3).write(&home.path().join("walk.mcap"));
    fs::write(home.path().join("onnx.toml"), include_str!("../../../../configs/onnx.toml"))
        .unwrap();
    let arguments = ["run", "onnx.toml", "walk.mcap", "-o", "out"];
    let told =
        messages_of(&tagalong().args(arguments).current_dir(home.path()).output().unwrap(), 1);
    assert!(told.contains("has no model (`model`)") && told.contains("tagalong model"), "{told}");
}

#[test]
fn a_name_that_is_no_config_costs_no_simulation() {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("walk.people.csv"), "frame,id\n").unwrap();
    for name in ["walk.people.csv", "none.toml"] {
        let told = messages_of(
            &tagalong().args(["run", name]).current_dir(home.path()).output().unwrap(),
            2,
        );
        assert!(
            !told.contains("two drawn people") && !told.contains("two simulated people"),
            "{told}"
        );
        assert!(!home.path().join("runs").exists(), "{name}: a log was simulated");
    }
}
