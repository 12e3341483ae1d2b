use std::collections::BTreeSet;

use tagalong_config::nearest;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};
use super::pose::mount_lines;

/// Checks that the frames of tf are connected, and that the frame of the camera is an optical one.
pub fn frames(evidence: &Evidence) -> Option<Finding> {
    fn ok(measured: String) -> Option<Finding> {
        Some(Finding::new("frames", Severity::Ok, measured))
    }

    let facts = &evidence.inspection.facts;
    let tf = &evidence.inspection.transforms;
    let camera = evidence.samples.camera.as_ref()?;
    let name = facts.camera_frame.clone().unwrap_or_default();
    if evidence.input.camera.is_some() {
        return ok("the pose of the camera comes from [input.camera]".into());
    }
    if tf.is_empty() {
        let sensor = if camera.is_blind() { "scanner" } else { "camera" };
        return ok(format!("no tf; the pose of the {sensor} comes from {}", facts.camera_source));
    }
    if !facts.camera_source.starts_with("tf") {
        return Some(if camera.is_blind() {
            cut_scanner(evidence, &name)
        } else {
            cut(evidence, &name)
        });
    }
    let pitch = camera.pitch_down_rad().to_degrees();
    let roll = camera.roll_rad().to_degrees();
    // A body frame instead of the optical one turns the camera by 90 degrees, far beyond these
    // limits.
    let upright = pitch.abs() <= 65.0 && roll.abs() <= 45.0;
    if upright || camera.panorama().is_some() {
        return ok(format!("{} hangs below {}", name, facts.robot_frame));
    }
    let measured = format!(
        "according to tf the frame {name} looks {pitch:.0} degrees down, rolled by {roll:.0}"
    );
    let finding = Finding::new("frames", Severity::Bad, measured)
        .figure("pitch_down_deg", pitch)
        .figure("roll_deg", roll)
        .why("images belong to an optical frame (REP 103: z forward, x right); this one is a body frame, a rotation is missing, or the camera is mounted on its side");
    Some(finding.remedy(format!(
        "publish the images in the *_optical_frame, or give the pose:\n{}",
        mount_lines(evidence)
    )))
}

/// Reports that the frame of the scanner is not connected to that of the robot.
fn cut_scanner(evidence: &Evidence, scanner: &str) -> Finding {
    let facts = &evidence.inspection.facts;
    let robot = facts.robot_frame.as_str();
    let (measured, remedy) = if scanner.is_empty() {
        let readings = if facts.laser_topic.is_some() { "scans" } else { "points" };
        (format!("the frame_id of the {readings} is empty"), "let the driver set the frame_id")
    } else {
        (format!("tf does not connect `{scanner}` with `{robot}`"), "publish the missing transform")
    };
    Finding::new("frames", Severity::Bad, format!("{measured}; {}", facts.camera_source))
        .why("without the transform the position of the scanner on the robot is not known")
        .remedy(remedy)
}

/// Reports that the frame of the camera is not connected to that of the robot.
fn cut(evidence: &Evidence, camera: &str) -> Finding {
    let facts = &evidence.inspection.facts;
    let tf = &evidence.inspection.transforms;
    let names: BTreeSet<&str> = tf.iter().flat_map(|(a, b)| [a.as_str(), b.as_str()]).collect();
    let roots: Vec<&str> = names.iter().copied().filter(|name| !tf.contains_key(*name)).collect();
    let robot = facts.robot_frame.as_str();
    let lost = if names.contains(camera) { robot } else { camera };
    let hint = nearest(lost, names.iter().copied()).filter(|near| *near != lost);
    let hint = hint.map(|near| format!(" (did you mean `{near}`?)")).unwrap_or_default();
    let measured = if names.contains(lost) {
        format!("tf consists of {} separate trees, below {}", roots.len(), roots.join(", "))
    } else {
        format!("tf does not know the frame `{lost}`{hint}; its roots are {}", roots.join(", "))
    };
    let stands_in = facts.camera_source.starts_with("the floor");
    let severity = if stands_in { Severity::Warn } else { Severity::Bad };
    let base =
        if lost == robot && names.contains(camera) { root_of(evidence, camera) } else { None };
    let remedy = match base {
        Some(root) => format!(
            "[input] base_frame = \"{root}\", if that frame is on the floor; else\n{}",
            mount_lines(evidence)
        ),
        None => format!("publish the missing transform, or\n{}", mount_lines(evidence)),
    };
    Finding::new("frames", severity, format!("{measured}; {} stands in", facts.camera_source))
        .figure("trees", roots.len() as f64)
        .why("without the transform the height and the tilt of the camera are not known")
        .remedy(remedy)
}

/// Returns the root of the tree that contains a frame.
fn root_of(evidence: &Evidence, frame: &str) -> Option<String> {
    let tf = &evidence.inspection.transforms;
    let mut at = frame;
    // Bounded by the number of frames, because a broken tf may have a cycle.
    for _ in 0..tf.len() {
        let Some(parent) = tf.get(at) else { break };
        at = parent;
    }
    (at != frame).then(|| at.to_owned())
}
