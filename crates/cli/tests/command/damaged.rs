//! Damaged files, as a user meets them: whatever the bytes, the program ends in time and within its
//! memory, with a code that its help names, and without a panic.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::common::text;

/// Longest time of one file, s: a busy machine takes a second for what takes milliseconds.
const LONGEST_S: f64 = 20.0;
/// Address space that the shell allows, KiB: threads reserve most of it and use little.
const MEMORY_KIB: u64 = 2 * 1024 * 1024;
/// Ends that the help of the program names for a log: done, failed, data lost.
const CODES: [i32; 3] = [0, 1, 3];

/// Runs the program within the limits, and returns its exit code.
fn end(arguments: &[&str], file: &Path) -> i32 {
    let limited = format!("ulimit -v {MEMORY_KIB} && exec \"$@\"");
    let program = env!("CARGO_BIN_EXE_tagalong");
    let mut child = Command::new("sh")
        .args(["-c", &limited, "sh", program])
        .args(arguments)
        .arg(file)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed().as_secs_f64() > LONGEST_S {
            child.kill().unwrap();
            panic!("{}: takes more than {LONGEST_S} s", file.display());
        }
        sleep(Duration::from_millis(2));
    }
    let output = child.wait_with_output().unwrap();
    let said = text(&output.stderr);
    assert!(!said.contains("panicked"), "{}: {said}", file.display());
    let code = output.status.code();
    // A program that is refused memory is killed by its own abort, and has no code.
    assert!(code.is_some_and(|code| CODES.contains(&code)), "{}: {code:?} {said}", file.display());
    code.unwrap()
}

/// Returns copies of a file: cut, with bytes that changed, and with lengths that lie.
fn damaged(bytes: &[u8], count: usize) -> Vec<Vec<u8>> {
    let copies = (0..count).map(|k| {
        let at = (k + 1) * bytes.len() / (count + 1);
        let mut copy = bytes.to_vec();
        match k % 3 {
            0 => copy.truncate(at),
            1 => (at..bytes.len()).step_by(997).for_each(|i| copy[i] ^= 0x5a),
            _ => (at..bytes.len().min(at + 8)).for_each(|i| copy[i] = 0xff),
        }
        copy
    });
    copies.collect()
}

/// Returns all logs below a folder, in order.
fn logs_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut stack = vec![folder.to_owned()];
    while let Some(folder) = stack.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let is_log = path.extension().is_some_and(|end| end == "mcap" || end == "db3");
            if path.is_dir() {
                stack.push(path);
            } else if is_log {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

fn seed(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/seeds").join(name)
}

#[test]
fn files_of_other_programs_whole_and_damaged_end_in_time_and_memory() {
    let Some(folder) = tagalong_conformance::testdata::find("mcap") else { return };
    let home = tempfile::tempdir().unwrap();
    let logs = logs_below(&folder);
    assert!(logs.len() > 150, "{} logs", logs.len());
    for (i, log) in logs.iter().enumerate() {
        end(&["inspect"], log);
        // Each is damaged in one way; neighbours are variants of one file.
        let bytes = fs::read(log).unwrap();
        let file = home.path().join(log.file_name().unwrap());
        fs::write(&file, &damaged(&bytes, 9)[i % 9]).unwrap();
        end(&["inspect"], &file);
    }
}

#[test]
fn damaged_recordings_are_tracked_in_time_and_memory_and_damage_is_told() {
    let home = tempfile::tempdir().unwrap();
    let out = home.path().join("out");
    let run = ["run", "depth-ekf", "--overwrite", "-o", out.to_str().unwrap()];
    for name in ["tiny.mcap", "tiny.bag", "tiny.db3"] {
        assert_eq!(end(&run, &seed(name)), 0, "{name}");
        let mut lost = 0;
        for copy in damaged(&fs::read(seed(name)).unwrap(), 15) {
            let file = home.path().join(name);
            fs::write(&file, copy).unwrap();
            let codes = [end(&["inspect"], &file), end(&run, &file)];
            lost += usize::from(codes.iter().any(|code| *code != 0));
        }
        assert!(lost > 5, "{name}: {lost} of 15 are told");
    }
}
