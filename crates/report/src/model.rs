use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tagalong_eval::{Consistency, CurvePoint, Event, EventKind, Repaired, Scores};

/// Results of a benchmark: pipelines x logs x seeds.
///
/// The contents do not depend on the machine or on the number of tasks that ran at once: the same
/// inputs give the same bytes. Times are stored separately, in [`Timings`].
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Benchmark {
    /// Version of Tagalong that ran the tasks.
    pub version: String,
    /// Results, one per task, in any order.
    pub tasks: Vec<TaskResult>,
    /// Groups of logs that come from one recording, for example copies made with `tagalong alter`;
    /// means and intervals count each of them as a separate log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub copies: Vec<Vec<String>>,
    /// Notes on the logs and their truth, for example that a truth seems to belong to another log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Moments in which people were missed, with their images; only for the page.
    #[serde(skip)]
    pub moments: Vec<Moment>,
}

/// Returns a note that logs come from one recording, so that intervals over logs are too narrow.
pub fn copies_note(logs: &[String]) -> String {
    format!(
        "{} come from one recording, such as copies of `tagalong alter`, but count as {} \
         independent logs: the intervals are too narrow and the p-values too small",
        logs.join(" and "),
        logs.len()
    )
}

/// Moment in which a person was missed, with the results of all pipelines.
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
    /// People that count: ID and box (left, top, width, height), pixels.
    pub people: Vec<(i64, [f64; 4])>,
    /// Tracks of each pipeline: ID and box.
    pub tracks: BTreeMap<String, Vec<(i64, [f64; 4])>>,
}

/// Person that a pipeline missed in one frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct MissedPerson {
    /// 1-based index of the frame.
    pub frame: u64,
    /// ID of the person in the truth.
    pub person: i64,
    /// Test that dropped the candidate at this person. If several candidates were dropped, it is
    /// the latest test, because that candidate came closest to a detection. `None` for another
    /// cause.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test: Option<String>,
    /// Box of that candidate, pixels: left, top, width, height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub box_px: Option<[f64; 4]>,
    /// Name of a cause other than a test, for example `no depth`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_cause: Option<String>,
    /// Index of the sentence in [`TaskResult::causes`].
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
    /// Name of the pipeline: the file name of its config without extension.
    pub pipeline: String,
    /// Name of the log: its file name without extension.
    pub log: String,
    /// Seed of the pipeline.
    pub seed: u64,
    /// Content hash of everything that the result depends on, in hex; the key into
    /// [`Timings::tasks`].
    pub hash: String,
    /// Inputs of the hash: kind (`config`, `log`, `truth`) and SHA-256 of each, in hex.
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
    /// True if the frames are not tracked over time; figures over time then have no meaning.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub single_frames: bool,
    /// Figures in the image (IoU), if the truth has boxes.
    pub image: Option<Scores>,
    /// Figures on the floor (metres), if the truth has positions.
    pub metres: Option<Scores>,
    /// Curve of the miss rate against false positives per image; empty without boxes.
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
    /// Events, in chronological order.
    #[serde(default)]
    pub events: Vec<EventRow>,
    /// Missed people by frame: in the image, or on the floor if the truth has no boxes.
    #[serde(default)]
    pub missed: Vec<MissedPerson>,
    /// Figures with one kind of error repaired, with boxes if the truth has them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub repairs: Vec<Repaired>,
    /// Lines of the config that set the tests that dropped missed people, by test.
    #[serde(default)]
    pub deciding: BTreeMap<String, Vec<String>>,
    /// Sentences that explain why people were missed, by test or other cause.
    #[serde(default)]
    pub reasons: BTreeMap<String, String>,
    /// Sentences that explain why a person was missed in a frame, with the tracks.
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
    /// The task was not started, because the log lacks an input of the pipeline, or because its
    /// figures would have no meaning: a detector has no model or is for another kind of camera.
    Skipped {
        /// Missing input or model.
        why: String,
    },
}

/// Test, and the number of candidates that it dropped.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Dropped {
    /// Name of the test.
    pub test: String,
    /// Number of candidates that the test dropped.
    pub count: u64,
}

/// Positions of a person or a track on the floor over time.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Trajectory {
    /// ID of the person or of the track.
    pub id: i64,
    /// Time since the first frame of the log in seconds, then x and y in the odometry frame in
    /// metres (x forward from the robot's initial pose, y left).
    pub points: Vec<[f64; 3]>,
}

/// Event of a recording that deserves a closer look.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct EventRow {
    /// 1-based index of the frame in which it begins.
    pub frame: u64,
    /// Time since the first frame of the log, in seconds.
    pub t_s: f64,
    /// `miss`, `found`, `switch`, `wrong-person`, `false-track`, or another kind defined by the
    /// caller.
    pub kind: String,
    /// ID of the track, if there is one.
    pub track: Option<i64>,
    /// ID of the person in the truth, if there is one.
    pub person: Option<i64>,
    /// Description, as a sentence.
    pub text: String,
    /// Small image of the scene at the event, PNG in base64 (the standard alphabet).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub picture_png_base64: Option<String>,
}

impl EventRow {
    /// Creates the row of an event in a log whose first frame is at `start_ns`, without a picture.
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

/// Processing times of the tasks, in a separate file because they differ in every run.
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

/// Processing times of the frames of one task, without reading and decoding.
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
