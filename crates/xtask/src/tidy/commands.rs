use std::collections::BTreeSet;
use std::process::Command;

use anyhow::Result;

use crate::markdown::Document;
use crate::metadata::Metadata;
use crate::program::{Name, Program};
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

/// A documented call: of `cargo`, of `cargo xtask`, or of a program.
#[derive(Debug, PartialEq)]
enum Call<'a> {
    Cargo(&'a str),
    Xtask(&'a str),
    Program(Name, Vec<&'a str>),
}

/// The calls of a line; comments are dropped, `&&` and `;` separate.
fn calls(line: &str) -> Vec<Call<'_>> {
    let line = line.trim_start().trim_start_matches("$ ");
    let line = line.split(" #").next().unwrap_or(line);
    line.split("&&").flat_map(|part| part.split(';')).flat_map(calls_of_part).collect()
}

fn calls_of_part(part: &str) -> Vec<Call<'_>> {
    let all: Vec<&str> = part.split_whitespace().skip_while(|word| word.contains('=')).collect();
    // Redirections and pipes belong to the shell, not to the program.
    let words =
        all.split(|word| matches!(*word, ">" | "2>" | "|" | "||")).next().unwrap_or_default();
    match words {
        ["tagalong", rest @ ..] => vec![Call::Program(Name::Tagalong, rest.to_vec())],
        ["tagalong-papers", rest @ ..] => vec![Call::Program(Name::Papers, rest.to_vec())],
        ["cargo", "xtask", command, ..] => vec![Call::Xtask(command)],
        ["cargo", "run", rest @ ..] => {
            let other = ["-p", "--package", "--example", "--manifest-path"];
            let own = rest.iter().any(|word| other.contains(word));
            let after = rest.iter().position(|word| *word == "--").map(|at| &rest[at + 1..]);
            let of_papers = rest.windows(2).any(|pair| pair == ["-p", Name::Papers.package()]);
            let program =
                if of_papers { Some(Name::Papers) } else { (!own).then_some(Name::Tagalong) };
            let call = program.zip(after);
            let call = call.map(|(program, words)| Call::Program(program, words.to_vec()));
            std::iter::once(Call::Cargo("run")).chain(call).collect()
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
    /// The built programs, where the workspace has them.
    programs: Vec<(Name, Program)>,
}

impl Known {
    fn new(workspace: &Workspace, metadata: &Metadata) -> Result<Self> {
        let list = output(Command::new("cargo").arg("--list"))?;
        let cargo = list.lines().skip(1).filter_map(|line| line.split_whitespace().next());
        let members = metadata.members(workspace.root());
        let cargo = cargo.chain(INSTALLED.iter().copied()).map(str::to_owned).collect();
        let programs = Name::ALL.into_iter().filter(|name| {
            members.values().any(|package| package.name == name.package() && package.is_program())
        });
        let programs = programs.map(|name| Ok((name, Program::built(workspace, name)?)));
        Ok(Self { cargo, programs: programs.collect::<Result<_>>()? })
    }

    fn complaint(&self, call: &Call<'_>) -> Result<Option<String>> {
        Ok(match call {
            Call::Cargo(command) => {
                (!self.cargo.contains(*command)).then(|| format!("there is no `cargo {command}`"))
            }
            Call::Xtask(command) => (!crate::subcommands().iter().any(|name| name == command))
                .then(|| format!("there is no `cargo xtask {command}`")),
            Call::Program(name, words) => {
                match self.programs.iter().find(|(known, _)| known == name) {
                    Some((name, program)) => misunderstood(*name, program, words)?,
                    None => None,
                }
            }
        })
    }
}

/// Returns the error of the program about words that it does not understand; asked for help, it
/// reads them all and does nothing.
fn misunderstood(name: Name, program: &Program, words: &[&str]) -> Result<Option<String>> {
    let said = program.call(&[]).args(words.iter().map(plain)).arg("--help").output()?;
    let error = String::from_utf8_lossy(&said.stderr);
    let first = error.lines().next().unwrap_or_default();
    let line = format!("{} {}", name.as_str(), words.join(" "));
    Ok((!said.status.success()).then(|| format!("`{line}`: {first}")))
}

/// A word as the shell hands it on; any number for each variable.
fn plain(word: &&str) -> String {
    let word = word.trim_matches(['\'', '"']);
    fn part(part: &str) -> String {
        if part.starts_with('$') { "1".to_owned() } else { part.to_owned() }
    }
    word.split('/').map(part).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_are_found_in_command_lines() {
        let line = "$ cargo xtask tidy && cargo run --release -- run a.toml --overlay  # why; not";
        let run = vec!["run", "a.toml", "--overlay"];
        let run = Call::Program(Name::Tagalong, run);
        assert_eq!(calls(line), [Call::Xtask("tidy"), Call::Cargo("run"), run]);
        let tables = Call::Program(Name::Papers, vec!["reproduce", "laser"]);
        let line = "cargo run --release -p tagalong-papers -- reproduce laser";
        assert_eq!(calls(line), [Call::Cargo("run"), tables]);
        assert_eq!(calls("RUSTFLAGS=-g cargo test -p x"), [Call::Cargo("test")]);
        assert_eq!(calls("cargo run -p x -- go"), [Call::Cargo("run")]);
        assert!(calls("ls cargo").is_empty());
    }

    #[test]
    fn what_the_shell_does_is_left_out_and_settings_are_kept() {
        let set = Call::Program(Name::Tagalong, vec!["simulate", "--set", "a.b=1"]);
        for rest in ["> x", "2> x", "| wc", "|| test $? -eq 2"] {
            let line = format!("tagalong simulate --set a.b=1 {rest}");
            assert_eq!(calls(&line), std::slice::from_ref(&set), "{rest}");
        }
        assert_eq!(plain(&"'HOTA<-0.01'"), "HOTA<-0.01");
        assert_eq!(plain(&"\"$TASK\""), "1");
        assert_eq!(plain(&"\"$TASK/$TASKS\""), "1/1");
    }
}
