//! Benchmark results as a self-contained web page, as JSON and as a table.

mod model;

pub use model::{
    Benchmark, Dropped, EventRow, Outcome, StageTiming, TaskResult, TaskTiming, Timings, Trajectory,
};
