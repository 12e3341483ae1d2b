//! Figures in sentences, taken from tables.
//!
//! `<!-- figure: PAGE; ROW; COLUMN -->` and `<!-- end -->` enclose the figure in this column of the first
//! row of PAGE that begins so, and has such a column. An empty PAGE is the page itself. An interval is
//! left out, but for a ROW that ends in `[]`, as in `crossing: depth-ekf []`.

use std::path::Path;

use anyhow::{Context as _, Result};

use crate::accuracy::cells;
use crate::workspace::Workspace;

const BEGIN: &str = "<!-- figure: ";
const END: &str = "<!-- end -->";

/// Ending of a row of which the interval is wanted, too.
const WITH_INTERVAL: &str = "[]";

/// Returns true if a page has figures in sentences.
pub fn are_in(text: &str) -> bool {
    text.contains(BEGIN)
}

/// Returns the text of a page with the figures in its sentences filled.
pub fn filled(workspace: &Workspace, path: &Path, text: &str) -> Result<String> {
    let mut out = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once(BEGIN) {
        let (source, body) = after.split_once(" -->").context("a figure has no `-->`")?;
        let (_, next) =
            body.split_once(END).with_context(|| format!("`{source}` has no `{END}`"))?;
        let figure = printed(workspace, text, source)
            .with_context(|| format!("in {}: the figure `{source}`", path.display()))?;
        out += &format!("{before}{BEGIN}{source} -->{figure}{END}");
        rest = next;
    }
    Ok(out + rest)
}

fn printed(workspace: &Workspace, own: &str, source: &str) -> Result<String> {
    let mut parts = source.splitn(3, ';').map(str::trim);
    let page = parts.next().unwrap_or_default();
    let row = parts.next().context("a figure names a page, a row and a column")?;
    let column = parts.next().context("a figure names a page, a row and a column")?;
    if page.is_empty() {
        return figure(own, row, column);
    }
    figure(&workspace.read(page)?, row, column)
}

/// Returns the figure of a page in a row and a column.
fn figure(page: &str, row: &str, column: &str) -> Result<String> {
    let name = row.strip_suffix(WITH_INTERVAL).map_or(row, str::trim_end);
    let cell = cell(page, name, column)
        .with_context(|| format!("no row `{name}` of a table with a column `{column}`"))?;
    let whole = cell.trim_matches('*');
    // "45.1 [33.6, 56.6]"
    let alone = whole.split_once(" [").map_or(whole, |(figure, _)| figure);
    Ok(if name == row { alone } else { whole }.to_owned())
}

/// Returns the cell of the first table that has both the row and the column.
fn cell<'a>(page: &'a str, name: &str, column: &str) -> Option<&'a str> {
    let mut head: Option<Vec<&str>> = None;
    for line in page.lines() {
        if !line.starts_with('|') {
            head = None;
            continue;
        }
        let cells = cells(line);
        let Some(titles) = &head else {
            head = Some(cells);
            continue;
        };
        if cells.first() == Some(&name)
            && let Some(at) = titles.iter().position(|title| *title == column)
        {
            return cells.get(at).copied();
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "|  | kept, % |\n| --- | --- |\n| b | 45.1 [33.6, 56.6] |\n\ntext\n\n\
                        |  | rate |\n| --- | --- |\n| b | **7** |\n";

    #[test]
    fn a_figure_is_that_of_the_first_table_with_row_and_column() {
        assert_eq!(figure(PAGE, "b", "kept, %").unwrap(), "45.1");
        assert_eq!(figure(PAGE, "b []", "kept, %").unwrap(), "45.1 [33.6, 56.6]");
        assert_eq!(figure(PAGE, "b", "rate").unwrap(), "7");
        let error = figure(PAGE, "c", "rate").unwrap_err().to_string();
        assert!(error.contains("no row `c`"), "{error}");
        assert!(figure(PAGE, "b", "time").is_err());
    }

    #[test]
    fn stale_figures_are_filled_and_the_rest_is_left() {
        let here = Workspace::at(std::env::temp_dir());
        let text = format!("kept <!-- figure: ; b; rate -->9<!-- end --> times.\n\n{PAGE}");
        let now = filled(&here, Path::new("p.md"), &text).unwrap();
        assert!(now.starts_with("kept <!-- figure: ; b; rate -->7<!-- end --> times.\n"), "{now}");
        assert_eq!(filled(&here, Path::new("p.md"), &now).unwrap(), now);
        let broken = "<!-- figure: ; b -->9<!-- end -->";
        assert!(filled(&here, Path::new("p.md"), broken).is_err());
    }
}
