//! Joints of people in the truth.

use nalgebra::{Isometry3, Point2, Point3};

use crate::body::Skeleton;
use crate::hits::HitImage;
use crate::mirror::MirrorCamera;
use crate::render::WorldCamera;

/// Maximum distance of the surface of a body in front of its joints, m; anything farther in front
/// is another part of the body.
const FLESH_M: f64 = 0.2;

/// A joint of a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Name in the keypoints of COCO, such as `left_shoulder`.
    pub name: &'static str,
    /// Position in the robot frame, m.
    pub in_robot: Point3<f64>,
    /// Position in the image, pixels, for a panorama camera in the unwrapped one; `None` outside.
    pub pixel: Option<Point2<f64>>,
    /// True if no object, other person or other part of the same body hides it; with a panorama
    /// camera the own body never hides it.
    pub in_sight: bool,
}

/// Pixel of a point in the image, and true if it is in sight; `None` outside.
pub(super) type Spot = Option<(Point2<f64>, bool)>;

/// Returns the joints of a person, with the `spot` of each point of the world.
pub(super) fn joints(
    skeleton: &Skeleton,
    world_from_robot: &Isometry3<f64>,
    spot: impl Fn(&Point3<f64>) -> Spot,
) -> Vec<Joint> {
    skeleton
        .joints()
        .into_iter()
        .map(|(name, at)| {
            let (pixel, in_sight) = spot(&at).unzip();
            let in_robot = world_from_robot.inverse_transform_point(&at);
            Joint { name, in_robot, pixel, in_sight: in_sight.unwrap_or(false) }
        })
        .collect()
}

/// Returns the appearance of a person's joint in an image through a lens.
pub(super) fn in_lens(
    view: &WorldCamera<'_>,
    seen: &HitImage,
    person: u16,
    joint: &Point3<f64>,
) -> Spot {
    let camera = view.camera;
    let row = camera.project(&(view.pose)(0.5).inverse_transform_point(joint))?.y;
    let in_robot = view.pose_at(row).inverse_transform_point(joint);
    let pixel = camera.project(&in_robot)?;
    let hit = seen.get(pixel.x.round() as i64, pixel.y.round() as i64)?;
    let is_own = hit.person == Some(person) && camera.depth_of(&in_robot) - hit.t < FLESH_M;
    Some((pixel, is_own))
}

/// Returns the appearance of a person's joint in the unwrapped image of a mirror.
pub(super) fn in_mirror(
    mirror: &MirrorCamera,
    raw: &HitImage,
    world_from_camera: &Isometry3<f64>,
    person: u16,
    joint: &Point3<f64>,
) -> Spot {
    let panorama = &mirror.panorama;
    let pixel = panorama.pixel(&world_from_camera.inverse_transform_point(joint));
    let at = panorama.raw_pixel(pixel.x, pixel.y).map(f64::round);
    let hit = raw.get(at.x as i64, at.y as i64)?;
    let is_inside = (0.0..panorama.rows as f64).contains(&pixel.y);
    is_inside.then_some((pixel, hit.person == Some(person)))
}
