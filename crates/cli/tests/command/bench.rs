//! `tagalong bench` over simulated logs: nothing is computed twice, no result depends on the number
//! of jobs, and one bad pipeline does not spoil the rest.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use serde_json::Value;

use crate::common::{Drawn, code, messages_of, own_plugin, results_of, text};

/// The two logs and their truth, and a config or more.
struct Home {
    folder: tempfile::TempDir,
}

impl Home {
    fn new() -> Self {
        let home = Self { folder: tempfile::tempdir().unwrap() };
        for (name, frames) in [("long", 24), ("short", 9)] {
            Drawn::of(frames).write(&home.path(&format!("logs/{name}.mcap")));
            fs::write(home.path(&format!("logs/{name}.people.csv")), crate::common::people(frames))
                .unwrap();
        }
        home.config("near", "");
        home.config("far", "config = { max_depth_m = 3.5 }");
        home
    }

    fn path(&self, name: &str) -> PathBuf {
        let path = self.folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn config(&self, name: &str, extra: &str) {
        let written = crate::common::config(self.folder.path(), extra);
        fs::rename(written, self.path(&format!("configs/{name}.toml"))).unwrap();
    }

    fn bench(&self, arguments: &[&str]) -> Output {
        let mut command = own_plugin();
        command.current_dir(self.folder.path()).arg("bench").args(arguments).output().unwrap()
    }

    /// Plans with these arguments and returns the hashes of the tasks.
    fn task_hashes(&self, out: &str, arguments: &[&str]) -> Vec<Value> {
        ok(self
            .bench(&[&["plan", "--logs", "logs/short.mcap", "-o", out][..], arguments].concat()));
        self.plan(out).iter().map(|task| task["hash"].clone()).collect()
    }

    fn plan(&self, out: &str) -> Vec<Value> {
        let text = fs::read_to_string(self.path(out).join("plan.jsonl")).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    fn report(&self, out: &str) -> Value {
        serde_json::from_slice(&fs::read(self.path(out).join("report.json")).unwrap()).unwrap()
    }
}

#[test]
fn a_config_for_other_cameras_is_named_once_with_its_logs() {
    let home = Home::new();
    home.config("high", "[suits]\ncamera_height_m = [2.0, 3.0]\n");
    let output = home.bench(&["plan", "--logs-dir", "logs", "-o", "out"]);
    let said = text(&output.stderr);
    let expected = "note: high is not made for long (the camera is 1.20 m high, but the config is \
                    for 2 to 3 m), short (";
    assert_eq!(said.matches(expected).count(), 1, "{said}");
    assert_eq!(said.matches("according to its [suits]").count(), 1, "{said}");
    assert!(said.contains("6 tasks planned: 3 configs on 2 logs; --configs limits them"), "{said}");
    // Several have one line.
    home.config("higher", "[suits]\ncamera_height_m = [3.0, 4.0]\n");
    let output = home.bench(&["plan", "--logs-dir", "logs", "-o", "out"]);
    let said = text(&output.stderr);
    let expected = "note: 2 configs are not made for some of the logs according to their [suits], \
                    and track worse there: high (2 logs), higher (2 logs)";
    assert!(said.contains(expected) && said.matches("[suits]").count() == 1, "{said}");
}

#[test]
fn the_truth_of_another_log_is_noted_in_all_forms_of_the_report() {
    let home = Home::new();
    fs::write(home.path("logs/short.people.csv"), crate::common::people(40)).unwrap();
    fs::remove_file(home.path("logs/long.people.csv")).unwrap();
    let corner: String = (1..=24).map(|n| format!("{n},1,0,0,9,20,1,1,1\n")).collect();
    fs::write(home.path("logs/long.boxes.csv"), corner).unwrap();
    let said = results_of(&home.bench(&["--logs-dir", "logs", "-o", "out"]));
    let json = home.report("out")["notes"].to_string();
    let page = fs::read_to_string(home.path("out/report.html")).unwrap();
    for note in [
        "short.people.csv has people up to frame 40, and the last of the log is 9: if the truth is that \
         of another log, the comparison means nothing",
        "long.boxes.csv: nothing matches: is it the truth of another log?",
    ] {
        // Once for both pipelines.
        assert_eq!(said.matches(note).count(), 1, "{said}");
        assert!(json.contains(note), "{json}");
        assert!(page.contains(note), "{note}");
    }
}

/// The recording has another name, and another log has its name.
#[test]
fn a_log_with_which_a_pipeline_was_made_is_noted_by_its_contents() {
    let Some(logs) = tagalong_conformance::testdata::find("logs") else { return };
    let home = Home::new();
    for ending in ["mcap", "people.csv"] {
        let short = home.path(&format!("logs/short.{ending}"));
        fs::rename(short, home.path(&format!("logs/um.{ending}"))).expect("a simulated log");
        fs::copy(logs.join(format!("um.{ending}")), home.path(&format!("logs/hall.{ending}")))
            .expect("a recording");
    }
    let configs = ["--configs", "depth-ekf", "configs/near.toml", "-o", "out"];
    let output =
        home.bench(&[&["--logs", "logs/um.mcap", "logs/hall.mcap"][..], &configs].concat());
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    let said = text(&output.stdout);
    let json = home.report("out")["notes"].to_string();
    let page = fs::read_to_string(home.path("out/report.html")).expect("a report");
    let note = "models or settings of depth-ekf were fitted to hall: figures there say little \
                about other rooms";
    for form in [&said, &json, &page] {
        assert_eq!(form.matches(note).count(), 1, "{form}");
    }
}

#[test]
fn places_on_the_floor_are_truth_beside_a_log() {
    let home = Home::new();
    fs::remove_file(home.path("logs/long.people.csv")).unwrap();
    let header = "scan,id,x_laser_m,y_laser_m,x_robot_m,y_robot_m,ignore,source\n";
    let rows = "15,7,2.88,-0.18,2.88,-0.18,0,annotated\n19,7,2.88,-0.1,2.88,-0.1,0,annotated\n";
    fs::write(home.path("logs/long.people-floor.csv"), format!("{header}{rows}")).unwrap();
    let said = results_of(&home.bench(&[
        "--logs-dir",
        "logs",
        "--configs",
        "configs/near.toml",
        "-o",
        "out",
    ]));
    let (image, floor) = said.split_once("on the floor, as the truth has no boxes:\n").unwrap();
    assert!(image.contains(" short ") && !image.contains(" long "), "{said}");
    assert!(floor.lines().nth(1).unwrap().starts_with("near      long "), "{said}");
    let report = home.report("out");
    let task = &report["tasks"][0];
    assert_eq!((task["log"].as_str(), task["image"].is_null()), (Some("long"), true), "{task}");
    assert_eq!(task["metres"]["TP"].as_u64(), Some(2), "{task}");
}

/// All files of a folder that are not times, by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            let inner = files(&entry.path()).into_iter();
            all.extend(inner.map(|(inside, bytes)| (format!("{name}/{inside}"), bytes)));
        } else {
            _ = all.insert(name, fs::read(entry.path()).unwrap())
        }
    }
    all
}

fn ok(output: Output) -> String {
    assert_eq!(code(&output), 0, "{}{}", text(&output.stdout), text(&output.stderr));
    text(&output.stderr)
}

#[test]
fn one_command_ends_in_a_report_and_a_second_one_computes_nothing() {
    let home = Home::new();
    let told = ok(home.bench(&["--logs-dir", "logs", "-o", "out"]));
    assert!(told.contains("4 tasks run"), "{told}");
    let before = files(&home.path("out"));
    for name in ["plan.jsonl", "report.html", "report.json", "report.csv"] {
        assert!(before.contains_key(name), "{name} of {:?}", before.keys());
    }
    assert!(!before.keys().any(|name| name.contains("partial")), "{:?}", before.keys());
    let result = home.path("out/results").join(before_result(&home));
    let written = fs::metadata(&result).unwrap().modified().unwrap();
    let told = ok(home.bench(&["--logs-dir", "logs", "-o", "out"]));
    assert!(told.contains("0 tasks run; 4 had results of an earlier run"), "{told}");
    assert_eq!(fs::metadata(&result).unwrap().modified().unwrap(), written);
    assert!(before == files(&home.path("out")), "the second report differs");
    let printed = home.bench(&["report", "-o", "out", "--format", "json"]);
    assert!(printed.stdout == before["report.json"], "{}", text(&printed.stdout));
}

#[test]
fn results_and_times_of_another_task_are_not_taken() {
    let home = Home::new();
    let arguments = ["--logs", "logs/short.mcap", "-o", "out", "--timing"];
    ok(home.bench(&arguments));
    let before = files(&home.path("out"));
    let hashes = home.plan("out");
    let [first, second] = [0, 1].map(|at: usize| hashes[at]["hash"].as_str().unwrap());
    for folder in ["results", "timings"] {
        let folder = home.path("out").join(folder);
        let copied = folder.join(format!("{second}.json"));
        fs::copy(folder.join(format!("{first}.json")), copied).unwrap();
    }
    let said = messages_of(&home.bench(&["report", "-o", "out"]), 1);
    assert!(said.contains("the first is 2"), "{said}");
    let told = ok(home.bench(&arguments));
    assert!(told.contains("1 task run; 1 had results of an earlier run"), "{told}");
    assert!(files(&home.path("out"))["report.json"] == before["report.json"], "the report differs");
    // A damaged result is computed again, too.
    fs::write(home.path("out/results").join(format!("{first}.json")), "{").unwrap();
    let told = ok(home.bench(&arguments[..4]));
    assert!(told.contains("1 task run; 1 had results of an earlier run"), "{told}");
    assert!(files(&home.path("out"))["report.json"] == before["report.json"], "the report differs");
}

fn before_result(home: &Home) -> String {
    format!("{}.json", home.plan("out")[0]["hash"].as_str().unwrap())
}

#[test]
fn figures_and_events_are_in_the_report() {
    let home = Home::new();
    let late = "[manager.config]\nconfirm_hits = 3\nconfirm_within = 5\nconfirm_score = 4.0\n";
    home.config("near", late);
    ok(home.bench(&["--logs", "logs/long.mcap", "--configs", "configs/near.toml", "-o", "out"]));
    let report = home.report("out");
    let task = &report["tasks"][0];
    assert_eq!((task["pipeline"].as_str(), task["log"].as_str()), (Some("near"), Some("long")));
    assert_eq!(task["frames"].as_u64(), Some(24));
    assert!((task["duration_s"].as_f64().unwrap() - 2.3).abs() < 1e-9, "{}", task["duration_s"]);
    assert!(task["image"]["MOTA"].as_f64().unwrap() > 0.7, "{}", task["image"]);
    assert!(task["metres"]["position_error_mean_m"].as_f64().unwrap() < 0.15);
    assert!(task["nis"]["count"].as_u64().unwrap() > 10, "{}", task["nis"]);
    let events = task["events"].as_array().unwrap();
    assert!(events.iter().any(|event| event["kind"] == "found"), "{events:?}");
    let html = fs::read_to_string(home.path("out/report.html")).unwrap();
    assert!(html.contains("near") && html.contains("long"));
}

#[test]
fn the_scores_equal_those_of_eval() {
    let home = Home::new();
    ok(home.bench(&["--logs", "logs/long.mcap", "--configs", "configs/near.toml", "-o", "out"]));
    let mut run = own_plugin();
    run.current_dir(home.folder.path());
    run.args(["run", "configs/near.toml", "logs/long.mcap", "-o", "run"]);
    assert!(run.output().unwrap().status.success());
    let mut eval = own_plugin();
    eval.current_dir(home.folder.path());
    eval.args(["eval", "--truth", "logs/long.people.csv", "--tracks", "run", "--format", "json"]);
    let eval: Value = serde_json::from_slice(&eval.output().unwrap().stdout).unwrap();
    let bench = &home.report("out")["tasks"][0]["image"];
    for figure in ["HOTA", "MOTA", "IDF1", "LocA", "position_error_mean_m"] {
        let a = eval[figure].as_f64().unwrap();
        let b = bench[figure].as_f64().unwrap();
        assert!((a - b).abs() < 2e-3, "{figure}: eval {a}, bench {b}; files are rounded");
    }
}

#[test]
fn jobs_shards_and_single_tasks_give_the_same_bytes() {
    let home = Home::new();
    home.config("panics", "config = { panic_after_frames = 4 }");
    fn arguments(out: &'static str) -> [&'static str; 6] {
        ["--logs-dir", "logs", "--seeds", "2", "-o", out]
    }
    assert_eq!(code(&home.bench(&arguments("one"))), 1, "one pipeline fails");
    assert_eq!(code(&home.bench(&[&arguments("two")[..], &["--jobs", "2"]].concat())), 1);
    home.bench(&[&["plan"][..], &arguments("three")].concat());
    let plan = home.plan("three");
    for task in plan.iter().rev() {
        let wanted = task["hash"].as_str().unwrap();
        home.bench(&["run", "-o", "three", "--task", wanted]);
    }
    home.bench(&["report", "-o", "three"]);
    home.bench(&[&["plan"][..], &arguments("four")].concat());
    home.bench(&["run", "-o", "four", "--shard", "2/2"]);
    let half = files(&home.path("four"));
    assert_eq!(half.keys().filter(|name| name.starts_with("results/")).count(), 6);
    home.bench(&["run", "-o", "four", "--shard", "1/2"]);
    home.bench(&["report", "-o", "four"]);
    let one = files(&home.path("one"));
    assert_eq!(one.keys().filter(|name| name.starts_with("results/")).count(), 12);
    for other in ["two", "three", "four"] {
        let other = files(&home.path(other));
        assert_eq!(one.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
        for (name, bytes) in &one {
            assert!(other[name] == *bytes, "{name} differs");
        }
    }
}

#[test]
fn a_pipeline_that_panics_fails_alone() {
    let home = Home::new();
    home.config("panics", "config = { panic_after_frames = 4 }");
    let said = messages_of(&home.bench(&["--logs-dir", "logs", "-o", "out"]), 1);
    assert!(said.contains("2 of 6 tasks failed"), "{said}");
    let report = home.report("out");
    for task in report["tasks"].as_array().unwrap() {
        let ended = task["outcome"]["ended"].as_str().unwrap();
        match task["pipeline"].as_str().unwrap() {
            "panics" => {
                assert_eq!(ended, "failed");
                let why = task["outcome"]["why"].as_str().unwrap();
                assert!(why.contains("nearest-thing") && why.contains("frame 5"), "{why}");
            }
            _ => assert_eq!(ended, "done"),
        }
    }
    let again = home.bench(&["run", "-o", "out"]);
    assert!(text(&again.stderr).contains("0 tasks run"), "a failure is a result, too");
    let retried = home.bench(&["run", "-o", "out", "--retry-failed"]);
    assert!(text(&retried.stderr).contains("2 tasks run"), "{}", text(&retried.stderr));
}

#[test]
fn a_log_that_lacks_depth_is_skipped_with_the_reason() {
    let home = Home::new();
    Drawn { depth: false, ..Drawn::of(5) }.write(&home.path("logs/mono.mcap"));
    fs::write(home.path("logs/mono.boxes.csv"), "1,1,60,40,26,80,1,1,1\n").unwrap();
    Drawn::of(3).write(&home.path("logs/bare.mcap"));
    let told = ok(home.bench(&["--logs-dir", "logs", "-o", "out"]));
    assert!(told.contains("bare.mcap has no truth"), "{told}");
    assert!(told.contains("`tagalong annotate "), "{told}");
    let skipped: Vec<Value> =
        home.plan("out").into_iter().filter(|task| task["skip"].is_string()).collect();
    assert_eq!(skipped.len(), 2, "{skipped:?}");
    assert!(skipped.iter().all(|task| task["log_name"] == "mono"));
    assert!(skipped[0]["skip"].as_str().unwrap().contains("depth"), "{}", skipped[0]["skip"]);
    let tasks = home.report("out")["tasks"].as_array().unwrap().clone();
    assert_eq!(tasks.iter().filter(|t| t["outcome"]["ended"] == "skipped").count(), 2);
}

#[test]
fn a_log_of_scans_alone_is_not_sent_to_annotate() {
    let Some(scans) = tagalong_conformance::testdata::find("laser/laser-moving.mcap") else {
        return;
    };
    let home = Home::new();
    fs::copy(scans, home.path("logs/scans.mcap")).unwrap();
    for arguments in [["--logs-dir", "logs"], ["--logs", "logs/scans.mcap"]] {
        let output = home.bench(&[&["plan", "-o", "out"][..], &arguments].concat());
        let said = text(&output.stderr);
        assert!(said.contains("scans.mcap has no truth"), "{said}");
        assert!(said.contains("give their positions as NAME.people-floor.csv"), "{said}");
        assert!(!said.contains("tagalong annotate"), "{said}");
    }
}

#[test]
fn a_pipeline_that_can_detect_nothing_is_skipped_with_the_reason_that_run_gives() {
    let home = Home::new();
    for config in ["omni-rich", "onnx"] {
        let shipped = format!("{}/../../configs/{config}.toml", env!("CARGO_MANIFEST_DIR"));
        let text = fs::read_to_string(shipped).unwrap();
        fs::write(home.path(&format!("unable/{config}.toml")), text).unwrap();
    }
    let configs = ["unable/omni-rich.toml", "unable/onnx.toml", "configs/near.toml"];
    let given = [&["--logs", "logs/short.mcap", "-o", "out", "--configs"][..], &configs].concat();
    let output = home.bench(&given);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    for task in home.report("out")["tasks"].as_array().unwrap() {
        let name = task["pipeline"].as_str().unwrap();
        let ended = task["outcome"]["ended"].as_str().unwrap();
        if name == "near" {
            assert_eq!(ended, "done");
            continue;
        }
        assert_eq!(ended, "skipped", "{name}");
        let why = task["outcome"]["why"].as_str().unwrap();
        let reason = why.split_once(": ").unwrap().1;
        let config = format!("unable/{name}.toml");
        let mut run = own_plugin();
        run.args(["run", &config, "logs/short.mcap", "-o", name]).current_dir(home.folder.path());
        let told = messages_of(&run.output().unwrap(), 1);
        assert!(told.contains(reason), "{told}\nis not: {reason}");
    }
}

#[test]
fn a_hash_changes_with_what_matters_and_with_nothing_else() {
    let home = Home::new();
    let first = home.task_hashes("a", &[]);
    let path = home.path("configs/near.toml");
    let config = fs::read_to_string(&path).unwrap();
    fs::write(&path, format!("# a comment\n{config}")).unwrap();
    assert_eq!(home.task_hashes("b", &[]), first, "a comment changes nothing");
    fs::write(&path, config.replace("seed = 7", "seed = 8")).unwrap();
    let seeded = home.task_hashes("c", &[]);
    assert_eq!((&seeded[0], seeded[1] != first[1]), (&first[0], true), "far, then near");
    fs::write(home.path("logs/short.people.csv"), crate::common::people(8)).unwrap();
    assert!(
        home.task_hashes("d", &[]).iter().zip(&seeded).all(|(new, old)| new != old),
        "other truth"
    );
}

#[test]
fn files_that_a_config_names_belong_to_the_hash() {
    let home = Home::new();
    let config = "[[detectors]]\nplugin = \"recorded-detections\"\nroles = [\"discover\"]\n\
                  config = { path = \"../det.txt\" }\n[filter]\nplugin = \"ekf\"\n";
    fs::write(home.path("configs/boxes.toml"), config).unwrap();
    let [first, same, other] = [("a", "0.9"), ("b", "0.9"), ("c", "0.8")].map(|(out, score)| {
        fs::write(home.path("det.txt"), format!("1,-1,90,40,26,79,{score}\n")).unwrap();
        home.task_hashes(out, &["--configs", "configs/boxes.toml"])
    });
    assert_eq!(same[0], first[0]);
    assert_ne!(other[0], first[0]);
}

#[test]
fn doubled_ids_of_a_truth_are_dropped_if_asked_for() {
    let home = Home::new();
    let truth = crate::common::people(10);
    let last = truth.lines().last().unwrap();
    fs::write(home.path("logs/short.people.csv"), format!("{truth}{last}\n")).unwrap();
    let only = ["--logs", "logs/short.mcap", "--configs", "configs/near.toml"];
    home.bench(&[&only[..], &["-o", "out"]].concat());
    let failed = home.report("out")["tasks"][0]["outcome"].clone();
    let why = failed["why"].as_str().unwrap_or_default();
    assert!(why.contains("occurs twice") && why.contains("`--drop-doubled-ids`"), "{failed}");
    let told =
        results_of(&home.bench(&[&only[..], &["-o", "dropped", "--drop-doubled-ids"]].concat()));
    assert!(told.contains("note: short.people.csv: 1 people are left out"), "{told}");
    let notes = home.report("dropped")["notes"].to_string();
    assert!(notes.contains("\"short.people.csv: 1 people are left out"), "{notes}");
    assert_eq!(home.report("dropped")["tasks"][0]["outcome"]["ended"], "done");
    assert_ne!(home.plan("out")[0]["hash"], home.plan("dropped")[0]["hash"], "another result");
}

#[test]
fn what_changed_since_the_plan_is_not_run() {
    let home = Home::new();
    ok(home.bench(&["plan", "--logs", "logs/short.mcap", "-o", "out"]));
    fs::write(home.path("logs/short.people.csv"), crate::common::people(8)).unwrap();
    let said = messages_of(&home.bench(&["run", "-o", "out"]), 2);
    assert!(said.contains("plan again"), "{said}");
    let said = messages_of(&home.bench(&["report", "-o", "out"]), 1);
    assert!(said.contains("2 of 2 tasks have no result"), "{said}");
    assert_eq!(code(&home.bench(&["run", "-o", "out", "--task", "99"])), 2);
    assert_eq!(code(&home.bench(&["run", "-o", "nowhere"])), 2);
}

#[test]
fn the_gate_closes_on_what_got_worse() {
    let home = Home::new();
    let logs = ["--logs", "logs/long.mcap", "--configs", "configs/near.toml"];
    ok(home.bench(&[&logs[..], &["-o", "old"]].concat()));
    let gate = ["--baseline", "old/report.json", "--fail-if", "HOTA<-0.01", "FN>0"];
    ok(home.bench(&[&logs[..], &["-o", "same"], &gate].concat()));
    // Nothing is nearer than this: no person is found.
    home.config("near", "config = { max_depth_m = 1.0 }");
    let told = messages_of(&home.bench(&[&logs[..], &["-o", "new"], &gate].concat()), 1);
    assert!(told.contains("near  long  7  HOTA<-0.01") && told.contains("FN>0"), "{told}");
    assert_eq!(code(&home.bench(&["report", "-o", "same", "--baseline", "no.json"])), 1);
}

#[test]
fn times_are_taken_only_when_asked_for() {
    let home = Home::new();
    let logs = ["--logs", "logs/short.mcap", "-o", "out"];
    ok(home.bench(&logs));
    let without = files(&home.path("out"));
    assert!(!without.keys().any(|name| name.contains("timing")), "{:?}", without.keys());
    let told = ok(home.bench(&[&logs[..], &["--timing", "--jobs", "2"]].concat()));
    assert!(told.contains("one task at a time"), "{told}");
    let with = files(&home.path("out"));
    let times: Value = serde_json::from_slice(&with["timings.json"]).unwrap();
    assert_eq!(
        (times["exclusive"].as_bool(), times["tasks"].as_object().unwrap().len()),
        (Some(true), 2)
    );
    assert!(with["report.json"] == without["report.json"], "times are kept apart");
}

#[test]
fn pictures_show_what_went_wrong() {
    let home = Home::new();
    // Truth somewhere else: a miss, and a false track.
    let shifted = crate::common::people(24).replace(",1,", ",2,");
    let moved: String = shifted
        .lines()
        .map(|line| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if cells[0] != "frame" {
                cells[2] = "2".into();
            }
            cells.join(",") + "\n"
        })
        .collect();
    fs::write(home.path("logs/long.people.csv"), moved).unwrap();
    ok(home.bench(&["--logs", "logs/long.mcap", "--configs", "configs/near.toml", "-o", "out"]));
    let html = fs::read_to_string(home.path("out/report.html")).unwrap();
    assert!(html.contains("data:image/png;base64,iVBOR"), "no picture in the report");
}

#[test]
fn trackeval_gets_its_tree() {
    let home = Home::new();
    ok(home.bench(&["--logs-dir", "logs", "-o", "out"]));
    ok(home.bench(&["export", "-o", "out", "--trackeval", "tree"]));
    let tree = files(&home.path("tree"));
    assert_eq!(tree["gt/mot_challenge/seqmaps/Tagalong-train.txt"], b"name\nlong\nshort\n");
    for name in [
        "gt/mot_challenge/Tagalong-train/long/seqinfo.ini",
        "gt/mot_challenge/Tagalong-train/short/gt/gt.txt",
        "trackers/mot_challenge/Tagalong-train/near-seed7/data/long.txt",
        "trackers/mot_challenge/Tagalong-train/far-seed7/data/short.txt",
    ] {
        assert!(tree.contains_key(name), "{name} of {:?}", tree.keys());
    }
}

#[test]
fn copies_of_one_log_are_no_independent_logs() {
    let home = Home::new();
    // A copy of a copy goes back to the same recording.
    for [log, copy] in [["short", "mirrored"], ["mirrored", "twice"]] {
        let mut command = own_plugin();
        let [log, copy] = [log, copy].map(|name| format!("logs/{name}.mcap"));
        command.current_dir(home.folder.path()).args(["alter", &log, "--mirror", "-o", &copy]);
        ok(command.output().unwrap());
    }
    let told = results_of(&home.bench(&["--logs-dir", "logs", "-o", "out"]));
    assert!(told.contains("note: mirrored and short and twice come from one recording"), "{told}");
    let copies = serde_json::json!([["mirrored", "short", "twice"]]);
    assert_eq!(home.report("out")["copies"], copies);
    let page = fs::read_to_string(home.path("out/report.html")).unwrap();
    assert!(page.contains("mirrored and short and twice come from one recording"));
}
