use tagalong_core::Detection;
use tagalong_geometry::Camera;

/// Numbers of the place.
pub const COUNT: usize = 4;

/// Height of the head above the floor, m; distance from the camera, m; side of
/// the square, pixels: how much there is to see; and the score of the detector,
/// with which everything else is weighed.
pub fn push(camera: &Camera, candidate: &Detection, out: &mut Vec<f32>) {
    let eye = camera.robot_from_camera.translation.vector;
    let distance_m = (candidate.position.coords - eye).norm();
    let width_px = candidate.rect_in(camera).width;
    let numbers = [candidate.position.z, distance_m, width_px, candidate.score];
    out.extend(numbers.map(|number| number as f32));
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix3, Point3};
    use tagalong_geometry::{Distortion, ImageBox, Pinhole, Rect};

    use super::*;

    #[test]
    fn the_distance_is_from_the_camera_and_the_height_from_the_floor() {
        let lens = Pinhole { fx: 60.0, fy: 60.0, cx: 32.0, cy: 32.0, distortion: Distortion::None };
        let camera = Camera::mounted(lens, 64, 64, 1.2, 0.0, 0.0);
        let candidate =
            Detection::new("test", Point3::new(3.0, 4.0, 1.2), Matrix3::identity(), -1.5)
                .with_image(ImageBox::upper_body(Rect::new(8.0, 8.0, 20.0, 20.0)));
        let mut out = Vec::new();
        push(&camera, &candidate, &mut out);
        assert_eq!(out, [1.2, 5.0, 20.0, -1.5]);
        assert_eq!(out.len(), COUNT);
    }
}
