use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result};

use crate::workspace::Workspace;

/// Larger files belong elsewhere.
const MAX_BYTES: u64 = 2 << 20;

/// Longer sources are split.
const MAX_RUST_LINES: usize = 700;

/// Marks of unfinished sources. In pieces, so that this file may contain them.
const UNFINISHED: &[&str] =
    &[concat!("to", "do!"), concat!("unimpl", "emented!"), concat!("FIX", "ME")];

/// Reads of a whole file, however long it is.
const UNBOUNDED: &[&str] = &["fs::read_to_string(", "fs::read("];

/// Beginnings of paths that exist on one machine only.
const MACHINE: &[&str] =
    &[concat!("/", "work"), concat!("/", "tmp"), concat!("/", "root"), concat!("/", "home")];

/// Complains about files that are too large, unfinished, or name a path of the
/// machine they were written on.
pub fn check(workspace: &Workspace) -> Result<Vec<String>> {
    let mut complaints = Vec::new();
    for file in workspace.files()? {
        let full = workspace.root().join(&file);
        let size =
            fs::metadata(&full).with_context(|| format!("cannot see {}", file.display()))?.len();
        if size > MAX_BYTES {
            complaints.push(format!("{} has {} KiB", file.display(), size >> 10));
        }
        if let Ok(text) = fs::read_to_string(&full) {
            complaints.extend(in_text(&file, &text));
        }
    }
    Ok(complaints)
}

/// Complains about files that are read without a limit: a user may name a device or a pipe.
fn unbounded<'a>(file: &'a Path, text: &'a str) -> impl Iterator<Item = String> + 'a {
    let is_program = file.components().any(|part| part.as_os_str() == "src")
        && !file.starts_with("crates/xtask")
        && !file.iter().any(|part| part == "tests" || part == "tests.rs");
    let tests = text.find("#[cfg(test)]").unwrap_or(text.len());
    let lines = (1..).zip(text[..tests].lines()).filter(move |_| is_program);
    let reads = lines.filter(|(_, line)| UNBOUNDED.iter().any(|read| line.contains(read)));
    // Files that the system itself writes are short.
    reads.filter(|(_, line)| !line.contains("\"/proc/")).map(|(number, _)| {
        format!(
            "{}:{number}: read it with `tagalong_config::read_text`, which has a limit",
            file.display()
        )
    })
}

fn in_text(file: &Path, text: &str) -> Vec<String> {
    let name = file.display();
    let is_rust = file.extension().is_some_and(|extension| extension == "rs");
    let mut complaints = Vec::new();
    if is_rust {
        complaints.extend(unbounded(file, text));
    }
    let lines = text.lines().count();
    if is_rust && lines > MAX_RUST_LINES {
        complaints.push(format!("{name} has {lines} lines: split it"));
    }
    for (number, line) in (1..).zip(text.lines()) {
        if let Some(word) = UNFINISHED.iter().find(|word| is_rust && line.contains(**word)) {
            complaints.push(format!("{name}:{number}: `{word}`"));
        }
        if let Some(path) = MACHINE.iter().find(|path| names_path(line, path)) {
            complaints.push(format!("{name}:{number}: `{path}` is a path of one machine"));
        }
    }
    complaints
}

/// True if `line` names `path` or something in it, as an absolute path.
fn names_path(line: &str, path: &str) -> bool {
    line.match_indices(path).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + path.len()..].chars().next();
        !before.is_some_and(|c| c.is_alphanumeric() || "._-/<>}*~".contains(c))
            && !after.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == '-')
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_read_without_a_limit_is_for_tests_alone() {
        fn complaints(file: &str, text: &str) -> usize {
            unbounded(Path::new(file), text).count()
        }

        let read = "let text = std::fs::read_to_string(path)?;\n";
        assert_eq!(complaints("crates/a/src/b.rs", read), 1);
        assert_eq!(complaints("crates/a/tests/b.rs", read), 0);
        assert_eq!(complaints("crates/a/src/tests/b.rs", read), 0);
        assert_eq!(complaints("crates/a/src/b.rs", &format!("#[cfg(test)]\n{read}")), 0);
        assert_eq!(complaints("crates/a/src/b.rs", "fs::read_to_string(\"/proc/cpuinfo\")"), 0);
    }

    #[test]
    fn paths_of_one_machine_are_found_and_others_are_not() {
        let tmp = MACHINE[1];
        let work = MACHINE[0];
        assert!(names_path(&format!("see {tmp}/x"), tmp));
        assert!(names_path(&format!("`{work}`"), work));
        assert!(!names_path(&format!("target{tmp}/x"), tmp));
        assert!(!names_path(&format!("{work}spaces"), work));
    }

    #[test]
    fn long_and_unfinished_sources_are_found() {
        let text = format!("fn f() {{ {}() }}\n", UNFINISHED[0]).repeat(MAX_RUST_LINES + 1);
        let complaints = in_text(Path::new("a.rs"), &text);
        assert_eq!(complaints.len(), MAX_RUST_LINES + 2);
        assert!(in_text(Path::new("a.md"), &text).is_empty());
    }
}
