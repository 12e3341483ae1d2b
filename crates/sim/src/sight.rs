//! Which solids can be met by rays through a part of an image: those that reach
//! into the pyramid which the eye and the part's edges make.

use nalgebra::{Point3, Vector3};

use crate::seen::SolidView;
use crate::shape::Shape;

/// Room for rounding, m.
const SLACK_M: f64 = 1e-6;

/// A solid before an eye.
pub struct SightedSolid<'a> {
    /// Its number among all solids.
    pub number: u32,
    /// The person that it belongs to, if it does.
    pub person: Option<u16>,
    /// The solid.
    pub shape: &'a Shape,
    /// As rays meet it.
    pub seen: SolidView,
    /// Nothing of it is closer to the eye along the optical axis, m.
    pub nearest: f64,
    /// From the eye to its origin.
    way: Vector3<f64>,
    eye: Point3<f64>,
}

impl SightedSolid<'_> {
    /// True if a part of it is on the side of a plane through the eye that the
    /// unit vector points to.
    fn reaches(&self, normal: &Vector3<f64>) -> bool {
        // The ball around a solid is a cheap question to ask first.
        !self.shape.is_behind(&self.eye, normal)
            && normal.dot(&self.way) + self.shape.extent(normal) > -SLACK_M
    }
}

/// All solids that are not behind an eye that looks along the unit vector
/// `forward`, nearest first.
pub fn before<'a>(
    solids: impl Iterator<Item = (Option<u16>, &'a Shape)>,
    eye: &Point3<f64>,
    forward: &Vector3<f64>,
) -> Vec<SightedSolid<'a>> {
    let mut sights = Vec::new();
    for (number, (person, shape)) in (0..).zip(solids) {
        let way = shape.origin - eye;
        let nearest = forward.dot(&way) - shape.extent(&-forward);
        let seen = shape.seen_from(eye);
        let sight = SightedSolid { number, person, shape, seen, nearest, way, eye: *eye };
        if sight.reaches(forward) {
            sights.push(sight);
        }
    }
    sights.sort_by(|a, b| a.nearest.total_cmp(&b.nearest));
    sights
}

/// Those that reach between two planes through the eye. Each is given by two
/// rays in it, and the other's rays are on its inner side.
pub fn between<'s, 'a>(
    sights: impl IntoIterator<Item = &'s SightedSolid<'a>>,
    one: [Vector3<f64>; 2],
    other: [Vector3<f64>; 2],
) -> Vec<&'s SightedSolid<'a>>
where
    'a: 's,
{
    let normals = [inward(&one, &other[0]), inward(&other, &one[0])];
    sights.into_iter().filter(|sight| normals.iter().all(|n| sight.reaches(n))).collect()
}

fn inward(plane: &[Vector3<f64>; 2], inside: &Vector3<f64>) -> Vector3<f64> {
    let normal = plane[0].cross(&plane[1]).normalize();
    if normal.dot(inside) < 0.0 { -normal } else { normal }
}
