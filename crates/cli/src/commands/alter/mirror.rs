//! Left becomes right: in images, poses and truth.

use std::sync::Arc;

use nalgebra::{Isometry2, Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};
use tagalong_core::{Image, Images};
use tagalong_eval::Region;
use tagalong_eval::formats::people::Row;
use tagalong_geometry::{Camera, Distortion, Lens};

/// Returns the images mirrored.
pub(super) fn images(of: &Images) -> Images {
    Images {
        colour: of.colour.as_deref().map(mirrored),
        grey: of.grey.as_deref().map(mirrored),
        depth: of.depth.as_deref().map(mirrored),
        right: None,
    }
}

fn mirrored<P: Copy>(image: &Image<P>) -> Arc<Image<P>> {
    let last = image.width().saturating_sub(1);
    Arc::new(Image::from_fn(image.width(), image.height(), |x, y| image.row(y)[last - x]))
}

/// Returns the camera that sees a mirrored room as the mirrored images show it.
pub(super) fn camera(of: &Camera) -> Camera {
    let mut camera = of.clone();
    if let Lens::Pinhole(lens) = &mut camera.lens {
        lens.cx = of.width as f64 - 1.0 - lens.cx;
        // Tangential distortion across the image is the one with a side.
        match &mut lens.distortion {
            Distortion::PlumbBob(d) => d[3] = -d[3],
            Distortion::Rational(d) => d[3] = -d[3],
            Distortion::None | Distortion::Equidistant(_) => {}
        }
    }
    // The robot's left is Y, the image's right is X.
    let in_robot = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
    let in_camera = Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0));
    let turn = of.robot_from_camera.rotation.to_rotation_matrix();
    let turn = Rotation3::from_matrix_unchecked(in_robot * turn.matrix() * in_camera);
    let at = in_robot * of.robot_from_camera.translation.vector;
    camera.robot_from_camera =
        Isometry3::from_parts(at.into(), UnitQuaternion::from_rotation_matrix(&turn));
    camera
}

/// Returns a pose on the floor mirrored.
pub(super) fn pose(of: &Isometry2<f64>) -> Isometry2<f64> {
    let at = of.translation.vector;
    Isometry2::new(Vector2::new(at.x, -at.y), -of.rotation.angle())
}

/// Returns a row of truth in images of this width, mirrored.
pub(super) fn row(of: &Row, width: usize) -> Row {
    Row {
        upper_body: of.upper_body.map(|region| mirrored_box(region, width)),
        visible_body: of.visible_body.map(|region| mirrored_box(region, width)),
        head_in_camera_m: of.head_in_camera_m.map(|[right, down, ahead]| [-right, down, ahead]),
        ..of.clone()
    }
}

/// Returns a box at the other side of an image.
fn mirrored_box(region: Region, width: usize) -> Region {
    Region { x: width as f64 - 1.0 - region.x - region.width, ..region }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;
    use tagalong_geometry::Pinhole;

    use super::*;

    #[test]
    fn what_is_on_the_left_is_seen_on_the_right() {
        let d = [0.1, -0.05, 0.002, 0.003, 0.01];
        let lens = Pinhole {
            fx: 500.0,
            fy: 510.0,
            cx: 300.0,
            cy: 250.0,
            distortion: Distortion::PlumbBob(d),
        };
        let camera = Camera::mounted(lens, 640, 480, 1.2, 0.1, 0.2);
        let turned = super::camera(&camera);
        for (y, z) in [(0.4, 1.0), (-0.7, 1.6), (0.0, 0.3)] {
            let seen = camera.project(&Point3::new(3.0, y, z)).unwrap();
            let mirrored = turned.project(&Point3::new(3.0, -y, z)).unwrap();
            assert!((mirrored.x - (639.0 - seen.x)).abs() < 1e-9, "{seen} {mirrored}");
            assert!((mirrored.y - seen.y).abs() < 1e-9, "{seen} {mirrored}");
        }
        assert!(
            (super::camera(&turned).robot_from_camera.inverse() * camera.robot_from_camera)
                .translation
                .vector
                .norm()
                < 1e-12
        );
    }

    #[test]
    fn a_box_keeps_its_pixels() {
        let image = Image::from_fn(10, 2, |x, _| x as u8);
        let turned = mirrored(&image);
        assert_eq!(turned.row(1), [9, 8, 7, 6, 5, 4, 3, 2, 1, 0]);
        let text = "frame,id,ub_x,ub_y,ub_w,ub_h,head_x,head_y,head_z\n1,1,2,0,3,1,0.5,1,2\n";
        let rows = tagalong_eval::formats::people::parse(text, "made").unwrap();
        let row = row(&rows[0], 10);
        // From pixel 2 to pixel 5 is from pixel 4 to pixel 7 of the mirrored image.
        assert_eq!(row.upper_body, Some(Region::new(4.0, 0.0, 3.0, 1.0)));
        assert_eq!(row.head_in_camera_m, Some([-0.5, 1.0, 2.0]));
    }
}
