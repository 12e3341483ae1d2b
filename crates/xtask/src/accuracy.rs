//! The table of pipelines as shipped and with settings that the other rooms chose, from the table of
//! a leave-one-room-out test.

use anyhow::{Context, Result};

/// Figures of the table: the head of their columns in the test, and here.
const FIGURES: [(&str, &str); 7] = [
    ("HOTA", "HOTA"),
    ("AssA", "AssA"),
    ("IDF1", "IDF1"),
    ("inherited", "inherited"),
    ("MOTA", "MOTA"),
    ("false", "FP/frame"),
    ("recall", "recall"),
];

/// Figures that a table which was printed before they were counted lacks: their columns are left out.
const LATER: [&str; 2] = ["AssA", "inherited"];

/// Figure of a pipeline, as shipped and left out.
struct Pair<'a> {
    shipped: &'a str,
    left_out: &'a str,
}

/// Returns two rows for each pipeline of `names`, in their order.
///
/// # Errors
/// A table without the pipeline or without one of the figures.
pub fn markdown(table: &str, names: &str) -> Result<String> {
    let mut rows = table.lines().filter(|line| line.starts_with('|')).map(cells);
    let head = rows.next().context("there is no table")?;
    let rows: Vec<Vec<&str>> = rows.collect();
    let mut figures = FIGURES.to_vec();
    figures.retain(|(figure, _)| !LATER.contains(figure) || place_of(&head, figure).is_some());
    let titles: Vec<&str> = figures.iter().map(|(_, title)| *title).collect();
    let titles = titles.join(" | ");
    let mut out = format!("| pipeline | | {titles} |\n|---|---|{}\n", "---|".repeat(figures.len()));
    for name in names.split_whitespace() {
        let row = rows.iter().find(|row| row.first() == Some(&name));
        let row = row.with_context(|| format!("there is no row `{name}`"))?;
        let mut shipped = Vec::new();
        let mut left_out = Vec::new();
        for (figure, _) in &figures {
            let pair = pair_of(&head, row, figure)
                .with_context(|| format!("there is no figure `{figure}`"))?;
            shipped.push(pair.shipped);
            left_out.push(pair.left_out);
        }
        out += &format!("| `{name}` | as shipped | {} |\n", shipped.join(" | "));
        out += &format!("| | left out | {} |\n", left_out.join(" | "));
    }
    Ok(out)
}

/// Returns what to expect of one pipeline in a single room, how many people it finds and how far off
/// these are, with the settings and models of the other rooms. `rooms` has a row for each room; rooms
/// of single frames, over which nothing is tracked, do not count.
///
/// # Errors
/// A table without the pipeline, without rooms or without one of the figures.
pub fn sentence(name: &str, means: &str, rooms: &str) -> Result<String> {
    let hota = column(rooms, "HOTA w/o")?;
    let single: Vec<f64> = hota
        .iter()
        .filter(|(row, _)| !row.starts_with("mean") && !row.ends_with("single frames"))
        .map(|(_, value)| *value)
        .collect();
    let least = single.iter().copied().reduce(f64::min).context("there is no room")?;
    let most = single.iter().copied().reduce(f64::max).context("there is no room")?;
    let recall = figure_of(name, means, "recall w/o")?;
    let off_m = figure_of(name, means, "off m w/o")?;
    Ok(format!(
        "In single rooms, left out, the HOTA of `{name}` is {least:.3} to {most:.3}. It finds people \
         in {:.1} % of their frames, {:.0} mm off on average.",
        1e2 * recall,
        1e3 * off_m
    ))
}

/// Returns one figure of a row.
fn figure_of(name: &str, table: &str, title: &str) -> Result<f64> {
    let all = column(table, title)?;
    let row = all.iter().find(|(row, _)| *row == name);
    row.map(|(_, figure)| *figure).with_context(|| format!("there is no row `{name}`"))
}

/// Returns the figures of a column by the first cells of their rows, without those that are missing.
fn column<'a>(table: &'a str, title: &str) -> Result<Vec<(&'a str, f64)>> {
    let mut rows = table.lines().filter(|line| line.starts_with('|')).map(cells);
    let head = rows.next().context("there is no table")?;
    let at = head.iter().position(|cell| *cell == title);
    let at = at.with_context(|| format!("there is no figure `{title}`"))?;
    let figures = rows.filter_map(|row| Some((*row.first()?, row.get(at)?.parse().ok()?)));
    Ok(figures.collect())
}

/// Returns the cells of a row of a table.
pub fn cells(line: &str) -> Vec<&str> {
    line.trim().trim_matches('|').split('|').map(str::trim).collect()
}

/// Returns a figure of a row: its columns begin with the one without the room, and that of the shipped
/// settings is the next `as is`.
fn pair_of<'a>(head: &[&str], row: &[&'a str], figure: &str) -> Option<Pair<'a>> {
    let first = place_of(head, figure)?;
    let as_is = first + head[first..].iter().position(|title| *title == "as is")?;
    Some(Pair { shipped: row.get(as_is)?, left_out: row.get(first)? })
}

/// Returns the place of the column of a figure without the room.
fn place_of(head: &[&str], figure: &str) -> Option<usize> {
    head.iter().position(|title| *title == format!("{figure} w/o"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "**means**\n\n\
        |  | rooms | HOTA w/o | all | gap | as is | IDF1 w/o | all | as is | MOTA w/o | all | as is | false w/o | all | as is | recall w/o | all | as is |\n\
        | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n\
        | a | 4 | 0.1 | 0.2 | 0.3 | 0.4 | 1.1 | 1.2 | 1.3 | 2.1 | 2.2 | 2.3 | 3.1 | 3.2 | 3.3 | 4.1 | 4.2 | 4.3 |\n\n* note\n";

    #[test]
    fn both_figures_stand_below_each_other() {
        let shown = markdown(TABLE, "a").unwrap();
        let rows: Vec<&str> = shown.lines().collect();
        assert_eq!(rows[2], "| `a` | as shipped | 0.4 | 1.3 | 2.3 | 3.3 | 4.3 |");
        assert_eq!(rows[3], "| | left out | 0.1 | 1.1 | 2.1 | 3.1 | 4.1 |");
    }

    #[test]
    fn identities_stand_beside_the_other_figures() {
        let table = "|  | HOTA w/o | all | gap | as is | AssA w/o | as is | IDF1 w/o | as is | inherited w/o | as is | MOTA w/o | as is | false w/o | as is | recall w/o | as is |\n\
            |---|---|\n\
            | a | 0.1 | 0.2 | 0.3 | 0.4 | 5.1 | 5.2 | 1.1 | 1.3 | 7 | 2 | 2.1 | 2.3 | 3.1 | 3.3 | 4.1 | 4.3 |\n";
        let shown = markdown(table, "a").unwrap();
        let rows: Vec<&str> = shown.lines().collect();
        assert_eq!(
            rows[0],
            "| pipeline | | HOTA | AssA | IDF1 | inherited | MOTA | FP/frame | recall |"
        );
        assert_eq!(rows[2], "| `a` | as shipped | 0.4 | 5.2 | 1.3 | 2 | 2.3 | 3.3 | 4.3 |");
        assert_eq!(rows[3], "| | left out | 0.1 | 5.1 | 1.1 | 7 | 2.1 | 3.1 | 4.1 |");
        let error = markdown(&table.replace("MOTA", "MOT"), "a").unwrap_err().to_string();
        assert!(error.contains("no figure `MOTA`"), "{error}");
    }

    #[test]
    fn a_sentence_has_the_range_over_rooms_and_the_distance_beside_the_recall() {
        let means = "|  | recall w/o | off m w/o |\n|---|---|---|\n| a | 0.845 | 0.0371 |\n";
        let rooms = "|  | HOTA w/o |\n|---|---|\n| A | 0.7 |\n| B | - |\n| C | 0.4 |\n\
                     | D, single frames | 0.1 |\n| mean | 0.9 |\n| mean, rooms alike | 0.8 |\n";
        assert_eq!(
            sentence("a", means, rooms).unwrap(),
            "In single rooms, left out, the HOTA of `a` is 0.400 to 0.700. It finds people in \
             84.5 % of their frames, 37 mm off on average."
        );
        assert!(sentence("b", means, rooms).unwrap_err().to_string().contains("no row `b`"));
    }

    #[test]
    fn a_pipeline_that_was_not_tested_is_named() {
        let error = markdown(TABLE, "a b").unwrap_err().to_string();
        assert!(error.contains("no row `b`"), "{error}");
    }
}
