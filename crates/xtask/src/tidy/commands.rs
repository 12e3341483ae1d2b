use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use anyhow::Result;

use super::markdown::Document;
use crate::metadata::Metadata;
use crate::workspace::{Workspace, output};

/// Complains about command lines in documents whose sub-command or option does
/// not exist.
pub fn check(
    workspace: &Workspace,
    metadata: &Metadata,
    documents: &[Document],
) -> Result<Vec<String>> {
    let mut known = Known::new(workspace, metadata)?;
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
    let words: Vec<&str> = part.split_whitespace().filter(|word| !word.contains('=')).collect();
    match words.as_slice() {
        ["tagalong", rest @ ..] => vec![Call::Tagalong(rest.to_vec())],
        ["cargo", "xtask", command, ..] => vec![Call::Xtask(command)],
        ["cargo", "run", rest @ ..] => {
            let own = rest.iter().any(|word| matches!(*word, "-p" | "--package" | "--example"));
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

/// What there is to call.
struct Known<'a> {
    workspace: &'a Workspace,
    cargo: BTreeSet<String>,
    /// The help of each sub-command of `tagalong`; `None` before it is built.
    tagalong: Option<BTreeMap<String, String>>,
    has_program: bool,
}

impl<'a> Known<'a> {
    fn new(workspace: &'a Workspace, metadata: &Metadata) -> Result<Self> {
        let list = output(Command::new("cargo").arg("--list"))?;
        let cargo = list.lines().skip(1).filter_map(first_word).map(String::from);
        let members = metadata.members(workspace.root());
        let has_program = members.get("crates/cli").is_some_and(|package| package.is_program());
        let cargo = cargo.chain(INSTALLED.iter().map(|name| (*name).to_owned())).collect();
        Ok(Self { workspace, cargo, tagalong: None, has_program })
    }

    fn complaint(&mut self, call: &Call<'_>) -> Result<Option<String>> {
        Ok(match call {
            Call::Cargo(command) => {
                (!self.cargo.contains(*command)).then(|| format!("there is no `cargo {command}`"))
            }
            Call::Xtask(command) => (!crate::subcommands().iter().any(|name| name == command))
                .then(|| format!("there is no `cargo xtask {command}`")),
            Call::Tagalong(words) if self.has_program => unknown_words(self.helps()?, words),
            Call::Tagalong(_) => None,
        })
    }

    /// The help of `tagalong` itself under the empty name, and of each of its
    /// sub-commands.
    fn helps(&mut self) -> Result<&BTreeMap<String, String>> {
        if self.tagalong.is_none() {
            let help = |words: &[&str]| {
                let mut cargo = Command::new("cargo");
                cargo.args(["run", "--quiet", "--package", "tagalong-cli", "--"]);
                output(cargo.args(words).arg("--help").current_dir(self.workspace.root()))
            };
            let all = help(&[])?;
            let mut helps = BTreeMap::new();
            for name in commands_in(&all).filter(|name| *name != "help") {
                helps.insert(name.to_owned(), help(&[name])?);
            }
            helps.insert(String::new(), all);
            self.tagalong = Some(helps);
        }
        Ok(self.tagalong.get_or_insert_default())
    }
}

fn first_word(line: &str) -> Option<&str> {
    line.split_whitespace().next()
}

/// The names listed under `Commands:` in a help text.
fn commands_in(help: &str) -> impl Iterator<Item = &str> {
    let lines = help.lines().skip_while(|line| !line.starts_with("Commands:")).skip(1);
    lines.take_while(|line| line.starts_with("  ")).filter_map(|line| {
        let name = line.strip_prefix("  ").filter(|rest| !rest.starts_with(' '));
        name.and_then(first_word)
    })
}

fn unknown_words(helps: &BTreeMap<String, String>, words: &[&str]) -> Option<String> {
    let command = words.iter().find(|word| !word.starts_with('-')).copied().unwrap_or_default();
    let Some(help) = helps.get(command) else {
        return Some(format!("there is no `tagalong {command}`"));
    };
    let flags = words.iter().filter_map(|word| word.strip_prefix("--"));
    let mut missing = flags.filter(|flag| !help.contains(&format!("--{flag}")));
    missing.next().map(|flag| format!("`tagalong {command}` has no option `--{flag}`"))
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
    fn unknown_sub_commands_and_options_are_named() {
        let all = "Usage: x\n\nCommands:\n  run   Runs\n  list  Lists\n\nOptions:\n  -h, --help\n";
        assert_eq!(commands_in(all).collect::<Vec<_>>(), ["run", "list"]);
        let helps = BTreeMap::from([
            (String::new(), all.to_owned()),
            ("run".to_owned(), "--overlay  Draws".to_owned()),
        ]);
        assert_eq!(unknown_words(&helps, &["run", "x", "--overlay"]), None);
        assert!(unknown_words(&helps, &["walk"]).unwrap().contains("tagalong walk"));
        assert!(unknown_words(&helps, &["run", "--over"]).is_none(), "a beginning is accepted");
        assert!(unknown_words(&helps, &["run", "--blue"]).unwrap().contains("--blue"));
    }
}
