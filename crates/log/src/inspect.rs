//! Description of a log, for users and for scripts.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

use serde::Serialize;
use tagalong_math::counted;

use crate::images::Content;
use crate::scan::{Scan, Topic};
use crate::timing::{Skew, Timing};
use crate::topics::account_of;
use crate::{FrameSource, InputAccount, InputSettings, Inputs, Limits, LogError, LogFacts};

/// Description of one topic.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TopicFacts {
    /// Name of the topic.
    pub topic: String,
    /// Message type.
    #[serde(rename = "type")]
    pub schema: String,
    /// Message encoding.
    pub encoding: String,
    /// Number of messages.
    pub count: u64,
    /// Number of messages that do not fit their type.
    pub undecodable: u64,
    /// Messages per second of log time; `None` with fewer than two.
    pub rate_hz: Option<f64>,
    /// Description of the images, if there are any.
    pub image: Option<ImageFacts>,
    /// Frame id of the first message.
    pub frame_id: Option<String>,
    /// Capture times of the images; `None` with fewer than two.
    pub timing: Option<Timing>,
}

/// Description of the images of a topic.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ImageFacts {
    /// `encoding` or `format`.
    pub pixels: String,
    /// Columns and rows, if known without decoding.
    pub size: Option<(u32, u32)>,
    /// `picture`, `depth` or `unknown`.
    pub content: &'static str,
}

/// Description of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Inspection {
    /// Chosen topics, the camera and its pose.
    pub facts: LogFacts,
    /// Time from the first to the last message, s.
    pub duration_s: f64,
    /// All topics.
    pub topics: Vec<TopicFacts>,
    /// Time offset of depth from colour.
    pub skew: Option<Skew>,
    /// Transforms: each frame with its parent.
    pub transforms: BTreeMap<String, String>,
    /// Use of each topic of images, scans, detections and odometry, with reasons.
    pub inputs: InputAccount,
    /// Inputs that a pipeline could use: `colour`, `depth`, `right`, `odometry`, `laser`, `detections`, and
    /// the names of further sensors.
    pub usable: Vec<&'static str>,
    /// Reason why no frames can be made, if so.
    pub unusable: Option<String>,
    /// Counters from reading the file.
    pub counters: BTreeMap<&'static str, u64>,
    /// Further remarks.
    pub notes: Vec<String>,
    /// True if something in the file is damaged.
    pub data_lost: bool,
}

/// Inspected log that is ready to be read.
#[non_exhaustive]
pub struct Examination {
    /// Description of the log.
    pub inspection: Inspection,
    /// Frames of the log, with the requested inputs, or otherwise with all inputs that it has;
    /// `None` if no frames can be made.
    pub frames: Option<FrameSource>,
    /// Error for the requested inputs, if the frames are not made from them.
    pub refusal: Option<LogError>,
}

/// Inspects a log. A log without usable images is described as well.
///
/// # Errors
/// A file that cannot be opened or is not MCAP; invalid settings.
pub fn inspect(
    path: &Path,
    input: &InputSettings,
    limits: &Limits,
) -> Result<Inspection, LogError> {
    examine(path, input, limits, Inputs::ANY).map(|examined| examined.inspection)
}

/// Inspects a log, and opens it for a pipeline with these inputs.
///
/// # Errors
/// As [`inspect`]; missing inputs are not an error but reported in [`Examination::refusal`].
pub fn examine(
    path: &Path,
    input: &InputSettings,
    limits: &Limits,
    inputs: Inputs,
) -> Result<Examination, LogError> {
    input.check()?;
    let scan = Arc::new(Scan::read(path, input.depth_unit_m, limits)?);
    // The description covers all inputs, even if the pipeline uses only some of them.
    let everything = FrameSource::of_scan(Arc::clone(&scan), input, limits, Inputs::ANY);
    let mut inspection = Inspection::of_scan(&scan);
    match &everything {
        Ok(frames) => inspection.describe(&scan, frames, input.pair_tolerance_s),
        Err(refusal) => {
            inspection.unusable = Some(refusal.to_string());
            inspection.inputs = account_of(&scan, input);
        }
    }
    let (frames, refusal) = match FrameSource::of_scan(scan, input, limits, inputs) {
        Ok(frames) => (Some(frames), None),
        Err(refusal) => (everything.ok(), Some(refusal)),
    };
    Ok(Examination { inspection, frames, refusal })
}

impl Inspection {
    /// Describes a log as far as that is possible without frames.
    fn of_scan(scan: &Scan) -> Self {
        let first = scan.topics.values().map(|topic| topic.first_log_time).min().unwrap_or(0);
        let last = scan.topics.values().map(|topic| topic.last_log_time).max().unwrap_or(0);
        Self {
            facts: LogFacts {
                path: scan.path.clone(),
                bytes: scan.bytes,
                sha256: scan.sha256.clone(),
                ..LogFacts::default()
            },
            duration_s: last.saturating_sub(first) as f64 * 1e-9,
            topics: scan.topics.iter().map(|(name, topic)| topic_facts(name, topic)).collect(),
            skew: None,
            transforms: scan.tf.parents(),
            inputs: InputAccount::default(),
            usable: Vec::new(),
            unusable: None,
            counters: scan.counters.clone(),
            notes: scan.notes.clone(),
            data_lost: scan.data_lost,
        }
    }

    fn describe(&mut self, scan: &Scan, source: &FrameSource, tolerance_s: f64) {
        self.facts = source.facts().clone();
        self.notes = source.notes().to_vec();
        let facts = &self.facts;
        self.inputs = source.account().clone();
        self.usable.clear();
        for (name, topic) in [
            ("colour", &facts.colour_topic),
            ("depth", &facts.depth_topic),
            ("right", &facts.right_topic),
            ("odometry", &facts.odometry_topic),
            ("laser", &facts.laser_topic),
        ] {
            let fails = self.inputs.used_as(name).is_some_and(|it| it.problem.is_some());
            if topic.is_some() && !fails {
                self.usable.push(name);
            }
        }
        if self.inputs.used_as("detections").is_some_and(|it| it.problem.is_none()) {
            self.usable.push("detections");
        }
        self.usable.extend(facts.sensor_topics.keys());
        let [colour, depth] =
            [&facts.colour_topic, &facts.depth_topic].map(|topic| scan.topics.get(topic.as_ref()?));
        let both = colour.zip(depth);
        self.skew = both.and_then(|(colour, depth)| depth.skew_from(colour, tolerance_s));
    }

    /// Returns the topic with that name.
    pub fn topic(&self, name: &str) -> Option<&TopicFacts> {
        self.topics.iter().find(|topic| topic.topic == name)
    }
}

fn topic_facts(name: &str, topic: &Topic) -> TopicFacts {
    let content = match topic.content {
        Content::Picture => "picture",
        Content::Depth => "depth",
        Content::Unknown => "unknown",
    };
    let span = topic.last_log_time.saturating_sub(topic.first_log_time) as f64 * 1e-9;
    TopicFacts {
        topic: name.to_owned(),
        schema: topic.schema.clone(),
        encoding: topic.encoding.clone(),
        count: topic.count,
        undecodable: topic.undecodable,
        // N messages span N - 1 periods.
        rate_hz: (topic.count > 1 && span > 0.0).then(|| (topic.count - 1) as f64 / span),
        image: topic.pixels.clone().map(|pixels| ImageFacts { pixels, size: topic.size, content }),
        frame_id: topic.frame_id.clone(),
        timing: Timing::of(&topic.stamps),
    }
}

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let facts = &self.facts;
        writeln!(f, "{}", facts.path.display())?;
        let mib = facts.bytes as f64 / f64::from(1 << 20);
        writeln!(f, "  {mib:.1} MiB, {:.2} s, sha256 {}", self.duration_s, facts.sha256)?;
        writeln!(f, "\ntopics")?;
        self.topics.iter().try_for_each(|topic| writeln!(f, "  {topic}"))?;
        match &self.unusable {
            Some(why) => writeln!(f, "\nno frames can be made: {why}")?,
            None => self.write_camera(f)?,
        }
        if !self.inputs.topics.is_empty() {
            writeln!(f, "\ninputs")?;
            self.inputs.lines().iter().try_for_each(|line| writeln!(f, "  {line}"))?;
        }
        if !self.notes.is_empty() {
            writeln!(f, "\nnotes")?;
            self.notes.iter().try_for_each(|note| writeln!(f, "  {note}"))?;
        }
        writeln!(f, "\ncounters")?;
        self.counters.iter().try_for_each(|(name, count)| writeln!(f, "  {name} {count}"))?;
        if self.data_lost {
            writeln!(f, "\ndata was lost")?;
        }
        Ok(())
    }
}

impl Inspection {
    fn write_camera(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let facts = &self.facts;
        if facts.width == 0 {
            writeln!(f, "\nno camera: each laser scan makes a frame")?;
            return self.write_usable(f);
        }
        writeln!(f, "\ncamera")?;
        writeln!(f, "  {}x{}, focal {:.1} px", facts.width, facts.height, facts.focal_px)?;
        writeln!(
            f,
            "  {:.2} m above the floor, {:.1} deg down, rolled by {:.1} deg; from {}",
            facts.camera_height_m,
            facts.camera_pitch_down_deg,
            facts.camera_roll_deg,
            facts.camera_source
        )?;
        if let Some(baseline) = facts.baseline_m {
            writeln!(f, "  stereo baseline {baseline:.4} m")?;
        }
        if let Some(skew) = self.skew {
            match skew.other_clock() {
                Some(words) => writeln!(f, "  depth: {words}")?,
                None => writeln!(f, "  depth {:+.1} ms after colour", 1e3 * skew.median_s)?,
            }
        }
        self.write_usable(f)
    }

    fn write_usable(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let usable = self.usable.join(", ");
        writeln!(f, "\na pipeline can use: {}", if usable.is_empty() { "nothing" } else { &usable })
    }
}

impl fmt::Display for TopicFacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}  {}  {}", self.topic, self.schema, counted(self.count, "message"))?;
        if let Some(rate) = self.rate_hz {
            write!(f, ", recorded at {rate:.2} Hz")?;
        }
        if let Some(image) = &self.image {
            write!(f, ", {}", image.pixels)?;
            if let Some((width, height)) = image.size {
                write!(f, ", {width}x{height}")?;
            }
        }
        if self.undecodable > 0 {
            write!(f, ", {} undecodable", self.undecodable)?;
        }
        Ok(())
    }
}
