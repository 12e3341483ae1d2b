use anyhow::Result;

use crate::workspace::Workspace;

/// Folders with the sources that are counted.
const FOLDERS: &[&str] = &["crates", "plugins", "benches", "bridges", "examples"];

/// Most closures bound by `let` in 1,000 lines.
const MOST: f64 = 2.0;

/// Complains if the sources bind too many closures by `let`, with the files that have the most of
/// them: a function has a name, types and a place of its own, and a closure that is used once can
/// stand where it is used.
pub fn check(workspace: &Workspace) -> Result<Vec<String>> {
    let mut lines = 0;
    let mut closures = 0;
    let mut of_files = Vec::new();
    for file in workspace.files()? {
        let is_rust = file.extension().is_some_and(|extension| extension == "rs");
        if !is_rust || !FOLDERS.iter().any(|folder| file.starts_with(folder)) {
            continue;
        }
        let text = workspace.read(&file)?;
        let count = bound_closures(&text);
        lines += text.lines().count();
        closures += count;
        of_files.push((count, file));
    }
    let rate = 1e3 * closures as f64 / lines.max(1) as f64;
    eprintln!("tidy: {rate:.2} closures bound by `let` in 1,000 lines");
    if rate <= MOST {
        return Ok(Vec::new());
    }
    let mut complaints = vec![format!(
        "{rate:.2} closures bound by `let` in 1,000 lines, not {MOST}: use functions"
    )];
    of_files.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
    for (count, file) in of_files.iter().take(10).filter(|(count, _)| *count > 0) {
        complaints.push(format!("{}: {count} closures bound by `let`", file.display()));
    }
    Ok(complaints)
}

/// Returns the number of closures, and of references to closures, that a source binds by `let`.
fn bound_closures(source: &str) -> usize {
    let mut count = 0;
    let mut lines = source.lines().map(str::trim).peekable();
    while let Some(line) = lines.next() {
        if !line.starts_with("let ") {
            continue;
        }
        let value = match line.split_once(" = ") {
            Some((_, value)) => value,
            // A long closure stands on the next line.
            None if line.ends_with(" =") => lines.peek().copied().unwrap_or_default(),
            None => continue,
        };
        let value = value.strip_prefix('&').unwrap_or(value);
        let value = value.strip_prefix("mut ").unwrap_or(value);
        let value = value.strip_prefix("move ").unwrap_or(value);
        count += usize::from(value.starts_with('|'));
    }
    count
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use tempfile::TempDir;

    use super::*;

    /// A workspace with these files.
    fn workspace_with(folder: &TempDir, files: &[(&str, String)]) -> Workspace {
        let workspace = Workspace::at(folder.path());
        for (path, text) in files {
            workspace.write(path, text).expect("the folder takes files");
        }
        let status = Command::new("git").arg("init").arg("-q").current_dir(folder.path()).status();
        assert!(status.expect("git is there").success());
        workspace
    }

    /// A source of this many lines, the first of which bind closures.
    fn source_of(closures: usize, lines: usize) -> String {
        "    let twice = |x| 2 * x;\n".repeat(closures) + &"\n".repeat(lines - closures)
    }

    #[test]
    fn closures_are_counted_in_each_form_and_other_values_are_not() {
        for (source, count) in [
            ("    let twice = |x| 2 * x;\n", 1),
            ("let mut add = move |x: u8| all.push(x);\nlet read = || 3;\n", 2),
            ("let twice: Twice =\n    |x| 2 * x;\n", 1),
            ("let tell = &mut |part| show(part);\nlet ask = &|| 3;\n", 2),
            ("let all = parts.iter().map(|x| 2 * x);\n", 0),
            ("let either = is_one || is_other;\nlet either =\n    is_one || is_other;\n", 0),
            ("if let Some(x) = y || z {}\n// let twice = |x| 2 * x;\n", 0),
        ] {
            assert_eq!(bound_closures(source), count, "{source}");
        }
    }

    #[test]
    fn few_closures_are_let_go_wherever_they_are() {
        let folder = tempfile::tempdir().expect("a folder");
        let files = [
            ("crates/a/src/lib.rs", source_of(2, 400)),
            ("plugins/b/src/lib.rs", source_of(0, 600)),
            ("tools/c.rs", source_of(50, 50)),
            ("benches/d.md", source_of(50, 50)),
        ];
        let workspace = workspace_with(&folder, &files);
        assert_eq!(check(&workspace).expect("files that can be read"), [""; 0]);
    }

    #[test]
    fn many_closures_are_told_with_the_ten_worst_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let names: Vec<String> = (1..=12).map(|at| format!("bridges/a/src/b{at:02}.rs")).collect();
        let files = (1..).zip(&names).map(|(count, name)| (name.as_str(), source_of(count, 100)));
        let mut files: Vec<(&str, String)> = files.collect();
        files.push(("examples/c.rs", source_of(0, 400)));
        let workspace = workspace_with(&folder, &files);
        let complaints = check(&workspace).expect("files that can be read");
        // 78 closures in 1,600 lines.
        assert!(complaints[0].starts_with("48.75 closures bound by `let`"), "{complaints:?}");
        assert_eq!(complaints.len(), 11, "{complaints:?}");
        assert_eq!(complaints[1], "bridges/a/src/b12.rs: 12 closures bound by `let`");
        assert_eq!(complaints[10], "bridges/a/src/b03.rs: 3 closures bound by `let`");
    }
}
