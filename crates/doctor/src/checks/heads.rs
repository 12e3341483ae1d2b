use std::ops::RangeInclusive;

use nalgebra::Point3;
use tagalong_geometry::Camera;

use super::super::evidence::Evidence;
use super::super::finding::{Finding, Severity};

/// Height of the top of a head, m.
const TOP_M: f64 = 1.75;

/// Range of the distances that are tried, m, and their number.
const NEAREST_M: f64 = 0.3;
const STEP_M: f64 = 0.05;
const STEPS: usize = 155;

/// Distance up to which people should be fully visible, m, and distance beyond which they are not
/// needed.
const NEAR_M: f64 = 1.5;
const BAD_NEAR_M: f64 = 2.5;
const FAR_M: f64 = 4.0;

/// Checks at which distances heads are in the image, from the height, pitch and lens of the camera.
pub fn heads(evidence: &Evidence) -> Option<Finding> {
    let camera = evidence.samples.camera.as_ref()?;
    // A mirror sees all around, and an unknown height gives no information.
    if camera.panorama().is_some() || camera.is_blind() || camera.height_m() <= 0.0 {
        return None;
    }
    if evidence.is_pose_assumed() {
        let measured = "not known: height and tilt of the camera are assumed";
        return Some(Finding::new("heads", Severity::Unknown, measured));
    }
    if evidence.is_lens_assumed() {
        let measured = "not known: the lens is assumed, and with it the field of view";
        return Some(Finding::new("heads", Severity::Unknown, measured));
    }
    let Some(range) = head_range(camera) else {
        let measured = format!("no head ({TOP_M} m) is in the image at any distance up to 8 m");
        let finding = Finding::new("heads", Severity::Bad, measured);
        return Some(finding.why(WHY).remedy(remedy(camera)));
    };
    let near = *range.start();
    let far = *range.end();
    let mut severity = Severity::beyond(near, NEAR_M, BAD_NEAR_M);
    let mut measured = format!("heads leave the image nearer than {near:.1} m");
    if near <= NEAREST_M {
        measured = "heads are in the image at any small distance".to_owned();
    }
    if far < FAR_M {
        measured += &format!(", and farther than {far:.1} m");
        severity = severity.max(Severity::Warn);
    }
    measured += &format!(
        " (camera {:.2} m high, {:.0} degrees down)",
        camera.height_m(),
        // Adding 0 turns a negative zero into a positive one.
        camera.pitch_down_rad().to_degrees().round() + 0.0
    );
    let finding = Finding::new("heads", severity, measured)
        .figure("nearest_head_m", near)
        .figure("farthest_head_m", far)
        .why(WHY);
    Some(finding.remedy(remedy(camera)))
}

const WHY: &str = "most detectors look for heads; only trunk and legs of nearer people are visible";

/// Returns the distances straight ahead at which the whole head is in the image, m; `None` if there
/// are none.
fn head_range(camera: &Camera) -> Option<RangeInclusive<f64>> {
    let eye = camera.robot_from_camera.translation.vector;
    let ahead = (camera.robot_from_camera.rotation * nalgebra::Vector3::z()).xy();
    let ahead = ahead.try_normalize(1e-6)?;
    let mut visible = Vec::new();
    for step in 0..STEPS {
        let distance = NEAREST_M + STEP_M * step as f64;
        let at = eye.xy() + ahead * distance;
        let pixel = camera.project(&Point3::new(at.x, at.y, TOP_M));
        if pixel.is_some_and(|pixel| pixel.y >= 0.0 && pixel.y < camera.height as f64) {
            visible.push(distance);
        }
    }
    Some(*visible.first()?..=*visible.last()?)
}

/// Returns the advice: the angle by which the camera would have to look up, and a detector that
/// needs no head.
fn remedy(camera: &Camera) -> String {
    let wanted = (TOP_M - camera.height_m()).atan2(NEAR_M);
    let top = camera.ray(nalgebra::Point2::new(0.5 * camera.width as f64, 0.0));
    let limit = (-top.y).atan2(top.z) - camera.pitch_down_rad();
    let up = (wanted - limit).to_degrees();
    let whole = "a detector that needs no head: depth-net (configs/depth-net-ekf.toml)";
    if (1.0..60.0).contains(&up) {
        format!("tilt the camera up by {up:.0} degrees, mount it higher, or take {whole}")
    } else {
        format!("mount the camera at another height or tilt, or take {whole}")
    }
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::Pinhole;

    use super::*;

    fn camera(height_m: f64, pitch_deg: f64) -> Camera {
        Camera::mounted(
            Pinhole::centred(525.0, 640, 480),
            640,
            480,
            height_m,
            f64::to_radians(pitch_deg),
            0.0,
        )
    }

    /// Half the view is atan(240 / 525) = 24.6 degrees.
    #[test]
    fn low_cameras_lose_heads_near_by() {
        let level = head_range(&camera(1.1, 0.0)).unwrap();
        let expected = 0.65 / (239.5 / 525.0);
        assert!((level.start() - expected).abs() <= STEP_M, "{level:?}, {expected}");
        assert!(*level.end() > 7.9);
        let low = head_range(&camera(0.3, 0.0)).unwrap();
        assert!((low.start() - 1.45 / (239.5 / 525.0)).abs() <= STEP_M, "{low:?}");
        let tilted = head_range(&camera(0.3, -15.0)).unwrap();
        assert!(tilted.start() < low.start());
    }

    #[test]
    fn high_cameras_that_look_down_lose_them_far_away() {
        let range = head_range(&camera(2.4, 35.0)).unwrap();
        let far = 0.65 / (35.0 - 24.52_f64).to_radians().tan();
        assert!((range.end() - far).abs() <= STEP_M, "{range:?}, {far}");
        assert_eq!(head_range(&camera(1.75, 60.0)), None);
    }

    #[test]
    fn a_remedy_says_by_how_much_to_look_up() {
        assert!(remedy(&camera(0.8, 10.0)).starts_with("tilt the camera up by 18 degrees"));
        assert!(remedy(&camera(1.75, 90.0)).starts_with("mount the camera"));
    }
}
