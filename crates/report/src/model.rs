use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tagalong_eval::{Consistency, CurvePoint, Event, EventKind, Scores};

/// The results of a benchmark: pipelines x logs x seeds.
///
/// Nothing in here depends on the machine or on how many tasks ran at once:
/// the same inputs give the same bytes. Times are kept apart, in [`Timings`].
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Benchmark {
    /// Version of Tagalong that ran the tasks.
    pub version: String,
    /// One result per task, in any order.
    pub tasks: Vec<TaskResult>,
}

/// One pipeline on one log with one seed.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TaskResult {
    /// Name of the pipeline: the file name of its config without ending.
    pub pipeline: String,
    /// Name of the log: its file name without ending.
    pub log: String,
    /// The seed.
    pub seed: u64,
    /// Content hash of everything that the result depends on, in hex; the key
    /// into [`Timings::tasks`].
    pub hash: String,
    /// What went into the hash: what it is (`config`, `log`, `truth`) and the
    /// SHA-256 of it, in hex.
    #[serde(default)]
    pub inputs: BTreeMap<String, String>,
    /// How it ended.
    pub outcome: Outcome,
    /// Frames that the pipeline processed.
    pub frames: u64,
    /// Length of the recording, in seconds of its own stamps.
    pub duration_s: f64,
    /// Part of the log was lost or could not be used.
    pub data_lost: bool,
    /// Figures in the image (IoU), if the truth has boxes.
    pub image: Option<Scores>,
    /// Figures on the floor (metres), if the truth has places.
    pub metres: Option<Scores>,
    /// Miss rate over false positives per image; empty without boxes.
    #[serde(default)]
    pub lamr_curve: Vec<CurvePoint>,
    /// Whether the filter's covariance fits its innovations, if it reports any.
    pub nis: Option<Consistency>,
    /// Which test dropped how many candidates, in the order of the stages.
    #[serde(default)]
    pub funnel: Vec<Dropped>,
    /// The confirmed tracks on the floor.
    #[serde(default)]
    pub tracks: Vec<Trajectory>,
    /// The people that count on the floor, in the same frame.
    #[serde(default)]
    pub truth: Vec<Trajectory>,
    /// What happened, in the order of time.
    #[serde(default)]
    pub events: Vec<EventRow>,
}

/// How a task ended.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "ended")]
pub enum Outcome {
    /// It ran to the end of the log.
    #[default]
    Done,
    /// It stopped with an error or a panic.
    Failed {
        /// The error, for people to read.
        why: String,
    },
    /// It was never begun, because the log lacks what the pipeline needs.
    Skipped {
        /// What is missing.
        why: String,
    },
}

/// A test and how many candidates it dropped.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Dropped {
    /// The test.
    pub test: String,
    /// Candidates dropped by it.
    pub count: u64,
}

/// Where somebody was on the floor over time.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Trajectory {
    /// Id of the person or of the track.
    pub id: i64,
    /// Time since the first frame of the log in seconds, then x and y in the
    /// odometry frame in metres (x ahead of the robot as it started, y left).
    pub points: Vec<[f64; 3]>,
}

/// Something worth looking at in a recording.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct EventRow {
    /// 1-based index of the frame in which it begins.
    pub frame: u64,
    /// Time since the first frame of the log, in seconds.
    pub t_s: f64,
    /// `miss`, `found`, `switch`, `wrong-person`, `false-track`, or a kind of
    /// the caller's own.
    pub kind: String,
    /// Id of the track, if there is one.
    pub track: Option<i64>,
    /// Id of the person in the truth, if there is one.
    pub person: Option<i64>,
    /// What happened, as a sentence.
    pub text: String,
    /// A small picture of the place, PNG in base64 (the standard alphabet).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture_png_base64: Option<String>,
}

impl EventRow {
    /// Describes an event of a log whose first frame has the stamp `start_ns`;
    /// without a picture.
    pub fn new(event: &Event, start_ns: i64) -> Self {
        let (kind, person, track) = match event.kind {
            EventKind::Miss { person, track } => ("miss", Some(person), track),
            EventKind::Found { person, track } => ("found", Some(person), Some(track)),
            EventKind::Switch { person, to, .. } => ("switch", Some(person), Some(to)),
            EventKind::WrongPerson { track, person, .. } => {
                ("wrong-person", Some(person), Some(track))
            }
            EventKind::FalseTrack { track } => ("false-track", None, Some(track)),
        };
        Self {
            frame: event.frame as u64,
            t_s: event.stamp_ns.saturating_sub(start_ns) as f64 * 1e-9,
            kind: kind.to_owned(),
            track,
            person,
            text: sentence(&event.kind),
            picture_png_base64: None,
        }
    }
}

fn sentence(kind: &EventKind) -> String {
    match kind {
        EventKind::Miss { person, track: None } => format!("Person {person} is not found."),
        EventKind::Miss { person, track: Some(track) } => {
            format!("Person {person} is lost; the last track was {track}.")
        }
        EventKind::Found { person, track } => format!("Person {person} is found as track {track}."),
        EventKind::Switch { person, from, to } => {
            format!("Person {person} goes on as track {to} instead of {from}.")
        }
        EventKind::WrongPerson { track, began_with, person } => {
            format!("Track {track}, which began with person {began_with}, is on person {person}.")
        }
        EventKind::FalseTrack { track } => format!("Track {track} is where nobody is."),
    }
}

/// How long the tasks took. A file of its own, because it is never the same twice.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Timings {
    /// The machine had nothing else to do. Otherwise the times mean nothing,
    /// and the report leaves them out.
    pub exclusive: bool,
    /// The machine, for people to read: processor, cores, system.
    pub machine: String,
    /// Times by [`TaskResult::hash`].
    pub tasks: BTreeMap<String, TaskTiming>,
}

/// How long the frames of one task took, reading and decoding not included.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TaskTiming {
    /// Half of the frames took less, in milliseconds.
    pub frame_ms_p50: f64,
    /// 95 % of the frames took less, in milliseconds.
    pub frame_ms_p95: f64,
    /// The stages, in the order of the pipeline.
    pub stages: Vec<StageTiming>,
}

/// How long one stage took per frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct StageTiming {
    /// The stage.
    pub stage: String,
    /// Half of the frames took less, in milliseconds.
    pub p50_ms: f64,
    /// 95 % of the frames took less, in milliseconds.
    pub p95_ms: f64,
}
