//! Parts of the documents that a command prints.
//!
//! Between `<!-- begin: tagalong ... -->` and `<!-- end -->` stands the output of that command, and
//! likewise that of `cargo xtask faults`. `<!-- begin: excerpt PAGE TITLE -->` repeats the table of
//! another page that is titled so, in bold, with its notes, and `<!-- begin: rows PAGE ROW; ROW -->`
//! repeats the rows of tables of another page that begin so, below their head.
//! `<!-- begin: accuracy PAGE NAME NAME -->` prints pipelines as shipped beside left out.
//! `<!-- begin: source FILE -->` repeats a file of code, such as an example, without the comment at its
//! head, and `<!-- begin: source FILE NAME -->` one function of it. Figures in sentences are those of
//! [`sentences`].
//! `cargo xtask docs` fills these parts, and `cargo xtask tidy` complains about those that have
//! become stale. Slow parts, the tables of `tagalong-papers`, `follow` and `bench`, are filled only on
//! request, and their sources are noted (see [`figures`]).

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};

use crate::accuracy;
use crate::faults;
use crate::figures::{self, Part};
use crate::program::{Name, Program};
use crate::sentences;
use crate::workspace::{Workspace, output};

const BEGIN: &str = "<!-- begin: ";
const END: &str = "<!-- end -->";

/// Beginning of a command that repeats a table of another page.
const EXCERPT: &str = "excerpt ";

/// Beginning of a command that repeats rows of the tables of another page.
const ROWS: &str = "rows ";

/// Beginning of a command that prints pipelines as shipped beside left out, from a page and by names.
const ACCURACY: &str = "accuracy ";

/// Title of the table with both.
const LEFT_OUT_TABLE: &str =
    "Chosen without the room that is scored, and with all: means over the rooms";

/// Beginning of a command that repeats code.
const SOURCE: &str = "source ";

/// Commands that take minutes to hours.
const SLOW: &[&str] = &["tagalong-papers", "tagalong follow", "tagalong bench", "tagalong trials"];

/// A document with parts to fill.
struct Document {
    path: PathBuf,
    text: String,
}

/// Fills the parts whose command contains `slow`, or those that are fast.
pub fn fill(workspace: &Workspace, slow: Option<&str>) -> Result<()> {
    let mut programs = Programs::default();
    for document in documents(workspace)? {
        let filled = filled(
            &document.text,
            |command| slow.map_or(!is_slow(command), |part| command.contains(part)),
            |command| printed(workspace, &mut programs, command),
        )
        .with_context(|| format!("in {}", document.path.display()))?;
        let filled = sentences::filled(workspace, &document.path, &filled)?;
        if filled != document.text {
            workspace.write(&document.path, &filled)?;
            eprintln!("docs: {} is filled anew", document.path.display());
        }
    }
    if let Some(part) = slow {
        let all = slow_parts(workspace)?;
        figures::note(workspace, &all, |one| one.command.contains(part))?;
    }
    Ok(())
}

/// Fills the figures in sentences of all documents, and runs no command.
pub fn fill_sentences(workspace: &Workspace) -> Result<()> {
    for document in documents(workspace)? {
        let filled = sentences::filled(workspace, &document.path, &document.text)?;
        if filled != document.text {
            workspace.write(&document.path, &filled)?;
            eprintln!("docs: {} is filled anew", document.path.display());
        }
    }
    Ok(())
}

/// Fills the one part whose command contains `part` with a file that the command printed elsewhere.
pub fn fill_from(workspace: &Workspace, part: &str, file: &Path) -> Result<()> {
    let text = fs::read_to_string(file).with_context(|| file.display().to_string())?;
    ensure!(text.contains("| --- |"), "{} has no table", file.display());
    let all = slow_parts(workspace)?;
    let commands: BTreeSet<&str> =
        all.iter().map(|one| one.command.as_str()).filter(|it| it.contains(part)).collect();
    let named: Vec<&str> = commands.into_iter().collect();
    ensure!(
        named.len() == 1,
        "`{part}` is in {} commands, and one is to be filled: {}",
        named.len(),
        named.join("; ")
    );
    for document in documents(workspace)? {
        let filled =
            filled(&document.text, |command| command == named[0], |_| Ok(text.trim().to_owned()))?;
        if filled != document.text {
            workspace.write(&document.path, &filled)?;
            eprintln!("docs: {} is filled from {}", document.path.display(), file.display());
        }
    }
    figures::note(workspace, &slow_parts(workspace)?, |one| one.command == named[0])
}

/// Prints a line for each slow table that is older than its sources.
pub fn list_stale_tables(workspace: &Workspace) -> Result<()> {
    let stale = stale_tables(workspace)?;
    for sentence in &stale {
        eprintln!("docs: {sentence}");
    }
    eprintln!("docs: {} tables are older than their sources", stale.len());
    Ok(())
}

/// Returns a sentence for each slow table that is older than its sources.
pub fn stale_tables(workspace: &Workspace) -> Result<Vec<String>> {
    figures::stale(workspace, &slow_parts(workspace)?)
}

/// Returns the slow parts of all documents.
fn slow_parts(workspace: &Workspace) -> Result<Vec<Part>> {
    let mut parts = Vec::new();
    for document in documents(workspace)? {
        let page = document.path.to_string_lossy();
        for after in document.text.split(BEGIN).skip(1) {
            let Some((command, body)) = after.split_once(" -->") else { continue };
            let Some((table, _)) = body.split_once(END) else { continue };
            if is_slow(command) {
                let page = page.clone().into_owned();
                parts.push(Part { page, command: command.to_owned(), table: table.to_owned() });
            }
        }
    }
    Ok(parts)
}

/// Complains about fast parts that are stale.
pub fn stale(workspace: &Workspace) -> Result<Vec<String>> {
    // Slow parts are compared only when they are filled.
    fn wanted(command: &str) -> bool {
        !is_slow(command)
    }

    let mut complaints = Vec::new();
    let mut programs = Programs::default();
    for document in documents(workspace)? {
        let filled =
            filled(&document.text, wanted, |command| printed(workspace, &mut programs, command))
                .with_context(|| format!("in {}", document.path.display()))?;
        let filled = sentences::filled(workspace, &document.path, &filled)?;
        if filled != document.text {
            let name = document.path.display();
            complaints.push(format!(
                "{name} is not what the commands in it print: run `cargo xtask docs`"
            ));
        }
    }
    Ok(complaints)
}

fn is_slow(command: &str) -> bool {
    SLOW.iter().any(|slow| command.starts_with(slow))
}

fn documents(workspace: &Workspace) -> Result<Vec<Document>> {
    let files = workspace.files()?.into_iter();
    let markdown = files.filter(|path| path.extension().is_some_and(|e| e == "md"));
    let read = markdown.map(|path| Ok(Document { text: workspace.read(&path)?, path }));
    let all: Vec<Document> = read.collect::<Result<_>>()?;
    Ok(all.into_iter().filter(|document| has_parts(&document.text)).collect())
}

fn has_parts(text: &str) -> bool {
    text.contains(BEGIN) || sentences::are_in(text)
}

/// The text with the wanted parts filled.
fn filled(
    text: &str,
    wanted: impl Fn(&str) -> bool,
    mut print: impl FnMut(&str) -> Result<String>,
) -> Result<String> {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once(BEGIN) {
        let (command, body) = after.split_once(" -->").context("a part has no `-->`")?;
        let (old, next) =
            body.split_once(END).with_context(|| format!("`{command}` has no `{END}`"))?;
        out += &format!("{before}{BEGIN}{command} -->");
        out += &if wanted(command) {
            format!("\n\n{}\n\n", print(command)?.trim())
        } else {
            old.to_owned()
        };
        out += END;
        rest = next;
    }
    Ok(out + rest)
}

/// Returns the table of a page that is titled so, with its notes.
fn titled(text: &str, page: &str, title: &str) -> Result<String> {
    excerpt(text, title).with_context(|| format!("{page} has no table `{title}`"))
}

/// Returns the table of a page that has this title, in bold, and everything up to the next title.
fn excerpt(page: &str, title: &str) -> Option<String> {
    let bold = format!("**{title}**");
    let mut lines = page.lines().skip_while(|line| *line != bold);
    let first = lines.next()?;
    let rest: Vec<&str> = lines.take_while(|line| !ends_excerpt(line)).collect();
    Some(format!("{first}\n{}\n", rest.join("\n")))
}

/// Returns true for a line with the next title, a heading or a marker.
fn ends_excerpt(line: &str) -> bool {
    ["**", "#", "<!--"].iter().any(|mark| line.starts_with(mark))
}

/// Returns the rows of a page with these first cells, each the first of its kind, below the head that
/// their tables have in common.
fn rows(page: &str, names: &str) -> Result<String> {
    let lines: Vec<&str> = page.lines().collect();
    let mut table: Vec<&str> = Vec::new();
    for name in names.split(';') {
        let begin = format!("| {} |", name.trim());
        let at = lines.iter().position(|line| line.starts_with(&begin));
        let at = at.with_context(|| format!("no row `{}`", name.trim()))?;
        let head = head_above(&lines[..at]);
        if table.is_empty() {
            table.extend(head);
        } else if !table.starts_with(head) {
            bail!("the table of the row `{}` has another head", name.trim());
        }
        table.push(lines[at]);
    }
    Ok(table.join("\n"))
}

/// Returns the first two lines of the table that these lines end in: titles and rule.
fn head_above<'a, 'b>(lines: &'a [&'b str]) -> &'a [&'b str] {
    let before = lines.iter().rposition(|line| !line.starts_with('|'));
    let table = &lines[before.map_or(0, |at| at + 1)..];
    &table[..table.len().min(2)]
}

/// Returns a file of code without the comment at its head, or one function of it, in a fence.
fn code(file: &str, text: &str, function: &str) -> Option<String> {
    // A documentation test of Rust compiles the block, and does not look for the log that it reads.
    let language = match file.rsplit('.').next()? {
        "rs" => "rust,no_run",
        "py" => "python",
        other => other,
    };
    let body = text.lines().skip_while(|line| is_head(line));
    let lines: Vec<&str> = if function.is_empty() {
        body.collect()
    } else {
        let begin = format!("fn {function}(");
        let head = body.clone().take_while(|line| line.starts_with("use ") || line.is_empty());
        let inner = body.skip_while(|line| !line.starts_with(&begin));
        let mut lines: Vec<&str> = head.collect();
        let before = lines.len();
        for line in inner {
            lines.push(line);
            if line == "}" {
                break;
            }
        }
        if lines.len() == before {
            return None;
        }
        lines
    };
    Some(format!("```{language}\n{}\n```", lines.join("\n").trim()))
}

/// Returns true for a line of the comment or of the lint attributes at the head of a file.
fn is_head(line: &str) -> bool {
    let is_attribute = line.starts_with("#![") || line.is_empty();
    is_attribute || line.starts_with("//! ") || line.starts_with("# ")
}

/// Returns the output of the command, with the program of this workspace; the table of faults is
/// this program's own.
fn printed(workspace: &Workspace, programs: &mut Programs, command: &str) -> Result<String> {
    if let Some(rows) = command.strip_prefix(faults::COMMAND) {
        return faults::markdown(workspace, &rows.split_whitespace().collect::<Vec<_>>());
    }
    if let Some(source) = command.strip_prefix(EXCERPT) {
        let (page, title) =
            source.split_once(' ').context("an excerpt names a page and a title")?;
        return titled(&workspace.read(page)?, page, title);
    }
    if let Some(source) = command.strip_prefix(ACCURACY) {
        let (page, names) =
            source.split_once(' ').context("accuracy names a page and pipelines")?;
        let text = workspace.read(page)?;
        let first = names.split_whitespace().next().unwrap_or_default();
        // Pipelines may stand in several such tables, by the number of settings that were tried.
        let mut means = titled(&text, page, LEFT_OUT_TABLE)?;
        for later in text.split(&format!("**{LEFT_OUT_TABLE}**")).skip(2) {
            means += &later
                .lines()
                .take_while(|line| !ends_excerpt(line))
                .collect::<Vec<_>>()
                .join("\n");
        }
        let rows = accuracy::markdown(&means, names).with_context(|| format!("in {page}"))?;
        let sentence = accuracy::sentence(first, &means, &titled(&text, page, first)?)
            .with_context(|| format!("in {page}"))?;
        return Ok(format!("{rows}\n{sentence}\n"));
    }
    if let Some(source) = command.strip_prefix(ROWS) {
        let (page, names) = source.split_once(' ').context("rows name a page and a row")?;
        return rows(&workspace.read(page)?, names).with_context(|| format!("in {page}"));
    }
    if let Some(source) = command.strip_prefix(SOURCE) {
        let (file, name) = source.split_once(' ').unwrap_or((source, ""));
        return code(file, &workspace.read(file)?, name)
            .with_context(|| format!("{file} has no function `{name}`"));
    }
    let mut words = command.split_whitespace();
    let first = words.next().unwrap_or_default();
    let Some(program) = Name::ALL.into_iter().find(|name| name.as_str() == first) else {
        bail!("`{command}` is no command of tagalong or tagalong-papers");
    };
    // Figures of slow commands take hours without optimisation.
    let program = programs.built(workspace, program, is_slow(command))?;
    output(program.call(&[]).args(words).current_dir(workspace.root()))
}

/// Programs that print parts of documents.
#[derive(Default)]
struct Programs(Vec<Built>);

/// A program that was built.
struct Built {
    name: Name,
    is_optimised: bool,
    program: Program,
}

impl Programs {
    /// Returns a program, which is built on the first use.
    fn built(&mut self, workspace: &Workspace, name: Name, is_optimised: bool) -> Result<&Program> {
        let known = self.0.iter().position(|it| it.name == name && it.is_optimised == is_optimised);
        let at = known.unwrap_or(self.0.len());
        if known.is_none() {
            let program = if is_optimised {
                Program::optimised(workspace, name)?
            } else {
                Program::built(workspace, name)?
            };
            self.0.push(Built { name, is_optimised, program });
        }
        Ok(&self.0[at].program)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "a\n<!-- begin: tagalong list -->\nold\n<!-- end -->\nb\n\
                        <!-- begin: tagalong-papers reproduce x -->\ntable\n<!-- end -->\nc\n";

    #[test]
    fn fast_parts_are_filled_and_slow_ones_left() {
        let out = filled(TEXT, |command| !is_slow(command), print_name).unwrap();
        assert!(
            out.contains("<!-- begin: tagalong list -->\n\n[tagalong list]\n\n<!-- end -->\nb")
        );
        assert!(out.contains("\ntable\n") && out.ends_with("c\n"), "{out}");
        assert_eq!(filled(&out, |command| !is_slow(command), print_name).unwrap(), out);
    }

    /// The name of a command as that which it prints.
    fn print_name(command: &str) -> Result<String> {
        Ok(format!("[{command}]\n"))
    }

    #[test]
    fn code_is_repeated_without_the_comment_at_its_head() {
        let text = "//! An example.\n#![allow(x)]\n\nuse a::b;\n\nfn main() {\n    f();\n}\n\nfn f() {\n}\n";
        let whole = code("x/y.rs", text, "").unwrap();
        assert!(whole.starts_with("```rust,no_run\nuse a::b;\n\nfn main() {"), "{whole}");
        assert!(whole.ends_with("fn f() {\n}\n```"), "{whole}");
        let one = code("x/y.rs", text, "main").unwrap();
        assert_eq!(one, "```rust,no_run\nuse a::b;\n\nfn main() {\n    f();\n}\n```");
        assert_eq!(code("x/y.rs", text, "g"), None);
    }

    #[test]
    fn an_excerpt_is_one_table_with_its_notes() {
        let page =
            "# a\n\n**first**\n\n| 1 |\n\n**second**\n\n| 2 |\n\n* note\n\n<!-- end -->\n| 3 |\n";
        let second = excerpt(page, "second").unwrap();
        assert_eq!(second.trim(), "**second**\n\n| 2 |\n\n* note");
        assert_eq!(excerpt(page, "first").unwrap().trim(), "**first**\n\n| 1 |");
        assert_eq!(excerpt(page, "third"), None);
    }

    #[test]
    fn rows_of_several_tables_stand_below_one_head() {
        let page = "# a\n\n|  | m |\n| --- | --- |\n| b 1 | 1 |\n| all: b | 2 |\n\ntext\n\n\
                    |  | m |\n| --- | --- |\n| all: c | 3 |\n| all: b | 4 |\n\n\
                    |  | s |\n| --- | --- |\n| all: d | 5 |\n";
        let both = rows(page, "all: b; all: c").unwrap();
        assert_eq!(both, "|  | m |\n| --- | --- |\n| all: b | 2 |\n| all: c | 3 |");
        assert!(rows(page, "all").unwrap_err().to_string().contains("no row `all`"));
        let error = rows(page, "all: b; all: d").unwrap_err().to_string();
        assert!(error.contains("`all: d` has another head"), "{error}");
    }

    #[test]
    fn a_part_without_an_end_is_an_error() {
        assert!(
            filled("<!-- begin: tagalong list -->\nold\n", |_| true, |_| Ok(String::new()))
                .is_err()
        );
    }
}
