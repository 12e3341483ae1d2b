//! Sources of the tables of slow commands.
//!
//! `benches/figures.toml` has, for each part of a page that takes minutes to hours to print, the
//! files that its command reads and the version of the simulator, with their hashes at that time;
//! comments, and tables of configs that the command does not read, are no part of a hash.
//! `cargo xtask docs --slow NAME` writes them; `cargo xtask docs --stale` lists the tables that are
//! older than one of them, and `cargo xtask tidy` says how many these are. That is no complaint:
//! fast parts, which can be printed anew at once, are held against their commands instead.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use sha2::{Digest as _, Sha256};

use crate::workspace::Workspace;

/// File with the sources of the tables.
const RECORD: &str = "benches/figures.toml";
/// File with the version of the simulator's figures.
const SIMULATOR: &str = "crates/sim/src/figures.rs";
/// Beginning of the line with that version.
const VERSION: &str = "pub const FIGURES_VERSION: u32 = ";
/// Name of the simulator among the files.
const SIMULATOR_NAME: &str = "simulator";
/// Folders with the configs and scenes that a table names by their stems.
const NAMED: &[&str] = &["configs", "configs/scenes", "configs/robots", "benches/papers/configs"];
/// Folder with the models that plugins have built in, named after them.
const MODELS: &str = "configs/models";
/// Tables of a config that the commands that begin so do not read: `[suits]` names the logs that a config
/// is chosen for or warned of, and `[tune]` the settings among which `bench` chooses.
const UNREAD: &[(&str, &[&str])] = &[
    ("tagalong-papers reproduce", &["[suits]", "[tune]"]),
    ("tagalong-papers follow", &["[tune]"]),
    ("tagalong follow", &["[tune]"]),
    ("tagalong trials", &["[tune]"]),
];
/// Digits of a hash.
const DIGITS: usize = 16;

/// Hashes by file, with the version of the simulator.
type Sources = BTreeMap<String, String>;
/// Sources by page and command.
type Record = BTreeMap<String, BTreeMap<String, Sources>>;

/// A part of a page: the table between its markers, and the command that prints it.
pub struct Part {
    pub page: String,
    pub command: String,
    pub table: String,
}

/// Notes the present sources of the printed ones of all parts, and drops parts that pages no longer
/// have.
pub fn note(workspace: &Workspace, all: &[Part], is_printed: impl Fn(&Part) -> bool) -> Result<()> {
    let files = Files::of(workspace)?;
    let mut record = read(workspace)?;
    for part in all.iter().filter(|part| is_printed(part)) {
        let sources = files.sources(workspace, part)?;
        record.entry(part.page.clone()).or_default().insert(part.command.clone(), sources);
    }
    for (page, commands) in &mut record {
        commands.retain(|command, _| {
            all.iter().any(|part| part.page == *page && part.command == *command)
        });
    }
    record.retain(|_, commands| !commands.is_empty());
    let text = toml::to_string(&record)?;
    workspace.write(RECORD, &format!("# Written by `cargo xtask docs --slow`.\n{text}"))
}

/// Returns a sentence for each table that is older than something that it is printed from.
pub fn stale(workspace: &Workspace, all: &[Part]) -> Result<Vec<String>> {
    let files = Files::of(workspace)?;
    let record = read(workspace)?;
    let mut sentences = Vec::new();
    for part in all {
        let Part { page, command, .. } = part;
        let now = files.sources(workspace, part)?;
        let noted = record.get(page).and_then(|commands| commands.get(command));
        let why = match noted {
            Some(noted) => changes(noted, &now),
            None => "nothing that was noted when it was printed".to_owned(),
        };
        if !why.is_empty() {
            sentences.push(format!(
                "{page}: the table of `{command}` is older than {why}: `cargo xtask docs --slow \
                 \"{command}\"` prints it anew"
            ));
        }
    }
    Ok(sentences)
}

/// Names the sources that differ, have come or have gone.
fn changes(noted: &Sources, now: &Sources) -> String {
    let mut why = Vec::new();
    for (name, hash) in now {
        match noted.get(name) {
            Some(before) if before == hash => {}
            Some(_) => why.push(name.clone()),
            None => why.push(format!("{name} (new)")),
        }
    }
    let gone = noted.keys().filter(|name| !now.contains_key(*name));
    why.extend(gone.map(|name| format!("{name} (gone)")));
    why.join(", ")
}

fn read(workspace: &Workspace) -> Result<Record> {
    if !workspace.root().join(RECORD).is_file() {
        return Ok(Record::new());
    }
    toml::from_str(&workspace.read(RECORD)?).with_context(|| format!("in {RECORD}"))
}

/// Files of the workspace that tables may be printed from.
struct Files {
    all: BTreeSet<PathBuf>,
    simulator: String,
}

impl Files {
    fn of(workspace: &Workspace) -> Result<Self> {
        let text = workspace.read(SIMULATOR)?;
        let version = text.lines().find_map(|line| line.strip_prefix(VERSION));
        let version = version.with_context(|| format!("{SIMULATOR} has no `{VERSION}`"))?;
        let simulator = format!("version {}", version.trim_end_matches(';'));
        Ok(Self { all: workspace.files()?.into_iter().collect(), simulator })
    }

    /// Returns the hashes of all sources of a part.
    fn sources(&self, workspace: &Workspace, part: &Part) -> Result<Sources> {
        let mut sources = Sources::from([(SIMULATOR_NAME.to_owned(), self.simulator.clone())]);
        let mut open = self.named(part);
        while let Some(path) = open.pop() {
            let name = path.to_string_lossy().into_owned();
            if sources.contains_key(&name) {
                continue;
            }
            let content = std::fs::read(workspace.root().join(&path))
                .with_context(|| format!("cannot read {name}"))?;
            if path.extension().is_none_or(|extension| extension != "toml") {
                sources.insert(name, hash(&content));
                continue;
            }
            let text = String::from_utf8_lossy(&content);
            open.extend(self.read_by(&path, &text));
            let read = meaningful_lines(&text, unread_tables(&part.command));
            sources.insert(name, hash(read.as_bytes()));
        }
        Ok(sources)
    }

    /// Returns the files whose paths the command has, and the configs and scenes whose names stand
    /// in the command or in the table.
    fn named(&self, part: &Part) -> Vec<PathBuf> {
        let words: BTreeSet<&str> = words(&part.command).chain(words(&part.table)).collect();
        self.all
            .iter()
            .filter(|path| {
                let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
                let is_config = NAMED.iter().any(|folder| path.parent() == Some(Path::new(folder)));
                let is_toml = path.extension().is_some_and(|extension| extension == "toml");
                is_config && is_toml && words.contains(stem)
                    || path.to_str().is_some_and(|path| words.contains(path))
            })
            .cloned()
            .collect()
    }

    /// Returns the files that a config reads: those that it names, and the models of its plugins.
    fn read_by(&self, config: &Path, text: &str) -> Vec<PathBuf> {
        let folder = config.parent().unwrap_or(Path::new(""));
        let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default());
        let mut files = Vec::new();
        for quoted in lines.flat_map(|line| line.split('"').skip(1).step_by(2)) {
            let beside = plain(&folder.join(quoted));
            files.extend(
                [beside, PathBuf::from(quoted)].into_iter().filter(|p| self.all.contains(p)),
            );
            let models = self.all.iter().filter(|path| is_model_of(path, quoted));
            files.extend(models.cloned());
        }
        files
    }
}

/// Returns the titles of the tables of a config that a command does not read.
fn unread_tables(command: &str) -> &'static [&'static str] {
    for (begin, tables) in UNREAD {
        if command.starts_with(begin) {
            return tables;
        }
    }
    &[]
}

/// Returns the lines of a file in TOML that a figure can depend on: without comments and without the
/// unread tables.
fn meaningful_lines(text: &str, unread: &[&str]) -> String {
    let mut lines = Vec::new();
    let mut is_unread = false;
    for line in text.lines() {
        let line = without_comment(line).trim();
        if line.starts_with('[') {
            is_unread = unread.contains(&line);
        }
        if !line.is_empty() && !is_unread {
            lines.push(line);
        }
    }
    lines.join("\n")
}

/// Returns a line up to its comment; a `#` between quotes begins none.
fn without_comment(line: &str) -> &str {
    let mut is_quoted = false;
    for (at, character) in line.char_indices() {
        match character {
            '"' => is_quoted = !is_quoted,
            '#' if !is_quoted => return &line[..at],
            _ => {}
        }
    }
    line
}

/// Returns true for a model that is named after a plugin.
fn is_model_of(path: &Path, plugin: &str) -> bool {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
    let rest = stem.strip_prefix(plugin);
    path.parent() == Some(Path::new(MODELS))
        && rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
}

/// Returns the words of a text; a path is one word.
fn words(text: &str) -> impl Iterator<Item = &str> {
    let parts = text.split(|c: char| !(c.is_ascii_alphanumeric() || "-_./".contains(c)));
    parts.map(|word| word.trim_end_matches('.')).filter(|word| !word.is_empty())
}

/// Returns the path without `..`.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path {
        if part == ".." {
            plain.pop();
        } else {
            plain.push(part);
        }
    }
    plain
}

fn hash(content: &[u8]) -> String {
    let mut out = String::new();
    for byte in Sha256::digest(content).iter().take(DIGITS / 2) {
        // Writing to a string cannot fail.
        let _ = write!(out, "{byte:02x}");
    }
    out
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use tempfile::TempDir;

    use super::*;

    const PAGE: &str = "docs/page.md";

    fn workspace(folder: &TempDir) -> Workspace {
        let workspace = Workspace::at(folder.path());
        for (path, text) in [
            (SIMULATOR, "pub const FIGURES_VERSION: u32 = 7;\n"),
            ("configs/best.toml", "extends = \"base.toml\"\n# plugin = \"other\"\n"),
            ("configs/base.toml", "[[verifiers]]\nplugin = \"svm\"\n"),
            ("configs/idle.toml", ""),
            ("configs/models/svm-small.toml", "vectors = 1\n"),
            ("configs/models/svmx.toml", ""),
            ("configs/models/other.toml", ""),
            ("configs/scenes/walk.toml", ""),
            ("benches/papers/configs/printed.toml", "extends = \"../../../configs/base.toml\"\n"),
        ] {
            workspace.write(path, text).unwrap();
        }
        let status = Command::new("git").arg("init").arg("-q").current_dir(folder.path()).status();
        assert!(status.unwrap().success());
        workspace
    }

    fn part(command: &str, table: &str) -> Part {
        Part { page: PAGE.into(), command: command.into(), table: table.into() }
    }

    fn names(workspace: &Workspace, part: &Part) -> Vec<String> {
        let files = Files::of(workspace).unwrap();
        files.sources(workspace, part).unwrap().into_keys().collect()
    }

    #[test]
    fn the_sources_of_a_table_are_the_configs_that_it_names_and_theirs() {
        let folder = tempfile::tempdir().unwrap();
        let workspace = workspace(&folder);
        let rides = part("tagalong follow configs/best.toml", "| walk: best | 3 |");
        let all = [
            "configs/base.toml",
            "configs/best.toml",
            "configs/models/svm-small.toml",
            "configs/scenes/walk.toml",
            "simulator",
        ];
        assert_eq!(names(&workspace, &rides), all);
        let printed = part("tagalong-papers reproduce x", "| as printed: printed | 1 |");
        let all = [
            "benches/papers/configs/printed.toml",
            "configs/base.toml",
            "configs/models/svm-small.toml",
            "simulator",
        ];
        assert_eq!(names(&workspace, &printed), all);
    }

    /// A table that another machine printed is filled in, and is as new as its sources.
    #[test]
    fn a_table_printed_elsewhere_is_filled_in_and_noted() {
        let folder = tempfile::tempdir().unwrap();
        let workspace = workspace(&folder);
        let begin = "<!-- begin: tagalong follow configs/best.toml -->";
        workspace.write(PAGE, &format!("a\n{begin}\nold\n<!-- end -->\n")).unwrap();
        let file = folder.path().join("printed.md");
        std::fs::write(&file, "nothing\n").unwrap();
        assert!(crate::docs::fill_from(&workspace, "best", &file).is_err(), "no table");
        std::fs::write(&file, "| a |\n| --- |\n| walk |\n").unwrap();
        let error = crate::docs::fill_from(&workspace, "other", &file).unwrap_err().to_string();
        assert!(error.contains("in 0 commands"), "{error}");
        crate::docs::fill_from(&workspace, "best", &file).unwrap();
        let page = workspace.read(PAGE).unwrap();
        assert!(page.contains("| walk |\n\n<!-- end -->") && !page.contains("old"), "{page}");
        assert_eq!(crate::docs::stale_tables(&workspace).unwrap(), [""; 0]);
    }

    /// A config with a comment, a `#` that begins none, and a table that some commands do not read.
    const COMMENTED: &str =
        "# a\n\nplugin = \"#1\" # b\n[suits]\nbaseline_m = 0.3\n[filter]\nx = 1\n";

    fn read_by_command(command: &str) -> String {
        meaningful_lines(COMMENTED, unread_tables(command))
    }

    #[test]
    fn comments_and_tables_that_a_command_does_not_read_make_no_table_stale() {
        let all = "plugin = \"#1\"\n[suits]\nbaseline_m = 0.3\n[filter]\nx = 1";
        assert_eq!(read_by_command("tagalong bench --configs a"), all);
        assert_eq!(read_by_command("tagalong follow a.toml"), all);
        let rest = "plugin = \"#1\"\n[filter]\nx = 1";
        assert_eq!(read_by_command("tagalong-papers reproduce a"), rest);
    }

    #[test]
    fn a_table_names_the_sources_that_it_is_older_than() {
        let folder = tempfile::tempdir().unwrap();
        let workspace = workspace(&folder);
        let parts = [part("tagalong follow configs/best.toml", "| walk: best | 3 |")];
        let why = stale(&workspace, &parts).unwrap().join("\n");
        assert!(why.contains("nothing that was noted"), "{why}");
        note(&workspace, &parts, |_| true).unwrap();
        assert_eq!(stale(&workspace, &parts).unwrap().join("\n"), "");
        workspace.write("configs/idle.toml", "changed = 1\n").unwrap();
        let why = stale(&workspace, &parts).unwrap().join("\n");
        assert_eq!(why, "", "it does not depend on that");
        workspace.write("configs/base.toml", "[[verifiers]]\nplugin = \"none\"\n").unwrap();
        workspace.write(SIMULATOR, "pub const FIGURES_VERSION: u32 = 8;\n").unwrap();
        let told =
            "is older than configs/base.toml, simulator, configs/models/svm-small.toml (gone)";
        let why = stale(&workspace, &parts).unwrap().join("\n");
        assert!(why.contains(told), "{why}");
        note(&workspace, &[], |_| true).unwrap();
        assert!(!workspace.read(RECORD).unwrap().contains("best"), "parts that are gone");
    }
}
