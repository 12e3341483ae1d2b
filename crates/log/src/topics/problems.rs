//! Reasons why an existing topic cannot be used.

use super::calibration::{calibration_of, calibrations, intrinsics_of, misfit};
use crate::InputSettings;
use crate::camera_info::Intrinsics;
use crate::clock::Times;
use crate::scan::{Scan, Topic};
use crate::sensors::recent::NEAR_S as NEAR_SCAN_S;
use crate::source::robot_frame;
use crate::timing::{Skew, Timing, clock_words};

/// Reason, with the setting or the action that solves the problem.
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

/// Fraction of the messages that a remedy must match with frames.
const MOST_PAIRED: f64 = 0.5;
/// Offset beyond which two topics must have different clocks, s.
const OTHER_CLOCK_S: f64 = 5.0;

/// Remedy for clocks that differ.
pub(super) const RECORDING: &str = "take the times of recording in place of the stamps: `--stamps recording`, or \
     `stamps = \"recording\"` under [input]";

/// Remedy for messages that were recorded at another time.
pub(super) const TOGETHER: &str = "record it together with the sensor that makes the frames";

/// Reason for stamps that are rounded to seconds.
pub(super) const WHOLE_SECONDS: &str = "its stamps are rounded to whole seconds";

/// Returns the reason why depth cannot be matched with the colour images.
pub(crate) fn depth_problem(
    scan: &Scan,
    input: &InputSettings,
    colour: &str,
    depth: &str,
) -> Option<Problem> {
    let of_colour = scan.topics.get(colour)?;
    let of_depth = scan.topics.get(depth)?;
    // On a robot, the first messages prove nothing about those to come.
    if !scan.is_live()
        && let Some(problem) = pairing_problem(scan, of_colour, of_depth, input.pair_tolerance_s)
    {
        return Some(problem);
    }
    registration_problem(scan, input, colour, depth)
}

/// Returns the reason why no image of a second topic is close in time to one of the first.
pub(super) fn pairing_problem(
    scan: &Scan,
    first: &Topic,
    second: &Topic,
    tolerance_s: f64,
) -> Option<Problem> {
    if second.has_constant_stamps() && !first.has_constant_stamps() {
        return Problem::new("its stamps never change", RECORDING);
    }
    let skew = second.skew_from(first, tolerance_s)?;
    if let Some(why) = skew.other_clock() {
        return Problem::new(why, RECORDING);
    }
    if skew.paired > 0.0 {
        return None;
    }
    let apart_s = other_clock(first, second);
    let off_s = apart_s.unwrap_or(skew.median_s);
    let near_s = near_s(first, second);
    let times = if scan.has_recording_times { "times of recording" } else { "stamps" };
    let offset =
        if off_s.abs() < near_s || apart_s.is_some() { offset(off_s) } else { around(off_s) };
    let why = format!(
        "none of its images is within {:.0} ms of a colour image: by their {times} they come {offset} it",
        1e3 * tolerance_s,
    );
    if off_s.abs() < near_s {
        return Problem::new(why, wider_tolerance(off_s.abs()));
    }
    if is_recorded_apart(first, second) {
        return Problem::new(why, TOGETHER);
    }
    let why = if apart_s.is_some() { format!("{why}, by another clock") } else { why };
    Problem::new(why, at_capture(scan, first, second, tolerance_s))
}

/// Share of the period of images within which a neighbour in time is that image and not the next one.
const NEAR_PERIODS: f64 = 0.48;

/// Returns the offset up to which images of two topics are neighbours without doubt, s: nearly half the
/// period of the faster one.
pub(super) fn near_s(first: &Topic, second: &Topic) -> f64 {
    let periods =
        [first, second].map(|topic| Timing::of(&topic.stamps).map(|it| it.median_period_s));
    let shortest_s = periods.into_iter().flatten().reduce(f64::min);
    shortest_s.map_or(OTHER_CLOCK_S, |period_s| NEAR_PERIODS * period_s)
}

/// Returns the remedy for images whose stamps are too far apart for a wider tolerance: the recording
/// times if these bring them together.
pub(super) fn at_capture(scan: &Scan, first: &Topic, second: &Topic, tolerance_s: f64) -> String {
    let recorded = Skew::between(&second.recorded, &first.recorded, tolerance_s);
    let is_cured = recorded.is_some_and(|skew| skew.paired >= MOST_PAIRED);
    if is_cured && !scan.has_recording_times {
        RECORDING.to_owned()
    } else {
        "let the driver stamp both images at capture".to_owned()
    }
}

/// Returns an offset to images on both sides in words.
fn around(off_s: f64) -> String {
    format!("{:.3} s before or after", off_s.abs())
}

/// Returns a time offset in words.
fn offset(off_s: f64) -> String {
    let side = if off_s > 0.0 { "after" } else { "before" };
    format!("{:.3} s {side}", off_s.abs())
}

/// Returns the setting that pairs messages in spite of an offset.
pub(super) fn wider_tolerance(size_s: f64) -> String {
    format!("set `pair_tolerance_s = {:.2}` under [input]", 1.2 * size_s + 0.01)
}

/// Returns the reason why no recorded detections belong to a frame.
pub(super) fn detections_problem(
    scan: &Scan,
    input: &InputSettings,
    primary: &str,
    detections: &str,
) -> Option<Problem> {
    // On a robot, the first messages prove nothing about those to come.
    if scan.is_live() {
        return None;
    }
    let frames = scan.topics.get(primary)?;
    let messages = scan.topics.get(detections)?;
    let tolerance_s = input.pair_tolerance_s;
    if messages.has_constant_stamps() && !frames.has_constant_stamps() {
        let stamp = messages.stamps.first()?;
        let why = format!("its stamps are not set: all are {stamp}");
        return Problem::new(why, recording_of(frames, messages, tolerance_s));
    }
    // Detections may be slower than images, so each of them counts rather than each image.
    let skew = Skew::between(&messages.stamps, &frames.stamps, tolerance_s)?;
    if let Some(off_s) = messages.clock_from(frames, skew.paired == 0.0) {
        let why = clock_words(off_s, "frames");
        return Problem::new(why, recording_of(frames, messages, tolerance_s));
    }
    if skew.paired > 0.0 {
        return None;
    }
    let other_clock_s = other_clock(frames, messages);
    let off_s = other_clock_s.unwrap_or(-skew.median_s);
    let times = if scan.has_recording_times { "times of recording" } else { "stamps" };
    let is_near = off_s.abs() < near_s(frames, frames);
    let offset = if is_near || other_clock_s.is_some() { offset(off_s) } else { around(off_s) };
    let why = format!(
        "none of its messages is within {:.0} ms of a frame: by their {times} they come {offset} it",
        1e3 * tolerance_s,
    );
    let is_recorded_apart = scan.has_recording_times || is_recorded_apart(frames, messages);
    match (other_clock_s, is_recorded_apart) {
        (Some(_), true) => Problem::new(why, TOGETHER),
        (Some(_), false) => {
            let remedy = recording_of(frames, messages, tolerance_s);
            Problem::new(format!("{why}, by another clock"), remedy)
        }
        (None, _) if is_near => Problem::new(why, wider_tolerance(off_s.abs())),
        (None, _) => Problem::new(why, "let the detector copy the stamps of the images"),
    }
}

/// Returns the time from the first frame to the first of other messages, s, if all of these are
/// outside of the time span of the frames.
fn other_clock(frames: &Topic, messages: &Topic) -> Option<f64> {
    let frames = frames.times()?;
    let messages = messages.times()?;
    let is_apart = messages.first.seconds_since(frames.last) > NEAR_S
        || frames.first.seconds_since(messages.last) > NEAR_S;
    is_apart.then(|| messages.first.seconds_since(frames.first))
}

/// Returns true if two topics were recorded one after the other.
fn is_recorded_apart(first: &Topic, second: &Topic) -> bool {
    second.first_log_time > first.last_log_time || second.last_log_time < first.first_log_time
}

/// Returns the reason why no scan of a scanner is close in time to a frame.
pub(super) fn scan_times_problem(scan: &Scan, primary: &str, scanner: &str) -> Option<Problem> {
    if scan.is_live() || primary == scanner {
        return None;
    }
    let frames = scan.topics.get(primary)?;
    let scans = scan.topics.get(scanner)?;
    if scans.has_constant_stamps() && !frames.has_constant_stamps() {
        let stamp = scans.stamps.first()?;
        return Problem::new(format!("its stamps are not set: all are {stamp}"), RECORDING);
    }
    let skew = Skew::between(&scans.stamps, &frames.stamps, NEAR_SCAN_S)?;
    if skew.paired > 0.0 {
        return None;
    }
    if let Some(off_s) = scans.clock_from(frames, true) {
        return Problem::new(clock_words(off_s, "frames"), RECORDING);
    }
    let times = if scan.has_recording_times { "times of recording" } else { "stamps" };
    let why = format!(
        "none of its scans is within {NEAR_SCAN_S} s of a frame: by their {times} they come {} it",
        offset(other_clock(frames, scans).unwrap_or(-skew.median_s))
    );
    if scan.has_recording_times || is_recorded_apart(frames, scans) {
        return Problem::new(why, TOGETHER);
    }
    Problem::new(format!("{why}, by another clock"), RECORDING)
}

/// Returns the remedy of using recording times, with a tolerance for a slow detector.
fn recording_of(frames: &Topic, messages: &Topic, tolerance_s: f64) -> String {
    let skew = Skew::between(&messages.recorded, &frames.recorded, tolerance_s);
    match skew.filter(|skew| skew.paired < MOST_PAIRED) {
        Some(skew) => format!("{RECORDING}, and {}", wider_tolerance(skew.median_s.abs())),
        None => RECORDING.to_owned(),
    }
}

/// Returns the reason why depth cannot be transformed to the view of the colour camera.
fn registration_problem(
    scan: &Scan,
    input: &InputSettings,
    colour: &str,
    depth: &str,
) -> Option<Problem> {
    let of_colour = scan.topics.get(colour)?.size?;
    let of_depth = scan.topics.get(depth)?.size?;
    // Images of the same size are assumed to be registered if nothing tells how to register them.
    if of_colour == of_depth {
        return None;
    }
    let (width, height) = of_depth;
    let sizes = format!(
        "its images are {width}x{height}, those of {colour} {}x{}",
        of_colour.0, of_colour.1
    );
    let Problem { why, remedy } = geometry_problem(scan, input, colour, depth)?;
    Problem::new(format!("{sizes}, and {why}"), remedy)
}

/// Returns the missing part of the geometry for transforming depth to the view of the colour
/// camera; `None` if it is complete.
pub(crate) fn geometry_problem(
    scan: &Scan,
    input: &InputSettings,
    colour: &str,
    depth: &str,
) -> Option<Problem> {
    let remedy = "record depth that the driver registers to colour (aligned depth), or ";
    let lens = match depth_lens(scan, input, depth) {
        Ok(lens) => lens,
        Err(why) => {
            let other = if scan.infos.is_empty() {
                "record its camera_info"
            } else {
                "name its calibration as `depth_info_topic` under [input]"
            };
            return Problem::new(why, format!("{remedy}{other}"));
        }
    };
    if let Some(size) = misfit(scan, depth, &lens.1) {
        return Problem::new(
            format!("its calibration {} is {size}", lens.0),
            format!(
                "{remedy}the camera_info of this resolution, named as `depth_info_topic` under [input]"
            ),
        );
    }
    let from = scan.frame_of(depth)?;
    let to = scan.frame_of(colour)?;
    for (topic, frame) in [(depth, from), (colour, to)] {
        if from != to && frame.is_empty() {
            let why = format!("the frame_id of {topic} is empty");
            return Problem::new(why, format!("{remedy}let its driver set the frame_id"));
        }
    }
    if from != to && !scan.tf.connects(from, to) {
        return Problem::new(
            format!("tf does not connect its frame `{from}` with `{to}`"),
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

/// Remedy for scans with an impossible header.
pub(super) const SCANNER_REMEDY: &str = "correct the driver's settings of the scanner";

/// Returns the reason why the scans of a topic cannot be used together with those of the first one.
pub(super) fn scanner_problem(
    scan: &Scan,
    input: &InputSettings,
    primary: &str,
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
    scan_times_problem(scan, primary, topic)
}

/// Returns the problem of poses that are all far from the frames in time. `subject` names them.
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
        Problem::new(format!("{why}, because it was recorded at another time"), TOGETHER)
    } else {
        Problem::new(
            format!("{why}, by another clock (simulated time against that of the computer?)"),
            RECORDING,
        )
    }
}

/// Time between a frame and a pose beyond which the two are unrelated, s.
const NEAR_S: f64 = 1.0;
