//! People in images, for the truth.

use tagalong_geometry::Rect;

use crate::body::Skeleton;
use crate::hits::HitImage;
use crate::render::{Visibility, WorldCamera};
use crate::shape::Shape;

/// Returns the appearance of a person's upper body: the region from its position, and its visible
/// part.
pub(super) fn sight(
    view: &WorldCamera<'_>,
    seen: &HitImage,
    of: (u16, &[Shape]),
    skeleton: &Skeleton,
) -> (Option<Rect>, Visibility) {
    let camera = view.camera;
    let head = (view.pose)(0.5).inverse_transform_point(&skeleton.head);
    let pose = view.pose_at(camera.upper_body(&head).centre().y);
    let whole = camera.upper_body(&pose.inverse_transform_point(&skeleton.head));
    let clipped = whole.clipped(camera.width, camera.height);
    if clipped.width < 2.0 || clipped.height < 2.0 {
        return (None, Visibility::default());
    }
    let mut visibility = view.visibility(seen, of, pixels(&clipped));
    // The part of the square outside of the image counts as not visible.
    visibility.fraction *= clipped.area() / whole.area();
    (Some(clipped), visibility)
}

/// Converts to left, top, right, bottom.
fn pixels(area: &Rect) -> [usize; 4] {
    [area.x as usize, area.y as usize, area.right() as usize, area.bottom() as usize]
}
