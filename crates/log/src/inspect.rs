//! What is in a log, for people and for scripts.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use crate::images::Content;
use crate::scan::{Scan, Topic};
use crate::timing::{Skew, Timing};
use crate::{FrameSource, InputSettings, Inputs, Limits, LogError, LogFacts};

/// One topic.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TopicFacts {
    /// Its name.
    pub topic: String,
    /// Its message type.
    #[serde(rename = "type")]
    pub schema: String,
    /// How messages are encoded.
    pub encoding: String,
    /// Messages.
    pub count: u64,
    /// Messages that do not fit their type.
    pub undecodable: u64,
    /// Messages per second of log time; `None` with fewer than two.
    pub rate_hz: Option<f64>,
    /// What its images are.
    pub image: Option<ImageFacts>,
    /// Frame id of the first message.
    pub frame_id: Option<String>,
    /// When its images were captured; `None` with fewer than two.
    pub timing: Option<Timing>,
}

/// The images of a topic.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImageFacts {
    /// `encoding` or `format`.
    pub pixels: String,
    /// Columns and rows, where known without decoding.
    pub size: Option<(u32, u32)>,
    /// `picture`, `depth` or `unknown`.
    pub content: &'static str,
}

/// What is in a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Inspection {
    /// The topics chosen, the camera and its pose.
    pub facts: LogFacts,
    /// From the first to the last message, s.
    pub duration_s: f64,
    /// All topics.
    pub topics: Vec<TopicFacts>,
    /// How depth lies in time beside colour.
    pub skew: Option<Skew>,
    /// The transforms: each frame with its parent.
    pub transforms: BTreeMap<String, String>,
    /// What a pipeline could use: `colour`, `depth`, `right`, `odometry`,
    /// `laser`.
    pub usable: Vec<&'static str>,
    /// Why no frames can be made, if so.
    pub unusable: Option<String>,
    /// Counters of the walk through the file.
    pub counters: BTreeMap<&'static str, u64>,
    /// What else is to be said.
    pub notes: Vec<String>,
    /// True if something in the file is damaged.
    pub data_lost: bool,
}

/// A log that was looked into, ready to be read.
pub struct Examination {
    /// What is in it.
    pub inspection: Inspection,
    /// Its frames: with the inputs that were asked for, else with all that there are;
    /// `None` if no frames can be made.
    pub frames: Option<FrameSource>,
    /// Why the frames are not those that were asked for.
    pub refusal: Option<LogError>,
}

/// Looks into a log. A log without usable images is described all the same.
///
/// # Errors
/// A file that cannot be opened or is not MCAP; settings that cannot work.
pub fn inspect(
    path: &Path,
    input: &InputSettings,
    limits: &Limits,
) -> Result<Inspection, LogError> {
    examine(path, input, limits, Inputs::ANY).map(|examined| examined.inspection)
}

/// Looks into a log, and opens it for a pipeline with those inputs.
///
/// # Errors
/// As [`inspect`]; what the log lacks is no error but
/// [`Examination::refusal`].
pub fn examine(
    path: &Path,
    input: &InputSettings,
    limits: &Limits,
    inputs: Inputs,
) -> Result<Examination, LogError> {
    input.check()?;
    let scan = Arc::new(Scan::read(path, input.depth_unit_m, limits)?);
    let open = |inputs| FrameSource::of_scan(Arc::clone(&scan), input, limits, inputs);
    let everything = open(Inputs::ANY);
    let mut inspection = Inspection::of_scan(&scan);
    match &everything {
        Ok(frames) => inspection.describe(&scan, frames, input.pair_tolerance_s),
        Err(refusal) => inspection.unusable = Some(refusal.to_string()),
    }
    let (frames, refusal) = match open(inputs) {
        Ok(frames) => (Some(frames), None),
        Err(refusal) => (everything.ok(), Some(refusal)),
    };
    Ok(Examination { inspection, frames, refusal })
}

impl Inspection {
    /// What shows without frames.
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
        let usable = [
            ("colour", &facts.colour_topic),
            ("depth", &facts.depth_topic),
            ("right", &facts.right_topic),
            ("odometry", &facts.odometry_topic),
            ("laser", &facts.laser_topic),
        ];
        self.usable = usable.iter().filter(|(_, t)| t.is_some()).map(|(name, _)| *name).collect();
        let stamps = |topic: &Option<String>| {
            topic.as_ref().and_then(|topic| scan.topics.get(topic)).map(|topic| &topic.stamps[..])
        };
        let both = stamps(&facts.colour_topic).zip(stamps(&facts.depth_topic));
        self.skew = both.and_then(|(colour, depth)| Skew::between(colour, depth, tolerance_s));
    }

    /// The topic of that name.
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
            writeln!(f, "  depth {:+.1} ms after colour", 1e3 * skew.median_s)?;
        }
        writeln!(f, "\na pipeline can use: {}", self.usable.join(", "))
    }
}

impl fmt::Display for TopicFacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}  {}  {} messages", self.topic, self.schema, self.count)?;
        if let Some(rate) = self.rate_hz {
            write!(f, ", {rate:.2} Hz")?;
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
