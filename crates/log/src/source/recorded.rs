//! Detections by other programs that were recorded in a log.

use nalgebra::{Isometry3, Point3};
use tagalong_core::ExternalDetection;
use tagalong_geometry::Rect;

use super::intake::Intake;
use super::mount::robot_frame;
use super::pairing::Payload;
use super::plan::Plan;
use super::tally::Tally;
use crate::msgs::{Detection2DArray, Detection3DArray, ObjectHypothesisWithPose, decode};
use crate::scan::Type;

/// Height of the crown above the centre of the head, m.
const CROWN_ABOVE_HEAD_M: f64 = 0.115;

/// Returns the detections of a message that was paired with a frame; none without a message, which
/// is counted.
pub(super) fn recorded(
    plan: &Plan,
    message: Option<Payload>,
    intake: &Intake,
    tally: &mut Tally,
) -> Option<Vec<ExternalDetection>> {
    let topic = plan.chosen.detections.as_ref()?;
    let Some(message) = message else {
        tally.count("frames_without_detections");
        return Some(Vec::new());
    };
    let in_space = plan.scan.topics.get(topic).map(|topic| topic.kind) == Some(Type::Detections3D);
    let read = if in_space { space(plan, &message, intake, tally) } else { boxes(&message) };
    Some(read.unwrap_or_else(|| {
        tally.lose("messages_undecodable", || format!("{topic}: not as its type says"));
        Vec::new()
    }))
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
    plan: &Plan,
    message: &Payload,
    intake: &Intake,
    tally: &mut Tally,
) -> Option<Vec<ExternalDetection>> {
    let array: Detection3DArray = decode(&message.data).ok()?;
    let robot = robot_frame(&plan.scan, &plan.input);
    let pose = match message.frame_id == robot {
        true => Some(Isometry3::identity()),
        false => intake.tf.lookup(robot, &message.frame_id, message.stamp),
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
