//! Selection of the solids that rays through a part of an image can hit: those that intersect the
//! pyramid between the eye and the edges of the part.

use nalgebra::{Point3, Vector3};

use crate::seen::SolidView;
use crate::shape::Shape;

/// A solid in front of an eye.
pub struct SightedSolid<'a> {
    /// Index among all solids.
    pub number: u32,
    /// The person that it belongs to, if any.
    pub person: Option<u16>,
    /// The solid.
    pub shape: &'a Shape,
    /// View of the solid, for intersections with rays.
    pub seen: SolidView,
    /// Minimum depth of the solid along the optical axis, m.
    pub nearest: f64,
    eye: Point3<f64>,
}

/// Returns the solids that are not behind an eye that looks along the unit vector `forward`, and
/// that extend between two planes through the eye, each given by two rays; nearest first.
pub fn before<'a>(
    solids: impl Iterator<Item = (Option<u16>, &'a Shape)>,
    eye: &Point3<f64>,
    forward: &Vector3<f64>,
    [one, other]: [[Vector3<f64>; 2]; 2],
) -> Vec<SightedSolid<'a>> {
    let normals = [*forward, inward(&one, &other[0]), inward(&other, &one[0])];
    let mut found = Vec::new();
    for (number, (person, shape)) in (0..).zip(solids) {
        if shape.reaches(eye, &normals) {
            let nearest = forward.dot(&(shape.origin - eye)) - shape.extent(&-forward);
            found.push((nearest, number, person, shape));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut sights = Vec::with_capacity(found.len());
    for (nearest, number, person, shape) in found {
        let seen = shape.seen_from(eye);
        sights.push(SightedSolid { number, person, shape, seen, nearest, eye: *eye });
    }
    sights
}

/// Returns the solids that extend between two planes through the eye. Each plane is given by two
/// rays in it, and the rays of the other are on its inner side.
pub fn between<'s, 'a>(
    sights: impl IntoIterator<Item = &'s SightedSolid<'a>>,
    one: [Vector3<f64>; 2],
    other: [Vector3<f64>; 2],
) -> Vec<&'s SightedSolid<'a>>
where
    'a: 's,
{
    let normals = [inward(&one, &other[0]), inward(&other, &one[0])];
    sights.into_iter().filter(|sight| sight.shape.reaches(&sight.eye, &normals)).collect()
}

fn inward(plane: &[Vector3<f64>; 2], inside: &Vector3<f64>) -> Vector3<f64> {
    let normal = plane[0].cross(&plane[1]).normalize();
    if normal.dot(inside) < 0.0 { -normal } else { normal }
}
