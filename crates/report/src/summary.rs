//! What the results come to: means, intervals, and who is best.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tagalong_eval::{Bootstrap, Interval, wilson};

use crate::figures::{Figure, Place};
use crate::model::{Benchmark, Outcome, TaskResult};
use crate::view::View;

/// Confidence of all intervals.
pub const CONFIDENCE: f64 = 0.95;

/// What a benchmark comes to.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Summary {
    /// One entry per pipeline, by name.
    pub pipelines: Vec<PipelineSummary>,
    /// One entry per pair of pipelines and figure, for pairs with common logs.
    pub pairs: Vec<PairSummary>,
}

/// What the results of one pipeline come to.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PipelineSummary {
    /// The pipeline.
    pub pipeline: String,
    /// Tasks that ran to their end.
    pub done: u64,
    /// Tasks that failed.
    pub failed: u64,
    /// Tasks that could not be begun.
    pub skipped: u64,
    /// Figures by `image.NAME` or `metres.NAME`, as [`tagalong_eval::Scores`]
    /// names them.
    pub figures: BTreeMap<String, Estimate>,
    /// Fraction of the people who were found at all, with its Wilson interval
    /// (95 %); one seed per log, so that nobody counts twice.
    pub people_found: Option<Interval>,
    /// People in `people_found`.
    pub people: u64,
}

/// The mean of a figure over logs (over the seeds of each log first).
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Its 95 % interval, from a bootstrap over logs; none for a single log.
    pub interval: Option<[f64; 2]>,
    /// Logs in the mean.
    pub logs: u64,
    /// No other pipeline with as many logs is better, and there is another one.
    pub best: bool,
}

/// How much `b` differs from `a` in one figure, on the logs that both have.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PairSummary {
    /// The one pipeline.
    pub a: String,
    /// The other.
    pub b: String,
    /// The figure, as in [`PipelineSummary::figures`].
    pub figure: String,
    /// Logs that both have.
    pub logs: u64,
    /// Mean of `b - a`.
    pub difference: f64,
    /// Its 95 % interval, from a paired bootstrap over logs; none for one log.
    pub interval: Option<[f64; 2]>,
    /// Probability of a difference this large if there were none.
    pub p_value: Option<f64>,
}

impl PairSummary {
    /// True if the interval excludes zero.
    pub fn is_clear(&self) -> bool {
        self.interval.is_some_and(|[low, high]| low > 0.0 || high < 0.0)
    }
}

impl Summary {
    /// Forms the means and intervals of a benchmark.
    ///
    /// Pipelines are compared by means over logs, not over frames: a long log
    /// says no more about a pipeline than a short one of another place. Failed
    /// and skipped tasks do not enter, which is why only pipelines with the
    /// greatest number of logs can be best.
    pub fn new(benchmark: &Benchmark) -> Self {
        let view = View::new(benchmark);
        let mut pipelines: Vec<_> = view.pipelines.iter().map(|p| pipeline(&view, p)).collect();
        for place in Place::ALL {
            Figure::at(place).for_each(|figure| mark_best(&mut pipelines, figure, place));
        }
        Self { pipelines, pairs: pairs(&view) }
    }

    /// The entry of a pipeline.
    pub fn pipeline(&self, name: &str) -> Option<&PipelineSummary> {
        self.pipelines.iter().find(|p| p.pipeline == name)
    }
}

/// The figure of a pipeline on each of its logs, mean over seeds.
pub fn per_log<'a>(
    view: &View<'a>,
    pipeline: &str,
    figure: &Figure,
    place: Place,
) -> BTreeMap<&'a str, f64> {
    let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for task in view.done(pipeline) {
        if let Some(value) = figure.of(place, task) {
            values.entry(&task.log).or_default().push(value);
        }
    }
    values.into_iter().map(|(log, v)| (log, mean(&v))).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn pipeline(view: &View<'_>, name: &str) -> PipelineSummary {
    let count = |is: fn(&Outcome) -> bool| view.of(name).filter(|t| is(&t.outcome)).count() as u64;
    let mut figures = BTreeMap::new();
    for place in Place::ALL {
        for figure in Figure::at(place) {
            let values: Vec<f64> = per_log(view, name, figure, place).into_values().collect();
            if let Some(estimate) = estimate(&values) {
                figures.insert(figure.key(place), estimate);
            }
        }
    }
    let (found, people) = people(view, name);
    PipelineSummary {
        pipeline: name.to_owned(),
        done: count(|o| *o == Outcome::Done),
        failed: count(|o| matches!(o, Outcome::Failed { .. })),
        skipped: count(|o| matches!(o, Outcome::Skipped { .. })),
        figures,
        people_found: wilson(found, people, CONFIDENCE),
        people,
    }
}

fn estimate(values: &[f64]) -> Option<Estimate> {
    if values.is_empty() {
        return None;
    }
    let drawn_mean =
        |drawn: &[usize]| drawn.iter().map(|&i| values[i]).sum::<f64>() / drawn.len() as f64;
    let several = values.len() >= 2;
    let interval =
        several.then(|| Bootstrap::default().interval(values.len(), drawn_mean)).flatten();
    Some(Estimate {
        mean: mean(values),
        interval: interval.map(|i| [i.lower, i.upper]),
        logs: values.len() as u64,
        best: false,
    })
}

/// People found and people there, over the logs.
fn people(view: &View<'_>, pipeline: &str) -> (u64, u64) {
    let counts = |task: &TaskResult| {
        let scores = task.image.as_ref().or(task.metres.as_ref())?;
        Some((scores.truth_ids.saturating_sub(scores.never_confirmed), scores.truth_ids))
    };
    let tasks = view.logs.iter().filter_map(|log| view.drawn(pipeline, log));
    tasks.filter_map(counts).fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
}

fn mark_best(pipelines: &mut [PipelineSummary], figure: &Figure, place: Place) {
    let key = figure.key(place);
    let with: Vec<Estimate> =
        pipelines.iter().filter_map(|p| p.figures.get(&key).copied()).collect();
    let most = with.iter().map(|e| e.logs).max().unwrap_or(0);
    let rivals: Vec<f64> = with.iter().filter(|e| e.logs == most).map(|e| e.mean).collect();
    if rivals.len() < 2 {
        return;
    }
    for estimate in pipelines.iter_mut().filter_map(|p| p.figures.get_mut(&key)) {
        let beaten = rivals.iter().any(|&rival| figure.better(rival, estimate.mean));
        estimate.best = estimate.logs == most && !beaten;
    }
}

fn pairs(view: &View<'_>) -> Vec<PairSummary> {
    let mut pairs = Vec::new();
    for (index, a) in view.pipelines.iter().enumerate() {
        for b in &view.pipelines[index + 1..] {
            for place in Place::ALL {
                let compared = Figure::at(place).filter(|f| f.compared);
                pairs.extend(compared.filter_map(|f| pair(view, [a, b], f, place)));
            }
        }
    }
    pairs
}

fn pair(view: &View<'_>, [a, b]: [&str; 2], figure: &Figure, place: Place) -> Option<PairSummary> {
    let of_a = per_log(view, a, figure, place);
    let of_b = per_log(view, b, figure, place);
    let common = of_a.iter().filter_map(|(log, &a)| Some((a, *of_b.get(log)?)));
    let (in_a, in_b): (Vec<f64>, Vec<f64>) = common.unzip();
    let differences: Vec<f64> = in_a.iter().zip(&in_b).map(|(a, b)| b - a).collect();
    if differences.is_empty() {
        return None;
    }
    let several = differences.len() >= 2;
    let gain = several.then(|| Bootstrap::default().paired(&in_a, &in_b)).flatten();
    Some(PairSummary {
        a: a.to_owned(),
        b: b.to_owned(),
        figure: figure.key(place),
        logs: differences.len() as u64,
        difference: mean(&differences),
        interval: gain.map(|g| [g.difference.lower, g.difference.upper]),
        p_value: gain.map(|g| g.p_value),
    })
}
