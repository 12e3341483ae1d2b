//! Figures in sentences, taken from tables and from cards of models.
//!
//! `<!-- figure: PAGE; ROW; COLUMN -->` and `<!-- end -->` enclose the figure in this column of the first
//! row of PAGE that begins so, and has such a column. An empty PAGE is the page itself, and `PAGE#TITLE`
//! the tables below that title, a heading or a line in bold. `ROW & ROW` are the first two cells of a row
//! whose first one stands in several. An interval is left out, but for a ROW that ends in `[]`, as in
//! `crossing: depth-ekf []`. A fourth part is the number of digits after the point, as in `; 2`, or that
//! of a share in percent, as in `; 1 %`. Where PAGE is a file in TOML, ROW is a table of it and COLUMN a
//! key.

use std::path::Path;

use anyhow::{Context as _, Result, bail, ensure};

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
    let mut parts = source.split(';').map(str::trim);
    let page = parts.next().unwrap_or_default();
    let row = parts.next().context("a figure names a page, a row and a column")?;
    let column = parts.next().context("a figure names a page, a row and a column")?;
    let form = parts.next();
    ensure!(parts.next().is_none(), "a figure has at most four parts");
    let (file, title) = page.split_once('#').unwrap_or((page, ""));
    let text = if file.is_empty() { own } else { &workspace.read(file)? };
    let cell = if file.ends_with(".toml") {
        value(text, row, column)?
    } else {
        figure(below(text, title)?, row, column)?
    };
    match form {
        None => Ok(cell),
        Some(form) => rounded(&cell, form),
    }
}

/// Level of a line in bold: it is below all headings.
const BOLD: usize = 7;

/// A heading, or a line that is all in bold.
struct Title<'a> {
    level: usize,
    text: &'a str,
}

/// Returns the part of a page below a title, up to the next one of the same level or a higher one.
fn below<'a>(page: &'a str, title: &str) -> Result<&'a str> {
    if title.is_empty() {
        return Ok(page);
    }
    let mut part: Option<(usize, usize)> = None;
    let mut at = 0;
    for line in page.split_inclusive('\n') {
        let here = title_of(line);
        match (part, here) {
            (Some((level, begin)), Some(next)) if next.level <= level => {
                return Ok(&page[begin..at]);
            }
            (None, Some(here)) if here.text == title => part = Some((here.level, at)),
            _ => {}
        }
        at += line.len();
    }
    let (_, begin) = part.with_context(|| format!("no title `{title}`"))?;
    Ok(&page[begin..])
}

/// Returns the title that a line is.
fn title_of(line: &str) -> Option<Title<'_>> {
    let line = line.trim_end();
    let heading = line.trim_start_matches('#');
    let level = line.len() - heading.len();
    if level > 0 {
        return heading.strip_prefix(' ').map(|text| Title { level, text });
    }
    let text = line.strip_prefix("**")?.strip_suffix("**")?;
    Some(Title { level: BOLD, text })
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
    let begins: Vec<&str> = name.split(" & ").collect();
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
        if cells.starts_with(&begins)
            && let Some(at) = titles.iter().position(|title| *title == column)
        {
            return cells.get(at).copied();
        }
    }
    None
}

/// Returns a value of a file in TOML: the keys of its tables are joined by dots, and the place in a
/// list is a number.
fn value(text: &str, table: &str, key: &str) -> Result<String> {
    let root: toml::Value = toml::from_str(text).context("it is no TOML")?;
    let mut here = Some(&root);
    for name in table.split('.').filter(|name| !name.is_empty()).chain([key]) {
        here = here.and_then(|value| match name.parse::<usize>() {
            Ok(place) => value.get(place),
            Err(_) => value.get(name),
        });
    }
    let value = here.with_context(|| format!("no key `{key}` in the table `{table}`"))?;
    match value {
        toml::Value::Table(_) | toml::Value::Array(_) => bail!("`{key}` is no figure"),
        figure => Ok(figure.to_string()),
    }
}

/// Returns a figure with so many digits after the point, or a share in percent with so many.
fn rounded(figure: &str, form: &str) -> Result<String> {
    let (digits, factor) = match form.strip_suffix('%') {
        Some(digits) => (digits.trim_end(), 1e2),
        None => (form, 1.0),
    };
    let digits: usize = digits.parse().with_context(|| format!("`{form}` is no form"))?;
    let value: f64 = figure.parse().with_context(|| format!("`{figure}` is no number"))?;
    Ok(format!("{:.digits$}", factor * value))
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

    const SEVERAL: &str = "# a\n\n**early**\n\n|  |  | kept |\n| --- | --- | --- |\n| um | b | 0.125 |\n\
                           | um | c | 2.5 |\n\n## late\n\n|  |  | kept |\n| --- | --- | --- |\n| um | c | 3.5 |\n\
                           | fil | c | 4.5 |\n";

    fn print(source: &str) -> Result<String> {
        printed(&Workspace::at(std::env::temp_dir()), SEVERAL, source)
    }

    #[test]
    fn a_title_and_two_cells_choose_among_rows_alike() {
        assert_eq!(print("; um; kept").unwrap(), "0.125");
        assert_eq!(print("; um & c; kept").unwrap(), "2.5");
        assert_eq!(print("#late; um & c; kept").unwrap(), "3.5");
        assert!(print("#early; um & d; kept").is_err());
        assert!(print("#early; fil; kept").is_err(), "it is below the next title");
        assert_eq!(print("#a; um & c; kept").unwrap(), "2.5", "a heading has the titles below it");
        let other = print("#late; um & b; kept").unwrap_err().to_string();
        assert!(other.contains("no row `um & b`"), "{other}");
        let unknown = print("#later; um; kept").unwrap_err().to_string();
        assert!(unknown.contains("no title `later`"), "{unknown}");
    }

    #[test]
    fn figures_are_rounded_and_shares_are_percents() {
        assert_eq!(print("; um; kept; 2").unwrap(), "0.12");
        assert_eq!(print("; um; kept; 1 %").unwrap(), "12.5");
        assert_eq!(print("; um & c; kept; 0 %").unwrap(), "250");
        assert!(print("; um; kept; many").is_err());
        assert!(print("; um; kept; 1; 2").is_err());
        assert!(rounded("-", "1").is_err());
    }

    #[test]
    fn a_figure_of_a_card_is_a_key_of_a_table() {
        let card = "seed = 3\n[held.false]\ncount = 265\nof = 314\n[[rounds]]\nloss = 0.25\n";
        assert_eq!(value(card, "held.false", "count").unwrap(), "265");
        assert_eq!(value(card, "rounds.0", "loss").unwrap(), "0.25");
        assert_eq!(value(card, "", "seed").unwrap(), "3");
        let error = value(card, "held.right", "count").unwrap_err().to_string();
        assert!(error.contains("no key `count` in the table `held.right`"), "{error}");
        assert!(value(card, "held", "false").is_err());
    }
}
