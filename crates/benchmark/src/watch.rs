//! Collection of the reports of one pipeline on the frames of one log.

use std::collections::BTreeMap;

use tagalong_app::missed::{Missed, Rules, Witness, find_missed};
use tagalong_app::scoring::{
    Rate, Reports, Shots, TruthFile, assemble, comparable, comparison, region, with_remedy,
};
use tagalong_app::timings::{StageTimes, Timings, WHOLE_FRAME};
use tagalong_core::{Funnel, Track};
use tagalong_eval::{
    Clear, Consistency, Event, Prepared, Repaired, Role, Sequence, SetDistance, Similarity, Tally,
    events, repairs,
};
use tagalong_log::LogFrame;
use tagalong_pipeline::FrameReport;
use tagalong_report::{Dropped, EventRow, StageTiming, TaskResult, TaskTiming, Trajectory};

use super::misses::add_missed;
use super::store::Recording;

/// Height of people whose whole bodies are tracked, m, the same as in the truth of whole bodies.
const STANDING_M: f64 = 1.7;

/// Confidence level of the bounds on the normalised innovation squared.
const CONFIDENCE: f64 = 0.95;

/// Collector of a pipeline's reports, frame by frame.
#[derive(Default)]
pub struct Watch {
    reports: Reports,
    paths: BTreeMap<i64, Vec<(u32, [f64; 2])>>,
    funnel: Funnel,
    nis: Vec<(f64, u32)>,
    frames: u64,
    times: Timings,
    stages: Vec<&'static str>,
}

impl Watch {
    /// Adds the report of a frame.
    pub fn take(&mut self, item: &LogFrame, report: &FrameReport) {
        self.funnel.merge(&report.funnel);
        self.nis.extend(report.nis.iter().map(|(_, nis, freedom)| (*nis, *freedom)));
        self.time(report);
        // A duplicate or late frame has no tracks of its own to score.
        if !report.outcome.is_processed() {
            return;
        }
        self.frames += 1;
        let number = u32::try_from(report.index).unwrap_or(u32::MAX);
        // A track that is only predicted has no box that could be scored.
        for track in report.tracks.iter().filter(|track| track.confirmed && track.seen) {
            self.track(item, number, track);
        }
    }

    fn track(&mut self, item: &LogFrame, number: u32, track: &Track) {
        let camera = &item.frame.camera;
        // The truth of whole people is reduced to their upper bodies, and so are tracks.
        let tracked = track.estimate.region;
        let upper = if tracked.is_whole_body() {
            tracked.upper_body_of_standing(STANDING_M)
        } else {
            tracked
        };
        let visible = upper.clipped(camera.width, camera.height);
        let head = track.estimate.person.position.xy();
        let id = i64::from(track.id.0);
        self.reports.entry(number).or_default().push(tagalong_eval::Report {
            id,
            region: (visible.area() > 0.0).then(|| region(&visible)),
            floor_m: Some([head.x, head.y]),
            score: track.score,
        });
        let in_odom = item.odom_from_robot * head;
        self.paths.entry(id).or_default().push((number, [in_odom.x, in_odom.y]));
    }

    fn time(&mut self, report: &FrameReport) {
        for (stage, _) in &report.timings {
            if !self.stages.contains(stage) {
                self.stages.push(stage);
            }
        }
        self.times.add_frame(&report.timings);
    }

    /// Returns the times of the frames.
    pub fn timing(&self) -> TaskTiming {
        let all = self.times.summary();
        let whole = all.get(WHOLE_FRAME).cloned().unwrap_or_default();
        let stages = self.stages.iter().map(|stage| {
            let times = all.get(*stage).cloned().unwrap_or_default();
            let StageTimes { p50_ms, p95_ms, p99_ms, max_ms, .. } = times;
            StageTiming { stage: (*stage).to_owned(), p50_ms, p95_ms, p99_ms, max_ms }
        });
        TaskTiming {
            frame_ms_p50: whole.p50_ms,
            frame_ms_p95: whole.p95_ms,
            frame_ms_p99: whole.p99_ms,
            frame_ms_max: whole.max_ms,
            stages: stages.collect(),
        }
    }

    /// Scores the reports. `result` already names the task. The causes of missed people are given
    /// if there is a witness of the run, with its rules.
    ///
    /// # Errors
    /// Truth that contradicts itself, as a sentence.
    pub fn score(
        self,
        truth: &TruthFile,
        shots: &Shots,
        mut result: TaskResult,
        told: Option<(&Witness, Rules<'_>)>,
    ) -> Result<(TaskResult, Recording), String> {
        result.frames = self.frames;
        result.nis = consistency(&self.nis);
        let dropped = self.funnel.entries().iter();
        result.funnel =
            dropped.map(|d| Dropped { test: d.test.to_owned(), count: d.count }).collect();
        result.tracks = paths(self.paths, shots);
        let sequence = assemble(&result.log, truth, shots, self.reports, Rate(1.0));
        score_tracks(sequence, truth, shots, told, result)
    }
}

/// Scores truth and tracks. `result` already names the task; causes are as for [`Watch::score`].
///
/// # Errors
/// Truth that contradicts itself, as a sentence.
pub fn score_tracks(
    sequence: Sequence,
    truth: &TruthFile,
    shots: &Shots,
    told: Option<(&Witness, Rules<'_>)>,
    mut result: TaskResult,
) -> Result<(TaskResult, Recording), String> {
    result.duration_s = shots.duration_s();
    result.truth = truth_paths(&sequence, shots);
    score(&sequence, truth, told, &mut result)?;
    let size = shots.at(1).map_or((0, 0), |shot| (shot.camera.width, shot.camera.height));
    let width = size.0 as u32;
    let height = size.1 as u32;
    Ok((result, Recording { sequence, rate_hz: shots.rate_hz(), width, height }))
}

/// Fills in figures and events, by boxes and by positions, whichever the truth has; if it has both,
/// the events are those of the boxes.
fn score(
    sequence: &Sequence,
    truth: &TruthFile,
    told: Option<(&Witness, Rules<'_>)>,
    result: &mut TaskResult,
) -> Result<(), String> {
    let image = measure_in(sequence, truth, told, Similarity::Iou)?;
    // If the truth has both, causes are those of the boxes, like the events.
    let told = told.filter(|_| image.is_none());
    let metres = measure_in(sequence, truth, told, Similarity::Metres)?;
    result.image = image.as_ref().map(|measured| measured.tally.scores());
    result.metres = metres.as_ref().map(|measured| measured.tally.scores());
    if let Some(measured) = &image {
        result.lamr_curve = measured.tally.detections.curve();
    }
    let Some(measured) = image.or(metres) else { return Ok(()) };
    add_missed(measured.missed, result);
    result.events = measured.events.iter().map(|event| EventRow::new(event, 0)).collect();
    Ok(())
}

/// Result of one comparison of the tracks with the truth.
struct Measured {
    tally: Tally,
    events: Vec<Event>,
    missed: Vec<Missed>,
}

/// Compares in the image or on the floor, if the truth has the data for it.
fn measure_in(
    sequence: &Sequence,
    truth: &TruthFile,
    told: Option<(&Witness, Rules<'_>)>,
    similarity: Similarity,
) -> Result<Option<Measured>, String> {
    let Some(sequence) = comparable(sequence, similarity) else { return Ok(None) };
    let comparison = comparison(truth, similarity);
    let prepared = Prepared::new(&sequence, &comparison).map_err(|error| with_remedy(&error))?;
    let (_, matches) = Clear::measure(&prepared);
    let missed =
        told.map(|(witness, rules)| find_missed(&sequence, &prepared, &matches, witness, rules));
    let missed = missed.unwrap_or_default();
    let tally = Tally::measure(&sequence, &comparison, &SetDistance::default());
    let tally = tally.map_err(|error| error.to_string())?;
    Ok(Some(Measured { tally, events: events(&prepared, &matches), missed }))
}

/// Returns the figures with one kind of error repaired, by boxes if the truth has them, otherwise by
/// positions; empty if it has neither.
///
/// # Errors
/// Truth that contradicts itself, as a sentence.
pub fn repaired(sequence: &Sequence, truth: &TruthFile) -> Result<Vec<Repaired>, String> {
    for similarity in [Similarity::Iou, Similarity::Metres] {
        if let Some(sequence) = comparable(sequence, similarity) {
            return repairs(&sequence, &comparison(truth, similarity))
                .map_err(|error| error.to_string());
        }
    }
    Ok(Vec::new())
}

/// Evaluates the values with the most frequent number of degrees of freedom.
fn consistency(nis: &[(f64, u32)]) -> Option<Consistency> {
    // The bounds are for a single number of degrees of freedom, so the few values with others are
    // left out.
    let mut counts: BTreeMap<u32, usize> = BTreeMap::new();
    nis.iter().for_each(|(_, freedom)| *counts.entry(*freedom).or_default() += 1);
    let (&freedom, _) = counts.iter().max_by_key(|(_, count)| **count)?;
    let values: Vec<f64> = nis.iter().filter(|(_, f)| *f == freedom).map(|(v, _)| *v).collect();
    Consistency::of(&values, freedom, CONFIDENCE)
}

fn paths(paths: BTreeMap<i64, Vec<(u32, [f64; 2])>>, shots: &Shots) -> Vec<Trajectory> {
    let trajectories = paths.into_iter().map(|(id, places)| {
        let points = places.iter().map(|(number, at)| point(*number, *at, shots));
        Trajectory { id, points: points.collect() }
    });
    trajectories.collect()
}

/// Returns the trajectories of the people that count, in the odometry frame.
fn truth_paths(sequence: &Sequence, shots: &Shots) -> Vec<Trajectory> {
    let mut paths: BTreeMap<i64, Vec<(u32, [f64; 2])>> = BTreeMap::new();
    for (number, frame) in (1..).zip(&sequence.frames) {
        for truth in frame.truths.iter().filter(|truth| truth.role == Role::Counts) {
            let (Some([x, y]), Some(shot)) = (truth.floor_m, shots.at(number)) else { continue };
            let at = shot.odom_from_robot * nalgebra::Point2::new(x, y);
            paths.entry(truth.id).or_default().push((number, [at.x, at.y]));
        }
    }
    self::paths(paths, shots)
}

/// Rounds to millimetres and milliseconds, which are enough for a plot.
fn point(number: u32, [x, y]: [f64; 2], shots: &Shots) -> [f64; 3] {
    let seconds = shots.stamp_ns(number, Rate(1.0)) as f64 * 1e-9;
    [seconds, x, y].map(|value| (value * 1e3).round() / 1e3)
}

/// Returns the rank of a kind of event, 0 first: identity errors, false tracks, misses, all others.
pub fn importance(kind: &str) -> u8 {
    match kind {
        "switch" | "wrong-person" => 0,
        "false-track" => 1,
        "miss" => 2,
        _ => 3,
    }
}
