use std::collections::BTreeSet;

use crate::model::{Benchmark, Outcome, TaskResult};

/// Benchmark in an order that does not depend on the way its tasks were run.
pub struct OrderedBenchmark<'a> {
    pub version: &'a str,
    /// Tasks by pipeline, log, seed and hash.
    pub tasks: Vec<&'a TaskResult>,
    pub pipelines: Vec<&'a str>,
    pub logs: Vec<&'a str>,
}

impl<'a> OrderedBenchmark<'a> {
    pub fn new(benchmark: &'a Benchmark) -> Self {
        let mut tasks: Vec<&TaskResult> = benchmark.tasks.iter().collect();
        // With the hash last, the order never depends on that of the input.
        tasks.sort_by_key(|t| (&t.pipeline, &t.log, t.seed, &t.hash));
        let names = |of: fn(&TaskResult) -> &str| {
            tasks.iter().map(|&t| of(t)).collect::<BTreeSet<_>>().into_iter().collect()
        };
        let (pipelines, logs) = (names(|t| &t.pipeline), names(|t| &t.log));
        Self { version: &benchmark.version, tasks, pipelines, logs }
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
