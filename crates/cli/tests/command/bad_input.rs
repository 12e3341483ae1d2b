//! Every command with every kind of bad input: one clear message that names the file, and the right
//! exit code: 1 for data that cannot be used, 2 for settings and outputs that cannot.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::common::{Drawn, code, config, own_plugin, people, text, unread};

/// Content in place of a valid file.
const BAD_FILES: [(&str, &str); 6] = [
    ("a missing file", "missing.EXT"),
    ("a file of words", "words.EXT"),
    ("an empty file", "empty.EXT"),
    ("a folder", "folder.EXT"),
    // Without a writer: opening it would wait for ever.
    ("a pipe", "pipe.EXT"),
    ("gigabytes of nothing", "sparse.EXT"),
];

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

/// Other mistakes: description, command, exit code, and part of the message.
const OTHERS: [(&str, &str, i32, &str); 30] = [
    ("no depth", "run nearest.toml no-depth.mcap -o out", 1, "depth"),
    ("no depth", "check nearest.toml no-depth.mcap", 1, "depth"),
    ("an unknown key", "run typo.toml good.mcap -o out", 2, "typo.toml:4"),
    ("an unknown key", "check typo.toml", 2, "typo.toml:4"),
    ("an unknown key", "doctor typo.toml good.mcap", 2, "typo.toml:4"),
    ("an unknown key", "bench --configs typo.toml --logs good.mcap -o out", 2, "typo.toml:4"),
    ("an unknown key", "simulate scene-typo.toml -o out.mcap", 2, "scene-typo.toml:"),
    (
        "an unknown key",
        "trials scene-typo.toml --seeds 1 --configs nearest.toml",
        2,
        "scene-typo.toml:",
    ),
    ("an output below a file", "run nearest.toml good.mcap -o old.bag/x", 2, "old.bag"),
    ("an output below a file", "doctor nearest.toml good.mcap -o old.bag/x", 2, "old.bag"),
    ("an output below a file", "demo -o old.bag/x", 2, "old.bag"),
    ("an output below a file", "simulate scene.toml -o old.bag/x.mcap", 2, "old.bag"),
    ("an output below a file", "import images photos -o old.bag/x.mcap", 2, "old.bag"),
    (
        "an output below a file",
        "bench --configs nearest.toml --logs good.mcap -o old.bag/x",
        2,
        "old.bag",
    ),
    ("an existing output", "run nearest.toml good.mcap -o full", 2, "--overwrite"),
    ("an existing output", "doctor nearest.toml good.mcap -o full", 2, "--overwrite"),
    ("an existing output", "demo -o full", 2, "--overwrite"),
    ("an existing output", "simulate scene.toml -o good.mcap", 2, "--overwrite"),
    ("an existing output", "import images photos -o good.mcap", 2, "--overwrite"),
    ("an unknown plugin", "config nearest-thin", 2, "nearest-thing"),
    ("an unknown plugin", "train svm-pitch", 2, "svm-patch"),
    ("an unknown layout", "import tmu folder.csv", 2, "tum"),
    (
        "no odometry for a controller",
        "run steered.toml good.mcap",
        1,
        "odometry = \"none\"` in [robot]",
    ),
    ("the same in a check", "check steered.toml good.mcap", 1, "odometry = \"none\"` in [robot]"),
    ("a model of gigabytes", "check sparse-model.toml", 2, "at most 67108864 are read"),
    ("a pipe as a model", "check pipe-model.toml", 2, "is a pipe or a device"),
    ("a cut image", "import images cut -o out.mcap", 1, "cut/1.png"),
    ("a rate beyond sense", "import images photos --fps 1e300", 2, "at most 10000"),
    ("a lens beyond sense", "import images photos --focal 1e30", 2, "at most 1000000"),
    ("a limit beyond its ceiling", "check fast.toml", 2, "must lie between 0.05 and 0.9, not 50"),
];

fn lay_out(home: &Path) {
    let write = |name: &str, text: &str| fs::write(home.join(name), text).unwrap();
    Drawn::of(3).write(&home.join("good.mcap"));
    Drawn { depth: false, ..Drawn::of(3) }.write(&home.join("no-depth.mcap"));
    config(home, "");
    write("good.people.csv", &people(3));
    write("good.boxes.csv", "1,1,10,10,20,40,1,1,1\n2,1,11,10,20,40,1,1,1\n");
    for extension in ["mcap", "toml", "csv"] {
        write(&format!("words.{extension}"), "these are only words, and a good lot of them\n");
        write(&format!("empty.{extension}"), "");
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
        write(&format!("{kind}-model.toml"), &(fine.clone() + "\n" + &model));
    }
    let steered = format!("{fine}\n[controller]\nplugin = \"arc-follow\"\n");
    write("steered.toml", &steered);
    write("fast.toml", &format!("robot.max_speed_mps = 50.0\n{steered}"));
    write("typo.toml", &fine.replace("roles = ", "rolls = "));
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/scenes");
    let scene = fs::read_to_string(scenes.join("sample.toml")).unwrap();
    write("scene.toml", &scene);
    write("scene-typo.toml", &scene.replace("duration_s", "durations"));
    write("old.bag", "#ROSBAG V2.0\n");
    fs::create_dir_all(home.join("full")).unwrap();
    write("full/precious.txt", "keep me");
    fs::create_dir_all(home.join("photos")).unwrap();
    image::RgbImage::new(8, 8).save(home.join("photos/1.png")).unwrap();
    let whole = fs::read(home.join("photos/1.png")).unwrap();
    fs::create_dir_all(home.join("cut")).unwrap();
    fs::write(home.join("cut/1.png"), &whole[..whole.len() - 20]).unwrap();
}

/// Runs a command; returns a description of its wrong answer, if it is wrong.
fn complaint(home: &Path, line: &str, expected: i32, says: &str) -> Option<String> {
    let output = own_plugin().args(line.split(' ')).current_dir(home).output().unwrap();
    let told = text(&output.stderr);
    let ended = output.status.code();
    let wrong = if ended != Some(expected) {
        format!("exit code {ended:?} instead of {expected}")
    } else if !told.contains(says) {
        format!("no `{says}`")
    } else if told.contains("panicked") || told.contains("internal error") {
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
        for (_, file) in BAD_FILES {
            let file = file.replace("EXT", extension);
            let line = template.replace("FILE", &file);
            if FINE.contains(&line.as_str()) {
                continue;
            }
            complaints.extend(complaint(home.path(), &line, expected, &file));
        }
    }
    for (_, line, expected, says) in OTHERS {
        complaints.extend(complaint(home.path(), line, expected, says));
    }
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
    assert_eq!(fs::read(home.path().join("full/precious.txt")).unwrap(), b"keep me");
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
