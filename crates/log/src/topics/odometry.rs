//! Choice of the odometry: the best of several topics whose times agree with those of the frames,
//! or otherwise transforms.

use super::kinds::{is_odometry, odometry_rank};
use super::problems::{Problem, RECORDING, WHOLE_SECONDS, clock_problem};
use super::{best_of, named};
use crate::clock::{DELAY_S, FUTURE_S, Times, constant_lag_s};
use crate::scan::{Scan, Topic};
use crate::source::robot_frame;
use crate::tf::plain;
use crate::{InputSettings, LogError};

/// Odometry of a log.
#[derive(Clone, Debug, Default)]
pub(super) struct FoundOdometry {
    pub(super) topic: Option<String>,
    /// Frames of tf that give the poses if no topic does: odometry frame and robot frame.
    pub(super) frames: Option<(String, String)>,
    /// Odometry that would have had priority but cannot be used, with the reasons.
    pub(super) unused: Vec<(String, Problem)>,
}

/// Chooses the odometry for frames that are made from the topic `primary`: the topic that the
/// settings name, otherwise the best one that can be used, otherwise transforms.
///
/// # Errors
/// A topic that the settings name but that is not odometry.
pub(super) fn choose_odometry(
    scan: &Scan,
    input: &InputSettings,
    primary: &str,
) -> Result<FoundOdometry, LogError> {
    let mut found = FoundOdometry::default();
    let mut next = named(scan, "odometry_topic", input.odometry_topic.as_deref(), is_odometry)?;
    let is_named = next.is_some();
    if !is_named {
        next = best_of(scan, &input.sources, scan.names(), odometry_rank);
    }
    while let Some(topic) = next {
        let Some(problem) = odometry_problem(scan, primary, &topic) else {
            found.topic = Some(topic);
            return Ok(found);
        };
        found.unused.push((topic, problem));
        if is_named {
            break;
        }
        let unused: Vec<&String> = found.unused.iter().map(|(unused, _)| unused).collect();
        let left = scan.names().filter(|name| unused.iter().all(|unused| unused != name));
        next = best_of(scan, &input.sources, left, odometry_rank);
    }
    let odom = &input.odom_frame;
    let robot = robot_frame(scan, input);
    if scan.tf.knows(odom) && scan.tf.connects(odom, robot) {
        match transform_odometry_problem(scan, primary, odom, robot) {
            Some(problem) => found.unused.push((format!("tf ({odom} to {robot})"), problem)),
            None => found.frames = Some((odom.clone(), robot.to_owned())),
        }
    }
    Ok(found)
}

/// Frame in which odometry moves, by convention (REP 105).
const ODOMETRY_FRAME: &str = "odom";
/// Lead of the odometry stamps over those of the frames beyond which its clock must be a different
/// one, s.
const LEAD_S: f64 = 0.5;

/// Returns the reason why odometry cannot give the poses of the frames.
pub(super) fn odometry_problem(scan: &Scan, primary: &str, odometry: &str) -> Option<Problem> {
    if scan.is_live() {
        return None;
    }
    let frames = scan.topics.get(primary)?;
    let poses = scan.topics.get(odometry)?;
    let times = poses.times()?;
    if let Some(problem) = clock_problem(&frames.times()?, &times, "it") {
        return Some(problem);
    }
    if poses.has_constant_stamps() {
        return Problem::new("its stamps never change", RECORDING);
    }
    if times.are_whole_seconds() {
        return Problem::new(WHOLE_SECONDS, RECORDING);
    }
    if times.are_coarse() {
        return Problem::new(
            "most of its stamps are those of several messages, which were recorded one after the \
             other",
            RECORDING,
        );
    }
    lag_problem(frames, poses)
}

/// Returns a message about odometry whose messages name the robot as the parent and the odometry
/// frame as the child. No message shows whether the poses are exchanged as well.
pub(crate) fn exchanged_frames(
    scan: &Scan,
    input: &InputSettings,
    odometry: &str,
) -> Option<String> {
    let topic = scan.topics.get(odometry)?;
    let parent = topic.frame_id.as_deref()?;
    let child = topic.child_frame_id.as_deref()?;
    let robot = robot_frame(scan, input);
    let is_robot = plain(parent) == plain(robot) || is_named(parent, &ROBOT_FRAMES);
    let is_fixed = plain(child) == plain(&input.odom_frame) || is_named(child, &FIXED_FRAMES);
    (is_robot && is_fixed).then(|| {
        format!(
            "{odometry} has the frame_id `{parent}`, which is the robot's, and the child_frame_id `{child}`: \
             parent and child are exchanged; its poses are taken for those of `{parent}` in `{child}`; let \
             the driver write `{child}` as frame_id and `{parent}` as child_frame_id, and if the poses \
             themselves are exchanged, name other odometry as `odometry_topic` under [input]"
        )
    })
}

/// Beginnings of the names of frames on the robot, and of frames in which it moves (REP 105).
const ROBOT_FRAMES: [&str; 1] = ["base"];
const FIXED_FRAMES: [&str; 3] = [ODOMETRY_FRAME, "map", "world"];

/// Returns true if the last part of a frame's name begins with one of these words.
fn is_named(frame: &str, words: &[&str]) -> bool {
    let name = frame.rsplit('/').next().unwrap_or_default();
    words.iter().any(|word| name.starts_with(word))
}

/// Returns the problem of odometry whose stamps are all too early or too late by the same time, as
/// the recording times show.
fn lag_problem(frames: &Topic, poses: &Topic) -> Option<Problem> {
    let of_frames_s = constant_lag_s(&frames.stamps, &frames.recorded)?;
    let of_poses_s = constant_lag_s(&poses.stamps, &poses.recorded)?;
    let off_s = of_poses_s - of_frames_s;
    // Frames may come late by any time. No stamp lies in the future, unless the clock of the
    // recording itself is late.
    let is_ahead = off_s > LEAD_S && of_poses_s > FUTURE_S && of_frames_s < FUTURE_S;
    if !is_ahead && off_s > -DELAY_S {
        return None;
    }
    let side = if off_s > 0.0 { "later" } else { "earlier" };
    lag_of(format!("{:.2} s {side}", off_s.abs()))
}

/// Returns the problem of stamps that differ from those of the frames, in words.
fn lag_of(off: String) -> Option<Problem> {
    let why = format!(
        "compared by the times of recording, its stamps are {off} than those of the frames: \
         another clock"
    );
    Problem::new(why, RECORDING)
}

/// Returns the problem of a transform whose stamps are all too early. Late ones prove nothing,
/// because localisation gives its transforms later stamps on purpose.
fn late_transform_problem(frames: &Topic, link: &Times) -> Option<Problem> {
    let of_frames_s = constant_lag_s(&frames.stamps, &frames.recorded)?;
    let off_s = link.latest_lag_s()? - of_frames_s;
    if off_s > -DELAY_S {
        return None;
    }
    lag_of(format!("all {:.2} s or more earlier", -off_s))
}

/// Returns the reason why transforms cannot be the odometry.
pub(crate) fn transform_odometry_problem(
    scan: &Scan,
    primary: &str,
    odom: &str,
    robot: &str,
) -> Option<Problem> {
    if let Some(problem) = transform_problem(scan, primary, odom, robot) {
        return Some(problem);
    }
    if scan.is_live() {
        return None;
    }
    let frames = scan.topics.get(primary)?;
    for (frame, _) in scan.tf.moving_frames(odom, robot) {
        let Some(times) = scan.link_times.get(frame) else { continue };
        if times.are_whole_seconds() {
            return Problem::new(WHOLE_SECONDS, RECORDING);
        }
        // Above the odometry frame there is localisation, which corrects it from time to time.
        let is_odometry_frame =
            frame.rsplit('/').next().is_some_and(|name| name.starts_with(ODOMETRY_FRAME));
        if !is_odometry_frame && let Some(problem) = late_transform_problem(frames, times) {
            return Some(problem);
        }
    }
    None
}

/// Returns the reason why tf has no pose of frame `source` in frame `target` at the times of the
/// frames made from the topic `primary`: a moving transform with another clock.
pub(crate) fn transform_problem(
    scan: &Scan,
    primary: &str,
    target: &str,
    source: &str,
) -> Option<Problem> {
    if scan.is_live() {
        return None;
    }
    let frames = scan.topics.get(primary)?.times()?;
    for (frame, parent) in scan.tf.moving_frames(target, source) {
        let Some(times) = scan.link_times.get(frame) else { continue };
        let subject = format!("the transform {parent} to {frame}");
        if let Some(problem) = clock_problem(&frames, times, &subject) {
            return Some(problem);
        }
    }
    None
}
