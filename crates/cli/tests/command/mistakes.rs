//! Users' mistakes at the boundary of the process: each gets its exit code and a message with the
//! problem and the remedy.

use std::fs;
use std::path::Path;

use crate::common::{Drawn, code, config, own_plugin, tagalong, text, unread};

/// A mistake: arguments, exit code, and required parts of the message.
struct Mistake {
    name: &'static str,
    args: Vec<&'static str>,
    code: i32,
    says: &'static [&'static str],
}

fn mistake(name: &'static str, args: &str, code: i32, says: &'static [&'static str]) -> Mistake {
    let args: &'static str = args.to_owned().leak();
    Mistake { name, args: args.split(' ').collect(), code, says }
}

/// Writes all files that the mistakes need, in one folder.
fn lay_out(home: &Path) {
    Drawn::of(3).write(&home.join("good.mcap"));
    Drawn { depth: false, ..Drawn::of(3) }.write(&home.join("no-depth.mcap"));
    config(home, "");
    let write = |name: &str, bytes: &str| fs::write(home.join(name), bytes).unwrap();
    write("empty.toml", "");
    write("words.toml", "this is\nno toml\n");
    write("typo.toml", "[[detectors]]\nplugin = \"nearest-thing\"\nrolls = []\n");
    write("plugin.toml", "[[detectors]]\nplugin = \"nearest-think\"\n[filter]\nplugin = \"ekf\"\n");
    let fine = fs::read_to_string(home.join("nearest.toml")).unwrap();
    write("input.toml", &format!("{fine}\n[input]\ndepth_tropic = \"/d\"\n"));
    write("output.toml", &format!("{fine}\n[output]\nreport_unseen_s = -1.0\n"));
    write("deep.toml", &format!("{fine}config = {{ max_depth_m = \"far\" }}\n"));
    write("extends.toml", "extends = 'secret.env'\n");
    write("secret.env", "SEED = 'abc'\n");
    write("stamps.txt", "1,1,0,0,9,9,1,1,1\n1700000000,1,0,0,9,9,1,1,1\n");
    write("empty.mcap", "");
    write("words.mcap", "these are only words, and a lot of them, but no log\n");
    write("old.bag", "#ROSBAG V1.2\n");
    write("bag.db3", "SQLite format 3\0");
    fs::create_dir_all(home.join("full")).unwrap();
    write("full/precious.txt", "keep me");
    fs::create_dir_all(home.join("logs")).unwrap();
    Drawn::of(2).write(&home.join("logs/inside.mcap"));
    // Two different logs in a folder are not the parts of one.
    fs::write(home.join("logs/other.mcap"), "x").unwrap();
}

fn mistakes() -> Vec<Mistake> {
    let m = mistake;
    vec![
        m("no command", "", 2, &["Usage"]),
        m("an unknown command", "rum a b", 2, &["rum", "run"]),
        m("an unknown option", "run a b --overly", 2, &["--overlay"]),
        m("no threads", "run a b --threads 0", 2, &["--threads"]),
        m("no config", "run neerest.toml good.mcap", 2, &["did you mean", "nearest.toml"]),
        m("a folder as config", "run full good.mcap", 2, &["full is a directory"]),
        m("an empty config", "run empty.toml good.mcap", 2, &["empty.toml", "filter"]),
        m("a config of words", "run words.toml good.mcap", 2, &["words.toml:1:"]),
        m(
            "an unknown key",
            "run typo.toml good.mcap",
            2,
            &["typo.toml:3:1", "did you mean `roles`"],
        ),
        m(
            "a config that extends another file",
            "run extends.toml good.mcap",
            2,
            &["extends.toml:1:11", "secret.env", "ends in .toml"],
        ),
        m(
            "a frame that is a stamp",
            "eval --truth stamps.txt --tracks stamps.txt",
            1,
            &["stamps.txt, line 2: frame 1700000000", "up to 1000000"],
        ),
        m("an unknown plugin", "run plugin.toml good.mcap", 2, &["plugin.toml:2", "nearest-thing"]),
        m("a wrong type", "check deep.toml", 2, &["deep.toml:"]),
        m("an unknown topic key", "run input.toml good.mcap", 2, &["depth_tropic", "depth_topic"]),
        m("a negative time", "run output.toml good.mcap", 2, &["report_unseen_s"]),
        m(
            "no log",
            "run nearest.toml goood.mcap",
            1,
            &["no such file", "did you mean `good.mcap`"],
        ),
        m("a folder as log", "run nearest.toml logs", 1, &["directory", "inside.mcap"]),
        m("an empty log", "run nearest.toml empty.mcap", 1, &["empty.mcap"]),
        m("a log of words", "run nearest.toml words.mcap", 1, &["words.mcap"]),
        m("an old ROS 1 bag", "run nearest.toml old.bag", 1, &["rosbag fix"]),
        m("a database that is no bag", "inspect bag.db3", 1, &["bag.db3", "rosbag2 database"]),
        m("no depth", "run nearest.toml no-depth.mcap", 1, &["depth"]),
        m("a log that does not fit", "check nearest.toml no-depth.mcap", 1, &["depth"]),
        m("results in a full folder", "run nearest.toml good.mcap -o full", 2, &["--overwrite"]),
        m("results below a file", "run nearest.toml good.mcap -o old.bag/x", 2, &["old.bag"]),
        m("results as a file", "run nearest.toml good.mcap -o old.bag", 2, &["not a directory"]),
        m(
            "results over the log",
            "run nearest.toml good.mcap -o good.mcap --overwrite",
            2,
            &["good.mcap"],
        ),
        m(
            "results beside the log",
            "run nearest.toml logs/inside.mcap -o logs --overwrite",
            2,
            &["logs/inside.mcap", "another directory"],
        ),
        m("no such plugin", "config nearest-thin", 2, &["nearest-thing", "pipeline"]),
        m("nothing to inspect", "inspect words.mcap", 1, &["words.mcap"]),
    ]
}

#[test]
fn every_mistake_has_its_exit_code_and_says_what_to_do() {
    let home = tempfile::tempdir().unwrap();
    lay_out(home.path());
    for Mistake { name, args, code: expected, says } in mistakes() {
        let args = args.iter().filter(|arg| !arg.is_empty());
        let output = own_plugin().args(args).current_dir(home.path()).output().unwrap();
        let told = text(&output.stderr);
        assert_eq!(code(&output), expected, "{name}: {told}");
        for part in says {
            assert!(told.contains(part), "{name}: no `{part}` in: {told}");
        }
        assert!(!told.contains("panicked") && !told.contains("backtrace"), "{name}: {told}");
        assert!(told.lines().count() <= 40, "{name} is told at length: {told}");
    }
    assert_eq!(fs::read(home.path().join("full/precious.txt")).unwrap(), b"keep me");
    assert!(fs::metadata(home.path().join("good.mcap")).unwrap().len() > 1000);
    assert!(!home.path().join("runs").exists(), "a refused run leaves nothing behind");
}

#[test]
fn a_closed_pipe_is_a_quiet_end() {
    let output = unread(tagalong().args(["config", "pipeline"]));
    assert_eq!((code(&output), text(&output.stderr).as_str()), (0, ""));
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
    let output = tagalong().args(arguments).current_dir(home.path()).output().unwrap();
    let told = text(&output.stderr);
    assert_eq!(code(&output), 1, "{told}");
    assert!(told.contains("has no model (`model`)") && told.contains("tagalong model"), "{told}");
}

#[test]
fn a_name_that_is_no_config_costs_no_simulation() {
    let home = tempfile::tempdir().unwrap();
    fs::write(home.path().join("walk.people.csv"), "frame,id\n").unwrap();
    for name in ["walk.people.csv", "none.toml"] {
        let output = tagalong().args(["run", name]).current_dir(home.path()).output().unwrap();
        let told = text(&output.stderr);
        assert_eq!(code(&output), 2, "{told}");
        assert!(
            !told.contains("two drawn people") && !told.contains("two simulated people"),
            "{told}"
        );
        assert!(!home.path().join("runs").exists(), "{name}: a log was simulated");
    }
}
