//! The tables of settings in the user page have the defaults and ceilings of the code.

#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fs;
use std::path::Path;

use schemars::schema_for;
use tagalong_following::{CollisionMonitorSettings, CommandLimiterSettings, RobotSettings};

/// A row of a table, with the title of each of its cells.
type Row<'a> = Vec<(&'a str, &'a str)>;

/// Returns the rows of those tables of a page that have a column `default`.
fn rows(page: &str) -> Vec<Row<'_>> {
    let mut rows = Vec::new();
    let mut titles: Option<Vec<&str>> = None;
    for line in page.lines() {
        if !line.starts_with('|') {
            titles = None;
            continue;
        }
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        match &titles {
            None => titles = Some(cells),
            Some(titles) if titles.contains(&"default") && !cells[0].starts_with("---") => {
                rows.push(titles.iter().copied().zip(cells).collect());
            }
            Some(_) => {}
        }
    }
    rows
}

/// Returns what stands in backticks.
fn quoted(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}

/// Returns the numbers of a cell, without their units and without what stands in parentheses.
fn numbers(cell: &str) -> Vec<f64> {
    let outside = cell.split_once(" (").map_or(cell.to_owned(), |(before, after)| {
        format!("{before}{}", after.split_once(')').unwrap().1)
    });
    outside.split(", ").filter_map(|part| part.split(' ').next().unwrap().parse().ok()).collect()
}

#[test]
fn tables_of_settings_have_the_defaults_and_ceilings_of_the_code() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/systems/following.md");
    let page = fs::read_to_string(page).unwrap();
    let schemas = [
        schema_for!(RobotSettings).to_value(),
        schema_for!(CommandLimiterSettings).to_value(),
        schema_for!(CollisionMonitorSettings).to_value(),
    ];
    let mut compared = 0;
    for row in rows(&page) {
        let keys: Vec<&str> = quoted(row[0].1).filter(|key| !key.starts_with('[')).collect();
        for (title, cell) in &row[1..] {
            // Names of the schema by titles of the page; the other columns are sentences.
            let name = match *title {
                "default" => "default",
                "ceiling" => "maximum",
                _ => continue,
            };
            for (at, key) in keys.iter().enumerate() {
                let property = schemas.iter().find_map(|schema| schema["properties"].get(key));
                let property = property.unwrap_or_else(|| panic!("no setting is called `{key}`"));
                let value = &property[name];
                // The footprint has a shape in words, and further sensors have none.
                if value.is_array() {
                    continue;
                }
                compared += 1;
                if let Some(number) = value.as_f64() {
                    assert_eq!(numbers(cell).get(at).copied(), Some(number), "{key}: {cell}");
                } else {
                    let word = value.to_string();
                    let word = word.trim_matches('"');
                    assert_eq!(quoted(cell).nth(at).or(Some(*cell)), Some(word), "{key}: {cell}");
                }
            }
        }
    }
    assert!(compared >= 40, "only {compared} figures were compared");
}
