//! Tracks that keep their positions after a fault that makes every further position wrong.

use nalgebra::{Matrix2, SMatrix};
use tagalong_core::{EgoMotion, Estimate, Person, Track};
use tagalong_geometry::Camera;

/// Returns a track that is not seen after a motion of the robot: at its place on the floor, with
/// its velocity and covariance in the robot's new axes.
pub(crate) fn held(track: &Track, motion: &EgoMotion, camera: &Camera) -> Track {
    let Estimate { person, covariance, .. } = &track.estimate;
    let mut position = person.position;
    let place = motion.apply_to_point(position.xy());
    (position.x, position.y) = (place.x, place.y);
    let velocity = motion.apply_to_velocity(person.velocity);
    let axes = axes(motion);
    let estimate = Estimate::new(
        Person { position, velocity },
        axes * covariance * axes.transpose(),
        camera.upper_body(&position),
    );
    let age = track.age.saturating_add(1);
    let unseen_s = track.unseen_s + motion.dt;
    track
        .clone()
        .with_estimate(estimate)
        .with_seen(false)
        .with_occluded(false)
        .with_age(age)
        .with_unseen_s(unseen_s)
}

/// Returns the turn of the axes of (x, y, z, vx, vy).
fn axes(motion: &EgoMotion) -> SMatrix<f64, 5, 5> {
    let turn: Matrix2<f64> = motion.isometry().rotation.inverse().to_rotation_matrix().into_inner();
    let mut axes = SMatrix::<f64, 5, 5>::identity();
    axes.fixed_view_mut::<2, 2>(0, 0).copy_from(&turn);
    axes.fixed_view_mut::<2, 2>(3, 3).copy_from(&turn);
    axes
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::{Point2, Point3, Vector2, one};
    use tagalong_core::TrackId;
    use tagalong_geometry::Rect;

    use super::*;

    /// The robot drives a metre ahead and turns to the left: what was ahead is to the right.
    #[test]
    fn a_held_track_stays_at_its_place_on_the_floor() {
        let person =
            Person { position: Point3::new(3.0, 0.5, 1.6), velocity: Vector2::new(1.0, 0.2) };
        let covariance = SMatrix::from_diagonal(&[0.4, 0.1, 0.2, 0.6, 0.3].into());
        let track = Track::new(TrackId(7), Estimate::new(person, covariance, Rect::default()), 2.0)
            .with_occluded(true)
            .with_age(3)
            .with_unseen_s(0.5);
        let turn = FRAC_PI_2;
        let motion = EgoMotion { forward: 1.0, turn, ..EgoMotion::at_rest(0.25) };
        let held = held(&track, &motion, &Camera::blind(one()));
        let Estimate { person, covariance, .. } = &held.estimate;
        assert!((person.position.xy() - Point2::new(0.5, -2.0)).norm() < 1e-12, "{person:?}");
        assert_eq!(person.position.z, 1.6);
        assert!((person.velocity - Vector2::new(0.2, -1.0)).norm() < 1e-12, "{person:?}");
        for (found, expected) in covariance.diagonal().iter().zip([0.1, 0.4, 0.2, 0.3, 0.6]) {
            assert!((found - expected).abs() < 1e-12, "{covariance}");
        }
        assert_eq!((held.id, held.confirmed, held.score), (TrackId(7), true, 2.0));
        assert_eq!((held.seen, held.occluded, held.age, held.unseen_s), (false, false, 4, 0.75));
    }
}
