use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Counters of undamaged messages that are skipped, each with its name, its description and a
/// remedy.
const SKIPPED: [(&str, &str, &str); 8] = [
    (
        "messages_not_read",
        "images in an encoding that is not read",
        "record jpeg, rgb8 or bayer_*8 instead",
    ),
    (
        "laser_scans_without_pose",
        "scans without a pose of the scanner",
        "publish tf from the robot to the scanner, throughout",
    ),
    (
        "detections_without_transform",
        "recorded detections without a transform",
        "publish tf from the robot to their frame, throughout",
    ),
    (
        "frames_without_camera_pose",
        "images at times without a pose of the camera, which get the last known one if there is any",
        "publish tf to the camera throughout, on /tf_static if it does not move on the robot, or give \
         [input.camera]",
    ),
    ("late_frames", "images that came too late to be put in order", "[input] reorder_frames = 8"),
    (
        "duplicate_frames",
        "images with the stamp of another",
        "check that no image is published twice, and that no bag is played in a loop",
    ),
    (
        "camera_info_changes",
        "changes of the calibration",
        "record with one calibration: the first one is used throughout",
    ),
    (
        "disparity_pixels_invalid",
        "pixels without a valid disparity",
        "their number depends on texture, light and the range of disparities: check the matcher's \
         settings",
    ),
];

/// Share of skipped messages above which they are a serious problem.
const MOST: f64 = 0.5;

/// Usual share of pixels without disparity.
const USUAL_INVALID: f64 = 0.5;

/// Checks the counters of messages that the reader did not use.
pub fn skipped(evidence: &Evidence) -> Option<Finding> {
    let found: Vec<_> = SKIPPED
        .iter()
        .filter_map(|(name, words, remedy)| Some((share(evidence, name)?, *words, *remedy)))
        .filter(|((severity, _), ..)| *severity > Severity::Ok)
        .collect();
    if found.is_empty() {
        return Some(Finding::new(
            "skipped",
            Severity::Ok,
            "no message of the topics used was left out",
        ));
    }
    let severity = found.iter().map(|((severity, _), ..)| *severity).max()?;
    let measured: Vec<String> =
        found.iter().map(|((_, count), words, _)| format!("{count} {words}")).collect();
    let remedies: Vec<&str> = found.iter().map(|(.., remedy)| *remedy).collect();
    let notes = evidence.inspection.notes.iter().filter(|note| note.contains("is not read"));
    let remedies: Vec<&str> = remedies.into_iter().chain(notes.map(String::as_str)).collect();
    let finding = Finding::new("skipped", severity, measured.join(", ")).why(
        "people in data that are left out are missed, and outdated poses or calibrations \
         misplace people",
    );
    Some(finding.remedy(remedies.join("\n")))
}

/// Returns the severity of a counter, and its count; `None` if nothing was counted.
fn share(evidence: &Evidence, name: &str) -> Option<(Severity, u64)> {
    let counters = &evidence.inspection.counters;
    let count = *counters.get(name).filter(|count| **count > 0)?;
    let (of, usual) = match name {
        "disparity_pixels_invalid" => {
            (counters.get("disparity_pixels").copied().unwrap_or(0), USUAL_INVALID)
        }
        _ => (evidence.reading.wanted.max(evidence.reading.made), 0.0),
    };
    let share = count as f64 / of.max(1) as f64;
    let serious = usual + MOST * (1.0 - usual);
    Some((Severity::beyond(share, usual, serious), count))
}
