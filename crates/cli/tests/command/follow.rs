//! `tagalong follow`: its output and files, and its refusals.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use serde_json::Value;

use crate::common::{code, json, messages_of, tagalong, text};

const SCENE: &str = "duration_s = 5.0\n[camera]\nwidth = 120\nheight = 90\ncolour = false\n\
    [robot]\nstart = [1.0, 3.0]\n[[people]]\npath = [[3.2, 3.0], [8.0, 3.0]]\nspeed_mps = 0.6\n";

fn configs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs")
}

fn follow(folder: &Path, config: &str, more: &[&str]) -> Output {
    fs::write(folder.join("walk.toml"), SCENE).unwrap();
    let mut command = tagalong();
    command.current_dir(folder).arg("follow").arg(configs().join(config));
    command.arg("walk.toml").args(more).output().unwrap()
}

#[test]
fn a_person_who_walks_is_followed_the_same_way_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["1", "2"].map(|jobs| {
        let more = ["--seeds", "2", "--jobs", jobs, "--format", "json"];
        json(&follow(folder.path(), "follow-depth.toml", &more))["rides"].clone()
    });
    assert_eq!(first, second);
    assert_eq!(first.as_array().unwrap().len(), 2);
    for ride in first.as_array().unwrap() {
        assert_eq!(ride["kept"], true, "{ride}");
        assert_eq!(ride["wrong_s"], 0.0, "{ride}");
        assert!(ride["right_s"].as_f64().unwrap() > 3.0, "{ride}");
    }
}

#[test]
fn the_text_tells_why_the_robot_stood_or_drove_slower() {
    let folder = tempfile::tempdir().unwrap();
    // No camera height of [suits] is as low.
    let output = follow(folder.path(), "follow-depth.toml", &["--set", "camera.height_m=0.6"]);
    let told = text(&output.stdout);
    let line = told.lines().find(|line| line.starts_with("  walk: follow-depth, seed ")).unwrap();
    assert!(line.contains("does not drive ") && line.contains(" %"), "{line}");
    let said = text(&output.stderr);
    assert_eq!(said.matches("is not made for walk (the camera").count(), 1, "{said}");
}

#[test]
fn another_first_seed_rides_elsewhere_and_the_tables_name_it() {
    let folder = tempfile::tempdir().unwrap();
    let [near, far] = ["3", "4"].map(|first| {
        let more = ["--seeds", "1", "--first-seed", first, "--format", "json"];
        json(&follow(folder.path(), "follow-depth.toml", &more))
    });
    assert_eq!(near["seeds"], serde_json::json!({ "split": "test", "first": 3, "count": 1 }));
    assert_eq!(
        (&near["rides"][0]["seed"], &far["rides"][0]["seed"]),
        (&2_000_000_003_u64.into(), &2_000_000_004_u64.into())
    );
    for table in near["tables"].as_array().unwrap() {
        let notes = table["notes"].to_string();
        assert!(notes.contains("each scene with 1 seed of the split test from 3 on"), "{notes}");
    }
    // With one ride, only the share of kept rides has an interval.
    let cells = near["tables"][0]["rows"][0]["cells"].as_array().unwrap();
    let with: Vec<usize> = (0..cells.len()).filter(|&k| !cells[k]["interval"].is_null()).collect();
    assert_eq!(with, [6], "{cells:?}");
}

#[test]
fn a_sweep_rides_each_scene_with_each_value_as_a_row_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let sweep = ["--sweep", "camera.height_m=0.9, 1.2", "--format", "json", "-o", "rides"];
    let found = json(&follow(folder.path(), "follow-depth.toml", &sweep));
    let suites = found["rides"].as_array().unwrap().iter().map(|ride| ride["suite"].clone());
    assert_eq!(suites.collect::<Vec<_>>(), ["walk 0.9", "walk 1.2"]);
    assert_ne!(found["rides"][0]["distance_kept_s"], Value::Null);
    for height in ["0.9", "1.2"] {
        let log = format!("rides/walk-{height}-follow-depth-2000000000.mcap");
        let output = tagalong().arg("inspect").arg(folder.path().join(log)).output();
        let told = text(&output.unwrap().stdout);
        assert!(told.contains(&format!("{height}0 m above the floor")), "{told}");
    }
    let wrong = follow(folder.path(), "follow-depth.toml", &["--sweep", "camera.height=1.0"]);
    assert_eq!(code(&wrong), 2, "{}", text(&wrong.stderr));
}

#[test]
fn the_log_of_a_ride_has_commands_and_their_reasons() {
    let folder = tempfile::tempdir().unwrap();
    let output = follow(folder.path(), "follow-arc.toml", &["-o", "rides"]);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let told = text(&output.stdout);
    assert!(told.contains("(locked: known well)"), "{told}");
    let log = folder.path().join("rides/walk-follow-arc-2000000000.mcap");
    let inspected = tagalong().arg("inspect").arg(log).output().unwrap();
    let topics = text(&inspected.stdout);
    for topic in ["/cmd_vel", "/follow/frames", "/truth/people", "/odom"] {
        assert!(topics.contains(topic), "{topic}: {topics}");
    }
    let csv = fs::read_to_string(folder.path().join("rides/likeness.csv")).unwrap();
    let columns: Vec<usize> = csv.lines().map(|line| line.split(',').count()).collect();
    assert!(columns.iter().all(|count| *count == columns[0]), "{csv}");
    assert!(folder.path().join("rides/follow.md").exists());
}

#[test]
fn a_pipeline_that_steers_nothing_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let said = messages_of(&follow(folder.path(), "depth-ekf.toml", &[]), 2);
    assert!(said.contains("has no [controller]"), "{said}");
    let output = follow(folder.path(), "follow-depth.toml", &["--drop", "1.5"]);
    assert_eq!(code(&output), 2);
}

#[test]
fn the_pictures_of_a_ride_are_those_of_its_frames() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = folder.path().join("rides/walk-follow-depth-2000000000/overlay");
    fs::create_dir_all(&pictures).unwrap();
    fs::write(pictures.join("999999.png"), "of a longer ride").unwrap();
    let more = ["-o", "rides", "--overlay", "--format", "json"];
    json(&follow(folder.path(), "follow-depth.toml", &more));
    let mut names: Vec<String> = fs::read_dir(&pictures)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names[0], "000001.png");
    assert_eq!(*names.last().unwrap(), format!("{:06}.png", names.len()), "{names:?}");
    let said = messages_of(&follow(folder.path(), "follow-depth.toml", &["--overlay"]), 2);
    assert!(said.contains("--output"), "{said}");
}

fn view(folder: &Path, arguments: &[&str]) -> Output {
    tagalong().current_dir(folder).arg("view").args(arguments).output().unwrap()
}

/// The data of a page.
fn page_data(page: &Path) -> Value {
    let page = fs::read_to_string(page).unwrap();
    let start = page.find("id=\"data\">").unwrap() + "id=\"data\">".len();
    let end = start + page[start..].find("</script>").unwrap();
    serde_json::from_str(&page[start..end]).unwrap()
}

#[test]
fn a_ride_is_seen_with_its_images_obstacles_zones_and_reasons() {
    let folder = tempfile::tempdir().unwrap();
    let narrow = ["-o", "rides", "--format", "json", "--set", "room.size_m=[9.0, 4.0]"];
    json(&follow(folder.path(), "follow-depth.toml", &narrow));
    let name = "rides/walk-follow-depth-2000000000";
    // The log of a ride stands for its folder.
    let shown = view(folder.path(), &[&format!("{name}.mcap")]);
    assert_eq!(code(&shown), 0, "{}", text(&shown.stderr));
    let page = page_data(&folder.path().join(name).join("view.html"));
    let run = &page["runs"][0];
    let frames = run["frames"].as_array().unwrap();
    let last = frames.last().unwrap();
    assert!(page["images"].as_array().unwrap().iter().all(|image| image != ""), "no images");
    assert!(page["truth"].is_array(), "the truth of the log");
    assert_eq!(last["target"], last["tracks"][0]["id"], "{last}");
    assert!(last["drive"]["v"].as_f64().unwrap() > 0.1, "{last}");
    // It waits at first, then it follows.
    for motion in ["stands", "drives"] {
        assert!(frames.iter().any(|frame| frame["drive"]["motion"] == motion), "{motion}: {last}");
    }
    assert!(frames.iter().any(|frame| frame["drive"]["things"].is_array()), "no walls: {last}");
    assert!(run["robot"]["people"][1].as_f64() > run["robot"]["people"][0].as_f64(), "{run}");
    let events = run["events"].as_array().unwrap();
    assert!(events.iter().any(|event| event["kind"] == "stands"), "{events:?}");
}

#[test]
fn the_results_of_earlier_rides_are_replaced_on_request_alone() {
    let folder = tempfile::tempdir().unwrap();
    let rides = ["-o", "rides", "--format", "json"];
    json(&follow(folder.path(), "follow-depth.toml", &rides));
    let results = folder.path().join("rides/follow.json");
    let before = fs::read(&results).unwrap();
    // Its log has another name, and its tables would take the place of those of the first.
    let other = ["--first-seed", "1"];
    let said =
        messages_of(&follow(folder.path(), "follow-depth.toml", &[&rides[..], &other].concat()), 2);
    assert!(said.contains("follow.json exists"), "{said}");
    assert_eq!(fs::read(&results).unwrap(), before);
    let again = [&rides[..], &other, &["--overwrite"]].concat();
    json(&follow(folder.path(), "follow-depth.toml", &again));
    assert_ne!(fs::read(&results).unwrap(), before);
}

/// The config names topics of the real robot, which the log of a ride does not have.
#[test]
fn a_ride_of_a_robot_with_topics_of_its_own_has_images() {
    let folder = tempfile::tempdir().unwrap();
    let bumper = ["--set", "bumpers=[{name=\"hazards\"}]"];
    let rides = ["-o", "rides", "--format", "json"];
    let said = messages_of(&follow(folder.path(), "robots/turtlebot4.toml", &rides), 2);
    assert!(said.contains("lacks the source `hazards`"), "{said}");
    assert!(!folder.path().join("rides").exists(), "nothing is written before the refusal");
    json(&follow(folder.path(), "robots/turtlebot4.toml", &[&rides[..], &bumper].concat()));
    let name = "rides/walk-turtlebot4-2000000000";
    let shown = view(folder.path(), &[name]);
    assert_eq!(code(&shown), 0, "{}", text(&shown.stderr));
    let page = page_data(&folder.path().join(name).join("view.html"));
    assert!(page["images"].as_array().unwrap().iter().all(|image| image != ""), "no images");
}

#[test]
fn a_folder_of_rides_has_a_page_for_each_and_a_list_with_the_worst_first() {
    let folder = tempfile::tempdir().unwrap();
    let more = ["--seeds", "2", "-o", "rides", "--format", "json"];
    let found = json(&follow(folder.path(), "follow-depth.toml", &more));
    let shown = view(folder.path(), &["rides"]);
    assert_eq!(code(&shown), 0, "{}", text(&shown.stderr));
    let list = fs::read_to_string(folder.path().join("rides/index.html")).unwrap();
    let mut places = Vec::new();
    for ride in found["rides"].as_array().unwrap() {
        let name = ride["folder"].as_str().unwrap();
        assert!(folder.path().join("rides").join(name).join("view.html").exists(), "{name}");
        let link = format!("href=\"{name}/view.html#t=");
        let place = list.find(&link).unwrap_or_else(|| panic!("{link}: {list}"));
        let room = ["clearance_people_m", "clearance_things_m"].map(|key| ride[key].as_f64());
        let room = room.into_iter().flatten().fold(f64::INFINITY, f64::min);
        places.push((room, place));
    }
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert!(places[0].1 < places[1].1, "{places:?}");
    let again = view(folder.path(), &["rides"]);
    assert_eq!(code(&again), 2, "pages are not replaced unasked");
    let truth = view(folder.path(), &["rides", "--truth", "x.csv", "--overwrite"]);
    assert_eq!(code(&truth), 2, "{}", text(&truth.stderr));
}
