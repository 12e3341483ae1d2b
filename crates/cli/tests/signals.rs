//! Ctrl-C and SIGTERM leave valid files.
#![cfg(unix)]

mod common;

use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use common::{Drawn, code, config, own_plugin, text};

/// A run that waits for the rest of its log, which never comes.
fn waiting_run(home: &Path) -> (Child, fs::File) {
    Drawn::of(40).write(&home.join("whole.mcap"));
    config(home, "");
    let pipe = home.join("pipe.mcap");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let child = own_plugin()
        .current_dir(home)
        .args(["run", "nearest.toml", "pipe.mcap", "-o", "out", "--threads", "2"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut writer = OpenOptions::new().write(true).open(&pipe).unwrap();
    let bytes = fs::read(home.join("whole.mcap")).unwrap();
    writer.write_all(&bytes[..bytes.len() * 3 / 4]).unwrap();
    writer.flush().unwrap();
    (child, writer)
}

/// Waits until tracks have reached the disk.
fn wait_for_tracks(home: &Path) {
    let started = Instant::now();
    let file = home.join("out/tracks.csv.partial");
    while fs::metadata(&file).map_or(0, |about| about.len()) == 0 {
        assert!(started.elapsed() < Duration::from_secs(60), "no tracks were written");
        thread::sleep(Duration::from_millis(20));
    }
}

fn stopped_by(signal: &str, expected: i32) {
    let home = tempfile::tempdir().unwrap();
    let (child, writer) = waiting_run(home.path());
    wait_for_tracks(home.path());
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-s", signal, &pid]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    drop(writer);
    assert_eq!(code(&output), expected, "{}", text(&output.stderr));
    let out = home.path().join("out");
    let bytes = fs::read(out.join("tracks.mcap")).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let messages = summary.stats.unwrap().message_count;
    assert!(messages > 0);
    let csv = fs::read_to_string(out.join("tracks.csv")).unwrap();
    assert!(csv.ends_with('\n') && csv.lines().all(|line| line.split(',').count() == 10));
    let report = fs::read_to_string(out.join("report.json")).unwrap();
    assert!(report.contains("stopped by signal"), "{report}");
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
