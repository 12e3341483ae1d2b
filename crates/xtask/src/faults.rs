//! The table of faults, each with the tests that cover it.

use std::collections::BTreeSet;

use anyhow::{Context as _, Result};
use serde::Deserialize;

use crate::workspace::Workspace;

const TABLE: &str = "crates/xtask/src/faults.toml";

/// Begins the lines of documents that this table fills.
pub const COMMAND: &str = "cargo xtask faults";

#[derive(Deserialize)]
struct Table {
    row: Vec<Row>,
}

#[derive(Deserialize)]
struct Row {
    id: String,
    fault: String,
    result: String,
    /// `file: name` of each test.
    tests: Vec<String>,
}

fn table(workspace: &Workspace) -> Result<Table> {
    toml::from_str(&workspace.read(TABLE)?).with_context(|| format!("in {TABLE}"))
}

/// Returns the table as Markdown; with `prefixes`, the rows whose names begin with one of them.
///
/// # Errors
/// A table that cannot be read.
pub fn markdown(workspace: &Workspace, prefixes: &[&str]) -> Result<String> {
    let mut out = "| | fault | result | tests |\n|---|---|---|---|\n".to_owned();
    for Row { id, fault, result, tests } in &table(workspace)?.row {
        if !prefixes.is_empty() && !prefixes.iter().any(|prefix| id.starts_with(prefix)) {
            continue;
        }
        let tests: Vec<String> = tests.iter().map(|test| shown(test)).collect();
        out += &format!("| {id} | {fault} | {result} | {} |\n", tests.join("; "));
    }
    Ok(out)
}

fn shown(test: &str) -> String {
    match test.split_once(": ") {
        Some((file, name)) => format!("`{name}` (`{file}`)"),
        None => test.to_owned(),
    }
}

/// Complains about rows without a test, and about tests that do not exist.
///
/// # Errors
/// A table that cannot be read.
pub fn check(workspace: &Workspace) -> Result<Vec<String>> {
    Ok(complaints(&table(workspace)?, |file: &str| workspace.read(file).ok()))
}

fn complaints(table: &Table, read: impl Fn(&str) -> Option<String>) -> Vec<String> {
    let mut known = BTreeSet::new();
    let mut complaints = Vec::new();
    for Row { id, tests, .. } in &table.row {
        if !known.insert(id) {
            complaints.push(format!("{TABLE}: {id} is there twice"));
        }
        if tests.is_empty() {
            complaints.push(format!("{TABLE}: {id} has no test"));
        }
        for test in tests.iter().filter(|test| exists(test, &read) != Some(true)) {
            complaints.push(format!("{TABLE}: {id}: there is no test `{test}`"));
        }
    }
    complaints
}

/// Reason of tests that the command for all tests leaves out and `.ci/run` has beside the lints.
const RUN_BY_CI: &str = "#[ignore = \"waits for messages";

/// Returns true if the file has a test of that name which is not switched off; nothing where there
/// is no such function.
fn exists(test: &str, read: impl Fn(&str) -> Option<String>) -> Option<bool> {
    let (file, name) = test.split_once(": ")?;
    let text = read(file)?;
    let at = text.find(&format!("fn {name}("))?;
    // The attributes stand between the last blank line or brace, and the name.
    let before = text[..at].rsplit("\n\n").next()?;
    let runs = !before.contains("#[ignore") || before.contains(RUN_BY_CI);
    Some(before.contains("#[test]") && runs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table_of(tests: &[&str]) -> Table {
        let row = Row {
            id: "F1".into(),
            fault: "a fault".into(),
            result: "a result".into(),
            tests: tests.iter().map(|test| (*test).to_owned()).collect(),
        };
        Table { row: vec![row] }
    }

    /// The number of complaints on a table, where there is one file of source.
    fn complaints_on(table: &Table) -> usize {
        let source =
            "fn helper() {}\n\n#[test]\nfn it_works() {}\n\n#[test]\n#[ignore]\nfn off() {}\n";
        complaints(table, |file| (file == "a.rs").then(|| source.to_owned())).len()
    }

    #[test]
    fn a_row_needs_tests_that_are_there() {
        assert_eq!(complaints_on(&table_of(&["a.rs: it_works"])), 0);
        assert_eq!(complaints_on(&table_of(&[])), 1);
        for none in ["a.rs: helper", "a.rs: off", "a.rs: gone", "b.rs: it_works", "it_works"] {
            assert_eq!(complaints_on(&table_of(&["a.rs: it_works", none])), 1, "{none}");
        }
        let twice = Table {
            row: [table_of(&["a.rs: it_works"]).row, table_of(&["a.rs: it_works"]).row]
                .into_iter()
                .flatten()
                .collect(),
        };
        assert_eq!(complaints_on(&twice), 1);
    }
}
