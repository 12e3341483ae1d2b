use std::fmt::Write as _;

use serde::Serialize;
use tagalong_eval::{
    CONFIDENCE, Clear, Gain, Identity, Interval, PositionError, draws_interval, holm,
    is_significant, paired_gain, wilson,
};
use tagalong_report::{self as report, Cell};
use tagalong_sim::Seeds;
use tagalong_trials::Contender;

use super::contest::Result;

/// Scores of contenders on suites.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// Seeds with which each suite was simulated.
    pub seeds: Seeds,
    /// One row per suite and contender.
    pub rows: Vec<Row>,
    /// Gains of each contender over the baseline, the last one.
    pub gains: Vec<GainRow>,
    /// Widths of the columns with the names of suites and contenders.
    #[serde(skip)]
    widths: [usize; 2],
}

/// Scores of one contender on one suite; intervals are over random variants, with 95 % confidence.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the scene.
    pub suite: String,
    /// Name of the contender.
    pub pipeline: String,
    /// Number of random variants.
    pub draws: usize,
    /// MOTA.
    pub mota: Option<Interval>,
    /// Identity F1.
    pub idf1: Option<Interval>,
    /// Errors on the floor, robot frame.
    pub error: Option<PositionError>,
    /// Fraction of the variants in which every person in view was tracked in all frames within 22
    /// cm (Wilson).
    pub success: Option<Interval>,
    /// Identity switches.
    pub switches: u64,
}

/// Gain of a contender over the baseline on the same random variants.
#[derive(Clone, Debug, Serialize)]
pub struct GainRow {
    /// Name of the scene.
    pub suite: String,
    /// Name of the contender.
    pub pipeline: String,
    /// Name of the baseline.
    pub baseline: String,
    /// Gain of IDF1.
    pub idf1: Gain,
    /// The p-value, corrected for all gains of the table (Holm).
    pub p_corrected: f64,
}

impl Table {
    /// Returns an empty table for these names.
    pub fn new<'a>(
        seeds: Seeds,
        suites: impl Iterator<Item = &'a String>,
        contenders: impl Iterator<Item = &'a String>,
    ) -> Self {
        // Eight is the width of the heading `pipeline`.
        let widths = [
            suites.map(String::len).fold(8, usize::max),
            contenders.map(String::len).fold(8, usize::max),
        ];
        Self { seeds, rows: Vec::new(), gains: Vec::new(), widths }
    }

    /// Adds a suite: for each random variant one result per contender.
    pub fn add(&mut self, suite: &str, contenders: &[Contender], results: &[Vec<Result>]) {
        for (at, contender) in contenders.iter().enumerate() {
            let column: Vec<&Result> = results.iter().map(|draw| &draw[at]).collect();
            self.rows.push(row(suite, &contender.name, &column));
        }
        let Some((baseline, others)) = contenders.split_last() else { return };
        let base = idf1_of(results, others.len());
        for (at, contender) in others.iter().enumerate() {
            self.gains.extend(paired_gain(&base, &idf1_of(results, at)).map(|gain| GainRow {
                suite: suite.to_owned(),
                pipeline: contender.name.clone(),
                baseline: baseline.name.clone(),
                idf1: gain,
                p_corrected: gain.p_value,
            }));
        }
        // Corrected again after each suite, because the number of comparisons has grown.
        let p_values: Vec<f64> = self.gains.iter().map(|gain| gain.idf1.p_value).collect();
        for (gain, corrected) in self.gains.iter_mut().zip(holm(&p_values)) {
            gain.p_corrected = corrected;
        }
    }

    /// Returns the names of the columns, for a terminal.
    pub fn header(&self) -> String {
        let [first, second] = self.widths;
        format!(
            "{:<first$}  {:<second$}  {:>5}  {:^21}  {:^21}  {:>7}  {:^21}  {:>4}\n",
            "suite", "pipeline", "draws", "MOTA", "IDF1", "error m", "all frames right", "IDSW"
        )
    }

    /// Returns the rows of the suite that was added last.
    pub fn last_rows(&self) -> String {
        let Some(suite) = self.rows.last().map(|row| &row.suite) else { return String::new() };
        self.rows.iter().filter(|row| row.suite == *suite).map(|row| self.line(row)).collect()
    }

    fn line(&self, row: &Row) -> String {
        let [first, second] = self.widths;
        let error = row.error.map_or("-".to_owned(), |error| format!("{:.3}", error.mean_m));
        format!(
            "{:<first$}  {:<second$}  {:>5}  {}  {}  {:>7}  {}  {:>4}\n",
            row.suite,
            row.pipeline,
            row.draws,
            interval(row.mota),
            interval(row.idf1),
            error,
            interval(row.success),
            row.switches
        )
    }

    /// Returns the notes and the gains below the rows.
    pub fn summary(&self) -> String {
        let mut out = format!(
            "\n{}\nintervals: 95 %, over draws (Student; Wilson where all is right)\n{}\n",
            self.seeds,
            self.perfection()
        );
        if !self.gains.is_empty() {
            let count = self.gains.len();
            let _ = writeln!(out, "p: sign-flip test over draws, Holm's correction for {count}");
        }
        for gain in &self.gains {
            let Interval { estimate, .. } = gain.idf1.difference;
            let ends = gain.idf1.difference.ends();
            let ends = ends.map_or(String::new(), |[a, b]| format!(" [{a:+.3}, {b:+.3}]"));
            let luck = if is_significant(gain.p_corrected) { "" } else { ", which may be luck" };
            let _ = writeln!(
                out,
                "{}: {} gains {estimate:+.3}{ends} IDF1 over {} on the same draws (p = {:.3}){luck}",
                gain.suite, gain.pipeline, gain.baseline, gain.p_corrected,
            );
        }
        out
    }

    /// Returns the table for a page, with the gains as its last column.
    pub fn page(&self) -> report::Table {
        let columns = ["MOTA", "IDF1", "error m", "all frames right", "IDSW", "IDF1 gained"]
            .map(str::to_owned);
        let seeds = format!("each scene with {}", self.seeds);
        let intervals = "intervals: 95 %, over draws (Student; Wilson where all is right)";
        let gains = self.gains.first().map(|gain| {
            format!(
                "gained: over {} on the same draws; sign-flip test over draws, with Holm's correction \
                 for {}",
                gain.baseline,
                self.gains.len()
            )
        });
        let notes = [seeds, intervals.into(), self.perfection()].into_iter().chain(gains);
        report::Table {
            title: "Simulated scenes".into(),
            columns: columns.to_vec(),
            rows: self.rows.iter().map(|row| self.page_row(row)).collect(),
            notes: notes.collect(),
        }
    }

    fn page_row(&self, row: &Row) -> report::Row {
        let gain = self
            .gains
            .iter()
            .find(|gain| gain.suite == row.suite && gain.pipeline == row.pipeline)
            .map(|gain| gain.idf1.difference);
        let cells = vec![
            Cell::estimate(row.mota, 3),
            Cell::estimate(row.idf1, 3),
            row.error.map_or_else(Cell::default, |error| Cell::number(error.mean_m, 3)),
            Cell::estimate(row.success, 3),
            Cell::number(row.switches as f64, 0),
            Cell::estimate(gain, 3),
        ];
        report::Row::ours(format!("{}: {}", row.suite, row.pipeline), cells)
    }

    /// Returns a note on suites that a pipeline solves completely, which are too easy.
    fn perfection(&self) -> String {
        // The mean is printed as 1.000.
        let named =
            self.rows.iter().filter(|row| row.mota.is_some_and(|mota| mota.estimate >= 0.9995));
        let all: Vec<String> =
            named.map(|row| format!("{} on {}", row.pipeline, row.suite)).collect();
        if all.is_empty() {
            "no pipeline is perfect (MOTA 1) on any suite".into()
        } else {
            format!("perfect, so the suite is too easy: {}", all.join(", "))
        }
    }
}

/// Returns the IDF1 of one contender, draw by draw.
fn idf1_of(results: &[Vec<Result>], contender: usize) -> Vec<f64> {
    results.iter().map(|draw| draw[contender].identity.idf1()).collect()
}

fn row(suite: &str, pipeline: &str, results: &[&Result]) -> Row {
    let mota = draws_interval(results.len(), |drawn| {
        Clear::combine(drawn.iter().map(|&i| &results[i].clear)).mota()
    });
    let idf1 = draws_interval(results.len(), |drawn| {
        Identity::combine(drawn.iter().map(|&i| &results[i].identity)).idf1()
    });
    let errors: Vec<f64> = results.iter().flat_map(|r| &r.errors_m).copied().collect();
    let successes = results.iter().filter(|result| result.success).count() as u64;
    Row {
        suite: suite.to_owned(),
        pipeline: pipeline.to_owned(),
        draws: results.len(),
        mota: mota.map(|of| of.within(f64::NEG_INFINITY, 1.0)),
        idf1: idf1.map(|of| of.within(0.0, 1.0)),
        error: PositionError::of(&errors),
        success: wilson(successes, results.len() as u64, CONFIDENCE),
        switches: results.iter().map(|result| result.clear.id_switches).sum(),
    }
}

fn interval(interval: Option<Interval>) -> String {
    let text = interval.map_or("-".to_owned(), |of| {
        let ends = of.ends().map_or(String::new(), |[a, b]| format!(" [{a:.3}, {b:.3}]"));
        format!("{:>6.3}{ends}", of.estimate)
    });
    format!("{text:<21}")
}
