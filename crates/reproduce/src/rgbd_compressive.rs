//! P2: upper bodies by gradients, a compressive tracker and a Kalman filter in
//! the image.

use tagalong_eval::{Similarity, Tally};
use tagalong_sim::Scene;
use tagalong_trials::{Judge, Run, Trial, TrialError};

use crate::{Cell, Experiment, Findings, Lab, ReproduceError, Row, System, Table};

/// The system.
pub const SYSTEM: System = System {
    name: "rgbd-compressive",
    about: "P2: upper bodies in RGB-D images, compressive tracking, a Kalman filter",
    experiments: &[
        Experiment {
            name: "static",
            about: "Fig. 6: log-average miss rate before a fixed camera, part by part",
            run: fixed,
        },
        Experiment {
            name: "moving",
            about: "Fig. 7: the same from a robot that drives",
            run: moving,
        },
    ],
};

/// The parts, then the whole, then what it is to be compared with.
const PIPELINES: [&str; 7] = [
    "rgbd-detector",
    "rgbd-kalman",
    "rgbd-follow",
    "rgbd-compressive",
    "rgbd-compressive-as-printed",
    "rgbd-best",
    "depth-ekf",
];
/// Logs of each kind in the paper.
const STATIC_LOGS: u64 = 17;
/// See `STATIC_LOGS`; they come from three kinds of rooms.
const MOVING_LOGS: u64 = 18;
const ROOMS: [&str; 3] = ["office", "corridor", "cafeteria"];
/// Tests that depth and geometry make of windows, and the one that follows.
const BY_DEPTH: [&str; 2] = ["window: size and depth", "window: head height"];
const BY_GRADIENTS: &str = "window: gradients";

/// How one pipeline did on one scene.
struct Done {
    tally: Tally,
    frames: u64,
    ms: f64,
    /// Windows that could have been looked at, and that were.
    windows: [u64; 2],
}

fn fixed(lab: &Lab) -> Result<Findings, ReproduceError> {
    let scenes = lab.scenes("static-high", &[], lab.seeds(STATIC_LOGS))?;
    let title = "Log-average miss rate before a fixed camera (P2, Fig. 6)";
    table(lab, title, &scenes, 23.8)
}

fn moving(lab: &Lab) -> Result<Findings, ReproduceError> {
    let seeds = lab.seeds(MOVING_LOGS).div_ceil(ROOMS.len() as u64);
    let mut scenes = Vec::new();
    for room in ROOMS {
        scenes.extend(lab.scenes(room, &[], seeds)?);
    }
    table(lab, "Log-average miss rate from a robot (P2, Fig. 7)", &scenes, 22.2)
}

fn table(
    lab: &Lab,
    title: &str,
    scenes: &[Scene],
    published_hz: f64,
) -> Result<Findings, ReproduceError> {
    let contenders = lab.contenders(&PIPELINES)?;
    let trials = lab.trials(title, scenes, &contenders, done)?;
    let of = |at: usize| trials.iter().map(|runs| &runs[at]).collect::<Vec<_>>();
    let published = |name: &str, hz: f64| {
        let mut cells = vec![Cell::default(); 6];
        cells[3] = Cell::number(hz, 1);
        Row::published(name, cells)
    };
    let mut rows = vec![published("P2", published_hz), published("RJ-MCMC, on a GPU", 4.0)];
    rows.extend((0..PIPELINES.len()).map(|at| Row::ours(PIPELINES[at], row(&of(at)))));
    let columns =
        ["LAMR", "recall", "IDF1", "frames/s", "windows a frame", "with depth"].map(String::from);
    let notes = vec![
        format!(
            "{} drawn scenes; boxes, IoU 0.5; people within 6 m; predicted boxes count",
            scenes.len()
        ),
        "The paper's curves are pictures; it says that it is better than RJ-MCMC by 8.0 (static) \
         and 8.55 (robot) points."
            .into(),
        "Frames a second are of this machine, and not exact while it does other things.".into(),
    ];
    Ok(Table { title: title.into(), columns: columns.to_vec(), rows, notes }.into())
}

fn done(trial: Trial) -> Result<Vec<Done>, TrialError> {
    let judge = Judge { similarity: Similarity::Iou, coasting: true, ..Judge::default() };
    let of = |run: &Run| {
        let count = |test: &str| run.reports.iter().map(|r| r.funnel.count(test)).sum::<u64>();
        let [unfit, misplaced] = BY_DEPTH.map(count);
        let looked_at = count(BY_GRADIENTS);
        let times = run.reports.iter().flat_map(|report| &report.timings);
        Ok(Done {
            tally: judge.judge(&trial, run)?.tally,
            frames: run.reports.len() as u64,
            ms: times.map(|(_, ms)| ms).sum(),
            windows: [unfit + misplaced + looked_at, looked_at],
        })
    };
    trial.runs.iter().map(of).collect()
}

fn row(all: &[&Done]) -> Vec<Cell> {
    let tally = Tally::combine(all.iter().map(|done| &done.tally));
    let scores = tally.scores();
    let number = |value: Option<f64>| Cell::number(value.unwrap_or(f64::NAN), 3);
    let frames = all.iter().map(|done| done.frames).sum::<u64>() as f64;
    let ms: f64 = all.iter().map(|done| done.ms).sum();
    let windows = |at: usize| match all.iter().map(|done| done.windows[at]).sum::<u64>() {
        0 => Cell::default(),
        sum => Cell::number(sum as f64 / frames, 0),
    };
    vec![
        number(tally.detections.log_average_miss_rate()),
        number(scores.recall),
        number(scores.idf1),
        Cell::number(1e3 * frames / ms, 0),
        windows(0),
        windows(1),
    ]
}
