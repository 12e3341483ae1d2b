//! Detections of half-hidden people: a detection covers the visible half, so its centre is off by
//! up to half the width of the hidden part. Without a larger covariance a filter takes on the
//! velocity of the person in front.

use nalgebra::{Matrix3, Point3, Vector3};
use tagalong_core::{Detection, Estimate, Frame, Track};
use tagalong_geometry::Camera;

use crate::OcclusionSettings;
use crate::detections::DetectionSet;
use crate::occlusion::{Occluder, occluder_of_detection, occluder_of_estimate, part_shown, ray};

/// Increases the covariances of detections of half-hidden people. `predicted` is sorted from near
/// to far.
pub(crate) fn inflate_half_hidden(
    frame: &Frame,
    predicted: &[Track],
    detections: &mut DetectionSet,
    settings: &OcclusionSettings,
) {
    if settings.body_width_m == 0.0 {
        return;
    }
    let camera = &frame.camera;
    let mut occluders: Vec<Occluder> = Vec::new();
    for track in predicted {
        let Estimate { region, person, .. } = &track.estimate;
        let part = part_shown(region, &person.position, &occluders, camera, settings);
        let changed = detections.change_of_track(track.id, |found: &mut Detection| {
            found.covariance += lateral_covariance(part, &found.position, camera, settings);
        });
        match changed {
            Some(found) => occluders.push(occluder_of_detection(found, &track.estimate, frame)),
            // A confirmed track still hides the people behind it when it is missed.
            None => occluders
                .extend(track.confirmed.then(|| occluder_of_estimate(&track.estimate, frame))),
        }
    }
}

/// Returns the covariance, in the robot frame, m², of the lateral error of a half-hidden person.
fn lateral_covariance(
    part_shown: f64,
    position: &Point3<f64>,
    camera: &Camera,
    settings: &OcclusionSettings,
) -> Matrix3<f64> {
    let ray = ray(position, camera);
    // A person straight above the camera has no lateral direction; the covariance is then zero.
    let across = Vector3::new(-ray.y, ray.x, 0.0).try_normalize(1e-9).unwrap_or_default();
    let off = across * (0.5 * settings.body_width_m * (1.0 - part_shown));
    off * off.transpose()
}

#[cfg(test)]
mod tests {
    use tagalong_geometry::Pinhole;

    use super::*;

    fn camera() -> Camera {
        Camera::mounted(Pinhole::centred(500.0, 640, 480), 640, 480, 1.2, 0.0, 0.0)
    }

    #[test]
    fn who_is_half_hidden_may_stand_aside_and_not_nearer() {
        let settings = OcclusionSettings { body_width_m: 0.5, ..OcclusionSettings::default() };
        let [none, off] = [1.0, 0.4].map(|part| {
            lateral_covariance(part, &Point3::new(3.0, 0.0, 1.6), &camera(), &settings)
        });
        assert_eq!(none, Matrix3::zeros());
        assert!((off[(1, 1)].sqrt() - 0.15).abs() < 1e-12, "{off}");
        assert_eq!((off[(0, 0)], off[(2, 2)]), (0.0, 0.0));
        let left = lateral_covariance(0.4, &Point3::new(0.0, 3.0, 1.6), &camera(), &settings);
        assert!((left[(0, 0)].sqrt() - 0.15).abs() < 1e-12 && left[(1, 1)] == 0.0, "{left}");
    }
}
