use tagalong_pipeline::Suits;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Deviations from a stated range that are harmless, and those that are serious: of the height, m,
/// and of the pitch, degrees.
const HEIGHT_M: (f64, f64) = (Suits::HEIGHT_TOLERANCE_M, 0.5);
const PITCH_DEG: (f64, f64) = (3.0, 15.0);

/// Checks that the robot and the camera are among those that the config states (`[suits]`).
pub fn suits(evidence: &Evidence) -> Option<Finding> {
    odometry(evidence).or_else(|| baseline(evidence)).or_else(|| camera(evidence))
}

/// Checks that the log has odometry if the config needs it.
fn odometry(evidence: &Evidence) -> Option<Finding> {
    if !evidence.suits.odometry || evidence.has_odometry {
        return None;
    }
    let measured = "the log has no odometry, but the config is for a robot that has it".to_owned();
    let finding = Finding::new("suits", Severity::Bad, measured).why(
        "the config takes motion over ground as evidence; without odometry furniture seems \
         to move like people",
    );
    Some(finding.remedy(
        "record odometry or tf from odom; or take a config that needs none: `tagalong run LOG` \
         chooses one",
    ))
}

/// Checks that the baseline of a stereo pair suits the config.
fn baseline(evidence: &Evidence) -> Option<Finding> {
    let baseline_m = evidence.inspection.facts.baseline_m?;
    let range = evidence.suits.baseline_m?;
    if evidence.suits.baseline_off_m(baseline_m) <= 0.0 {
        return None;
    }
    let measured = format!("not for this pair: {}", said("m of baseline", 2, (baseline_m, range)));
    let finding = Finding::new("suits", Severity::Bad, measured)
        .figure("baseline_m", baseline_m)
        .why("a wide baseline gives no depth nearby, and a narrow one none far away");
    Some(finding.remedy("`tagalong run LOG` chooses the config for such a pair"))
}

fn camera(evidence: &Evidence) -> Option<Finding> {
    let camera = evidence.samples.camera.as_ref()?;
    let stated = &evidence.suits;
    let height = stated.camera_height_m.map(|range| (camera.height_m(), range));
    let pitch = stated.pitch_down_deg.map(|range| (camera.pitch_down_rad().to_degrees(), range));
    let is_stated = height.is_some() || pitch.is_some();
    if camera.is_blind() || evidence.is_pose_assumed() || !is_stated {
        return None;
    }
    let height_off_m = stated.height_off_m(camera.height_m());
    let pitch_off_deg = stated.pitch_off_deg(camera.pitch_down_rad().to_degrees());
    let severity = Severity::beyond(height_off_m, HEIGHT_M.0, HEIGHT_M.1).max(Severity::beyond(
        pitch_off_deg,
        PITCH_DEG.0,
        PITCH_DEG.1,
    ));
    let facts =
        [height.map(|it| said("m high", 2, it)), pitch.map(|it| said("degrees down", 0, it))];
    let facts: Vec<String> = facts.into_iter().flatten().collect();
    let verdict = if severity >= Severity::Warn { "not for this camera: " } else { "" };
    let finding = Finding::new("suits", severity, format!("{verdict}{}", facts.join("; ")))
        .figure("camera_height_m", camera.height_m())
        .figure("pitch_down_deg", camera.pitch_down_rad().to_degrees())
        .why("settings and models were fitted to cameras in this range only");
    Some(finding.remedy(
        "take a config for this height, see the first table of configs/README.md (depth-net-ekf: any \
         height); or try: `tagalong doctor LOG` compares those that fit",
    ))
}

fn said(unit: &str, digits: usize, (now, [low, high]): (f64, [f64; 2])) -> String {
    format!("{now:.digits$} {unit}, the config is for {low} to {high}")
}
