//! Free space where a person is expected: depth readings far beyond the position of a track
//! contradict the track. They say more than a miss of a detector, which errs on people, too.

use tagalong_core::{Estimate, Frame};
use tagalong_geometry::Camera;

use crate::OcclusionSettings;
use crate::occlusion::{ray, silhouette};

/// Smallest part of the silhouette that must have readings: a hole in depth is no free space.
const MIN_READINGS: f64 = 0.4;
/// Smallest part of the readings that must lie beyond: the rest may be noise, or the edge of a
/// thing beside the silhouette.
const MIN_BEYOND: f64 = 0.9;
/// Standard deviations of the range by which readings must lie beyond the position.
const GAP_SIGMAS: f64 = 2.0;

/// Returns true if the depth image shows free space at the estimated position of a person: most
/// readings on the silhouette of head and trunk lie beyond it by more than `settings.free_gap_m`
/// and the uncertainty of its range. False without a depth image.
pub(crate) fn is_seen_through(
    estimate: &Estimate,
    frame: &Frame,
    settings: &OcclusionSettings,
) -> bool {
    let camera = &frame.camera;
    let Ok(depth) = frame.depth() else { return false };
    let expected_m = camera.depth_of(&estimate.person.position);
    let gap_m = settings.free_gap_m.max(GAP_SIGMAS * range_sigma(estimate, camera));
    let (mut inside, mut readings, mut beyond) = (0_u32, 0_u32, 0_u32);
    for point in silhouette(&estimate.region) {
        let (x, y) = (point.x.floor() as i64, point.y.floor() as i64);
        let Some(metres) = depth.get(x, y) else { continue };
        inside += 1;
        if metres.is_finite() {
            readings += 1;
            beyond += u32::from(f64::from(metres) > expected_m + gap_m);
        }
    }
    let enough = |part: u32, of: u32, least: f64| f64::from(part) >= least * f64::from(of);
    inside > 0 && enough(readings, inside, MIN_READINGS) && enough(beyond, readings, MIN_BEYOND)
}

/// Returns the standard deviation of an estimated position along the viewing ray, m.
fn range_sigma(estimate: &Estimate, camera: &Camera) -> f64 {
    // A point at the camera has no direction; its variance is then zero.
    let direction = ray(&estimate.person.position, camera).try_normalize(1e-9).unwrap_or_default();
    let covariance = estimate.covariance.fixed_view::<3, 3>(0, 0);
    // Rounding may make the variance slightly negative, which would give a root that is NaN.
    (direction.transpose() * covariance * direction).x.max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Point3, SMatrix, Vector2};
    use tagalong_core::{DepthImage, EgoMotion, Images, Person, Stamp};
    use tagalong_geometry::{Distortion, Pinhole, Rect};

    use super::*;

    const HEAD: Point3<f64> = Point3::new(3.0, 0.0, 1.6);

    fn camera() -> Camera {
        let lens =
            Pinhole { fx: 500.0, fy: 500.0, cx: 319.5, cy: 239.5, distortion: Distortion::None };
        Camera::mounted(lens, 640, 480, 1.2, 0.0, 0.0)
    }

    /// Returns what depth says of a person 3 m ahead, whose range has a standard deviation.
    fn seen_through_with(sigma_m: f64, depth: impl Fn(usize, usize, &Rect) -> f32) -> bool {
        let camera = camera();
        let region = camera.upper_body(&HEAD);
        let depth = DepthImage::from_fn(640, 480, |x, y| depth(x, y, &region));
        let images = Images { depth: Some(Arc::new(depth)), ..Images::default() };
        let frame =
            Frame::new(0, Stamp::default(), Arc::new(camera), EgoMotion::at_rest(0.1), images);
        let person = Person { position: HEAD, velocity: Vector2::zeros() };
        let mut covariance = SMatrix::zeros();
        covariance[(0, 0)] = sigma_m * sigma_m;
        let estimate = Estimate { person, covariance, region };
        is_seen_through(&estimate, &frame, &OcclusionSettings::default())
    }

    fn seen_through(depth: impl Fn(usize, usize, &Rect) -> f32) -> bool {
        seen_through_with(0.05, depth)
    }

    #[test]
    fn a_wall_far_behind_contradicts_a_person() {
        assert!(seen_through(|_, _, _| 5.0));
        assert!(seen_through(|_, _, _| 3.52));
        assert!(!seen_through(|_, _, _| 3.48), "it may be the person's back");
        assert!(!seen_through(|_, _, _| 3.0), "the person");
        assert!(!seen_through(|_, _, _| 1.0), "a thing in front hides the person");
    }

    #[test]
    fn an_uncertain_range_is_contradicted_only_from_farther_away() {
        assert!(!seen_through_with(0.5, |_, _, _| 3.9));
        assert!(seen_through_with(0.5, |_, _, _| 4.1));
    }

    #[test]
    fn a_person_beside_the_expected_place_does_not_leave_it_free() {
        let beside = |part: f64| {
            move |x: usize, _: usize, region: &Rect| {
                if (x as f64) < region.x + part * region.width { 3.0 } else { 5.0 }
            }
        };
        assert!(!seen_through(beside(0.4)));
        assert!(seen_through(beside(0.1)), "an edge of another thing");
    }

    #[test]
    fn holes_in_depth_are_no_free_space() {
        let holes = |of_ten: usize| {
            move |_: usize, y: usize, _: &Rect| if y % 10 < of_ten { f32::NAN } else { 5.0 }
        };
        assert!(seen_through(holes(4)));
        assert!(!seen_through(holes(8)));
        assert!(!seen_through(holes(10)));
    }
}
