//! Pose of the camera from the visible floor, for several checks.

use tagalong_math::median;

use super::super::evidence::Evidence;

/// Returns height, pitch and roll from the floor, each as the median over the frames.
pub fn by_floor(evidence: &Evidence) -> Option<[f64; 3]> {
    let floors = &evidence.samples.floors;
    Some([
        median(floors.iter().map(|(ground, _)| ground.height_m))?,
        median(floors.iter().map(|(ground, _)| ground.pitch_down_rad().to_degrees()))?,
        median(floors.iter().map(|(ground, _)| ground.roll_rad().to_degrees()))?,
    ])
}

/// Returns the settings for the pose of the camera, from the floor if it is visible.
pub fn mount_lines(evidence: &Evidence) -> String {
    match by_floor(evidence) {
        Some([height, pitch, roll]) => format!(
            "[input.camera]\nheight_m = {height:.2}\npitch_down_deg = {pitch:.1}\nroll_deg = {roll:.1}"
        ),
        None => "[input.camera]\nheight_m = 1.2  # measure it\npitch_down_deg = 0.0".into(),
    }
}
