use std::collections::BTreeSet;
use std::process::Command;

use anyhow::Result;

use crate::markdown::Document;
use crate::metadata::Metadata;
use crate::program::Program;
use crate::workspace::{Workspace, output};

/// Complains about command lines in documents that the program does not understand.
pub fn check(
    workspace: &Workspace,
    metadata: &Metadata,
    documents: &[Document],
) -> Result<Vec<String>> {
    let known = Known::new(workspace, metadata)?;
    let mut complaints = Vec::new();
    for document in documents {
        for (number, line) in &document.shell {
            for call in calls(line) {
                if let Some(what) = known.complaint(&call)? {
                    complaints.push(format!("{}:{number}: {what}", document.path.display()));
                }
            }
        }
    }
    Ok(complaints)
}

/// A documented call: of `cargo`, of `cargo xtask`, or of `tagalong`.
#[derive(Debug, PartialEq)]
enum Call<'a> {
    Cargo(&'a str),
    Xtask(&'a str),
    Tagalong(Vec<&'a str>),
}

/// The calls of a line; comments are dropped, `&&` and `;` separate.
fn calls(line: &str) -> Vec<Call<'_>> {
    let line = line.trim_start().trim_start_matches("$ ");
    let line = line.split(" #").next().unwrap_or(line);
    line.split("&&").flat_map(|part| part.split(';')).flat_map(calls_of_part).collect()
}

fn calls_of_part(part: &str) -> Vec<Call<'_>> {
    let settings = |word: &&str| word.contains('=');
    let all: Vec<&str> = part.split_whitespace().skip_while(settings).collect();
    // Redirections and pipes belong to the shell, not to the program.
    let words = all.split(|word| matches!(*word, ">" | "|")).next().unwrap_or_default();
    match words {
        ["tagalong", rest @ ..] => vec![Call::Tagalong(rest.to_vec())],
        ["cargo", "xtask", command, ..] => vec![Call::Xtask(command)],
        ["cargo", "run", rest @ ..] => {
            let other = ["-p", "--package", "--example", "--manifest-path"];
            let own = rest.iter().any(|word| other.contains(word));
            let after = rest.iter().position(|word| *word == "--").map(|at| &rest[at + 1..]);
            match after {
                Some(words) if !own => vec![Call::Cargo("run"), Call::Tagalong(words.to_vec())],
                _ => vec![Call::Cargo("run")],
            }
        }
        ["cargo", command, ..] if !command.starts_with('-') => vec![Call::Cargo(command)],
        _ => Vec::new(),
    }
}

/// Sub-commands that need an installation of their own.
const INSTALLED: &[&str] = &["deny", "install"];

/// Commands and files that documents may call.
struct Known {
    cargo: BTreeSet<String>,
    program: Option<Program>,
}

impl Known {
    fn new(workspace: &Workspace, metadata: &Metadata) -> Result<Self> {
        let list = output(Command::new("cargo").arg("--list"))?;
        let cargo = list.lines().skip(1).filter_map(|line| line.split_whitespace().next());
        let members = metadata.members(workspace.root());
        let has_program = members.get("crates/cli").is_some_and(|package| package.is_program());
        let cargo = cargo.chain(INSTALLED.iter().copied()).map(str::to_owned).collect();
        let program = has_program.then(|| Program::built(workspace)).transpose()?;
        Ok(Self { cargo, program })
    }

    fn complaint(&self, call: &Call<'_>) -> Result<Option<String>> {
        Ok(match (call, &self.program) {
            (Call::Cargo(command), _) => {
                (!self.cargo.contains(*command)).then(|| format!("there is no `cargo {command}`"))
            }
            (Call::Xtask(command), _) => (!crate::subcommands().iter().any(|name| name == command))
                .then(|| format!("there is no `cargo xtask {command}`")),
            (Call::Tagalong(words), Some(program)) => misunderstood(program, words)?,
            (Call::Tagalong(_), None) => None,
        })
    }
}

/// Returns the error of the program about words that it does not understand; asked for help, it
/// reads them all and does nothing.
fn misunderstood(program: &Program, words: &[&str]) -> Result<Option<String>> {
    let said = program.call(&[]).args(words.iter().map(plain)).arg("--help").output()?;
    let error = String::from_utf8_lossy(&said.stderr);
    let first = error.lines().next().unwrap_or_default();
    Ok((!said.status.success()).then(|| format!("`tagalong {}`: {first}", words.join(" "))))
}

/// A word as the shell hands it on; any number for each variable.
fn plain(word: &&str) -> String {
    let word = word.trim_matches(['\'', '"']);
    let part = |part: &str| if part.starts_with('$') { "1".to_owned() } else { part.to_owned() };
    word.split('/').map(part).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_found_in_command_lines() {
        let line = "$ cargo xtask tidy && cargo run --release -- run a.toml --overlay  # why; not";
        let run = vec!["run", "a.toml", "--overlay"];
        assert_eq!(calls(line), [Call::Xtask("tidy"), Call::Cargo("run"), Call::Tagalong(run)]);
        assert_eq!(calls("RUSTFLAGS=-g cargo test -p x"), [Call::Cargo("test")]);
        assert_eq!(calls("cargo run -p x -- go"), [Call::Cargo("run")]);
        assert!(calls("ls cargo").is_empty());
    }

    #[test]
    fn what_the_shell_does_is_left_out_and_settings_are_kept() {
        let set = Call::Tagalong(vec!["simulate", "--set", "a.b=1"]);
        assert_eq!(calls("tagalong simulate --set a.b=1 > x"), [set]);
        assert_eq!(plain(&"'HOTA<-0.01'"), "HOTA<-0.01");
        assert_eq!(plain(&"\"$TASK\""), "1");
        assert_eq!(plain(&"\"$TASK/$TASKS\""), "1/1");
    }
}
