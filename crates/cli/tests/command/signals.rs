//! Ctrl-C and SIGTERM leave valid files.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::common::{Drawn, code, config, messages_of, own_plugin, tagalong, text};

/// A run that takes much longer than the test.
fn slow_run(home: &Path) -> Child {
    Drawn::of(600).write(&home.join("walk.mcap"));
    config(home, "config = { delay_ms = 50 }");
    own_plugin()
        .current_dir(home)
        .args(["run", "nearest.toml", "walk.mcap", "-o", "out"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Waits until the file has so many bytes.
fn wait_for(file: &Path, bytes: u64) {
    let started = Instant::now();
    while fs::metadata(file).map_or(0, |about| about.len()) < bytes {
        let late = started.elapsed() > Duration::from_secs(60);
        assert!(!late, "too little was written to {}", file.display());
        thread::sleep(Duration::from_millis(20));
    }
}

/// Waits for the tracks of some twenty frames, so that a second of them is on disk.
fn wait_for_tracks(home: &Path) {
    wait_for(&home.join("out/tracks.csv.partial"), 1000);
}

fn interrupt(child: &Child, signal: &str) {
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-s", signal, &pid]).status().unwrap().success());
}

fn stopped_by(signal: &str, expected: i32) {
    let home = tempfile::tempdir().unwrap();
    let child = slow_run(home.path());
    wait_for_tracks(home.path());
    interrupt(&child, signal);
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), expected, "{}", text(&output.stderr));
    let out = home.path().join("out");
    let bytes = fs::read(out.join("tracks.mcap")).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let [frames, poses, texts] = ["/people/tracks", "/tf", "/people/tracks_json"].map(|topic| {
        let channel = summary.channels.values().find(|channel| channel.topic == topic).unwrap();
        summary.stats.as_ref().unwrap().channel_message_counts[&channel.id]
    });
    assert!((5..600).contains(&frames), "{frames} frames");
    assert_eq!((poses, texts), (frames, frames));
    let csv = fs::read_to_string(out.join("tracks.csv")).unwrap();
    assert!(csv.ends_with('\n') && csv.lines().all(|line| line.split(',').count() == 10));
    let report = fs::read_to_string(out.join("report.json")).unwrap();
    assert!(report.contains("stopped by signal"), "{report}");
    assert!(report.contains(&format!("\"processed\": {frames},")), "{report}");
    assert!(!out.join("tracks.mcap.partial").exists());
}

#[test]
fn an_interrupt_finishes_the_files() {
    stopped_by("INT", 130);
}

#[test]
fn a_termination_finishes_the_files() {
    stopped_by("TERM", 143);
}

/// A log is looked through before anything is written, and a long one for minutes.
#[test]
fn a_signal_ends_the_search_through_a_long_log() {
    use std::os::unix::process::ExitStatusExt as _;
    let home = tempfile::tempdir().unwrap();
    config(home.path(), "");
    // The hash covers what is behind the last record, too: gigabytes of nothing.
    Drawn::of(3).write(&home.path().join("walk.mcap"));
    let log = fs::File::options().write(true).open(home.path().join("walk.mcap")).unwrap();
    log.set_len(16 << 30).unwrap();
    let mut child = own_plugin()
        .current_dir(home.path())
        .args(["run", "nearest.toml", "walk.mcap", "-o", "out"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    thread::sleep(Duration::from_millis(500));
    // Not SIGINT, which a shell ignores on behalf of what it starts in the background.
    interrupt(&child, "TERM");
    assert_eq!(child.wait().unwrap().signal(), Some(15));
    assert!(!home.path().join("out").exists());
}

#[test]
fn a_killed_run_leaves_what_can_be_recovered_under_no_final_name() {
    let home = tempfile::tempdir().unwrap();
    let mut child = slow_run(home.path());
    wait_for_tracks(home.path());
    child.kill().unwrap();
    child.wait().unwrap();
    let out = home.path().join("out");
    let finals = ["tracks.mcap", "tracks.csv", "tracks-metres.csv", "report.json"];
    assert!(finals.iter().all(|name| !out.join(name).exists()));
    let bytes = fs::read(out.join("tracks.mcap.partial")).unwrap();
    let options = [mcap::read::Options::IgnoreEndMagic].into_iter().collect();
    let stream = mcap::MessageStream::new_with_options(&bytes, options).unwrap();
    let kept = stream.map_while(Result::ok).filter(|m| m.channel.topic == "/people/tracks").count();
    assert!(kept >= 11, "everything older than a second: {kept} frames");
}

#[test]
fn a_full_disk_is_told_with_the_name_of_the_file() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(200).write(&home.path().join("walk.mcap"));
    config(home.path(), "");
    let limited = "trap '' XFSZ; ulimit -f 8; exec \"$0\" run nearest.toml walk.mcap -o out";
    let told = messages_of(
        &Command::new("sh")
            .args(["-c", limited])
            .arg(own_plugin().get_program())
            .current_dir(home.path())
            .output()
            .unwrap(),
        1,
    );
    assert!(told.contains("cannot write") && told.contains("out/tracks"), "{told}");
    assert!(!home.path().join("out/tracks.mcap").exists(), "half a file has no final name");
}

/// Runs the program in a shell with a small disk at `small`; `None` where this machine lets no one
/// mount it.
fn on_small_disk(home: &Path, disk: &str, program: &Command) -> Option<Output> {
    fs::create_dir_all(home.join("small")).unwrap();
    let mount = format!("mount -t tmpfs -o {disk} none small || exit 99");
    let words = program.get_args().map(|word| word.to_string_lossy().into_owned());
    let words = words.collect::<Vec<_>>().join(" ");
    let output = Command::new("unshare")
        .args(["--user", "--map-root-user", "--mount", "sh", "-c"])
        .arg(format!("{mount}; exec \"$0\" {words}"))
        .arg(program.get_program())
        .current_dir(home)
        .output()
        .ok()?;
    let refused = output.status.code() == Some(99) || text(&output.stderr).contains("unshare: ");
    (!refused).then_some(output)
}

/// Disks on which the folder, the first file, the log, the tables and the report are too much.
#[test]
fn a_full_disk_is_the_same_failure_early_and_late() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(200).write(&home.path().join("walk.mcap"));
    config(home.path(), "");
    let mut program = own_plugin();
    program.args(["run", "nearest.toml", "walk.mcap", "-o", "small/out"]);
    let kilobytes = (1..).map(|pages| format!("size={}k", 4 * pages));
    let disks = ["nr_inodes=1", "nr_inodes=2", "nr_inodes=3"].map(String::from);
    let mut places = BTreeSet::new();
    for disk in disks.into_iter().chain(kilobytes) {
        let Some(output) = on_small_disk(home.path(), &disk, &program) else {
            eprintln!("skipped: this machine mounts no small disk");
            return;
        };
        let told = text(&output.stderr);
        if code(&output) == 0 {
            break;
        }
        assert_eq!(code(&output), 1, "{disk}: {told}");
        let words = told.lines().rfind(|line| line.contains("the disk is full: cannot "));
        let words = words.unwrap_or_else(|| panic!("{disk}: {told}"));
        assert!(words.ends_with("make room, or choose another"), "{words}");
        places.insert(words.split("small/").nth(1).unwrap().split(':').next().unwrap().to_owned());
    }
    assert!(places.len() >= 4, "{places:?}");
}

#[test]
fn an_interrupted_simulation_leaves_a_whole_log() {
    let home = tempfile::tempdir().unwrap();
    let scene = "duration_s = 600.0\n[camera]\nwidth = 64\nheight = 48\n";
    fs::write(home.path().join("long.toml"), scene).unwrap();
    let mut simulate = tagalong();
    simulate.current_dir(home.path()).args(["simulate", "long.toml", "-o", "long.mcap"]);
    let child = simulate.stderr(Stdio::piped()).spawn().unwrap();
    wait_for(&home.path().join("long.mcap.partial"), 1);
    interrupt(&child, "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), 130, "{}", text(&output.stderr));
    let bytes = fs::read(home.path().join("long.mcap")).unwrap();
    assert!(mcap::Summary::read(&bytes).unwrap().unwrap().stats.unwrap().message_count > 0);
}
