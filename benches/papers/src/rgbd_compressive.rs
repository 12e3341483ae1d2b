//! P2: upper bodies by gradients, a compressive tracker and a Kalman filter in the image.

use std::ops::Range;

use tagalong_eval::{Similarity, Tally};
use tagalong_pipeline::FrameReport;
use tagalong_report::{Cell, Row, Table};
use tagalong_sim::Scene;
use tagalong_trials::{Contender, Judge, Run, Trial, TrialError};

use crate::findings::{Experiment, Findings, System};
use crate::forms::{self, Forms, Headline};
use crate::given::given;
use crate::lab::{Lab, ReproduceError};
use crate::recorded::{Recorded, recorded};

/// The system of P2.
pub const SYSTEM: System = System {
    name: "rgbd-compressive",
    about: "P2: upper bodies in RGB-D images, compressive tracking, a Kalman filter",
    experiments: &[
        forms::experiment(|lab| OF_P2.compare(lab)),
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
        Experiment {
            name: "length",
            about: "how long a log has to be for its miss rate to settle",
            run: length,
        },
        Experiment {
            name: "boxes",
            about: "how many of the boxes around a person depth leaves, and which",
            run: boxes,
        },
        Experiment {
            name: "speed",
            about: "Table I: frames a second, with one to eight people",
            run: speed,
        },
        Experiment {
            name: "colour",
            about: "the real logs without their depth images",
            run: colour,
        },
        Experiment {
            name: "given",
            about: "boxes that others detected, MOT15: filter and association beside SORT",
            run: given,
        },
    ],
};

/// Forms of P2.
pub(crate) const OF_P2: Forms = Forms {
    paper: "P2",
    configs: ["rgbd-compressive-as-printed", "rgbd-compressive", "rgbd-ekf"],
    contenders: forms::shipped,
    judge: JUDGE,
    has_real: true,
    otherwise: None,
    scene: "static-high",
    scenes: static_scenes,
    headline: Headline {
        column: "frames/s",
        published: 23.8,
        digits: 0,
        is_share: false,
        of: frames_a_second,
    },
    notes: &[
        "Trained on: the detectors of faces and upper bodies on photographs alone. A threshold of \
         the last row was chosen while looking at real logs.",
        "The paper's curves of the miss rate are pictures (next table); frames a second are of \
         processor time, and its processor is an older one.",
    ],
};

fn frames_a_second(trial: Trial) -> Result<Vec<Vec<f64>>, TrialError> {
    Ok(trial.runs.iter().map(|run| vec![1e3 * run.reports.len() as f64 / run.worked_ms]).collect())
}

/// The parts, the whole, and the pipelines for comparison.
const PIPELINES: [&str; 9] = [
    "rgbd-faces",
    "rgbd-upper-bodies",
    "rgbd-detector",
    "rgbd-kalman",
    "rgbd-follow",
    "rgbd-compressive",
    "rgbd-compressive-as-printed",
    "rgbd-ekf",
    "depth-ekf",
];
/// Pipelines for logs without depth.
const WITHOUT_DEPTH: [&str; 2] = ["mono", "rgbd-compressive"];
/// Number of simulated static logs; the paper has 17, and 18 moving ones. Half as many of twice the
/// length take the same time.
const STATIC_LOGS: u64 = 8;
/// Number of simulated moving logs, from three kinds of rooms.
const MOVING_LOGS: u64 = 9;
const ROOMS: [&str; 3] = ["office", "corridor", "cafeteria"];
/// Pipeline for which boxes are counted.
const FOLLOWER: &str = "rgbd-compressive";
/// Duration of each log; see the experiment `length`.
const SIMULATED: [(&str, &str); 1] = [("duration_s", "12")];
/// Number of logs for the miss rate by length, and their full duration.
const GROWING_LOGS: u64 = 4;
const GROWING_S: &str = "48";
/// Durations of the parts that are judged.
const LENGTHS_S: [f64; 5] = [48.0, 24.0, 12.0, 6.0, 3.0];
const GROWING: [&str; 2] = ["rgbd-compressive", "rgbd-ekf"];

/// Number of logs of one person each, in which boxes around the person are counted, and their
/// duration.
const BOXED_LOGS: u64 = 2;
const BOXED_S: &str = "3";
/// Radii of the search around the expected position, widths. The papers' boxes are some 64 pixels
/// wide and searched pixel by pixel: 0.75 widths are 48 pixels and 7,200 boxes.
const RADII: [f64; 4] = [0.2, 0.4, 0.75, 1.5];
/// Radius of the search of `rgbd-compressive`, which starts on a coarse grid.
const COARSE: f64 = 0.4;
/// Tolerances of the depth of a box against the distance of the person, m. The first is P2's.
const TOLERANCES_M: [f64; 2] = [0.5, 0.1];
/// Tests of windows by depth and geometry, and the test that follows.
const BY_DEPTH: [&str; 3] =
    ["window: size and depth", "window: goes on above", "window: head height"];
const BY_GRADIENTS: &str = "window: gradients";
/// Tests of boxes around tracks, and the one that follows.
const BOXES: [&str; 2] = ["box: outside", "box: depth"];
const COMPARED: &str = "box: another is surer";

/// Numbers of people in the table of times.
const CROWDS: [&str; 4] = ["1", "2", "4", "8"];
/// Pipelines that are timed.
const TIMED: [&str; 3] = ["rgbd-compressive", "rgbd-compressive-as-printed", "rgbd-ekf"];
/// Number of scenes of each crowd, and their duration.
const TIMED_SCENES: u64 = 3;
const TIMED_S: &str = "4";

/// Results of one pipeline on one scene or log.
struct PipelineResult {
    tally: Tally,
    work: Work,
}

/// Work of one pipeline.
#[derive(Clone, Copy, Default)]
struct Work {
    frames: u64,
    /// Processor time.
    ms: f64,
    /// Candidate windows, and those that were classified.
    windows: [u64; 2],
    /// Candidate boxes around tracks, and those that were compared.
    boxes: [u64; 2],
    /// Frames in which such boxes were searched.
    searched: u64,
}

impl Work {
    fn of(reports: &[FrameReport], ms: f64) -> Self {
        fn is_searched(r: &&FrameReport) -> bool {
            BOXES.iter().chain([&COMPARED]).any(|test| r.funnel.count(test) > 0)
        }

        fn count(reports: &[FrameReport], tests: &[&str]) -> u64 {
            reports.iter().map(|r| tests.iter().map(|test| r.funnel.count(test)).sum::<u64>()).sum()
        }

        let by_depth = count(reports, &BY_DEPTH);
        let looked_at = count(reports, &[BY_GRADIENTS]);
        let compared = count(reports, &[COMPARED]);
        Self {
            frames: reports.len() as u64,
            ms,
            // Each window either fails a test of depth or reaches the gradients.
            windows: [by_depth + looked_at, looked_at],
            boxes: [compared + count(reports, &BOXES), compared],
            searched: reports.iter().filter(is_searched).count() as u64,
        }
    }

    fn sum(all: impl IntoIterator<Item = Self>) -> Self {
        all.into_iter().fold(Self::default(), |a, b| Self {
            frames: a.frames + b.frames,
            ms: a.ms + b.ms,
            windows: [a.windows[0] + b.windows[0], a.windows[1] + b.windows[1]],
            boxes: [a.boxes[0] + b.boxes[0], a.boxes[1] + b.boxes[1]],
            searched: a.searched + b.searched,
        })
    }

    /// Returns frames per second; windows and boxes per frame, and how many of each remain after
    /// the depth tests.
    fn cells(&self) -> [Cell; 5] {
        let hz = Cell::number(1e3 * self.frames as f64 / self.ms, 0);
        let ([windows, looked_at], [boxes, compared]) = (self.windows, self.boxes);
        let [windows, looked_at, boxes, compared] =
            [windows, looked_at, boxes, compared].map(|count| match count {
                0 => Cell::default(),
                _ => Cell::number(count as f64 / self.frames as f64, 0),
            });
        [hz, windows, looked_at, boxes, compared]
    }
}

fn fixed(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    let scenes = static_scenes(lab)?;
    let title = "Log-average miss rate before a fixed camera (P2, Fig. 6)";
    table(lab, title, &scenes, 23.8)
}

/// Returns the simulated logs before a fixed camera.
fn static_scenes(lab: &Lab<'_>) -> Result<Vec<Scene>, ReproduceError> {
    lab.scenes("static-high", &SIMULATED, lab.seeds(STATIC_LOGS))
}

fn moving(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    // At least one scene of each kind of room.
    let seeds = lab.seeds(MOVING_LOGS).div_ceil(ROOMS.len() as u64);
    let mut scenes = Vec::new();
    for room in ROOMS {
        scenes.extend(lab.scenes(room, &SIMULATED, seeds)?);
    }
    table(lab, "Log-average miss rate from a robot (P2, Fig. 7)", &scenes, 22.2)
}

fn table(
    lab: &Lab<'_>,
    title: &str,
    scenes: &[Scene],
    published_hz: f64,
) -> Result<Findings, ReproduceError> {
    let contenders = lab.contenders(&PIPELINES)?;
    let real = recorded(lab, &contenders, &JUDGE)?;
    let trials = lab.trials(title, scenes, &contenders, done)?;
    let mut rows = vec![published("P2", published_hz, 6), published("RJ-MCMC, on a GPU", 4.0, 6)];
    for (at, (name, real)) in PIPELINES.iter().zip(&real).enumerate() {
        let simulated: Vec<&PipelineResult> = trials.iter().map(|runs| &runs[at]).collect();
        let mut cells = scores(real.iter().map(|log| &log.tally)).to_vec();
        cells.extend(scores(simulated.iter().map(|done| &done.tally)));
        cells.extend(Work::sum(simulated.iter().map(|done| done.work)).cells());
        rows.push(Row::ours(*name, cells));
    }
    let scores = ["LAMR", "IDF1", "MOTA"];
    let scores =
        ["real", "simulated"].into_iter().flat_map(|w| scores.map(|s| format!("{s}, {w}")));
    let columns = scores.chain(WORK.map(String::from)).collect();
    let notes = vec![
        describe(&real),
        format!(
            "{} simulated scenes; boxes, IoU 0.5; people within 6 m; predicted boxes count",
            scenes.len()
        ),
        "The paper's curves are pictures; it says that it is better than RJ-MCMC by 8.0 (static) \
         and 8.55 (robot) points."
            .into(),
        TIMES.into(),
    ];
    Ok(Table { title: title.into(), columns, rows, notes }.into())
}

/// Columns of [`Work::cells`].
const WORK: [&str; 5] =
    ["frames/s", "windows a frame", "windows with depth", "boxes a frame", "boxes with depth"];
/// Judge of real and of simulated people.
const JUDGE: Judge = Judge { similarity: Similarity::Iou, max_range_m: 6.0, coasting: true };
const TIMES: &str =
    "Frames a second are of the time that one core worked; a busy machine makes it work slower.";

/// Returns a published row with frames per second only, after `before` empty columns.
fn published(name: &str, hz: f64, before: usize) -> Row {
    let mut cells = vec![Cell::default(); before + WORK.len()];
    cells[before] = Cell::number(hz, 1);
    Row::published(name, cells)
}

/// Describes the real logs in a note.
fn describe(real: &[Vec<Recorded>]) -> String {
    let Some(first) = real.first().filter(|logs| !logs.is_empty()) else {
        return "The real logs are skipped: there are none in the folder of data.".into();
    };
    let frames: usize = first.iter().map(|log| log.reports.len()).sum();
    let logs = first.len();
    format!("{logs} real logs with {frames} frames, annotated by hand; cameras at rest")
}

/// Compares the miss rates of the first seconds of the same logs, and of the second half.
fn length(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    let contenders = lab.contenders(&GROWING)?;
    let set = [("duration_s", GROWING_S)];
    let scenes = lab.scenes("static-high", &set, lab.seeds(GROWING_LOGS))?;
    let trials = lab.trials("growing logs", &scenes, &contenders, growing)?;
    let mut rows = Vec::new();
    for (at, name) in GROWING.iter().enumerate() {
        let cells = (0..=LENGTHS_S.len()).rev().map(|part| {
            let parts: Vec<&Tally> = trials.iter().map(|runs| &runs[at][part]).collect();
            let rate = Tally::combine(parts).detections.log_average_miss_rate();
            Cell::number(rate.unwrap_or(f64::NAN), 3)
        });
        rows.push(Row::ours(*name, cells.collect()));
    }
    let firsts = LENGTHS_S.iter().rev().map(|seconds| format!("first {seconds} s"));
    let columns = std::iter::once("second half".to_owned()).chain(firsts).collect();
    let notes = vec![format!(
        "Log-average miss rate of {} simulated logs before a fixed camera, as they grow",
        scenes.len()
    )];
    let title = "Log-average miss rate by the length of the logs".into();
    Ok(Table { title, columns, rows, notes }.into())
}

/// Returns for each contender the tallies of the first seconds, longest first, and last that of the
/// second half.
fn growing(trial: Trial) -> Result<Vec<Vec<Tally>>, TrialError> {
    let frames = trial.moments.len();
    // The longest duration is that of the whole log.
    let mut tallies = vec![Vec::new(); trial.runs.len()];
    for frames in LENGTHS_S
        .map(|seconds| 0..(frames as f64 * seconds / LENGTHS_S[0]).round() as usize)
        .into_iter()
        .chain(std::iter::once(frames / 2..frames))
    {
        let part = part(&trial, frames);
        for (run, tallies) in part.runs.iter().zip(&mut tallies) {
            tallies.push(JUDGE.judge(&part, run)?.tally);
        }
    }
    Ok(tallies)
}

/// Returns some frames of a trial.
fn part(trial: &Trial, frames: Range<usize>) -> Trial {
    Trial {
        moments: trial.moments[frames.clone()].to_vec(),
        runs: trial
            .runs
            .iter()
            .map(|run| Run {
                pipeline: run.pipeline.clone(),
                reports: run.reports[frames.clone()].to_vec(),
                worked_ms: run.worked_ms,
            })
            .collect(),
        furniture: trial.furniture.clone(),
        camera: trial.camera.clone(),
        seed: trial.seed,
    }
}

/// Counts the boxes around one person, pixel by pixel.
fn boxes(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    let set = [("crowd", "1"), ("duration_s", BOXED_S)];
    let scenes = lab.scenes("crowd", &set, lab.seeds(BOXED_LOGS))?;
    let mut contenders = Vec::new();
    let searches: Vec<(f64, bool)> =
        std::iter::once((COARSE, false)).chain(RADII.map(|radius| (radius, true))).collect();
    for tolerance_m in TOLERANCES_M {
        for (radius, each_pixel) in &searches {
            let follower = lab.contender(FOLLOWER)?;
            contenders.push(searching(follower, *radius, *each_pixel, tolerance_m));
        }
    }
    let trials = lab.trials("boxes around a person", &scenes, &contenders, done)?;
    let mut rows = Vec::new();
    for (at, (radius, each_pixel)) in searches.iter().enumerate() {
        let mut cells = Vec::new();
        for tolerance in 0..TOLERANCES_M.len() {
            let run = tolerance * searches.len() + at;
            let work = Work::sum(trials.iter().map(|runs| runs[run].work));
            let Work { boxes: [all, left], searched, .. } = work;
            // The number of all boxes does not depend on the tolerance.
            if tolerance == 0 {
                cells.push(Cell::number(all as f64 / searched as f64, 0));
            }
            cells.push(Cell::number(left as f64 / searched as f64, 0));
            cells.push(Cell::number(100.0 * left as f64 / all as f64, 1));
        }
        let how = if *each_pixel { "pixel by pixel" } else { "on the coarse grid" };
        rows.push(Row::ours(format!("within {radius} widths, {how}"), cells));
    }
    let columns = std::iter::once("boxes a searched frame".to_owned())
        .chain(
            TOLERANCES_M
                .iter()
                .flat_map(|metres| [format!("within {metres} m"), format!("within {metres} m, %")]),
        )
        .collect();
    let notes = vec![
        "Boxes of a search around where a person is expected, and those of them that show something as far away as the person, give or take; a box shows what \
         the median of its central half shows."
            .into(),
        "The paper: more than 7000, and 40 that are left.".into(),
    ];
    Ok(Table { title: "Boxes that depth leaves (P2, section IV)".into(), columns, rows, notes }
        .into())
}

/// Returns the pipeline with another search around a person.
fn searching(contender: Contender, radius: f64, each_pixel: bool, tolerance_m: f64) -> Contender {
    let section = "plugin = \"compressive\"\n";
    let config = format!(
        "{section}config = {{ full_search = {each_pixel}, search_radius = {radius:?}, \
         depth_tolerance_m = {tolerance_m:?} }}\n"
    );
    Contender { config: contender.config.replace(section, &config), ..contender }
}

fn colour(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    let contenders: Vec<Contender> =
        lab.contenders(&WITHOUT_DEPTH)?.into_iter().map(without_depth).collect();
    let real = recorded(lab, &contenders, &JUDGE)?;
    let rows = WITHOUT_DEPTH
        .iter()
        .zip(&real)
        .map(|(name, logs)| {
            let mut cells = scores(logs.iter().map(|log| &log.tally)).to_vec();
            cells.push(
                Work::sum(logs.iter().map(|log| Work::of(&log.reports, log.worked_ms))).cells()[0]
                    .clone(),
            );
            Row::ours(*name, cells)
        })
        .collect();
    let columns = ["LAMR, real", "IDF1, real", "MOTA, real", WORK[0]].map(String::from).to_vec();
    let notes = vec![describe(&real), "Boxes, IoU 0.5; people within 6 m".into(), TIMES.into()];
    Ok(Table { title: "Without depth".into(), columns, rows, notes }.into())
}

/// Returns the same pipeline without the depth images of the logs.
fn without_depth(contender: Contender) -> Contender {
    let key = "without = [\"depth\"]";
    if contender.config.contains(key) {
        return contender;
    }
    // A top-level key must stand before the first table of the config.
    Contender { config: format!("{key}\n{}", contender.config), ..contender }
}

fn done(trial: Trial) -> Result<Vec<PipelineResult>, TrialError> {
    trial
        .runs
        .iter()
        .map(|run| {
            Ok(PipelineResult {
                tally: JUDGE.judge(&trial, run)?.tally,
                work: Work::of(&run.reports, run.worked_ms),
            })
        })
        .collect()
}

/// Returns log-average miss rate, IDF1 and MOTA.
fn scores<'a>(tallies: impl Iterator<Item = &'a Tally>) -> [Cell; 3] {
    let tallies: Vec<&Tally> = tallies.collect();
    if tallies.is_empty() {
        return [Cell::default(), Cell::default(), Cell::default()];
    }
    let tally = Tally::combine(tallies);
    let scores = tally.scores();
    [tally.detections.log_average_miss_rate(), scores.idf1, scores.mota]
        .map(|value| Cell::number(value.unwrap_or(f64::NAN), 3))
}

fn speed(lab: &Lab<'_>) -> Result<Findings, ReproduceError> {
    let contenders = lab.contenders(&TIMED)?;
    let mut p2 = published("P2, before a fixed camera", 23.8, 0);
    (p2.cells[3], p2.cells[4]) = (Cell::number(7000.0, 0), Cell::number(40.0, 0));
    let mut rows = vec![p2, published("P2, from a robot", 22.2, 0)];
    for crowd in CROWDS {
        let set = [("crowd", crowd), ("duration_s", TIMED_S)];
        let scenes = lab.scenes("crowd", &set, lab.seeds(TIMED_SCENES))?;
        let trials = lab.trials("frames a second", &scenes, &contenders, done)?;
        for (at, name) in TIMED.iter().enumerate() {
            let work = Work::sum(trials.iter().map(|runs| runs[at].work));
            let people = if crowd == "1" { "person" } else { "people" };
            rows.push(Row::ours(format!("{name}, {crowd} {people}"), work.cells().to_vec()));
        }
    }
    let columns = WORK.map(String::from).to_vec();
    let title = "Frames a second by the number of people (P2, Table I)";
    let notes = vec![
        "The paper's boxes are those of one person; without depth more than 7000.".into(),
        TIMES.into(),
    ];
    Ok(Table { title: title.into(), columns, rows, notes }.into())
}
