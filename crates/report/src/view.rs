use std::collections::BTreeSet;

use crate::figures::{ComparisonSpace, MAIN};
use crate::model::{Benchmark, Outcome, TaskResult};
use crate::summary::Summary;

/// Benchmark in an order that does not depend on the order in which its tasks were run.
pub struct OrderedBenchmark<'a> {
    pub version: &'a str,
    /// Tasks by pipeline, log, seed and hash.
    pub tasks: Vec<&'a TaskResult>,
    /// Pipelines by name, or best first once they are [ranked](Self::ranked).
    pub pipelines: Vec<&'a str>,
    pub logs: Vec<&'a str>,
    /// Groups of logs that come from one recording.
    pub copies: &'a [Vec<String>],
    /// Notes on the logs and their truth.
    pub notes: &'a [String],
}

impl<'a> OrderedBenchmark<'a> {
    pub fn new(benchmark: &'a Benchmark) -> Self {
        let mut tasks: Vec<&TaskResult> = benchmark.tasks.iter().collect();
        // With the hash last, the order never depends on that of the input.
        tasks.sort_by_key(|t| (&t.pipeline, &t.log, t.seed, &t.hash));
        let pipelines: BTreeSet<&str> = tasks.iter().map(|task| task.pipeline.as_str()).collect();
        let logs: BTreeSet<&str> = tasks.iter().map(|task| task.log.as_str()).collect();
        Self {
            version: &benchmark.version,
            tasks,
            pipelines: pipelines.into_iter().collect(),
            logs: logs.into_iter().collect(),
            copies: &benchmark.copies,
            notes: &benchmark.notes,
        }
    }

    /// Sorts the pipelines by their main figure, best first. Those with fewer logs come after those
    /// with more, because their means may be those of the easier logs.
    pub fn ranked(mut self, summary: &Summary) -> Self {
        let place = ComparisonSpace::ALL.into_iter().find(|place| {
            summary.pipelines.iter().any(|p| p.figures.contains_key(&MAIN.key(*place)))
        });
        let Some(place) = place else { return self };
        let key = MAIN.key(place);
        // The sort is stable, so that equal ones stay sorted by name.
        self.pipelines.sort_by(|a, b| {
            let [a, b] = [a, b].map(|name| {
                let estimate = summary.pipeline(name).and_then(|it| it.figures.get(&key));
                let estimate = estimate.filter(|estimate| estimate.mean.is_finite());
                estimate.map_or((0, f64::NEG_INFINITY), |estimate| (estimate.logs, estimate.mean))
            });
            b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
        });
        self
    }

    /// Returns the finished tasks of a pipeline.
    pub fn done(&self, pipeline: &str) -> impl Iterator<Item = &'a TaskResult> {
        self.of(pipeline).filter(|t| t.outcome == Outcome::Done)
    }

    /// Returns all tasks of a pipeline.
    pub fn of(&self, pipeline: &str) -> impl Iterator<Item = &'a TaskResult> {
        self.tasks.iter().copied().filter(move |t| t.pipeline == pipeline)
    }

    /// Returns the finished task of a pipeline on a log with the lowest seed, for charts with one
    /// task per log.
    pub fn drawn(&self, pipeline: &str, log: &str) -> Option<&'a TaskResult> {
        self.done(pipeline).find(|t| t.log == log)
    }
}
