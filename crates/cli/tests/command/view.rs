//! `tagalong view`: the page of a run, and the runs that it refuses.

use std::fs;
use std::path::Path;
use std::process::Output;

use crate::common::{Drawn, code, config, messages_of, own_plugin, results_of, text};

fn run(home: &Path, log: &str, out: &str) {
    let mut command = own_plugin();
    command.current_dir(home).args(["run", "nearest.toml", log, "-o", out]);
    let output = command.output().unwrap();
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
}

fn view(home: &Path, arguments: &[&str]) -> Output {
    own_plugin().current_dir(home).arg("view").args(arguments).output().unwrap()
}

fn home() -> tempfile::TempDir {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(20).write(&home.path().join("walk.mcap"));
    config(home.path(), "");
    run(home.path(), "walk.mcap", "one");
    home
}

fn data(page: &str) -> serde_json::Value {
    let start = page.find("id=\"data\">").unwrap() + "id=\"data\">".len();
    let end = start + page[start..].find("</script>").unwrap();
    serde_json::from_str(&page[start..end]).unwrap()
}

#[test]
fn a_page_has_the_frames_the_images_and_the_candidates() {
    let home = home();
    let said = results_of(&view(home.path(), &["one"]));
    assert!(said.contains("one/view.html: 20 frames"), "{said}");
    let page = data(&fs::read_to_string(home.path().join("one/view.html")).unwrap());
    let frames = page["runs"][0]["frames"].as_array().unwrap();
    assert_eq!((frames.len(), page["t"].as_array().unwrap().len()), (20, 20));
    assert!(page["images"].as_array().unwrap().iter().all(|image| image != ""));
    let last = &frames[19];
    assert_eq!(last["tracks"][0]["state"], "seen");
    assert!(last["found"][0]["track"].is_u64(), "{last}");
    assert_eq!(page["runs"][0]["events"][0]["kind"], "started");
    // The page of the run is made anew, and shows a part where that is asked; a file of another name
    // is not replaced unasked.
    assert_eq!(code(&view(home.path(), &["one", "-o", "one/view.html"])), 2);
    let part = view(home.path(), &["one", "--from", "0.5", "--to", "1.0"]);
    assert_eq!(code(&part), 0, "{}", text(&part.stderr));
    assert!(!text(&part.stdout).contains("20 frames"), "{}", text(&part.stdout));
}

#[test]
fn a_log_that_is_gone_or_another_one_is_said() {
    let home = home();
    Drawn::of(12).write(&home.path().join("other.mcap"));
    let said = messages_of(&view(home.path(), &["one", "--log", "other.mcap"]), 2);
    assert!(said.contains("is not the log of one"), "{said}");
    fs::rename(home.path().join("walk.mcap"), home.path().join("moved.mcap")).unwrap();
    let said = results_of(&view(home.path(), &["one"]));
    assert!(said.contains("name it with --log"), "{said}");
    let named = view(home.path(), &["one", "--overwrite", "--log", "moved.mcap"]);
    assert!(text(&named.stdout).contains("20 images"), "{}", text(&named.stdout));
}

#[test]
fn only_runs_of_one_log_are_compared() {
    let home = home();
    Drawn::of(12).write(&home.path().join("other.mcap"));
    run(home.path(), "other.mcap", "two");
    run(home.path(), "walk.mcap", "three");
    let said = messages_of(&view(home.path(), &["one", "two"]), 2);
    assert!(said.contains("different logs"), "{said}");
    let both = view(home.path(), &["one", "three", "-o", "both.html"]);
    assert_eq!(code(&both), 0, "{}", text(&both.stderr));
    let page = data(&fs::read_to_string(home.path().join("both.html")).unwrap());
    assert_eq!(page["runs"][0]["name"], "one", "runs of one config are told apart by folder");
    assert_eq!(page["runs"][1]["name"], "three");
}

#[test]
fn what_is_no_run_is_answered_with_the_command_that_makes_one() {
    let home = home();
    fs::create_dir(home.path().join("empty")).unwrap();
    let answers = [("walk.mcap", "is a file"), ("empty", "no tracks.mcap"), ("x", "no such")];
    for (argument, said) in answers {
        let output = view(home.path(), &[argument]);
        assert_eq!(code(&output), 2, "{argument}");
        let message = text(&output.stderr);
        assert!(message.contains(said) && message.contains("tagalong run"), "{message}");
    }
}

#[test]
fn what_belongs_to_a_run_is_answered_with_the_command_that_shows_it() {
    let home = home();
    for (argument, said) in
        [(".", "tagalong view ./one`"), ("one/tracks.mcap", "`tagalong view one`")]
    {
        let output = view(home.path(), &[argument]);
        assert_eq!(code(&output), 2, "{argument}");
        assert!(text(&output.stderr).contains(said), "{}", text(&output.stderr));
    }
    let late = view(home.path(), &["one", "--from", "99"]);
    assert!(text(&late.stderr).contains("the last one of the run is at "), "{late:?}");
    let run = own_plugin().current_dir(home.path()).args(["run", "one"]).output().unwrap();
    let why = text(&run.stderr);
    assert!(why.contains("one is a run, not a log: `tagalong view one`"), "{why}");
}

#[test]
fn the_truth_of_another_log_is_told() {
    let home = home();
    for (name, frames, sign) in [
        ("walk.people.csv", 20, ""),
        ("other.people.csv", 20, "is named after other, and the run is of walk.mcap"),
        ("truth.csv", 40, "has people up to frame 40, and the last of the log is 20"),
    ] {
        fs::write(home.path().join(name), crate::common::people(frames)).unwrap();
        let said = results_of(&view(home.path(), &["one", "--overwrite", "--truth", name]));
        let is_told = said.contains("if the truth is that of another log");
        assert_eq!((is_told, said.contains(sign)), (!sign.is_empty(), true), "{name}: {said}");
    }
}
