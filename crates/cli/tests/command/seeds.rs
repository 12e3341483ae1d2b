//! Tables of simulated scenes: other random variants on request, their names, and the limits of
//! claims from few of them.

use std::path::{Path, PathBuf};
use std::process::Output;

use serde_json::Value;

use crate::common::{code, tagalong, text};

/// One person passing at a distance that differs from seed to seed.
const SCENE: &str = "duration_s = 1.5\n[camera]\nwidth = 120\nheight = 90\ncolour = false\n\
    [robot]\nstart = [1.0, 3.0]\n[[people]]\npath = [[3.2, 2.4], [3.8, 4.0]]\nspeed_mps = 0.8\n";
const CONFIGS: [&str; 2] = ["depth-ekf.toml", "naive.toml"];

fn trials(more: &[&str]) -> Output {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("pass.toml"), SCENE).unwrap();
    let mut command = tagalong();
    command.current_dir(folder.path()).args(["trials", "pass.toml", "--configs"]);
    command.args(CONFIGS.map(|name| configs().join(name))).args(more).output().unwrap()
}

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs")
}

fn printed(output: &Output) -> String {
    assert_eq!(code(output), 0, "{}", text(&output.stderr));
    text(&output.stdout)
}

#[test]
fn another_first_seed_draws_other_scenes_and_the_same_one_the_same() {
    let [here, again, there] = [("5", "1"), ("5", "2"), ("6", "2")].map(|(first, jobs)| {
        let more = ["--seeds", "2", "--format", "json", "--jobs", jobs, "--first-seed", first];
        printed(&trials(&more))
    });
    assert_eq!(here, again);
    let [here, there] = [here, there].map(|text| serde_json::from_str::<Value>(&text).unwrap());
    assert_ne!(here["rows"], there["rows"]);
    let seeds = serde_json::json!({ "split": "test", "first": 5, "count": 2 });
    assert_eq!(here["seeds"], seeds);
}

#[test]
fn one_draw_is_printed_without_an_interval_and_two_are_never_clear() {
    let one = printed(&trials(&["--seeds", "1", "--first-seed", "7"]));
    assert!(one.contains("1 seed of the split test from 7 on"), "{one}");
    let row = one.lines().find(|line| line.contains("depth-ekf ")).unwrap();
    assert_eq!(row.matches('[').count(), 1, "only all frames right has one: {row}");
    assert!(one.contains("(p = 1.000), which may be luck"), "{one}");
    let two = printed(&trials(&["--seeds", "2"]));
    assert!(two.contains("2 seeds of the split test from 0 on"), "{two}");
    assert!(two.contains("which may be luck"), "{two}");
}

#[test]
fn seeds_that_the_split_does_not_have_are_refused() {
    let scene = configs().join("scenes/follow-swap.toml");
    let beyond: [&[&str]; 3] = [
        &["trials", "--seeds", "2", "--first-seed", "999999999"],
        &["trials", "--split", "train", "--first-seed", "1000000000"],
        &["follow", "--seeds", "2", "--split", "validation", "--first-seed", "1999999999"],
    ];
    for arguments in beyond {
        let mut command = tagalong();
        command.args(arguments);
        if arguments[0] == "follow" {
            command.arg(configs().join("follow-depth.toml")).arg(&scene);
        }
        let output = command.output().unwrap();
        let told = text(&output.stderr);
        assert_eq!(code(&output), 2, "{arguments:?}: {told}");
        assert!(told.contains("the split"), "{arguments:?}: {told}");
    }
}
