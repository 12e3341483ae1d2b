//! Selection of the obstacle sources that a log or a robot has.

use tagalong_math::counted;

use super::bumper::Contact;
use super::{ObstacleKind, ObstacleTopic};
use crate::camera_info::{Intrinsics, intrinsics};
use crate::scan::{Scan, Topic, Type};
use crate::sensors::is_type;
use crate::tally::Tally;
use crate::topics::{calibration_of, kind_of, missing};
use crate::{InputSettings, LogError};

/// Source whose topic was found.
#[derive(Clone, Debug)]
pub(crate) struct PlannedSource {
    pub(crate) topic: ObstacleTopic,
    /// Message type.
    pub(crate) schema: String,
    /// Lens of a depth camera.
    pub(super) lens: Option<Intrinsics>,
    /// Topic of the calibration of a depth camera.
    pub(crate) info_topic: Option<String>,
}

impl PlannedSource {
    /// Returns true for the topic of the source, and that of its calibration.
    pub(crate) fn has(&self, topic: &str) -> bool {
        self.topic.topic == topic || self.info_topic.as_deref() == Some(topic)
    }
}

impl ObstacleKind {
    /// Returns true for messages of this kind in an encoding that can be read.
    fn reads(self, topic: &Topic) -> bool {
        let is_readable = matches!(topic.encoding.as_str(), "cdr" | "ros1");
        is_readable
            && match self {
                Self::Scan => is_type(&topic.schema, "sensor_msgs/LaserScan"),
                Self::Depth => matches!(topic.kind, Type::Image | Type::CompressedImage),
                Self::Range => is_type(&topic.schema, "sensor_msgs/Range"),
                Self::Bumper => Contact::of(&topic.schema).is_some(),
            }
    }

    /// Returns the names of the message types as text.
    fn type_names(self) -> String {
        match self {
            Self::Scan => "sensor_msgs/LaserScan".to_owned(),
            Self::Depth => "sensor_msgs/Image, sensor_msgs/CompressedImage".to_owned(),
            Self::Range => "sensor_msgs/Range".to_owned(),
            Self::Bumper => Contact::type_names(),
        }
    }
}

/// Returns the sources in the settings that exist. A source that a log lacks is reported and left
/// out, so that it never delivers a reading; on a robot its topic is waited for.
///
/// # Errors
/// A topic of another type, a calibration that cannot be used, and on a robot a source that has not
/// yet delivered a reading.
pub(crate) fn planned_sources(
    scan: &Scan,
    input: &InputSettings,
    tally: &mut Tally,
) -> Result<Vec<PlannedSource>, LogError> {
    let mut planned = Vec::new();
    // Sources without a topic are filled by a program.
    for source in input.sources.iter().filter(|source| !source.topic.is_empty()) {
        match planned_source(scan, source)? {
            Planned::Found(found) => planned.push(*found),
            Planned::Lacks { wanted, remedy } if scan.is_live() => {
                return Err(missing(scan, wanted, format!("; {remedy}")));
            }
            Planned::Lacks { wanted, remedy } => {
                tally.count("sources_without_messages");
                tally.note(format!("there is no {wanted}; {remedy}"));
            }
        }
    }
    Ok(planned)
}

/// Result of the search for a source.
enum Planned {
    Found(Box<PlannedSource>),
    Lacks { wanted: String, remedy: String },
}

/// Looks for the topic of a source, and for the calibration if it is a depth camera.
fn planned_source(scan: &Scan, source: &ObstacleTopic) -> Result<Planned, LogError> {
    let ObstacleTopic { name, kind, topic, .. } = source;
    let found = scan.topics.get(topic);
    if let Some(other) = found.filter(|found| !kind.reads(found)) {
        let wanted = kind.type_names();
        let why = format!("{topic}, which is {}; it has to be one of: {wanted}", kind_of(other));
        return Err(LogError::Source { path: scan.path.clone(), name: name.clone(), why });
    }
    let Some(found) = found.filter(|found| found.count > 0 || may_be_silent(found)) else {
        let wanted = format!("message of source `{name}` on {topic}");
        return Ok(Planned::Lacks { wanted, remedy: alternatives(scan, *kind) });
    };
    let info_topic = match kind {
        ObstacleKind::Depth => info_topic_of(scan, source),
        ObstacleKind::Scan | ObstacleKind::Range | ObstacleKind::Bumper => None,
    };
    let lens = match &info_topic {
        Some(info_topic) => lens_of(scan, source, info_topic)?,
        None => None,
    };
    if *kind == ObstacleKind::Depth && lens.is_none() {
        let wanted = format!("calibration (sensor_msgs/CameraInfo) of source `{name}` on {topic}");
        let remedy = "name its topic as `info_topic` of the source".to_owned();
        return Ok(Planned::Lacks { wanted, remedy });
    }
    let schema = found.schema.clone();
    Ok(Planned::Found(Box::new(PlannedSource { topic: source.clone(), schema, lens, info_topic })))
}

/// Returns true for a bumper whose silence means that it is not pressed.
fn may_be_silent(topic: &Topic) -> bool {
    Contact::of(&topic.schema).is_some_and(Contact::may_be_silent)
}

/// Returns the topics that a source of this kind could have, as text.
fn alternatives(scan: &Scan, kind: ObstacleKind) -> String {
    let fitting = scan.topics.iter().filter(|(_, topic)| kind.reads(topic));
    let names: Vec<String> = fitting
        .map(|(name, topic)| format!("{name} ({})", counted(topic.count, "message")))
        .collect();
    if names.is_empty() {
        format!("no topic has {}", kind.type_names())
    } else {
        format!("of {} there are {}", kind.type_names(), names.join(", "))
    }
}

/// Returns the topic of the calibration of a depth camera: the one that the settings name, or the one
/// beside its images.
fn info_topic_of(scan: &Scan, source: &ObstacleTopic) -> Option<String> {
    let named = source.info_topic.clone();
    named.or_else(|| calibration_of(scan, &source.topic, false).map(|it| it.topic))
}

/// Returns the lens of a depth camera; `None` without a calibration on this topic.
fn lens_of(
    scan: &Scan,
    source: &ObstacleTopic,
    info_topic: &str,
) -> Result<Option<Intrinsics>, LogError> {
    let Some(info) = scan.infos.get(info_topic) else { return Ok(None) };
    // The topic name is the only indication that images are rectified.
    intrinsics(info, source.topic.contains("rect")).map(Some).map_err(|source| {
        LogError::Calibration { path: scan.path.clone(), topic: info_topic.to_owned(), source }
    })
}
