//! Runs the documented command lines of `tagalong`, each document in a folder of its
//! own in which the files lie that the lines speak of.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use std::{env, fs};

use anyhow::{Result, bail};

use crate::markdown::{Document, documents};
use crate::program::{Name, Program};
use crate::workspace::{Workspace, copy_file, output, remove_folder};

/// Where it happens: where `cargo clean` removes it.
const STAGE: &str = "target/rehearsal";

/// Lines with this in them are not run, for a reason. Tidy checks their options.
const LEFT_OUT: &[(&str, &str)] = &[
    ("contrast", "needs the plugin of the walk-through, whose own trial runs it"),
    ("import kitti", "needs another data set"),
    ("import leg-tracker", "needs another data set"),
    ("import mot", "needs another data set"),
    ("import tum", "needs another data set"),
    ("run configs/onnx.toml", "needs a network of the user"),
    ("yolox_s.onnx", "needs a network of the user"),
    ("yolox_nano", "needs a network of the user"),
    ("yolox-nano", "needs a network of the user"),
    ("people.toml", "needs a network of the user"),
    ("every-third", "needs a network that a script of Python makes"),
    ("upper-bodies", "needs a network that a script of Python makes"),
    ("turning", "needs a log that a script of Python makes"),
    ("boxes variants", "needs sequences that a script of Python makes"),
    ("../shared", "needs the annotated logs"),
    ("benches/rooms.toml", "needs the annotated logs"),
    ("COCO.json", "needs boxes of another program"),
    ("LOG.people.csv", "needs an annotated log"),
    ("old/report.json", "needs a report of last week"),
    ("SLURM_", "needs a cluster"),
    ("annotate", "waits for a browser"),
    ("reproduce", "takes long"),
    ("realism", "takes long"),
    ("train", "takes long"),
    ("trials", "takes long"),
    ("--seeds", "takes long"),
    ("--fit", "takes long"),
    ("LONG.mcap", "takes a quarter of an hour"),
    ("crowd=5", "takes half a minute, as the tests build it"),
    ("hide_s=3", "takes a quarter of a minute, as the tests build it"),
    ("--gallery pictures", "takes half a minute, as the tests build it"),
];

/// Contents of each folder: a short log, a folder of logs, and one of images.
const PROPS: &[&str] = &[
    "simulate configs/scenes/crossing.toml --set duration_s=3 -o LOG.mcap",
    "simulate configs/scenes/crossing.toml --set duration_s=3 -o logs/short.mcap",
    "simulate configs/scenes/crossing.toml --set duration_s=3 -o LOGS/short.mcap",
    "simulate configs/scenes/crossing.toml --gallery FOLDER",
];

/// Runs all that can be run in a few minutes; an error if any line fails.
pub fn rehearse(workspace: &Workspace) -> Result<()> {
    let program = Program::built(workspace, Name::Tagalong)?;
    // It lies in the same folder, where the shell finds it.
    Program::built(workspace, Name::Papers)?;
    let stage = workspace.root().join(STAGE);
    remove_folder(&stage)?;
    let props = stage.join("props");
    workspace.copy_to(&props, |file: &Path| {
        file.starts_with("configs") || file.starts_with("benches/papers/configs")
    })?;
    for line in PROPS {
        output(program.call(&words(line)).current_dir(&props))?;
    }
    let mut done = 0;
    let mut failed = Vec::new();
    for (number, document) in documents(workspace)?.iter().enumerate() {
        let lines: Vec<_> = lines(document).collect();
        if lines.is_empty() {
            continue;
        }
        let folder = stage.join(number.to_string());
        // A folder for each document, so that results of one cannot help another.
        copy(&props, &folder)?;
        for (at, line) in lines {
            let place = format!("{}:{at}", document.path.display());
            let start = Instant::now();
            match output(&mut in_shell(&program, &line, &folder)?) {
                Ok(_) => done += 1,
                Err(error) => failed.push(format!("{place}: {error:#}")),
            }
            eprintln!("rehearse: {place}: {line} ({:.1} s)", start.elapsed().as_secs_f64());
        }
    }
    if failed.is_empty() {
        eprintln!("rehearse: {done} documented lines run");
        return Ok(());
    }
    bail!("{}", failed.join("\n"))
}

/// The lines of a document that call `tagalong` and are not left out.
fn lines(document: &Document) -> impl Iterator<Item = (usize, String)> {
    let lines = document.shell.iter().filter_map(|(at, line)| Some((*at, call(line)?)));
    lines.filter(|(_, line)| !LEFT_OUT.iter().any(|(part, _)| line.contains(part)))
}

/// The line as `tagalong ...` or `tagalong-papers ...`, without its comment; `None` if it calls
/// something else.
fn call(line: &str) -> Option<String> {
    let line = line.trim_start().trim_start_matches("$ ");
    // Comments behind a command belong to the reader.
    let line = line.split(" #").next().unwrap_or(line).trim_end();
    if let Some(rest) = line.strip_prefix("cargo run --release -- ") {
        return Some(format!("tagalong {rest}"));
    }
    if let Some(rest) = line.strip_prefix("cargo run --release -p tagalong-papers -- ") {
        return Some(format!("tagalong-papers {rest}"));
    }
    let is_call = ["tagalong ", "tagalong-papers "].iter().any(|name| line.starts_with(name));
    is_call.then(|| line.to_owned())
}

fn words(line: &str) -> Vec<&str> {
    line.split_whitespace().collect()
}

/// The line as a shell runs it, for `tagalong` this workspace's program.
fn in_shell(program: &Program, line: &str, folder: &Path) -> Result<Command> {
    let others = env::var_os("PATH").unwrap_or_default();
    // The program that was just built comes first, before an installed one.
    let all = std::iter::once(program.folder().to_owned()).chain(env::split_paths(&others));
    let mut shell = Command::new("sh");
    shell.args(["-c", line]).current_dir(folder).env("PATH", env::join_paths(all)?);
    Ok(shell)
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    for entry in fs::read_dir(from)? {
        let entry: PathBuf = entry?.path();
        let Some(name) = entry.file_name() else { continue };
        if entry.is_dir() {
            copy(&entry, &to.join(name))?
        } else {
            copy_file(&entry, &to.join(name))?
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_of_the_program_are_found_without_comments() {
        let run = call("cargo run --release -- run a.toml   # why").unwrap();
        assert_eq!(run, "tagalong run a.toml");
        assert_eq!(call("$ tagalong list").unwrap(), "tagalong list");
        assert_eq!(call("cargo run -p x -- go"), None);
        assert_eq!(call("cargo test"), None);
    }

    #[test]
    fn what_takes_long_is_left_out() {
        let shell = vec![(1, "tagalong list".to_owned()), (2, "tagalong train x".to_owned())];
        let document = Document { path: PathBuf::from("x.md"), prose: Vec::new(), shell };
        assert_eq!(lines(&document).collect::<Vec<_>>(), [(1, "tagalong list".to_owned())]);
    }
}
