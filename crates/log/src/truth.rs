//! Ground truth inside a log: positions of the people, from a simulator or an annotator.
//!
//! The channel [`crate::TRUTH_TOPIC`] carries one JSON text per image, with the image's stamp (see
//! [`TruthFrame`]). JSON is used because no ROS message has a field for "hidden and does not
//! count", and because any viewer can show it. It is written as a `std_msgs/String`, because some
//! readers of ROS 2 logs reject a file with any other kind of schema. A plain JSON message can be
//! read as well (message encoding `json`, schema encoding `jsonschema`, schema name
//! [`TRUTH_SCHEMA`]).

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::log_files::{LogFiles, TRUTH_TOPIC, open_file};
use crate::msgs::{StringMsg, decode};
use crate::walker::LogWalker;
use crate::{Limits, LogError};

/// Name of the schema in plain JSON.
pub const TRUTH_SCHEMA: &str = "tagalong/TruthFrame";

/// All people at the time of one image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TruthFrame {
    /// Stamp of the image, ns.
    pub stamp_ns: u64,
    /// All people, including those that do not count.
    pub people: Vec<TruthPerson>,
}

/// One person at one moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TruthPerson {
    /// ID, the same throughout the log.
    pub id: i64,
    /// Centre of the head in the robot frame (X forward, Y left, Z up), m.
    pub head_in_robot_m: Option<[f64; 3]>,
    /// Upper-body square clipped to the image: x, y, width, height, pixels. With a conical mirror
    /// it lies in the unwrapped panorama, and may continue beyond the right edge (see
    /// `tagalong_geometry::Panorama`).
    pub upper_body_px: Option<[f64; 4]>,
    /// Visible part of the upper body, likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visible_px: Option<[f64; 4]>,
    /// Centre of the trunk in the robot frame, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torso_in_robot_m: Option<[f64; 3]>,
    /// ID of the person that hides most of the hidden part of the upper body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub occluder: Option<i64>,
    /// Visible fraction of the upper body, 0 to 1.
    #[serde(default = "whole")]
    pub visible: f64,
    /// True if the person counts neither as a miss nor as a false positive.
    #[serde(default)]
    pub ignore: bool,
    /// Joints by their names in the keypoints of COCO (`left_shoulder`), if they are known.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub joints: BTreeMap<String, TruthJoint>,
}

/// One joint of a person.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TruthJoint {
    /// Position in the robot frame (X forward, Y left, Z up), m.
    pub in_robot_m: [f64; 3],
    /// Column and row in the image, pixels; absent outside of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub px: Option<[f64; 2]>,
    /// True if nothing hides the joint.
    #[serde(default)]
    pub in_sight: bool,
}

fn whole() -> f64 {
    1.0
}

impl TruthFrame {
    /// Returns the JSON schema of the message, for the log's schema record.
    pub fn schema() -> String {
        schemars::schema_for!(TruthFrame).to_value().to_string()
    }
}

/// Reads the truth of a log, sorted by stamp; `None` if the log has no such channel.
///
/// # Errors
/// A log that cannot be opened, or a message of the channel that is not a [`TruthFrame`], because
/// an incomplete truth would give wrong figures.
pub fn read_truth(path: &Path, limits: &Limits) -> Result<Option<Vec<TruthFrame>>, LogError> {
    let mut frames = Vec::new();
    let mut present = false;
    for part in LogFiles::of(path)?.parts() {
        let mut walker = LogWalker::open(part, limits)?;
        while let Some(message) = walker.next() {
            if message.channel.topic == TRUTH_TOPIC {
                let plain = message.channel.encoding == "json";
                let frame = parse(message.data, plain).map_err(|why| LogError::Truth {
                    path: part.clone(),
                    number: frames.len() + 1,
                    why,
                })?;
                frames.push(frame);
            }
        }
        present |= walker.channels().any(|channel| channel.topic == TRUTH_TOPIC);
    }
    frames.sort_by_key(|frame: &TruthFrame| frame.stamp_ns);
    Ok(present.then_some(frames))
}

/// Reads truth from a text with one [`TruthFrame`] per line, sorted by stamp.
///
/// # Errors
/// A file that cannot be read, or a line that is not a [`TruthFrame`].
pub fn read_truth_lines(path: &Path) -> Result<Vec<TruthFrame>, LogError> {
    let mut text = String::new();
    let read = open_file(path)?.read_to_string(&mut text);
    read.map_err(|error| wrong_line(path, 1, &error))?;
    let mut frames: Vec<TruthFrame> = Vec::new();
    for (at, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let frame = serde_json::from_str(line);
        frames.push(frame.map_err(|error| wrong_line(path, at + 1, &error))?);
    }
    frames.sort_by_key(|frame| frame.stamp_ns);
    Ok(frames)
}

/// Returns the error for a line of a truth file, counted from 1.
fn wrong_line(path: &Path, number: usize, why: &dyn std::fmt::Display) -> LogError {
    LogError::Truth { path: path.to_owned(), number, why: why.to_string() }
}

fn parse(data: &[u8], plain: bool) -> Result<TruthFrame, String> {
    if plain {
        return serde_json::from_slice(data).map_err(|error| error.to_string());
    }
    let text: StringMsg = decode(data).map_err(|error| error.to_string())?;
    serde_json::from_str(&text.data).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truth_is_read_from_lines_and_a_wrong_one_is_named() {
        let path =
            std::env::temp_dir().join(format!("tagalong-lines-{}.jsonl", std::process::id()));
        let [five, seven] = [5, 7].map(|stamp_ns| {
            serde_json::to_string(&TruthFrame { stamp_ns, people: Vec::new() }).unwrap()
        });
        std::fs::write(&path, format!("{seven}\n\n{five}\n")).unwrap();
        let stamps: Vec<u64> =
            read_truth_lines(&path).unwrap().iter().map(|frame| frame.stamp_ns).collect();
        assert_eq!(stamps, [5, 7]);
        std::fs::write(&path, format!("{seven}\nnonsense\n")).unwrap();
        let error = read_truth_lines(&path).unwrap_err();
        assert!(matches!(error, LogError::Truth { number: 2, .. }), "{error}");
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn what_is_left_out_means_whole_and_counted() {
        let text = r#"{"stamp_ns":5,"people":[{"id":3,"head_in_robot_m":[1,2,1.6],
                       "upper_body_px":null}]}"#;
        let frame: TruthFrame = serde_json::from_str(text).unwrap();
        let person = &frame.people[0];
        assert_eq!((person.visible, person.ignore, person.upper_body_px), (1.0, false, None));
        let text = serde_json::to_string(&frame).unwrap();
        assert_eq!(serde_json::from_str::<TruthFrame>(&text).unwrap(), frame);
        assert!(TruthFrame::schema().contains("head_in_robot_m"));
    }

    #[test]
    fn joints_are_read_by_their_names() {
        let text = r#"{"stamp_ns":5,"people":[{"id":3,"head_in_robot_m":null,"upper_body_px":null,
            "joints":{"left_knee":{"in_robot_m":[2,0.1,0.5],"px":[320,400.5],"in_sight":true},
                      "left_hip":{"in_robot_m":[2,0.1,0.9]}}}]}"#;
        let frame: TruthFrame = serde_json::from_str(text).unwrap();
        let joints = &frame.people[0].joints;
        assert_eq!(joints["left_knee"].px, Some([320.0, 400.5]));
        assert_eq!((joints["left_hip"].px, joints["left_hip"].in_sight), (None, false));
        let text = serde_json::to_string(&frame).unwrap();
        assert_eq!(serde_json::from_str::<TruthFrame>(&text).unwrap(), frame);
    }
}
