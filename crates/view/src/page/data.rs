//! Data of the page, in the format of its script.

use std::collections::BTreeMap;

use serde::Serialize;

/// Everything that the page shows.
#[derive(Clone, Debug, Default, Serialize)]
pub struct PageData {
    /// Times of the frames since the first one, s.
    pub t: Vec<f64>,
    /// Columns and rows of the image in which all boxes are given, pixels.
    pub image_px: [usize; 2],
    /// Images as JPEG in base64, one for each frame; empty for a frame without an image. `None`
    /// without any.
    pub images: Option<Vec<String>>,
    /// Points of laser scans in the odometry frame, cm, x and y in turn. `None` without any.
    pub scans: Option<Vec<Vec<i32>>>,
    /// Directions of the left and the right edge of the field of view, rad from the heading of the
    /// robot.
    pub view_rad: Option<[f64; 2]>,
    /// Annotated people by frame. `None` without truth.
    pub truth: Option<Vec<Vec<TruthBox>>>,
    /// The runs, one or two.
    pub runs: Vec<RunData>,
    /// True for a live run, whose frames the page requests.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub live: bool,
}

/// Annotated person in one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TruthBox {
    /// ID of the person.
    pub id: i64,
    /// Box in the image, pixels.
    #[serde(rename = "box")]
    pub box_px: Option<[f64; 4]>,
    /// Position on the floor in the odometry frame, m.
    pub at: Option<[f64; 2]>,
    /// False for people that count neither as misses nor as hits.
    pub counts: bool,
}

/// One run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RunData {
    /// Name of the run.
    pub name: String,
    /// Frames; `None` if the run has no frame at that time.
    pub frames: Vec<Option<FrameData>>,
    /// Events in the order of time.
    pub events: Vec<EventData>,
    /// Tests of the funnel, by name, with their settings.
    pub tests: BTreeMap<String, TestData>,
    /// ID of the track that matches each counted person of the truth, frame by frame; `None` for a
    /// miss.
    pub hits: Option<Vec<BTreeMap<i64, Option<i64>>>>,
    /// Sentences that say why a person was missed.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub causes: Vec<String>,
    /// Index of the sentence in `causes`, by the index of the frame and the ID of the person.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub missed: BTreeMap<usize, BTreeMap<i64, usize>>,
    /// The robot and the zones around it, if the run has a controller.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub robot: Option<RobotData>,
}

/// Robot with the zones in which it slows down or stops.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RobotData {
    /// Corners of its outline, robot frame, m.
    pub footprint: Vec<[f64; 2]>,
    /// Corners of the stop polygon, robot frame, m; empty without one.
    pub stop: Vec<[f64; 2]>,
    /// Corners of the slowdown polygon, robot frame, m; empty without one.
    pub slowdown: Vec<[f64; 2]>,
    /// Distances from the outline at which an approaching person makes the robot stop, and, at full
    /// speed, slow down, m; `None` if people are treated like other obstacles.
    pub people: Option<[f64; 2]>,
    /// Distance from the outline at which an obstacle ahead makes the robot stop, m.
    pub things: f64,
    /// Latency from an image to the response of the wheels, s.
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
    /// True if the image is frozen: boxes and positions are those of an earlier time.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub stale: bool,
    /// Tracks, nearest first.
    pub tracks: Vec<TrackData>,
    /// Candidates.
    pub found: Vec<CandidateData>,
    /// Tests that dropped candidates.
    pub dropped: Vec<DroppedData>,
    /// Track of the person to follow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<u32>,
    /// Target lock and command, if there is a controller.
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
    /// The person, the position or the sensor that is the cause; empty if there is none.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub cause: String,
    /// Commanded speed, m/s.
    pub v: f64,
    /// Commanded turn rate, positive to the left, rad/s.
    pub w: f64,
    /// Effect of the reason: `drives`, `slower`, `stands`, or empty if it is unknown.
    pub motion: String,
    /// Positions of obstacles in the odometry frame, cm, x and y in turn.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub things: Vec<i32>,
    /// Positions of people and of moving obstacles, cm, x and y in turn.
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
    /// Box of the whole person, pixels, if the run reports such boxes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub whole: Option<[f64; 4]>,
    /// Position in the odometry frame, m.
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
    /// Past positions of the head in this image, pixels, x and y in turn.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub trail: Vec<i32>,
}

/// Candidate in one frame.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CandidateData {
    /// Upper-body square, pixels.
    #[serde(rename = "box")]
    pub box_px: [f64; 4],
    /// Position in the odometry frame, m.
    pub at: [f64; 2],
    /// Log-odds.
    pub score: f64,
    /// Detector.
    pub by: String,
    /// Test that dropped it; `None` for a candidate that was used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub test: Option<String>,
    /// Track to which it was assigned, or that it started.
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
    /// Number of candidates that it dropped.
    pub n: u64,
    /// Regions of these, as far as they are known and not those of a candidate, pixels.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub boxes: Vec<[f64; 4]>,
    /// Values because of which some of these were dropped, in words, by the index of the region.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub values: BTreeMap<usize, String>,
}

/// Test of the funnel with the settings that decide it.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TestData {
    /// Lines of the config that set it, with their values in this run.
    pub settings: Vec<String>,
    /// Sentence on why it drops people, with at most two settings.
    pub why: String,
    /// Stage of the test; of several tests at one position, the last one decided.
    pub stage: usize,
}

/// Event to jump to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct EventData {
    /// Index in the times of the page.
    pub i: usize,
    /// Kind, for example `started`.
    pub kind: &'static str,
    /// Track of the event.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub track: Option<u32>,
    /// Person of the truth of the event.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub person: Option<i64>,
    /// One sentence.
    pub text: String,
}
