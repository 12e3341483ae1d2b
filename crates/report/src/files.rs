//! Results as files for programs: JSON and CSV.

use std::collections::BTreeSet;

use serde_json::{Map, Value};
use tagalong_eval::Scores;

use crate::figures::ComparisonSpace;
use crate::model::{Benchmark, Outcome, TaskResult};
use crate::summary::Summary;
use crate::view::OrderedBenchmark;

/// Returns the text of `report.json`: one task per line in a fixed order, and the [`Summary`] under
/// `summary`. Pictures are left out, because only the page needs them. The text can be read back as
/// a [`Benchmark`], for example as the baseline of a gate.
///
/// # Errors
///
/// None with the types of this crate; the error type is that of the JSON writer.
pub fn json(benchmark: &Benchmark) -> serde_json::Result<String> {
    let view = OrderedBenchmark::new(benchmark);
    let tasks: Vec<String> =
        view.tasks.iter().map(|task| task_json(task)).collect::<serde_json::Result<_>>()?;
    let version = serde_json::to_string(view.version)?;
    let summary = serde_json::to_string(&Summary::new(benchmark))?;
    let tasks = tasks.join(",\n");
    let copies = if view.copies.is_empty() {
        String::new()
    } else {
        format!("\"copies\":{},\n", serde_json::to_string(view.copies)?)
    };
    let notes = if view.notes.is_empty() {
        String::new()
    } else {
        format!("\"notes\":{},\n", serde_json::to_string(view.notes)?)
    };
    Ok(format!(
        "{{\"version\":{version},\n{copies}{notes}\"summary\":{summary},\n\"tasks\":[\n{tasks}\n]}}\n"
    ))
}

fn task_json(task: &TaskResult) -> serde_json::Result<String> {
    let mut task = task.clone();
    task.events.iter_mut().for_each(|event| event.picture_png_base64 = None);
    serde_json::to_string(&task)
}

/// Returns the text of `report.csv`: a header and one row per task (RFC 4180). The names of figures
/// begin with `image.` or with `metres.` for those on the floor; figures that have no meaning for a
/// task are empty.
pub fn csv(benchmark: &Benchmark) -> String {
    let names = figure_names();
    let mut rows = vec![header(&names)];
    rows.extend(OrderedBenchmark::new(benchmark).tasks.iter().map(|task| row(task, &names)));
    rows.iter().map(|cells| line(cells)).collect()
}

fn figure_names() -> BTreeSet<String> {
    // All names are taken from the default, so that they are there even if no task has the figure.
    figures(&Scores::default()).keys().cloned().collect()
}

/// Returns the figures by name.
pub fn figures(scores: &Scores) -> Map<String, Value> {
    match serde_json::to_value(scores) {
        Ok(Value::Object(map)) => map,
        _ => Map::new(),
    }
}

fn header(names: &BTreeSet<String>) -> Vec<String> {
    let first = [
        "pipeline",
        "log",
        "seed",
        "hash",
        "outcome",
        "why",
        "frames",
        "duration_s",
        "data_lost",
        "nis_mean",
        "nis_lower",
        "nis_upper",
        "nis_count",
        "dropped",
        "events",
    ];
    let figures = ComparisonSpace::ALL
        .iter()
        .flat_map(|place| names.iter().map(move |name| format!("{}.{name}", place.key())));
    first.map(str::to_owned).into_iter().chain(figures).collect()
}

fn row(task: &TaskResult, names: &BTreeSet<String>) -> Vec<String> {
    let (outcome, why) = match &task.outcome {
        Outcome::Done => ("done", ""),
        Outcome::Failed { why } => ("failed", why.as_str()),
        Outcome::Skipped { why } => ("skipped", why.as_str()),
    };
    let nis = task.nis.as_ref().map(|nis| {
        [nis.mean.to_string(), nis.lower.to_string(), nis.upper.to_string(), nis.count.to_string()]
    });
    let [mean, lower, upper, count] = nis.unwrap_or_default();
    let mut cells = vec![
        task.pipeline.clone(),
        task.log.clone(),
        task.seed.to_string(),
        task.hash.clone(),
        outcome.to_owned(),
        why.to_owned(),
        task.frames.to_string(),
        task.duration_s.to_string(),
        task.data_lost.to_string(),
        mean,
        lower,
        upper,
        count,
        task.funnel.iter().map(|d| d.count).sum::<u64>().to_string(),
        task.events.len().to_string(),
    ];
    for place in ComparisonSpace::ALL {
        let scores = place.scores(task).map(figures).unwrap_or_default();
        cells.extend(names.iter().map(|name| number(scores.get(name))));
    }
    cells
}

fn number(value: Option<&Value>) -> String {
    value.filter(|v| !v.is_null()).map(Value::to_string).unwrap_or_default()
}

fn line(cells: &[String]) -> String {
    let quoted: Vec<String> = cells.iter().map(|cell| quote(cell)).collect();
    // RFC 4180 ends lines with CRLF.
    quoted.join(",") + "\r\n"
}

fn quote(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}
