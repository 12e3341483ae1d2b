//! Warnings about settings that are valid but work badly.

use nalgebra::Point2;
use tagalong_core::Input;
use tagalong_geometry::Camera;

use crate::Pipeline;

/// Height of a tall person's head, m.
const TALL_M: f64 = 1.9;
/// Half of the view in height that is assumed where no camera is known, degrees: that of colour images of
/// a RealSense D435.
const HALF_VIEW_DEG: f64 = 21.0;
/// A config that needs no higher camera than this suits the usual ones, m.
const USUAL_CAMERA_M: f64 = 1.25;
/// Configs for lower cameras find people by their legs, too, m.
const HEADS_FROM_M: f64 = 0.9;

impl Pipeline {
    /// Returns sentences on settings that are valid and work badly on a robot, with the remedy: a person who
    /// is kept where no detector sees them, or so near that their head is above the image of the `camera`,
    /// or of a usual one where none is known. None without a controller.
    pub fn cautions(&self, camera: Option<&Camera>) -> Vec<String> {
        let Some(steering) = &self.steering else { return Vec::new() };
        if self.sees_around() {
            return Vec::new();
        }
        if steering.leaves_view() {
            let words = "the controller keeps the person beside or behind the robot, where a \
                         camera that looks ahead does not see them, and no detector uses a laser \
                         scan: add such a detector, as docs/systems/following.md shows, or follow behind \
                         (`side = \"behind\"`)";
            return vec![words.to_owned()];
        }
        let suits = self.config.suits.camera_height_m;
        let needs_heads = suits.is_some_and(|[low_m, _]| low_m >= HEADS_FROM_M);
        let distance_m = steering.stand_off_m().filter(|_| needs_heads);
        distance_m.and_then(|distance_m| above_image(distance_m, camera)).into_iter().collect()
    }

    /// Returns true if a detector may find people all around the robot.
    fn sees_around(&self) -> bool {
        self.tracker.detectors().iter().any(|slot| {
            let inputs = slot.plugin.plugin().capabilities().inputs;
            [Input::Laser, Input::POINTS, Input::Detections].iter().any(|it| inputs.uses(*it))
        })
    }
}

/// Returns the warning of a distance at which the head of a tall person is above the image.
fn above_image(distance_m: f64, camera: Option<&Camera>) -> Option<String> {
    let raise = "raise `stand_off_m`";
    let Some(camera) = camera else {
        let camera_m = TALL_M - distance_m * HALF_VIEW_DEG.to_radians().tan();
        return (camera_m > USUAL_CAMERA_M).then(|| {
            format!(
                "at a stand-off of {distance_m:.2} m a level camera with a vertical field of view \
                 of {:.0} degrees sees the head of a tall person ({TALL_M} m) only if mounted at \
                 least {camera_m:.2} m above the floor: {raise}, or check with your camera \
                 (`tagalong check CONFIG LOG`)",
                2.0 * HALF_VIEW_DEG
            )
        });
    };
    let top_m = seen_up_to_m(distance_m, camera)?;
    (top_m < TALL_M).then(|| {
        format!(
            "at a stand-off of {distance_m:.2} m the camera sees people up to {top_m:.2} m: the head of a tall \
             person ({TALL_M} m) is above the image; {raise}, or tilt the camera up"
        )
    })
}

/// Returns the height up to which a camera sees at a distance ahead of the robot, m; `None` if it looks
/// nowhere ahead.
fn seen_up_to_m(distance_m: f64, camera: &Camera) -> Option<f64> {
    let eye = camera.robot_from_camera.translation.vector;
    let top = Point2::new(0.5 * (camera.width as f64 - 1.0), 0.0);
    let up = camera.back_project(top, 1.0).coords - eye;
    (up.x > 0.0).then(|| eye.z + up.z / up.x * (distance_m - eye.x))
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::{Distortion, Pinhole};

    use super::*;

    fn camera(height_m: f64, pitch_rad: f64) -> Camera {
        let lens =
            Pinhole { fx: 100.0, fy: 100.0, cx: 99.5, cy: 49.5, distortion: Distortion::None };
        Camera::mounted(lens, 200, 100, height_m, pitch_rad, 0.0)
    }

    #[test]
    fn a_camera_sees_as_high_as_its_upper_edge() {
        let top_m = seen_up_to_m(2.0, &camera(1.2, 0.0)).expect("it looks ahead");
        assert!((top_m - (1.2 + 2.0 * 0.495)).abs() < 1e-6, "{top_m}");
        assert_eq!(above_image(1.8, Some(&camera(1.2, 0.0))), None);
        let near = above_image(1.3, Some(&camera(1.2, 0.0))).expect("1.84 m");
        assert!(near.contains("1.30 m the camera sees people up to 1.84 m"), "{near}");
    }

    #[test]
    fn without_a_camera_the_height_that_one_needs_is_told() {
        assert_eq!(above_image(1.8, None), None);
        let near = above_image(1.3, None).expect("near");
        assert!(near.contains("only if mounted at least 1.40 m above the floor"), "{near}");
    }

    #[cfg(feature = "plugins")]
    #[test]
    fn configs_of_the_folder_need_no_caution_and_a_person_beside_a_camera_does() {
        fn cautions(text: &str) -> Vec<String> {
            Pipeline::from_toml(text).map(|pipeline| pipeline.cautions(None)).expect("it is valid")
        }

        for base in ["follow-depth", "follow-low", "robots/turtlebot3", "robots/turtlebot4"] {
            let text = format!("extends = '{base}.toml'\n");
            assert_eq!(cautions(&text), Vec::<String>::new(), "{base}");
        }
        let beside = "[controller]\nplugin = 'foresee-follow'\nconfig = { side = 'left' }\n";
        let camera = cautions(&format!("extends = 'follow-depth.toml'\n{beside}"));
        assert!(camera.len() == 1 && camera[0].contains("no detector uses a laser"), "{camera:?}");
        let scanner = cautions(&format!("extends = 'robots/turtlebot3.toml'\n{beside}"));
        assert_eq!(scanner, Vec::<String>::new());
        let near = "[controller]\nconfig = { stand_off_m = 1.3 }\n";
        let near = cautions(&format!("extends = 'follow-depth.toml'\n{near}"));
        assert!(near.len() == 1 && near[0].contains("stand-off of 1.30 m"), "{near:?}");
    }
}
