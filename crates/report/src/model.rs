use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tagalong_eval::{Consistency, CurvePoint, Event, EventKind, Repaired, Scores};

/// Results of a benchmark: pipelines x logs x seeds.
///
/// The contents do not depend on the machine or on the number of tasks that ran at once: the same
/// inputs give the same bytes. Times are kept apart, in [`Timings`].
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Benchmark {
    /// Version of Tagalong that ran the tasks.
    pub version: String,
    /// Results, one per task, in any order.
    pub tasks: Vec<TaskResult>,
    /// Names of logs that go back to one recording, as copies that `tagalong alter` makes; means and
    /// intervals count each of them as a log of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub copies: Vec<Vec<String>>,
    /// Notes on the logs and their truth, as signs that a truth is that of another log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Moments in which people were missed, with their images; for the page alone.
    #[serde(skip)]
    pub moments: Vec<Moment>,
}

/// Says that logs go back to one recording, so that intervals over logs are too narrow.
pub fn copies_note(logs: &[String]) -> String {
    format!(
        "{} come from one recording, such as copies of `tagalong alter`, but count as {} \
         independent logs: the intervals are too narrow and the p-values too small",
        logs.join(" and "),
        logs.len()
    )
}

/// Moment in which a person was missed, with all that the pipelines made of it.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Moment {
    /// Name of the log.
    pub log: String,
    /// 1-based index of the frame.
    pub frame: u64,
    /// Time since the first frame of the log, s.
    pub t_s: f64,
    /// Width and height of the image in which boxes are given, pixels.
    pub size: [u32; 2],
    /// The whole image, JPEG in base64.
    pub image_jpeg_base64: String,
    /// People that count: number and box (left, top, width, height), pixels.
    pub people: Vec<(i64, [f64; 4])>,
    /// Tracks of each pipeline: number and box.
    pub tracks: BTreeMap<String, Vec<(i64, [f64; 4])>>,
}

/// Person whom a pipeline missed in one frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct MissedPerson {
    /// 1-based index of the frame.
    pub frame: u64,
    /// Id of the person in the truth.
    pub person: i64,
    /// Test that dropped the candidate at this person; of several the one that comes last, because
    /// it let the candidate come nearest. None for another cause.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test: Option<String>,
    /// Box of that candidate, pixels: left, top, width, height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub box_px: Option<[f64; 4]>,
    /// Name of a cause that is no test, for example `no depth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_cause: Option<String>,
    /// Position of the sentence in [`TaskResult::causes`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cause: Option<usize>,
}

impl MissedPerson {
    /// Returns the name of the cause, if it is known.
    pub fn name(&self) -> Option<&str> {
        self.test.as_deref().or(self.other_cause.as_deref())
    }
}

/// Result of one pipeline on one log with one seed.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TaskResult {
    /// Name of the pipeline: the file name of its config without ending.
    pub pipeline: String,
    /// Name of the log: its file name without ending.
    pub log: String,
    /// Seed of the pipeline.
    pub seed: u64,
    /// Content hash of everything that the result depends on, in hex; the key into
    /// [`Timings::tasks`].
    pub hash: String,
    /// Inputs of the hash: the kind (`config`, `log`, `truth`) and the SHA-256 of each, in hex.
    #[serde(default)]
    pub inputs: BTreeMap<String, String>,
    /// Outcome of the task.
    pub outcome: Outcome,
    /// Number of frames that the pipeline processed.
    pub frames: u64,
    /// Length of the recording by its own stamps, in seconds.
    pub duration_s: f64,
    /// True if part of the log was lost or could not be used.
    pub data_lost: bool,
    /// True if nothing is tracked over the frames of the log: figures over time mean nothing.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub single_frames: bool,
    /// Figures in the image (IoU), if the truth has boxes.
    pub image: Option<Scores>,
    /// Figures on the floor (metres), if the truth has positions.
    pub metres: Option<Scores>,
    /// Miss rate over false positives per image; empty without boxes.
    #[serde(default)]
    pub lamr_curve: Vec<CurvePoint>,
    /// Consistency of the filter's covariance with its innovations, if it reports any.
    pub nis: Option<Consistency>,
    /// Number of candidates dropped by each test, in the order of the stages.
    #[serde(default)]
    pub funnel: Vec<Dropped>,
    /// Confirmed tracks on the floor.
    #[serde(default)]
    pub tracks: Vec<Trajectory>,
    /// People that count on the floor, in the same frame.
    #[serde(default)]
    pub truth: Vec<Trajectory>,
    /// Events, in the order of time.
    #[serde(default)]
    pub events: Vec<EventRow>,
    /// People missed by frame: in the image, or on the floor where the truth has no boxes.
    #[serde(default)]
    pub missed: Vec<MissedPerson>,
    /// Figures with one kind of error repaired, by boxes if the truth has them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub repairs: Vec<Repaired>,
    /// Lines of the config that decide the tests that dropped missed people, by test.
    #[serde(default)]
    pub deciding: BTreeMap<String, Vec<String>>,
    /// Sentences that say why people are missed, by test or other cause.
    #[serde(default)]
    pub reasons: BTreeMap<String, String>,
    /// Sentences that say why a person was missed in a frame, with the tracks.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub causes: Vec<String>,
}

/// Outcome of a task.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "ended")]
pub enum Outcome {
    /// The task ran to the end of the log.
    #[default]
    Done,
    /// The task stopped with an error or a panic.
    Failed {
        /// Error message.
        why: String,
    },
    /// The task was not started, because the log lacks an input of the pipeline, or its figures say
    /// nothing, because a detector has no model or is for another kind of camera.
    Skipped {
        /// Missing input or model.
        why: String,
    },
}

/// Test and the number of candidates it dropped.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Dropped {
    /// Name of the test.
    pub test: String,
    /// Number of candidates dropped by it.
    pub count: u64,
}

/// Positions of a person or a track on the floor over time.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Trajectory {
    /// Id of the person or of the track.
    pub id: i64,
    /// Time since the first frame of the log in seconds, then x and y in the
    /// odometry frame in metres (x ahead of the robot as it started, y left).
    pub points: Vec<[f64; 3]>,
}

/// Event of a recording that is worth a look.
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
    /// Description, as a sentence.
    pub text: String,
    /// Small image of the position, PNG in base64 (the standard alphabet).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture_png_base64: Option<String>,
}

impl EventRow {
    /// Describes an event of a log with a first frame at `start_ns`; without a picture.
    pub fn new(event: &Event, start_ns: i64) -> Self {
        let (kind, person, track) = match event.kind {
            EventKind::Miss { person, track } => ("miss", Some(person), track),
            EventKind::Found { person, track } => ("found", Some(person), Some(track)),
            EventKind::Switch { person, to, .. } => ("switch", Some(person), Some(to)),
            EventKind::WrongPerson { track, person, .. } => {
                ("wrong-person", Some(person), Some(track))
            }
            EventKind::FalseTrack { track } => ("false-track", None, Some(track)),
            _ => ("other", None, None),
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
        other => format!("{other:?}"),
    }
}

/// Processing times of the tasks. A file of its own, because it is never the same twice.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Timings {
    /// True if the machine was otherwise idle. If not, the times are meaningless, and the report
    /// leaves them out.
    pub exclusive: bool,
    /// Description of the machine: processor, cores, system.
    pub machine: String,
    /// Times by [`TaskResult::hash`].
    pub tasks: BTreeMap<String, TaskTiming>,
}

/// Processing times of the frames of one task, reading and decoding not included.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TaskTiming {
    /// Median time per frame, in milliseconds.
    pub frame_ms_p50: f64,
    /// 95th percentile of the time per frame, in milliseconds.
    pub frame_ms_p95: f64,
    /// 99th percentile of the time per frame, in milliseconds.
    #[serde(default)]
    pub frame_ms_p99: f64,
    /// Time of the slowest frame, in milliseconds.
    #[serde(default)]
    pub frame_ms_max: f64,
    /// Times of the stages, in the order of the pipeline.
    pub stages: Vec<StageTiming>,
}

/// Processing times of one stage per frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct StageTiming {
    /// Name of the stage.
    pub stage: String,
    /// Median time per frame, in milliseconds.
    pub p50_ms: f64,
    /// 95th percentile of the time per frame, in milliseconds.
    pub p95_ms: f64,
    /// 99th percentile of the time per frame, in milliseconds.
    #[serde(default)]
    pub p99_ms: f64,
    /// Time in the slowest frame, in milliseconds.
    #[serde(default)]
    pub max_ms: f64,
}
