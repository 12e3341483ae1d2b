use tagalong_math::median;
use tagalong_vision::ground::ROBOT_HEIGHTS_M;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};
use super::pose::{by_floor, mount_lines};

/// Checks that height and tilt of the camera agree with the visible floor.
pub fn mount(evidence: &Evidence) -> Option<Finding> {
    let floors = &evidence.samples.floors;
    // A pose that comes from the floor itself would always agree with it.
    if evidence.inspection.facts.camera_source.starts_with("the floor")
        || floors.len() < 3.min(evidence.samples.count)
    {
        return None;
    }
    if evidence.is_lens_assumed() {
        let measured = "not known: the lens is assumed, and the floor is measured with it";
        return Some(Finding::new("mount", Severity::Unknown, measured));
    }
    let height = median(floors.iter().map(|(ground, camera)| ground.height_m - camera.height_m()))?;
    let pitch =
        median(floors.iter().map(|(ground, camera)| {
            (ground.pitch_down_rad() - camera.pitch_down_rad()).to_degrees()
        }))?;
    let roll = median(
        floors.iter().map(|(ground, camera)| (ground.roll_rad() - camera.roll_rad()).to_degrees()),
    )?;
    let [seen, ..] = by_floor(evidence)?;
    let told = seen - height;
    let severity = Severity::beyond(height.abs(), 0.12, 0.3)
        .max(Severity::beyond(pitch.abs(), 3.0, 6.0))
        .max(Severity::beyond(roll.abs(), 3.0, 6.0));
    let measured = format!(
        "{told:.2} m high by {}; the floor says {height:+.2} m, {pitch:+.1} degrees further down, \
         {roll:+.1} of roll",
        evidence.inspection.facts.camera_source
    );
    let finding = Finding::new("mount", severity, measured)
        .figure("height_off_m", height)
        .figure("pitch_off_deg", pitch)
        .figure("roll_off_deg", roll)
        .why("heads are looked for at the height of heads above the floor");
    // A wrong unit of depth scales the height, but not the angles.
    let scaled = pitch.abs() < 3.0
        && roll.abs() < 3.0
        && ROBOT_HEIGHTS_M.contains(&told)
        && !(0.7..1.4).contains(&(seen / told));
    Some(finding.remedy(if scaled {
        format!(
            "the tilt agrees, but the height does not: depth may be in another unit, {:.3} of the \
             assumed one:\n[input] depth_unit_m = ...\nelse\n{}",
            told / seen,
            mount_lines(evidence)
        )
    } else {
        mount_lines(evidence)
    }))
}
