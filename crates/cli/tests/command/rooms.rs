//! `tagalong bench --leave-one-room-out` over simulated logs: a room has no influence on its own
//! settings, and nothing is computed twice.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::process::Output;

use serde_json::Value;

use crate::common::{Drawn, assert_same, code, messages_of, own_plugin, people, text};

/// The detector of the config misses the walker; one value of two lets it detect them.
const TUNE: &str = "config = { max_depth_m = 2.0 }";
const VALUES: &str = "\"detectors.0.config.max_depth_m\" = [2.0, 4.0]";
const KEY: &str = "detectors.0.config.max_depth_m";

/// Two rooms with a log each.
struct Home {
    folder: tempfile::TempDir,
}

impl Home {
    fn new() -> Self {
        let home = Self { folder: tempfile::tempdir().unwrap() };
        for (name, frames) in [("a", 12), ("b", 9)] {
            Drawn::of(frames).write(&home.path(&format!("logs/{name}.mcap")));
            home.write(&format!("logs/{name}.people.csv"), &people(frames));
        }
        home.write(
            "rooms.toml",
            "folder = \"logs\"\n[rooms.A]\nlogs = [\"a.mcap\"]\n[rooms.B]\nlogs = [\"b.mcap\"]\n",
        );
        home.config("near", TUNE, VALUES);
        home
    }

    fn path(&self, name: &str) -> PathBuf {
        let path = self.folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    fn config(&self, name: &str, extra: &str, tune: &str) {
        let written = crate::common::config(self.folder.path(), extra);
        let text = fs::read_to_string(&written).unwrap() + "[tune]\n" + tune + "\n";
        fs::remove_file(written).unwrap();
        self.write(&format!("configs/{name}.toml"), &text);
    }

    fn command(&self, arguments: &[&str]) -> std::process::Command {
        let mut command = own_plugin();
        command.current_dir(self.folder.path()).args(["bench", "--leave-one-room-out"]);
        command.arg("rooms.toml").args(arguments);
        command
    }

    fn rooms(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// The comparison is refused as a wrong use, with these words.
    fn refuses_with(&self, words: &[&str]) {
        let told = messages_of(&self.rooms(&[]), 2);
        words.iter().for_each(|word| assert!(told.contains(word), "{word} in {told}"));
    }

    /// The tables for a page.
    fn page(&self) -> String {
        text(&self.rooms(&["--format", "markdown"]).stdout)
    }

    /// The report on the first pipeline.
    fn fitted(&self, arguments: &[&str]) -> Value {
        let output = self.rooms(&[&["--format", "json"], arguments].concat());
        assert_eq!(code(&output), 0, "{}", text(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).unwrap()["pipelines"][0].clone()
    }

    fn results(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let entries = fs::read_dir(self.path(out).join("rooms")).unwrap().map(Result::unwrap);
        let files = entries.map(|entry| {
            (entry.file_name().into_string().unwrap(), fs::read(entry.path()).unwrap())
        });
        files.collect()
    }
}

fn chosen(fitted: &Value) -> [f64; 3] {
    let rooms = &fitted["rooms"];
    [&rooms[0]["chosen_without"], &rooms[1]["chosen_without"], &fitted["chosen_with_all"]]
        .map(|values| values[KEY].as_f64().unwrap())
}

fn mota(fitted: &Value, room: usize, which: &str) -> f64 {
    fitted["rooms"][room][which]["MOTA"].as_f64().unwrap()
}

#[test]
fn a_room_has_no_say_in_what_is_chosen_without_it() {
    let home = Home::new();
    let before = home.fitted(&["--objective", "MOTA"]);
    assert_eq!(chosen(&before), [4.0, 4.0, 4.0]);
    assert!(mota(&before, 0, "without") > 0.5 && mota(&before, 1, "with_all") > 0.5, "{before}");
    assert_eq!(mota(&before, 0, "shipped"), 0.0, "nobody is seen");
    // Another truth of room A: a detection of the walker is wrong nine times in twelve.
    home.write(
        "logs/a.people.csv",
        &people(12).lines().take(4).map(|l| format!("{l}\n")).collect::<String>(),
    );
    let after = home.fitted(&["--objective", "MOTA"]);
    assert_eq!(chosen(&after), [4.0, 2.0, 4.0], "room B has three times as many people: {after}");
    assert!(mota(&after, 0, "without") < -1.0, "{after}");
    assert!(mota(&after, 0, "with_all") < -1.0, "{after}");
    assert_eq!(mota(&after, 1, "without"), 0.0);
}

#[test]
fn a_second_time_computes_nothing_and_jobs_change_no_byte() {
    let home = Home::new();
    let first = home.rooms(&["-o", "one"]);
    assert!(text(&first.stderr).contains("4 runs done\n"), "{}", text(&first.stderr));
    let second = home.rooms(&["-o", "one"]);
    let told = text(&second.stderr);
    assert!(told.contains("0 runs done; 4 had results of an earlier run"), "{told}");
    let third = home.rooms(&["-o", "two", "--jobs", "3"]);
    assert!(first.stdout == second.stdout && first.stdout == third.stdout);
    assert_eq!(home.results("one").len(), 4);
    assert!(home.results("one") == home.results("two"));
    assert_same(&home.path("one/rooms.json"), &home.path("two/rooms.json"));
    let lost = home.results("two").into_keys().next().unwrap();
    fs::write(home.path("two").join("rooms").join(lost), "{\"figures\":").unwrap();
    let repaired = home.rooms(&["-o", "two"]);
    let told = text(&repaired.stderr);
    assert!(told.contains("1 run done; 3 had results of an earlier run"), "{told}");
    assert!(first.stdout == repaired.stdout && home.results("one") == home.results("two"));
}

#[test]
fn tables_name_figures_and_choices() {
    let home = Home::new();
    let shown = text(&home.rooms(&[]).stdout);
    for words in [
        "HOTA w/o",
        "AssA w/o",
        "inherited w/o",
        "near",
        "means over the rooms",
        "A (a)",
        "With all: `detectors",
    ] {
        assert!(shown.contains(words), "{words} in\n{shown}");
    }
    let page = text(&home.rooms(&["--format", "markdown"]).stdout);
    assert!(page.contains("| near | 2 | "), "{page}");
    assert!(page.contains("* Without A, without B: `detectors.0.config.max_depth_m` = 4.0."));
    let mut step = own_plugin();
    step.current_dir(home.folder.path()).args(["bench", "rooms", "rooms.toml"]);
    assert_eq!(text(&step.output().unwrap().stdout), shown, "a step by another name");
}

#[test]
fn a_search_says_whether_a_seed_has_a_say() {
    let home = Home::new();
    let whole = text(&home.rooms(&[]).stdout);
    assert!(whole.contains("every setting of the grid was tried, so that no seed"), "{whole}");
    assert!(whole.contains("Tried: every setting of the grid, 2 in all"), "{whole}");
    assert!(!whole.contains("Spread of"), "{whole}");
    home.config("near", TUNE, &VALUES.replace("[2.0, 4.0]", "[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]"));
    let sampled = text(&home.rooms(&["--budget", "2", "--seed", "7", "--samples", "4"]).stdout);
    for words in [
        "a sample of at most 2 (seed 7; its luck stands below)",
        "Tried: a sample of 2 of the 6 settings of the grid (seed 7).",
        "Spread of the mean w/o over samples (seeds 7 to 10): HOTA ",
    ] {
        assert!(sampled.contains(words), "{words} in {sampled}");
    }
    let one = text(&home.rooms(&["--budget", "2", "--seed", "7", "--samples", "1"]).stdout);
    assert!(!one.contains("Spread of"), "{one}");
    let fitted = home.fitted(&["--budget", "2", "--seed", "7", "--samples", "4"]);
    let by_sample = fitted["by_sample"].as_array().unwrap();
    assert_eq!(by_sample.len(), 4);
    let first = (mota(&fitted, 0, "without"), mota(&fitted, 1, "without"));
    let people = [0, 1].map(|room| {
        let people = &fitted["rooms"][room]["without"]["people"];
        people.as_f64().unwrap()
    });
    let mean = (first.0 * people[0] + first.1 * people[1]) / (people[0] + people[1]);
    let told = by_sample[0]["MOTA"].as_f64().unwrap();
    assert!((told - mean).abs() < 1e-9, "{told} instead of {mean}");
}

#[test]
fn named_pipelines_are_compared_with_the_last_one_room_by_room_and_log_by_log() {
    let home = Home::new();
    home.config("far", "config = { max_depth_m = 4.0 }", "manager.config.confirm_hits = [2]");
    home.config("blind", TUNE, "manager.config.confirm_hits = [2]");
    let named = ["--configs", "configs/far.toml", "configs/blind.toml"];
    let report = home.rooms(&[&named[..], &["--format", "json"]].concat());
    let report: Value = serde_json::from_slice(&report.stdout).unwrap();
    let [far, blind] = [0, 1].map(|pipeline| {
        let rooms = &report["pipelines"][pipeline]["rooms"];
        [0, 1].map(|room| rooms[room]["without"]["IDF1"].as_f64().unwrap())
    });
    let gained = (far[0] + far[1] - blind[0] - blind[1]) / 2.0;
    let pair = &report["pairs"][0];
    assert_eq!((&pair["pipeline"], &pair["baseline"]), (&"far".into(), &"blind".into()));
    assert_eq!(pair["rooms"], 2);
    let told = pair["gains"][2]["difference"]["estimate"].as_f64().unwrap();
    assert!(gained > 0.5 && (told - gained).abs() < 1e-9, "{told} instead of {gained}");
    let page = text(&home.rooms(&[&named[..], &["--format", "markdown"]].concat()).stdout);
    for words in ["**Difference to blind, each", "| far | 2 | ", "| a: far | ", "| b: blind | "] {
        assert!(page.contains(words), "{words} in {page}");
    }
    assert!(!text(&home.rooms(&[]).stdout).contains("Difference to"), "nobody named a baseline");
}

#[test]
fn logs_that_cannot_be_read_are_listed_with_the_reason() {
    let home = Home::new();
    Drawn { depth: false, ..Drawn::of(5) }.write(&home.path("logs/mono.mcap"));
    home.write("logs/mono.boxes.csv", "1,1,60,40,26,80,1,1,1\n");
    let rooms = fs::read_to_string(home.path("rooms.toml")).unwrap();
    home.write("rooms.toml", &format!("{rooms}[rooms.C]\nlogs = [\"mono.mcap\"]\n"));
    let fitted = home.fitted(&[]);
    assert_eq!(fitted["rooms"].as_array().unwrap().len(), 2, "{fitted}");
    assert_eq!(fitted["skipped"][0]["log"], "mono");
    assert!(fitted["skipped"][0]["why"].as_str().unwrap().contains("depth"), "{fitted}");
    home.write("rooms.toml", &rooms.replace("b.mcap", "mono.mcap"));
    let shown = text(&home.rooms(&[]).stdout);
    assert!(shown.contains("can read logs of 1 room, and two are needed"), "{shown}");
}

#[test]
fn a_setting_that_fails_is_named() {
    let home = Home::new();
    let tune = "\"detectors.0.config.panic_after_frames\" = [0, 4]";
    home.config("near", "", tune);
    let told = messages_of(&home.rooms(&[]), 1);
    for words in ["2 runs failed", "near on a", "panic_after_frames = 4", "frame 5"] {
        assert!(told.contains(words), "{words} in {told}");
    }
    assert_eq!(home.results("bench").len(), 2, "the others are kept");
}

#[test]
fn settings_that_contradict_each_other_are_left_out_and_counted() {
    let home = Home::new();
    let tune = "manager.config.confirm_hits = [3, 4]\nmanager.config.confirm_within = [3, 5]";
    home.config("near", "[manager.config]\nconfirm_within = 4\n", tune);
    let config = fs::read_to_string(home.path("configs/near.toml")).unwrap();
    // The section of the detector ends before that of the life cycle.
    assert!(config.contains("[manager.config]"));
    let fitted = home.fitted(&[]);
    assert_eq!((fitted["settings"].as_u64(), fitted["refused"].as_u64()), (Some(3), Some(1)));
    let tune = "manager.config.confirm_hits = [4]\nmanager.config.confirm_within = [3]";
    home.config("near", "[manager.config]\nconfirm_within = 4\n", tune);
    let told = text(&home.rooms(&[]).stderr);
    assert!(
        told.contains("near: no setting of [tune] is left, all 1 contradict themselves"),
        "{told}"
    );
}

/// The shipped setting finds the walker and the only candidate does not: it would be chosen by all.
#[test]
fn the_settings_of_the_config_are_scored_and_not_chosen() {
    let home = Home::new();
    home.config("near", "config = { max_depth_m = 4.0 }", &VALUES.replace("[2.0, 4.0]", "[2.0]"));
    let fitted = home.fitted(&["--objective", "MOTA"]);
    assert_eq!(chosen(&fitted), [2.0, 2.0, 2.0]);
    assert_eq!(fitted["settings"], 1);
    assert_eq!(mota(&fitted, 0, "without"), 0.0, "nobody is seen");
    assert!(mota(&fitted, 0, "shipped") > 0.5, "{fitted}");
    let alone = home.fitted(&["--objective", "MOTA", "--budget", "1"]);
    assert_eq!(chosen(&alone), [4.0, 4.0, 4.0], "without a choice");
}

#[test]
fn a_room_of_single_frames_has_no_say() {
    let home = Home::new();
    Drawn::of(60).write(&home.path("logs/c.mcap"));
    // The walker is annotated in the first two frames alone, so that finding it is mostly wrong.
    home.write(
        "logs/c.people.csv",
        &people(60).lines().take(3).map(|l| format!("{l}\n")).collect::<String>(),
    );
    let rooms = fs::read_to_string(home.path("rooms.toml")).unwrap();
    let third = "[rooms.C]\nlogs = [\"c.mcap\"]\n";
    home.write("rooms.toml", &format!("{rooms}{third}"));
    assert_eq!(chosen(&home.fitted(&["--objective", "MOTA"])), [2.0, 2.0, 2.0]);
    assert!(!home.page().contains("single frames |"));
    home.write("rooms.toml", &format!("{rooms}{third}single_frames = true\n"));
    let fitted = home.fitted(&["--objective", "MOTA"]);
    assert_eq!(chosen(&fitted), [4.0, 4.0, 4.0]);
    assert!(fitted["rooms"][2]["single_frames"].as_bool().unwrap(), "{fitted}");
    assert!(fitted["rooms"][2]["without"]["people"].as_u64().unwrap() > 0, "{fitted}");
    assert!(home.page().contains("| C, single frames | "));
    // With one other room that can choose, there is none where it is left out.
    let first = rooms.split("[rooms.B]").next().unwrap();
    home.write("rooms.toml", &format!("{first}{third}single_frames = true\n"));
    let told = text(&home.rooms(&[]).stdout);
    assert!(told.contains("1 room beside those of single frames, and two are needed"), "{told}");
}

#[test]
fn mistakes_are_told_with_file_and_line() {
    let home = Home::new();
    home.config("near", "", "\"manager.config.confirm_hit\" = [1]");
    home.refuses_with(&["near.toml:9:1", "did you mean `manager.config.confirm_hits`?"]);
    home.config("near", "", "manager.config.confirm_hits = [1, 99]");
    home.refuses_with(&[
        "configs/near.toml:9:35",
        "= 99 is not allowed",
        "`confirm_hits` must lie between",
    ]);
    let mut check = own_plugin();
    let checked = check.current_dir(home.folder.path()).args(["check", "configs/near.toml"]);
    let checked = checked.output().unwrap();
    assert!(code(&checked) == 2 && text(&checked.stderr).contains("= 99 is not allowed"));
    home.config("near", "", "");
    home.refuses_with(&["no config in the folder configs", "--configs"]);
    home.config("near", TUNE, VALUES);
    let rooms = fs::read_to_string(home.path("rooms.toml")).unwrap();
    home.write("rooms.toml", &rooms.replace("b.mcap", "c.mcap"));
    home.refuses_with(&["rooms.toml:5:9", "c.mcap"]);
    Drawn::of(3).write(&home.path("logs/c.mcap"));
    home.refuses_with(&["rooms.toml:5:9", "has no truth"]);
    home.write("rooms.toml", &format!("{rooms}[rooms.B.models]\nown = 'none.toml'\n"));
    home.refuses_with(&["rooms.toml:7:7", "there is no model none.toml"]);
    home.write("rooms.toml", "[rooms.A]\nlogs = [\"logs/a.mcap\"]\n");
    home.refuses_with(&["rooms.toml:1:", "two are needed"]);
    fs::remove_file(home.path("rooms.toml")).unwrap();
    home.refuses_with(&["rooms.toml"]);
}

#[cfg(unix)]
#[test]
fn a_signal_leaves_whole_files_and_a_second_run_goes_on() {
    let home = Home::new();
    Drawn::of(60).write(&home.path("logs/b.mcap"));
    home.config("near", "config = { max_depth_m = 2.0, delay_ms = 50 }", VALUES);
    let child = home
        .command(&[])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let waited = std::time::Instant::now();
    while fs::read_dir(home.folder.path().join("bench/rooms")).map_or(0, Iterator::count) < 2
        && waited.elapsed().as_secs() < 60
    {
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let pid = child.id().to_string();
    let kill = std::process::Command::new("kill").args(["-s", "INT", &pid]).status().unwrap();
    assert!(kill.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), 130, "{}", text(&output.stderr));
    let results = home.results("bench");
    assert_eq!(results.len(), 2, "{:?}", results.keys());
    for bytes in results.values() {
        assert!(serde_json::from_slice::<Value>(bytes).is_ok());
    }
    let told = text(&home.rooms(&[]).stderr);
    assert!(told.contains("2 runs done; 2 had results of an earlier run"), "{told}");
}
