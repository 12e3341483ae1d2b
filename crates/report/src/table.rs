use serde::Serialize;
use tagalong_eval::{CONFIDENCE, Interval, clustered_share, wilson};

/// A table of published and measured numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Table {
    /// Title, with the table or figure of the paper.
    pub title: String,
    /// Names of the columns after the column of row names, with units.
    pub columns: Vec<String>,
    /// Rows of the table.
    pub rows: Vec<Row>,
    /// Conditions of the numbers: scenes, number of draws, meaning of the intervals, and limits of
    /// the comparison.
    pub notes: Vec<String>,
}

/// A row of a table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Row {
    /// Name of the row.
    pub name: String,
    /// True if the numbers are the paper's.
    pub published: bool,
    /// One cell per column.
    pub cells: Vec<Cell>,
}

/// One number, or an empty cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Cell {
    /// The number; `None` if it is not known.
    pub value: Option<f64>,
    /// Standard deviation of the values whose mean is the number.
    pub deviation: Option<f64>,
    /// Confidence interval of 95 %.
    pub interval: Option<[f64; 2]>,
    /// Digits after the decimal point.
    #[serde(skip)]
    pub digits: usize,
}

impl Cell {
    /// Creates a cell with a number, shown with `digits` digits after the decimal point.
    pub fn number(value: f64, digits: usize) -> Self {
        Self { value: value.is_finite().then_some(value), digits, ..Self::default() }
    }

    /// Creates a cell with mean and standard deviation; empty without values.
    pub fn mean(values: &[f64], digits: usize) -> Self {
        tagalong_math::mean_and_deviation(values).map_or_else(Self::default, |(mean, deviation)| {
            Self {
                // A single value has no spread.
                deviation: (values.len() > 1).then_some(deviation),
                ..Self::number(mean, digits)
            }
        })
    }

    /// Creates a cell with an estimate and its interval, if there is one.
    pub fn estimate(interval: Option<Interval>, digits: usize) -> Self {
        interval.map_or_else(Self::default, |of| Self {
            interval: of.ends(),
            ..Self::number(of.estimate, digits)
        })
    }

    /// Creates a cell with `count` out of `of` in per cent, and its Wilson interval; empty if `of`
    /// is 0. For independent samples, such as one result per draw.
    pub fn share(count: u64, of: u64, digits: usize) -> Self {
        // Two digits more, because `percent` removes two.
        Self::estimate(wilson(count, of, CONFIDENCE), digits + 2).percent()
    }

    /// Creates a cell with the sum of these `[count, of]` in per cent, and the interval from the
    /// spread between clusters, such as the frames of a draw.
    pub fn clustered(clusters: &[[u64; 2]], digits: usize) -> Self {
        Self::estimate(clustered_share(clusters), digits + 2).percent()
    }

    /// Cuts the interval to the range of possible values, because Student's interval of a fraction
    /// may reach beyond 1.
    #[must_use]
    pub fn within(self, least: f64, most: f64) -> Self {
        let interval = self.interval.map(|[lower, upper]| [lower.max(least), upper.min(most)]);
        Self { interval, ..self }
    }

    /// Converts a fraction to per cent.
    #[must_use]
    pub fn percent(self) -> Self {
        Self {
            value: self.value.map(|value| 100.0 * value),
            deviation: self.deviation.map(|value| 100.0 * value),
            interval: self.interval.map(|ends| ends.map(|value| 100.0 * value)),
            digits: self.digits.saturating_sub(2),
        }
    }

    fn text(&self) -> String {
        let Some(value) = self.value else { return "-".to_owned() };
        let digits = self.digits;
        let mut text = format!("{value:.digits$}");
        if let Some(deviation) = self.deviation {
            text += &format!(" \u{b1} {deviation:.digits$}");
        }
        if let Some([lower, upper]) = self.interval {
            text += &format!(" [{lower:.digits$}, {upper:.digits$}]");
        }
        text
    }
}

impl Row {
    /// Creates a row of measured numbers.
    pub fn ours(name: impl Into<String>, cells: Vec<Cell>) -> Self {
        Self { name: name.into(), published: false, cells }
    }

    /// Creates a row of published numbers.
    pub fn published(name: impl Into<String>, cells: Vec<Cell>) -> Self {
        Self { name: name.into(), published: true, cells }
    }

    fn title(&self) -> String {
        if self.published { format!("published: {}", self.name) } else { self.name.clone() }
    }
}

impl Table {
    /// Formats the table for a terminal.
    pub fn text(&self) -> String {
        let lines = self.lines();
        let columns = lines.iter().map(Vec::len).max().unwrap_or(0);
        // Characters, not bytes: the sign of a deviation has two bytes.
        let mut widths = vec![0; columns];
        for line in &lines {
            for (width, cell) in widths.iter_mut().zip(line) {
                *width = cell.chars().count().max(*width);
            }
        }
        let mut out = format!("{}\n", self.title);
        for line in &lines {
            let cells = line.iter().zip(&widths).enumerate().map(|(at, (cell, width))| match at {
                0 => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            });
            out += format!("  {}", cells.collect::<Vec<_>>().join("  ")).trim_end();
            out.push('\n');
        }
        self.notes.iter().for_each(|note| out += &format!("  * {note}\n"));
        out
    }

    /// Formats the table for a page of the documentation.
    pub fn markdown(&self) -> String {
        fn line(cells: Vec<String>) -> String {
            format!("| {} |\n", cells.join(" | "))
        }

        let mut lines = self.lines().into_iter();
        let mut out = format!("**{}**\n\n", self.title);
        if let Some(header) = lines.next() {
            let rule = vec!["---".to_owned(); header.len()];
            out += &(line(header) + &line(rule));
        }
        lines.for_each(|cells| out += &line(cells));
        self.notes.iter().for_each(|note| out += &format!("\n* {note}"));
        out + if self.notes.is_empty() { "" } else { "\n" }
    }

    /// Returns header and rows as texts.
    fn lines(&self) -> Vec<Vec<String>> {
        let header = std::iter::once(String::new()).chain(self.columns.iter().cloned());
        let rows = self.rows.iter().map(|row| {
            std::iter::once(row.title()).chain(row.cells.iter().map(Cell::text)).collect()
        });
        std::iter::once(header.collect()).chain(rows).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let interval = Interval { estimate: 0.971, lower: 0.93, upper: 0.988 };
        Table {
            title: "Crossings (Table I)".into(),
            columns: vec!["success %".into(), "ms".into()],
            rows: vec![
                Row::published("625", vec![Cell::number(97.8, 1), Cell::number(247.0, 0)]),
                Row::ours(
                    "all",
                    vec![Cell::estimate(Some(interval), 3).percent(), Cell::default()],
                ),
            ],
            notes: vec!["simulated".into()],
        }
    }

    #[test]
    fn text_has_aligned_columns() {
        let expected = [
            "Crossings (Table I)",
            "                          success %   ms",
            "  published: 625               97.8  247",
            "  all             97.1 [93.0, 98.8]    -",
            "  * simulated\n",
        ];
        assert_eq!(table().text(), expected.join("\n"));
    }

    #[test]
    fn markdown_is_a_table() {
        let markdown = table().markdown();
        assert!(markdown.contains("|  | success % | ms |\n| --- | --- | --- |\n"), "{markdown}");
        assert!(markdown.contains("| all | 97.1 [93.0, 98.8] | - |\n"), "{markdown}");
        assert!(markdown.ends_with("\n* simulated\n"));
    }

    #[test]
    fn means_have_deviations_and_nothing_has_none() {
        let cell = Cell::mean(&[1.0, 3.0], 1);
        assert_eq!(cell.text(), "2.0 \u{b1} 1.0");
        assert_eq!(Cell::mean(&[], 1), Cell::default());
        assert_eq!(Cell::number(f64::NAN, 1).text(), "-");
    }

    #[test]
    fn an_interval_ends_where_the_figures_do() {
        fn share() -> Cell {
            Cell::estimate(tagalong_math::mean_interval(&[0.0, 1.0, 1.0]), 2)
        }

        assert_eq!(share().text(), "0.67 [-0.77, 2.10]");
        assert_eq!(share().within(0.0, 1.0).text(), "0.67 [0.00, 1.00]");
        assert_eq!(share().within(0.0, 1.0).percent().text(), "67 [0, 100]");
        assert_eq!(share().within(f64::NEG_INFINITY, 1.0).text(), "0.67 [-0.77, 1.00]");
        assert_eq!(Cell::number(0.5, 1).within(0.0, 1.0), Cell::number(0.5, 1));
    }

    #[test]
    fn figures_of_one_draw_stand_alone() {
        assert_eq!(Cell::estimate(Some(Interval::open(0.25)), 2).text(), "0.25");
        assert_eq!(Cell::estimate(None, 2).text(), "-");
        assert_eq!(Cell::clustered(&[[3, 4]], 1).text(), "75.0");
        assert_eq!(Cell::clustered(&[[1, 1], [0, 1]], 0).text(), Cell::share(1, 2, 0).text());
    }

    #[test]
    fn json_says_who_measured() {
        let json = serde_json::to_value(table()).unwrap();
        assert_eq!(json["rows"][0]["published"], true);
        assert_eq!(json["rows"][1]["cells"][0]["interval"][1], 98.8);
    }
}
