//! Rays in one plane, such as those of a laser scanner: most solids are completely above or below
//! it.

use nalgebra::{Point3, Vector3};

use crate::seen::SolidView;
use crate::shape::Shape;

/// Margin for rounding, m.
const SLACK_M: f64 = 1e-6;

/// Solids that a plane intersects, for rays in it from one eye.
pub(crate) struct Slice<'a> {
    /// Start of the rays, m.
    pub eye: Point3<f64>,
    solids: Vec<(&'a Shape, SolidView)>,
}

impl<'a> Slice<'a> {
    /// Selects the solids that intersect the plane through an eye with this unit normal, in their
    /// order.
    pub fn new(
        solids: impl Iterator<Item = &'a Shape>,
        eye: Point3<f64>,
        normal: &Vector3<f64>,
    ) -> Self {
        let mut cut = Vec::new();
        for solid in solids {
            let above_m = normal.dot(&(solid.origin - eye));
            // The test of the bounding ball is cheap, so it comes first.
            if solid.is_beside(&eye, normal) {
                continue;
            }
            let reaches_down = solid.extent(&-normal) - above_m > -SLACK_M;
            let reaches_up = solid.extent(normal) + above_m > -SLACK_M;
            if reaches_down && reaches_up {
                cut.push((solid, solid.seen_from(&eye)));
            }
        }
        Self { eye, solids: cut }
    }

    /// Selects all solids, for rays from an eye in any direction.
    pub fn around(solids: impl Iterator<Item = &'a Shape>, eye: Point3<f64>) -> Self {
        Self { eye, solids: solids.map(|solid| (solid, solid.seen_from(&eye))).collect() }
    }

    /// Returns the first solid that a ray in the plane hits, and its distance in ray lengths.
    pub fn first(&self, ray: &Vector3<f64>) -> Option<(f64, &'a Shape)> {
        let per_length = 1.0 / ray.norm_squared();
        let mut first: Option<(f64, &'a Shape)> = None;
        for (solid, seen) in &self.solids {
            if !solid.near(&self.eye, ray, per_length) {
                continue;
            }
            if let Some(t) = seen.meet(ray)
                && first.is_none_or(|(nearest, _)| t < nearest)
            {
                first = Some((t, solid));
            }
        }
        first
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use nalgebra::Isometry3;

    use super::*;
    use crate::material::Material;
    use crate::shape::samples;
    use crate::world::{self, Object};

    fn solid(form: usize, at: [f64; 3], turn: f64) -> Shape {
        let form = samples::form(form);
        let turn = samples::turn(turn);
        Shape::new(form, Point3::from(at), turn, Material::plain([0.5; 3]))
    }

    proptest! {
        #[test]
        fn a_slice_loses_nothing_that_a_ray_in_its_plane_meets(
            solids in prop::collection::vec(
                (0..3usize, prop::array::uniform3(-3.0..3.0f64), -3.0..3.0f64), 0..30),
            tilt in -0.2..0.2f64, height_m in -1.0..1.0f64,
        ) {
            let solids: Vec<Shape> =
                solids.into_iter().map(|(form, at, turn)| solid(form, at, turn)).collect();
            let pose = Isometry3::new(
                Vector3::new(0.1, -0.2, height_m), Vector3::new(tilt, 0.5 * tilt, 0.0));
            let eye = pose * Point3::origin();
            let slice = Slice::new(solids.iter(), eye, &(pose.rotation * Vector3::z()));
            let object = Object::new(solids.clone(), None, true);
            for direction in 0..90 {
                let angle = f64::from(direction) * 0.07;
                let ray = pose.rotation * Vector3::new(angle.cos(), angle.sin(), 0.0);
                let met = slice.first(&ray).map_or(f64::INFINITY, |(t, _)| t);
                prop_assert_eq!(met, world::distance([&object], &eye, &ray));
            }
        }
    }
}
