//! Reasons for which a topic that is there cannot be used.

use super::calibration::{calibration_of, calibrations, intrinsics_of, misfit};
use crate::InputSettings;
use crate::camera_info::Intrinsics;
use crate::clock::Times;
use crate::scan::{Scan, Topic};
use crate::source::robot_frame;
use crate::timing::Skew;

/// Reason, with the setting or the action that cures it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Problem {
    pub(crate) why: String,
    pub(crate) remedy: String,
}

impl Problem {
    pub(super) fn new(why: impl Into<String>, remedy: impl Into<String>) -> Option<Self> {
        Some(Self { why: why.into(), remedy: remedy.into() })
    }
}

/// Offset beyond which two topics have different clocks, s.
const OTHER_CLOCK_S: f64 = 5.0;

/// Remedy for clocks that differ.
pub(super) const RECORDING: &str = "take the times of recording in place of the stamps: `--stamps recording`, or \
     `stamps = \"recording\"` under [input]";

/// Returns the reason for which depth cannot be brought together with the colour images.
pub(crate) fn depth_problem(
    scan: &Scan,
    input: &InputSettings,
    colour: &str,
    depth: &str,
) -> Option<Problem> {
    let of_colour = scan.topics.get(colour)?;
    let of_depth = scan.topics.get(depth)?;
    // On a robot, the first messages tell nothing about those to come.
    if !scan.is_live()
        && let Some(problem) = pairing_problem(of_colour, of_depth, input.pair_tolerance_s)
    {
        return Some(problem);
    }
    registration_problem(scan, input, colour, depth)
}

/// Returns the reason for which no image of a second topic is near one of the first in time.
fn pairing_problem(first: &Topic, second: &Topic, tolerance_s: f64) -> Option<Problem> {
    if second.has_constant_stamps() && !first.has_constant_stamps() {
        return Problem::new("its stamps never change", RECORDING);
    }
    let skew = Skew::between(&first.stamps, &second.stamps, tolerance_s)?;
    if skew.paired > 0.0 {
        return None;
    }
    let off_s = skew.median_s;
    let size_s = off_s.abs();
    let side = if off_s > 0.0 { "after" } else { "before" };
    let why = format!(
        "none of its images is within {:.0} ms of a colour image: by their stamps they come \
         {size_s:.3} s {side} it",
        1e3 * tolerance_s
    );
    if size_s > OTHER_CLOCK_S {
        return Problem::new(format!("{why}, by another clock"), RECORDING);
    }
    let wider_s = 1.2 * size_s + 0.01;
    Problem::new(
        why,
        format!("set `pair_tolerance_s = {wider_s:.2}` under [input], or {RECORDING}"),
    )
}

/// Returns the reason for which depth cannot be moved into the view of the colour camera.
fn registration_problem(
    scan: &Scan,
    input: &InputSettings,
    colour: &str,
    depth: &str,
) -> Option<Problem> {
    let of_colour = scan.topics.get(colour)?.size?;
    let of_depth = scan.topics.get(depth)?.size?;
    // Images of the same size are taken to be registered where nothing says how to do it.
    if of_colour == of_depth {
        return None;
    }
    let (width, height) = of_depth;
    let sizes = format!(
        "its images are {width}x{height}, those of {colour} {}x{}",
        of_colour.0, of_colour.1
    );
    let remedy = "record depth that the driver registers to colour (aligned depth), or ";
    let lens = match depth_lens(scan, input, depth) {
        Ok(lens) => lens,
        Err(why) => {
            return Problem::new(
                format!("{sizes}, and {why}"),
                format!("{remedy}name its calibration as `depth_info_topic` under [input]"),
            );
        }
    };
    if let Some(size) = misfit(scan, depth, &lens.1) {
        return Problem::new(
            format!("{sizes}, and its calibration {} is {size}", lens.0),
            format!(
                "{remedy}the camera_info of this resolution, named as `depth_info_topic` under [input]"
            ),
        );
    }
    let from = scan.frame_of(depth)?;
    let to = scan.frame_of(colour)?;
    if from != to && !scan.tf.connects(from, to) {
        return Problem::new(
            format!("{sizes}, and tf does not connect its frame `{from}` with `{to}`"),
            format!("{remedy}record /tf_static with the mounts of both cameras"),
        );
    }
    None
}

/// Returns the calibration of a depth topic and its lens, or the reason why there is none.
fn depth_lens(
    scan: &Scan,
    input: &InputSettings,
    depth: &str,
) -> Result<(String, Intrinsics), String> {
    let is_disparity = input.disparity.is_some();
    let named = input.depth_info_topic.clone();
    let found = named.or_else(|| calibration_of(scan, depth, is_disparity).map(|it| it.topic));
    let Some(topic) = found else {
        return Err(format!(
            "no calibration (sensor_msgs/CameraInfo) belongs to it: {}",
            calibrations(scan)
        ));
    };
    let lens = intrinsics_of(scan, depth, &topic, is_disparity);
    lens.map(|lens| (topic.clone(), lens)).map_err(|why| format!("its calibration {topic}: {why}"))
}

/// Remedy for scans with a header that cannot be.
pub(super) const SCANNER_REMEDY: &str = "correct the driver's settings of the scanner";

/// Returns the reason for which the scans of a topic cannot be used beside those of the first one.
pub(super) fn scanner_problem(
    scan: &Scan,
    input: &InputSettings,
    first: &str,
    topic: &str,
) -> Option<Problem> {
    if let Some(source) = input.sources.iter().find(|source| source.topic == topic) {
        return Problem::new(format!("it is the source of obstacles `{}`", source.name), "");
    }
    if let Some(fault) = scan.topics.get(topic).and_then(Topic::impossible) {
        return Problem::new(format!("its messages are invalid: {fault}"), SCANNER_REMEDY);
    }
    let named =
        format!("`laser_topic = \"{topic}\"` under [input] takes this one in place of {first}");
    let frame = scan.frame_of(topic).unwrap_or_default();
    if scan.frame_of(first) == Some(frame) {
        return Problem::new(format!("it has the frame `{frame}` of {first}: one scanner"), named);
    }
    let robot = robot_frame(scan, input);
    if !scan.tf.connects(robot, frame) {
        let why = format!("tf does not connect its frame `{frame}` with `{robot}`");
        return Problem::new(why, "record /tf_static with its mount");
    }
    None
}

/// Returns the problem of poses of which none is near a frame in time. `subject` names them.
pub(super) fn clock_problem(frames: &Times, poses: &Times, subject: &str) -> Option<Problem> {
    let behind_s = poses.first.seconds_since(frames.last);
    let ahead_s = frames.first.seconds_since(poses.last);
    if behind_s <= NEAR_S && ahead_s <= NEAR_S {
        return None;
    }
    let off_s = poses.first.seconds_since(frames.first);
    let side = if off_s > 0.0 { "later" } else { "earlier" };
    let is_other_time =
        poses.first_recorded > frames.last_recorded || poses.last_recorded < frames.first_recorded;
    let why = format!(
        "no stamp of {subject} is within {NEAR_S} s of any frame: it begins {:.1} s {side}",
        off_s.abs()
    );
    if is_other_time {
        Problem::new(
            format!("{why}, because it was recorded at another time"),
            "record it together with the sensor that makes the frames",
        )
    } else {
        Problem::new(
            format!("{why}, by another clock (simulated time against that of the computer?)"),
            RECORDING,
        )
    }
}

/// Time between a frame and a pose beyond which the two have nothing to do with each other, s.
const NEAR_S: f64 = 1.0;
