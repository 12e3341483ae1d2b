//! Detections by other programs that were recorded in a log.

use std::sync::Arc;

use nalgebra::{Isometry3, Point3};
use tagalong_core::{ExternalDetection, ExternalDetections, Input, Sensors, Stamp};
use tagalong_geometry::Rect;

use super::{Moment, SensorReader, SensorType, is_type};
use crate::msgs::{CdrError, Detection2DArray, Detection3DArray, ObjectHypothesisWithPose, decode};
use crate::pairing::{Payload, Waiting};
use crate::tally::Tally;
use crate::walk::Message;

const BOXES: &str = "vision_msgs/Detection2DArray";
const SPACE: &str = "vision_msgs/Detection3DArray";

/// Entry of recorded detections. They are read only if the settings name their topic, because
/// Tagalong's own output has the same type.
pub(super) const ENTRY: SensorType = SensorType {
    input: Input::Detections,
    messages: &[BOXES, SPACE],
    wanted: "recorded detections that `detections_topic` under [input] names",
    rank: None,
    header: |_| Ok(None),
    reader: |schema| Box::new(Recorded { in_space: is_type(schema, SPACE), ..Recorded::default() }),
};

/// Height of the crown above the centre of the head, m.
const CROWN_ABOVE_HEAD_M: f64 = 0.115;

/// Messages that wait for their frame.
#[derive(Default)]
struct Recorded {
    in_space: bool,
    waiting: Waiting,
    /// Message of the frame that is being made.
    paired: Option<Payload>,
}

impl SensorReader for Recorded {
    fn take(&mut self, message: &Message<'_>, _: &mut Tally) -> Result<(), CdrError> {
        self.waiting.push(Payload::of_headed(message)?);
        Ok(())
    }

    fn pair(&mut self, stamp: Stamp, next: Option<Stamp>, tolerance_s: f64) {
        self.paired = self.waiting.take(stamp, next, tolerance_s);
    }

    fn add_to(&self, sensors: Sensors, moment: &Moment<'_>, tally: &mut Tally) -> Sensors {
        let detections = self.detections(moment, tally);
        sensors.with(ExternalDetections { detections, camera: Arc::clone(moment.camera) })
    }

    fn is_ready(&self, stamp: Stamp, tolerance_s: f64) -> bool {
        self.waiting.has(stamp, tolerance_s)
    }

    fn set_aside(&mut self, newest: Stamp) {
        self.waiting.set_aside(newest);
    }

    fn restore(&mut self) {
        self.waiting.restore();
    }
}

impl Recorded {
    /// Returns the detections of the paired message; none without a message, which is counted.
    fn detections(&self, moment: &Moment<'_>, tally: &mut Tally) -> Vec<ExternalDetection> {
        let Some(message) = &self.paired else {
            tally.count("frames_without_detections");
            return Vec::new();
        };
        let read = if self.in_space { space(message, moment, tally) } else { boxes(message) };
        read.unwrap_or_else(|| {
            let topic = moment.topic;
            tally.lose("messages_undecodable", || format!("{topic}: not as its type says"));
            Vec::new()
        })
    }
}

fn boxes(message: &Payload) -> Option<Vec<ExternalDetection>> {
    let array: Detection2DArray = decode(&message.data).ok()?;
    let all = array.detections.iter().map(|detection| {
        let (centre, size) = (&detection.bbox.center.position, &detection.bbox);
        let (width, height) = (size.size_x, size.size_y);
        let (x, y) = (centre.x - 0.5 * width, centre.y - 0.5 * height);
        let region = Some(Rect { x, y, width, height });
        ExternalDetection { region, head: None, score: score(&detection.results) }
    });
    Some(all.filter(|recorded| recorded.region.is_some_and(|region| region.is_sane())).collect())
}

fn space(
    message: &Payload,
    moment: &Moment<'_>,
    tally: &mut Tally,
) -> Option<Vec<ExternalDetection>> {
    let array: Detection3DArray = decode(&message.data).ok()?;
    let robot = moment.robot_frame;
    let pose = match message.frame_id == robot {
        true => Some(Isometry3::identity()),
        false => moment.tf.lookup(robot, &message.frame_id, message.stamp),
    };
    let Some(robot_from_message) = pose else {
        tally.count("detections_without_transform");
        return Some(Vec::new());
    };
    let head = |detection: &crate::msgs::Detection3D| {
        let pose = robot_from_message * detection.bbox.center.isometry()?;
        let size = detection.bbox.size;
        // Vertical extent of the rotated box.
        let up = pose.rotation.to_rotation_matrix().matrix().row(2).abs();
        let height = up[0] * size.x + up[1] * size.y + up[2] * size.z;
        let at = pose.translation.vector;
        let head = Point3::new(at.x, at.y, at.z + 0.5 * height - CROWN_ABOVE_HEAD_M);
        head.iter().all(|v| v.is_finite()).then_some(head)
    };
    let all = array.detections.iter().filter_map(|detection| {
        let score = score(&detection.results);
        Some(ExternalDetection { region: None, head: Some(head(detection)?), score })
    });
    Some(all.collect())
}

/// Returns the best score; 1 for a detection without a hypothesis.
fn score(results: &[ObjectHypothesisWithPose]) -> f64 {
    let best = results.iter().map(|result| result.hypothesis.score).max_by(f64::total_cmp);
    best.filter(|score| score.is_finite()).unwrap_or(1.0)
}
