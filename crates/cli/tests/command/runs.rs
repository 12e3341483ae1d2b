//! Whole runs over a simulated log: the files, their formats, and that they are the same every
//! time.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::{Drawn, assert_same, code, config, messages_of, own_plugin, results_of, text};

const FILES: [&str; 4] = ["tracks.mcap", "tracks.csv", "tracks-metres.csv", "report.json"];

struct Home {
    folder: tempfile::TempDir,
}

impl Home {
    fn new(log: &Drawn, extra: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        log.write(&folder.path().join("walk.mcap"));
        config(folder.path(), extra);
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, out: &str, more: &[&str]) -> Command {
        let mut command = own_plugin();
        command.current_dir(self.folder.path());
        command.args(["run", "nearest.toml", "walk.mcap", "-o", out]).args(more);
        command
    }

    fn run(&self, out: &str, more: &[&str]) -> Output {
        self.command(out, more).output().unwrap()
    }
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(path).unwrap()).unwrap()
}

fn cells(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn a_run_that_found_no_person_says_which_command_looks_for_the_cause() {
    let log = Drawn::of(1);
    // Nothing is nearer than this.
    let home = Home::new(&log, "config = { max_depth_m = 1.0 }");
    let said = results_of(&home.run("out", &[]));
    assert!(said.contains("walk.mcap: 1 frame, people in 0 of them"), "{said}");
    assert!(said.contains("`tagalong doctor nearest.toml walk.mcap` looks for"), "{said}");
}

#[test]
fn a_run_writes_whole_files_and_says_what_it_found() {
    let home = Home::new(&Drawn::of(20), "");
    let said = results_of(&home.run("out", &[]));
    assert!(said.contains("\n1 ID:\n"), "{said}");
    let mut names: Vec<_> = fs::read_dir(home.path("out"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(
        names,
        [
            "origin.json",
            "report.json",
            "timings.json",
            "tracks-metres.csv",
            "tracks.csv",
            "tracks.mcap"
        ]
    );
}

#[test]
fn boxes_follow_the_walker_in_ten_columns() {
    let home = Home::new(&Drawn::of(20), "");
    home.run("out", &[]);
    let rows = cells(&home.path("out/tracks.csv"));
    assert!(rows.len() >= 15, "{} rows", rows.len());
    assert!(rows.iter().all(|row| row.len() == 10 && row[7..] == ["-1", "-1", "-1"]));
    for row in &rows {
        let values: Vec<f64> = row.iter().map(|cell| cell.parse().unwrap()).collect();
        let frame = values[0];
        let centre = values[2] + 0.5 * values[4];
        assert!((1.0..=20.0).contains(&frame));
        let walker = 90.0 - (frame - 1.0) + 13.0;
        assert!((centre - walker).abs() < 4.0, "frame {frame}: {centre}, drawn at {walker}");
        assert!((0.0..=1.0).contains(&values[6]));
    }
}

#[test]
fn metres_have_a_header_and_the_place_of_the_walker() {
    let home = Home::new(&Drawn::of(20), "");
    home.run("out", &[]);
    let rows = cells(&home.path("out/tracks-metres.csv"));
    assert_eq!(rows[0][..3], ["stamp_ns", "frame", "id"]);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    let last = rows.last().unwrap();
    let [in_robot, in_odom] = [3, 6].map(|column: usize| last[column].parse::<f64>().unwrap());
    assert_eq!(last[0], (crate::common::FIRST_NS + 19 * 100_000_000).to_string());
    assert!((in_robot - 2.88).abs() < 0.15, "the head is 2.88 m ahead: {in_robot}");
    assert_eq!(in_robot, in_odom, "no odometry: both frames agree");
}

#[test]
fn the_report_tells_frames_persons_and_hashes() {
    let home = Home::new(&Drawn { twice: 5, ..Drawn::of(20) }, "");
    let output = home.run("out", &["--format", "json", "--seed", "11"]);
    let report = json(&home.path("out/report.json"));
    let printed: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(printed, report, "stdout carries the report and nothing else");
    assert_eq!(report["seed"], 11);
    assert_eq!(report["ended"], "complete");
    assert_eq!(report["frames"]["processed"], 20);
    assert_eq!(report["persons"]["1"]["last_frame"], report["frames"]["read"]);
    assert!(report["config"]["sha256"].as_str().is_some_and(|hash| hash.len() == 64));
    assert!(report["log"]["sha256"].as_str().is_some_and(|hash| hash.len() == 64), "{report}");
    assert!(report["nis"]["mean"].as_f64().is_some_and(f64::is_finite));
    let timings = json(&home.path("out/timings.json"));
    let worst = &timings["whole frame"]["max_ms"];
    assert!(worst.as_f64() >= timings["update"]["p99_ms"].as_f64().map(|ms| 0.9 * ms), "{timings}");
    assert!(timings["read"]["p95_ms"].as_f64().is_some_and(|ms| ms > 0.0), "{timings}");
}

#[test]
fn every_run_gives_the_same_bytes() {
    let home = Home::new(&Drawn::of(30), "");
    assert_eq!(code(&home.run("a", &["--threads", "1"])), 0);
    for (out, threads) in [("b", "1"), ("c", "2"), ("d", "3"), ("e", "8")] {
        let mut command = home.command(out, &["--threads", threads, "--overlay"]);
        command.env("TZ", "Asia/Tokyo").env("LC_ALL", "de_DE.UTF-8").env_remove("HOME");
        assert!(command.output().unwrap().status.success());
        for name in FILES {
            assert_same(&home.path("a").join(name), &home.path(out).join(name));
        }
    }
    assert_same(&home.path("b/overlay/000017.png"), &home.path("e/overlay/000017.png"));
}

/// The surroundings of a process have no part in its results; without a terminal are all tests.
#[cfg(unix)]
#[test]
fn p10_surroundings_change_no_byte() {
    let home = Home::new(&Drawn::of(30), "");
    assert_eq!(code(&home.run("plain", &[])), 0);
    // The time that files have is the wall clock's. Pinning to one core needs `taskset`.
    let wrappers = ["umask 077; exec nice -n 19 \"$0\" \"$@\"", "exec \"$0\" \"$@\" < /dev/null"];
    let settings =
        [("TZ", "Pacific/Apia"), ("TZ", "UTC"), ("LC_ALL", "de_DE.UTF-8"), ("LANG", "tr_TR")];
    for (at, (name, value)) in settings.into_iter().enumerate() {
        let out = format!("changed-{at}");
        let plain = home.command(&out, &[]);
        let mut command = Command::new("sh");
        command.args(["-c", wrappers[at % 2]]).arg(plain.get_program()).args(plain.get_args());
        command.current_dir(home.folder.path()).env_clear();
        command.env("PATH", std::env::var_os("PATH").unwrap()).env(name, value);
        let done = command.output().unwrap();
        assert!(done.status.success(), "{}", text(&done.stderr));
        for file in FILES {
            assert_same(&home.path("plain").join(file), &home.path(&out).join(file));
        }
    }
}

/// The results tell nothing of the day on which they were made: the clock of a process that runs
/// later is another one.
#[test]
fn p10_the_wall_clock_is_not_in_the_results() {
    let home = Home::new(&Drawn::of(10), "");
    assert_eq!(code(&home.run("early", &[])), 0);
    std::thread::sleep(std::time::Duration::from_millis(1100));
    assert_eq!(code(&home.run("late", &[])), 0);
    for file in FILES {
        assert_same(&home.path("early").join(file), &home.path("late").join(file));
    }
}

#[test]
fn overlay_draws_every_frame() {
    let home = Home::new(&Drawn::of(12), "");
    home.run("out", &["--overlay"]);
    let mut names: Vec<_> = fs::read_dir(home.path("out/overlay"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names.len(), 12);
    assert_eq!((names[0].as_str(), names[11].as_str()), ("000001.png", "000012.png"));
}

#[test]
fn results_are_replaced_only_when_asked() {
    let home = Home::new(&Drawn::of(5), "");
    assert_eq!(code(&home.run("out", &[])), 0);
    let before = fs::read(home.path("out/report.json")).unwrap();
    assert_eq!(code(&home.run("out", &["--seed", "3"])), 2);
    assert_eq!(fs::read(home.path("out/report.json")).unwrap(), before);
    assert_eq!(code(&home.run("out", &["--seed", "3", "--overwrite"])), 0);
    assert_ne!(fs::read(home.path("out/report.json")).unwrap(), before);
}

#[test]
fn what_a_killed_run_left_is_replaced_without_being_asked() {
    let home = Home::new(&Drawn::of(5), "");
    fs::create_dir(home.path("out")).unwrap();
    for name in ["tracks.mcap.partial", "tracks.csv.partial", "tracks-metres.csv.partial"] {
        fs::write(home.path("out").join(name), "cut").unwrap();
    }
    let output = home.run("out", &[]);
    assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    assert!(home.path("out/tracks.csv").exists() && !home.path("out/tracks.csv.partial").exists());
}

#[cfg(target_os = "linux")]
#[test]
fn a_log_whose_name_is_no_text_is_run_checked_and_compared() {
    use std::os::unix::ffi::OsStrExt;
    let home = Home::new(&Drawn::of(5), "");
    let odd = home.path("").join(std::ffi::OsStr::from_bytes(b"n\xff.mcap"));
    fs::rename(home.path("walk.mcap"), &odd).unwrap();
    let people = odd.with_extension("people.csv");
    fs::write(people, crate::common::people(5)).unwrap();
    for words in [
        &["run", "-o", "out", "nearest.toml"][..],
        &["view", "out", "-o", "page.html", "--log"],
        &["inspect", "--format", "json"],
        &["check", "--format", "json", "nearest.toml"],
        &["bench", "--configs", "nearest.toml", "-o", "bench", "--logs"],
    ] {
        let mut command = own_plugin();
        let output =
            command.current_dir(home.folder.path()).args(words).arg(&odd).output().unwrap();
        assert_eq!(code(&output), 0, "{words:?} {}", text(&output.stderr));
    }
    let log = json(&home.path("out/origin.json"))["log"]["escaped"].as_str().unwrap().to_owned();
    assert!(log.ends_with("/n\\xff.mcap"), "{log}");
}

#[test]
fn results_go_to_a_folder_named_after_log_and_config() {
    let home = Home::new(&Drawn::of(3), "");
    let mut command = own_plugin();
    command.current_dir(home.folder.path()).args(["run", "nearest.toml", "walk.mcap"]);
    assert!(command.output().unwrap().status.success());
    assert!(home.path("runs/walk-nearest/tracks.mcap").exists());
}

#[test]
fn a_damaged_log_is_used_as_far_as_it_goes() {
    let home = Home::new(&Drawn::of(30), "");
    let whole = fs::read(home.path("walk.mcap")).unwrap();
    fs::write(home.path("walk.mcap"), &whole[..whole.len() / 2]).unwrap();
    let output = home.run("out", &[]);
    assert_eq!(code(&output), 3, "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(
        said.lines().next().unwrap().ends_with("(complete, but part of the log was lost)"),
        "{said}"
    );
    let report = json(&home.path("out/report.json"));
    assert_eq!(report["data_lost"], true);
    assert!(report["frames"]["processed"].as_u64().is_some_and(|n| n > 3), "{report}");
    assert!(report["counters"].as_object().is_some_and(|c| !c.is_empty()), "{report}");
    let strict = home.run("strict", &["--strict"]);
    assert_eq!(code(&strict), 1);
    assert!(text(&strict.stderr).contains("--strict"));
}

#[test]
fn a_plugin_that_panics_ends_the_run_with_valid_files() {
    let home = Home::new(&Drawn::of(20), "config = { panic_after_frames = 9 }");
    let mut command = home.command("out", &[]);
    let told = messages_of(&command.env_remove("RUST_BACKTRACE").output().unwrap(), 3);
    assert!(told.contains("nearest-thing") && told.contains("frame 10"), "{told}");
    assert!(!told.contains("backtrace") && told.lines().count() < 8, "{told}");
    let report = json(&home.path("out/report.json"));
    assert_eq!(report["frames"]["processed"], 9);
    assert!(report["ended"].as_str().is_some_and(|s| s.contains("nearest-thing")), "{report}");
    let bytes = fs::read(home.path("out/tracks.mcap")).unwrap();
    assert!(mcap::Summary::read(&bytes).unwrap().is_some());
}

#[test]
fn the_config_travels_with_the_tracks() {
    let home = Home::new(&Drawn::of(3), "");
    home.run("out", &[]);
    let bytes = fs::read(home.path("out/tracks.mcap")).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let attachment = mcap::read::attachment(&bytes, &summary.attachment_indexes[0]).unwrap();
    let config = text(&attachment.data);
    fs::write(home.path("again.toml"), &config).unwrap();
    let mut command = own_plugin();
    command.current_dir(home.folder.path()).args(["run", "again.toml", "walk.mcap", "-o", "again"]);
    let output = command.output().unwrap();
    assert_eq!(code(&output), 0, "{config}\n{}", text(&output.stderr));
    // The resolved config does the same.
    assert_same(&home.path("out/tracks.csv"), &home.path("again/tracks.csv"));
}
