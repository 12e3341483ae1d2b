//! Prints how long the frames of a log take with each config that is named, in milliseconds of
//! processor time, on one thread and without reading: median, 95 % and 99 % of the frames are
//! faster, the slowest frame by the median, its index and its longest stage. Each frame counts with
//! the least time of five runs, because other programs only ever make one longer, or, after
//! `--once`, with the time of one run.
//!
//! ```sh
//! cargo run --release -p tagalong-benches --example time_frames -- LOG configs/depth-ekf.toml
//! ```
#![allow(clippy::print_stdout, reason = "a program for developers")]

use std::error::Error;
use std::path::Path;

use cpu_time::ThreadTime;
use tagalong_config::Registry;
use tagalong_log::FrameSource;
use tagalong_math::percentile;
use tagalong_pipeline::{FrameReport, Pipeline};

const RUNS: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let mut paths = std::env::args().skip(1);
    let mut log = paths.next().ok_or("expected: [--once] LOG CONFIG...")?;
    let is_once = log == "--once";
    if is_once {
        log = paths.next().ok_or("expected: --once LOG CONFIG...")?;
    }
    let runs = if is_once { 1 } else { RUNS };
    let registry = tagalong_catalog::registry();
    println!("| config | log | p50 [ms] | p95 | p99 | slowest | slowest / p50 | frame | stage |");
    println!("|---|---|---|---|---|---|---|---|---|");
    for config in paths {
        let first = run(&log, &config, &registry)?;
        let frames = (1..runs).try_fold(first, |best, _| {
            Ok::<_, Box<dyn Error>>(least(best, run(&log, &config, &registry)?))
        })?;
        print_row(&log, &config, &frames);
    }
    Ok(())
}

/// A frame: processor time, ms, and the stage that took longest.
struct Timed {
    index: u64,
    ms: f64,
    stage: &'static str,
}

fn least(before: Vec<Timed>, now: Vec<Timed>) -> Vec<Timed> {
    before.into_iter().zip(now).map(|(a, b)| if b.ms < a.ms { b } else { a }).collect()
}

fn run(log: &str, config: &str, registry: &Registry) -> Result<Vec<Timed>, Box<dyn Error>> {
    let mut pipeline = Pipeline::builder(registry).threads(1).from_toml_file(config)?;
    let input = pipeline.config().table("input")?;
    let limits = pipeline.config().table("limits")?;
    let mut source = FrameSource::open(Path::new(log), &input, &limits, pipeline.inputs())?;
    let mut frames = Vec::new();
    while let Some(item) = source.next_frame() {
        let start = ThreadTime::now();
        let report = pipeline.step(&item.frame)?;
        let ms = 1e3 * start.elapsed().as_secs_f64();
        frames.push(Timed { index: report.index, ms, stage: longest(&report) });
    }
    Ok(frames)
}

fn longest(report: &FrameReport) -> &'static str {
    report.timings.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or("", |(stage, _)| stage)
}

fn print_row(log: &str, config: &str, frames: &[Timed]) {
    fn name(path: &str) -> String {
        Path::new(path).file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    let times: Vec<f64> = frames.iter().map(|frame| frame.ms).collect();
    let [p50, p95, p99] =
        [0.5, 0.95, 0.99].map(|part| percentile(&times, part).unwrap_or(f64::NAN));
    let Some(slowest) = frames.iter().max_by(|a, b| a.ms.total_cmp(&b.ms)) else { return };
    println!(
        "| {} | {} | {p50:.2} | {p95:.2} | {p99:.2} | {:.2} | {:.1} | {} | {} |",
        name(config),
        name(log),
        slowest.ms,
        slowest.ms / p50,
        slowest.index,
        slowest.stage
    );
}
