//! `tagalong run --serve`: its address, its answers while the run goes on, and its end. The page has
//! tests of its own.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::common::{Drawn, assert_same, code, config, own_plugin, text};

/// Starts a run that takes much longer than the test; returns it with host and path of its page.
fn start(home: &Path, frames: u64) -> (Child, String, String) {
    Drawn::of(frames).write(&home.join("walk.mcap"));
    config(home, "config = { delay_ms = 30 }");
    let mut child = own_plugin()
        .current_dir(home)
        .args(["run", "nearest.toml", "walk.mcap", "-o", "out", "--serve"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines();
    let said = lines.find_map(|line| line.unwrap().split("http://").nth(1).map(str::to_owned));
    let address = said.expect("the address of the page");
    let (host, path) = address.split(' ').next().unwrap().split_once('/').unwrap();
    // The rest is read, so that the program never waits for a reader.
    thread::spawn(move || lines.for_each(drop));
    (child, host.to_owned(), format!("/{path}"))
}

fn get(host: &str, path: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(host).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    let status = answer.split(' ').nth(1).unwrap().parse().unwrap();
    (status, answer.split_once("\r\n\r\n").unwrap().1.to_owned())
}

/// Deadline of a run that has to end, so that one that waits for ever fails its test.
#[cfg(unix)]
const DEADLINE: Duration = Duration::from_secs(180);

/// Waits for the end of a run.
#[cfg(unix)]
fn ended(child: &mut Child) -> ExitStatus {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if start.elapsed() > DEADLINE {
            child.kill().unwrap();
            panic!("the run does not end");
        }
        thread::sleep(Duration::from_millis(20));
    }
}

#[test]
#[cfg(unix)]
fn frames_are_served_while_the_run_goes_on_and_ctrl_c_ends_it_whole() {
    let home = tempfile::tempdir().unwrap();
    let (mut child, host, path) = start(home.path(), 600);
    assert!(host.starts_with("127.0.0.1:"), "{host}");
    assert_eq!(get(&host, &path).0, 200);
    assert_eq!(get(&host, "/").0, 403, "without the key");
    let mut after = 0;
    for _ in 0..3 {
        let (status, body) = get(&host, &format!("{path}now?after={after}"));
        let now: Value = serde_json::from_str(&body).unwrap();
        let seq = now["seq"].as_u64().unwrap();
        assert!(status == 200 && seq > after, "{body}");
        assert!(now["image"].as_str().unwrap().len() > 100, "an image");
        after = seq;
    }
    // Browsers that never read, until the run is over.
    let silent: Vec<TcpStream> = (0..8)
        .map(|_| {
            let mut stream = TcpStream::connect(&host).unwrap();
            write!(stream, "GET {path}now?after=0 HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
            stream
        })
        .collect();
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-s", "INT", &pid]).status().unwrap().success());
    assert_eq!(ended(&mut child).code(), Some(130));
    drop(silent);
    let report = fs::read_to_string(home.path().join("out/report.json")).unwrap();
    assert!(report.contains("stopped by signal"), "{report}");
    assert!(home.path().join("out/tracks.mcap").exists());
    assert!(TcpStream::connect(&host).is_err(), "nothing listens any more");
}

/// The results do not depend on browsers, nor on their absence.
#[test]
fn a_run_without_a_browser_ends_by_itself_with_the_same_tracks() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(12).write(&home.path().join("walk.mcap"));
    config(home.path(), "");
    for (out, more) in [("one", &[][..]), ("two", &["--serve", "--realtime"])] {
        let mut command = own_plugin();
        command.current_dir(home.path()).args(["run", "nearest.toml", "walk.mcap", "-o", out]);
        let output = command.args(more).output().unwrap();
        assert_eq!(code(&output), 0, "{}", text(&output.stderr));
    }
    assert_same(&home.path().join("one/tracks.mcap"), &home.path().join("two/tracks.mcap"));
}

#[test]
fn an_address_that_cannot_be_served_is_refused_with_the_remedy() {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(3).write(&home.path().join("walk.mcap"));
    config(home.path(), "");
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    for (address, part) in
        [(port.as_str(), "--serve=PORT"), ("robot", "0.0.0.0:8080"), ("99999", "no address")]
    {
        let serve = format!("--serve={address}");
        let arguments = ["run", "nearest.toml", "walk.mcap", &serve];
        let output = own_plugin().current_dir(home.path()).args(arguments).output().unwrap();
        let said = text(&output.stderr);
        assert_eq!(code(&output), 2, "{address}: {said}");
        assert!(said.contains(part), "{address}: {said}");
    }
}
