//! Data of the page, as its script reads it.

use std::collections::BTreeMap;

use serde::Serialize;

/// Everything that the page shows.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PageData {
    /// Times of the frames since the first one, s.
    pub t: Vec<f64>,
    /// Columns and rows of the image in which all boxes are given, pixels.
    pub image_px: [usize; 2],
    /// Images as JPEG in base64, one for each frame; empty where there is none. None without any.
    pub images: Option<Vec<String>>,
    /// Points of laser scans in the odometry frame, cm, x and y in turn. None without any.
    pub scans: Option<Vec<Vec<i32>>>,
    /// Directions of the left and the right edge of the view, rad from the heading of the robot.
    pub view_rad: Option<[f64; 2]>,
    /// Annotated people by frame. None without truth.
    pub truth: Option<Vec<Vec<TruthBox>>>,
    /// The runs, one or two.
    pub runs: Vec<RunData>,
    /// True for a run that happens now: the page asks for its frames.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub live: bool,
}

/// Annotated person in one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TruthBox {
    /// Identity.
    pub id: i64,
    /// Box in the image, pixels.
    #[serde(rename = "box")]
    pub box_px: Option<[f64; 4]>,
    /// Place on the floor in the odometry frame, m.
    pub at: Option<[f64; 2]>,
    /// False for people that count neither as missed nor as found.
    pub counts: bool,
}

/// One run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunData {
    /// Name of the run.
    pub name: String,
    /// Frames; none where the run has no frame at that time.
    pub frames: Vec<Option<FrameData>>,
    /// Events in the order of time.
    pub events: Vec<EventData>,
    /// Tests of the funnel, by name, with their settings.
    pub tests: BTreeMap<String, TestData>,
    /// Number of the track on each counted person of the truth, frame by frame; none for a miss.
    pub hits: Option<Vec<BTreeMap<i64, Option<i64>>>>,
    /// Sentences that say why a person was missed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub causes: Vec<String>,
    /// Position of the sentence in `causes`, by the position of the frame and the person.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub missed: BTreeMap<usize, BTreeMap<i64, usize>>,
    /// The robot and the zones around it, where the run has a controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<RobotData>,
}

/// Robot with the zones in which it drives slower or stands.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RobotData {
    /// Corners of its outline, robot frame, m.
    pub footprint: Vec<[f64; 2]>,
    /// Corners of the stop polygon, robot frame, m; empty without one.
    pub stop: Vec<[f64; 2]>,
    /// Corners of the slowdown polygon, robot frame, m; empty without one.
    pub slowdown: Vec<[f64; 2]>,
    /// Distances from the outline at which an approaching person makes the robot stand, and at full
    /// speed drive slower, m; none where people are judged like things.
    pub people: Option<[f64; 2]>,
    /// Distance from the outline at which a thing ahead makes it stand, m.
    pub things: f64,
    /// Time from an image to wheels that move accordingly, s.
    pub reaction: f64,
    /// Deceleration, m/s².
    pub decel: f64,
}

/// Frame of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FrameData {
    /// Index in the log.
    pub n: u64,
    /// Pose of the robot in the odometry frame: x, y, heading.
    pub robot: [f64; 3],
    /// True if the image is frozen: boxes and places are those of an earlier time.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub stale: bool,
    /// Tracks, near to far.
    pub tracks: Vec<TrackData>,
    /// Candidates.
    pub found: Vec<CandidateData>,
    /// Tests that dropped anything.
    pub dropped: Vec<DroppedData>,
    /// Track of the person to follow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<u32>,
    /// Target lock and command, where there is a controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drive: Option<DriveData>,
}

/// State of the target lock and command for the wheels in one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct DriveData {
    /// State of the lock, and its meaning.
    pub lock: [String; 2],
    /// Cause of the last change of state.
    pub why: String,
    /// Time since that change, s.
    pub since: f64,
    /// Probability that the followed track is the person.
    pub belief: Option<f64>,
    /// Reason of the command, and its meaning.
    pub reason: [String; 2],
    /// The person, the place or the sensor that is the cause; empty where there is none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub cause: String,
    /// Commanded speed, m/s.
    pub v: f64,
    /// Commanded rate of turn, to the left, rad/s.
    pub w: f64,
    /// Effect of the reason: `drives`, `slower`, `stands`, or empty where it is not known.
    pub motion: String,
    /// Places of things in the odometry frame, cm, x and y in turn.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub things: Vec<i32>,
    /// Places of people and of things that move, cm, x and y in turn.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub movers: Vec<i32>,
}

/// Track in one frame.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TrackData {
    /// Number.
    pub id: u32,
    /// State: `seen`, `predicted`, `hidden` (predicted, behind another person) or `tentative`.
    pub state: &'static str,
    /// Upper-body square, pixels.
    #[serde(rename = "box")]
    pub box_px: [f64; 4],
    /// Box of the whole person, pixels, where the run reports such boxes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub whole: Option<[f64; 4]>,
    /// Place in the odometry frame, m.
    pub at: [f64; 2],
    /// Velocity in the odometry frame, m/s.
    pub v: [f64; 2],
    /// Height of the head's centre, m.
    pub z: f64,
    /// Distance from the robot, m.
    pub d: f64,
    /// True if the distance is a guess.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub guess: bool,
    /// Probability that it is a person.
    pub p: f64,
    /// Past places of the head in this image, pixels, x and y in turn.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub trail: Vec<i32>,
}

/// Candidate in one frame.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CandidateData {
    /// Upper-body square, pixels.
    #[serde(rename = "box")]
    pub box_px: [f64; 4],
    /// Place in the odometry frame, m.
    pub at: [f64; 2],
    /// Log-odds.
    pub score: f64,
    /// Detector.
    pub by: String,
    /// Test that dropped it; none for one that was used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub test: Option<String>,
    /// Track that it was given to, or that it started.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track: Option<u32>,
    /// True if it started the track.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub starts: bool,
}

/// Test of the funnel in one frame.
#[derive(Clone, Debug, Default, Serialize)]
pub struct DroppedData {
    /// Name of the test.
    pub test: String,
    /// Number of things that it dropped.
    pub n: u64,
    /// Their regions, as far as they are known and no candidate has them, pixels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub boxes: Vec<[f64; 4]>,
    /// Values that some of these were dropped for, in words, by the position of the box.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<usize, String>,
}

/// Test of the funnel with what decides it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TestData {
    /// Lines of the config that decide it, with their values in this run.
    pub settings: Vec<String>,
    /// Sentence that says why it drops people, with two settings at most.
    pub why: String,
    /// Stage of the test: of several at one place the last one decided.
    pub stage: usize,
}

/// Event to jump to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct EventData {
    /// Position in the times of the page.
    pub i: usize,
    /// Kind, for example `started`.
    pub kind: &'static str,
    /// Track that it is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track: Option<u32>,
    /// Person of the truth that it is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub person: Option<i64>,
    /// One sentence.
    pub text: String,
}
