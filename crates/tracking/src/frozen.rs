//! Tracks that stay where they are: after a fault that makes every further position wrong.

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
