//! Means and intervals of the results, and the best pipelines.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tagalong_eval::{
    Gain, Interval, clustered_share, holm, is_significant, mean_interval, paired_gain,
};

use crate::figures::{ComparisonSpace, Figure};
use crate::model::{Benchmark, Outcome};
use crate::view::OrderedBenchmark;

/// Summary of a benchmark.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Summary {
    /// Entries of the pipelines, by name.
    pub pipelines: Vec<PipelineSummary>,
    /// Entries per pair of pipelines and figure, for pairs with common logs.
    pub pairs: Vec<PairSummary>,
}

/// Summary of the results of one pipeline.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PipelineSummary {
    /// Name of the pipeline.
    pub pipeline: String,
    /// Number of tasks that ran to their end.
    pub done: u64,
    /// Number of tasks that failed.
    pub failed: u64,
    /// Number of tasks that could not be started.
    pub skipped: u64,
    /// Figures by `image.NAME` or `metres.NAME`, with the names of [`tagalong_eval::Scores`].
    pub figures: BTreeMap<String, Estimate>,
    /// Fraction of the people that were found in at least one frame, with a 95 % interval from the
    /// spread between logs; one seed per log, so that each person counts once.
    pub people_found: Option<Interval>,
    /// Number of people in `people_found`.
    pub people: u64,
}

/// Mean of a figure over logs (over the seeds of each log first).
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Estimate {
    /// Mean over the logs.
    pub mean: f64,
    /// 95 % interval over logs (Student); `None` for a single log, and if all logs have the same
    /// value.
    pub interval: Option<[f64; 2]>,
    /// Number of logs in the mean.
    pub logs: u64,
    /// True if no other pipeline with the same number of logs is better, and there is at least one
    /// other.
    pub best: bool,
}

impl PipelineSummary {
    /// Returns the number of people that were found in at least one frame; `None` without truth.
    pub fn people_found_count(&self) -> Option<u64> {
        let found = self.people_found.as_ref()?;
        // The summary stores the fraction; the count is computed back from it.
        Some((found.estimate * self.people as f64).round() as u64)
    }

    /// Returns false if there are people in the truth and the pipeline found none.
    fn finds_people(&self) -> bool {
        self.people_found_count() != Some(0)
    }
}

/// Difference between `b` and `a` in one figure, on the logs that both have.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PairSummary {
    /// First pipeline.
    pub a: String,
    /// Second pipeline.
    pub b: String,
    /// Key of the figure, as in [`PipelineSummary::figures`].
    pub figure: String,
    /// Number of logs that both have.
    pub logs: u64,
    /// Mean of `b - a`.
    pub difference: f64,
    /// 95 % interval over logs (Student); `None` for a single log, and if all logs have the same
    /// difference.
    pub interval: Option<[f64; 2]>,
    /// Probability of a difference this large if there were none, by the sign-flip test over logs.
    pub p_value: f64,
    /// P-value corrected for all pairs that are compared by this figure (Holm).
    pub p_corrected: f64,
}

impl PairSummary {
    /// Returns true if the corrected p-value is below 0.05. This takes at least six logs, and more
    /// if several pairs are compared.
    pub fn is_clear(&self) -> bool {
        is_significant(self.p_corrected)
    }
}

impl Summary {
    /// Computes the means and intervals of a benchmark.
    ///
    /// Pipelines are compared by means over logs, not over frames, because a long log contains no
    /// more information about a pipeline than a short one of another place. Failed and skipped
    /// tasks are left out, which is why only pipelines with the largest number of logs can be best.
    pub fn new(benchmark: &Benchmark) -> Self {
        let view = OrderedBenchmark::new(benchmark);
        let mut pipelines: Vec<_> = view.pipelines.iter().map(|p| pipeline(&view, p)).collect();
        for place in ComparisonSpace::ALL {
            Figure::at(place).for_each(|figure| mark_best(&mut pipelines, figure, place));
        }
        Self { pipelines, pairs: pairs(&view) }
    }

    /// Returns the number of pairs that are compared by a figure.
    pub(crate) fn pairs_by(&self, figure: &str) -> usize {
        self.pairs.iter().filter(|pair| pair.figure == figure).count()
    }

    /// Returns the summary of a pipeline.
    pub fn pipeline(&self, name: &str) -> Option<&PipelineSummary> {
        self.pipelines.iter().find(|p| p.pipeline == name)
    }
}

/// Returns the figure of a pipeline on each of its logs, as the mean over seeds.
pub fn per_log<'a>(
    view: &OrderedBenchmark<'a>,
    pipeline: &str,
    figure: &Figure,
    place: ComparisonSpace,
) -> BTreeMap<&'a str, f64> {
    let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for task in view.done(pipeline) {
        if let Some(value) = figure.of(place, task) {
            values.entry(&task.log).or_default().push(value);
        }
    }
    values.into_iter().filter_map(|(log, v)| Some((log, tagalong_math::mean(&v)?))).collect()
}

fn pipeline(view: &OrderedBenchmark<'_>, name: &str) -> PipelineSummary {
    let mut figures = BTreeMap::new();
    for place in ComparisonSpace::ALL {
        for figure in Figure::at(place) {
            let values: Vec<f64> = per_log(view, name, figure, place).into_values().collect();
            if let Some(estimate) = estimate(&values, figure) {
                figures.insert(figure.key(place), estimate);
            }
        }
    }
    let mut done = 0;
    let mut failed = 0;
    let mut skipped = 0;
    for task in view.of(name) {
        match task.outcome {
            Outcome::Done => done += 1,
            Outcome::Failed { .. } => failed += 1,
            Outcome::Skipped { .. } => skipped += 1,
        }
    }
    let people = people(view, name);
    PipelineSummary {
        pipeline: name.to_owned(),
        done,
        failed,
        skipped,
        figures,
        people: people.iter().map(|[_, all]| all).sum(),
        people_found: clustered_share(&people),
    }
}

fn estimate(values: &[f64], figure: &Figure) -> Option<Estimate> {
    let [least, most] = figure.range;
    let interval = mean_interval(values)?;
    Some(Estimate {
        // A Student interval may reach beyond the possible values, for instance above 1.
        mean: interval.estimate,
        interval: interval.within(least, most).ends(),
        logs: values.len() as u64,
        best: false,
    })
}

/// Returns the numbers of people found and of people present, for each log.
fn people(view: &OrderedBenchmark<'_>, pipeline: &str) -> Vec<[u64; 2]> {
    // One seed per log: the same people again would make the interval too narrow.
    let tasks = view.logs.iter().filter_map(|log| view.drawn(pipeline, log));
    let counts = tasks.filter_map(|task| {
        let scores = task.image.as_ref().or(task.metres.as_ref())?;
        Some([scores.truth_ids.saturating_sub(scores.never_confirmed), scores.truth_ids])
    });
    counts.collect()
}

fn mark_best(pipelines: &mut [PipelineSummary], figure: &Figure, place: ComparisonSpace) {
    let key = figure.key(place);
    // A pipeline without any detection has no false positives either, but must not count as best
    // for that.
    let finding = pipelines.iter().filter(|p| p.finds_people());
    let with: Vec<Estimate> = finding.filter_map(|p| p.figures.get(&key).copied()).collect();
    let most = with.iter().map(|e| e.logs).max().unwrap_or(0);
    let rivals: Vec<f64> = with.iter().filter(|e| e.logs == most).map(|e| e.mean).collect();
    // Without a rival no pipeline is the best.
    if rivals.len() < 2 {
        return;
    }
    let finding = pipelines.iter_mut().filter(|p| p.finds_people());
    for estimate in finding.filter_map(|p| p.figures.get_mut(&key)) {
        let beaten = rivals.iter().any(|&rival| figure.better_as_printed(rival, estimate.mean));
        estimate.best = estimate.logs == most && !beaten;
    }
}

fn pairs(view: &OrderedBenchmark<'_>) -> Vec<PairSummary> {
    let mut pairs = Vec::new();
    for (index, a) in view.pipelines.iter().enumerate() {
        for b in &view.pipelines[index + 1..] {
            for place in ComparisonSpace::ALL {
                let compared = Figure::at(place).filter(|f| f.compared);
                pairs.extend(compared.filter_map(|f| pair(view, [a, b], f, place)));
            }
        }
    }
    correct(&mut pairs);
    pairs
}

/// Corrects the p-values of each figure, because among many pairs some differ by chance.
fn correct(pairs: &mut [PairSummary]) {
    let mut of_figure: BTreeMap<String, Vec<&mut PairSummary>> = BTreeMap::new();
    for pair in pairs {
        of_figure.entry(pair.figure.clone()).or_default().push(pair);
    }
    for pairs in of_figure.into_values() {
        let p_values: Vec<f64> = pairs.iter().map(|pair| pair.p_value).collect();
        for (pair, corrected) in pairs.into_iter().zip(holm(&p_values)) {
            pair.p_corrected = corrected;
        }
    }
}

fn pair(
    view: &OrderedBenchmark<'_>,
    [a, b]: [&str; 2],
    figure: &Figure,
    place: ComparisonSpace,
) -> Option<PairSummary> {
    let of_a = per_log(view, a, figure, place);
    let of_b = per_log(view, b, figure, place);
    let common = of_a.iter().filter_map(|(log, &a)| Some((a, *of_b.get(log)?)));
    let (in_a, in_b): (Vec<f64>, Vec<f64>) = common.unzip();
    let Gain { difference, p_value } = paired_gain(&in_a, &in_b)?;
    Some(PairSummary {
        a: a.to_owned(),
        b: b.to_owned(),
        figure: figure.key(place),
        logs: in_a.len() as u64,
        difference: difference.estimate,
        interval: difference.ends(),
        p_value,
        p_corrected: p_value,
    })
}
