//! `tagalong annotate`: its start and its ends, and what it refuses. The page has tests of its own.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use crate::common::{Drawn, code, tagalong, text};

fn home() -> tempfile::TempDir {
    let home = tempfile::tempdir().unwrap();
    Drawn::of(5).write(&home.path().join("walk.mcap"));
    home
}

fn command(home: &Path, arguments: &[&str]) -> Command {
    let mut command = tagalong();
    command.current_dir(home).arg("annotate").args(arguments);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn refused(home: &Path, arguments: &[&str]) -> Output {
    command(home, arguments).output().unwrap()
}

/// Starts the program; returns it with host and path of its page.
fn start(home: &Path, arguments: &[&str]) -> (Child, String, String) {
    let mut child = command(home, arguments).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let address = lines.next().unwrap().unwrap();
    // The rest is read, so that the program never waits for a reader.
    lines.take(2).for_each(|line| drop(line.unwrap()));
    let (host, path) = address.strip_prefix("http://").unwrap().split_once('/').unwrap();
    (child, host.to_owned(), format!("/{path}"))
}

fn post(host: &str, path: &str, body: &str) -> String {
    let mut stream = TcpStream::connect(host).unwrap();
    let length = body.len();
    write!(
        stream,
        "POST {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://{host}\r\n\
         Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n{body}"
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

const BOX: &str = r#"{"op":"box","frame":2,"id":7,"region":[10,10,30,30]}"#;

#[test]
fn a_change_is_beside_the_log_and_the_page_ends_the_program() {
    let home = home();
    let (mut child, host, path) = start(home.path(), &["walk.mcap", "--empty"]);
    let answer = post(&host, &format!("{path}change"), BOX);
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    let file = home.path().join("walk.people.csv");
    assert!(fs::read_to_string(&file).unwrap().contains("\n2,7,10,10,30,30,"));
    post(&host, &format!("{path}finish"), "{}");
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
#[cfg(unix)]
fn ctrl_c_and_a_kill_leave_the_file_whole_and_it_is_continued() {
    let home = home();
    let file = home.path().join("truth.csv");
    let arguments = ["walk.mcap", "--empty", "-o", "truth.csv"];
    for (signal, expected) in [("KILL", None), ("INT", Some(130))] {
        let (mut child, host, path) = start(home.path(), &arguments);
        post(&host, &format!("{path}change"), BOX);
        let pid = child.id().to_string();
        assert!(Command::new("kill").args(["-s", signal, &pid]).status().unwrap().success());
        assert_eq!(child.wait().unwrap().code(), expected);
        let rows = fs::read_to_string(&file).unwrap();
        assert_eq!(rows.lines().count(), 2, "{rows}");
    }
}

#[test]
#[cfg(unix)]
fn ctrl_c_without_a_change_says_that_nothing_is_written() {
    let home = home();
    let (child, ..) = start(home.path(), &["walk.mcap", "--empty"]);
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-s", "INT", &pid]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let said = text(&output.stderr);
    assert_eq!(code(&output), 130, "{said}");
    assert!(said.contains("walk.people.csv is not written") && said.contains("Finish"), "{said}");
    assert!(!home.path().join("walk.people.csv").exists());
}

#[test]
fn what_cannot_be_annotated_is_refused_with_the_remedy() {
    let home = home();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    fs::write(home.path().join("broken.csv"), "frame,id,ub_x\n").unwrap();
    fs::write(home.path().join("other.csv"), "frame,id,ub_x,ub_y,ub_w,ub_h\n99,1,1,1,9,9\n")
        .unwrap();
    for (arguments, expected, parts) in [
        (&["none.mcap"][..], 1, &["none.mcap"][..]),
        (&["walk.mcap", "--port", &port], 2, &["--port", &port]),
        (&["walk.mcap", "none.toml"], 2, &["none.toml"]),
        (&["walk.mcap", "-o", "walk.mcap/people.csv"], 2, &["walk.mcap", "-o"]),
        (&["walk.mcap", "-o", "."], 2, &["is a folder", "-o"]),
        (&["walk.mcap", "-o", "broken.csv"], 1, &["broken.csv, line 1", "ub_y"]),
        (&["walk.mcap", "-o", "other.csv"], 1, &["other.csv", "frame 99", "another one"]),
    ] {
        let output = refused(home.path(), arguments);
        let said = text(&output.stderr);
        assert_eq!(code(&output), expected, "{arguments:?}: {said}");
        assert!(parts.iter().all(|part| said.contains(part)), "{arguments:?}: {said}");
    }
    assert!(!home.path().join("walk.people.csv").exists());
}
