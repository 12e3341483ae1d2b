//! Shadows: for each direction from a lamp, the few solids that may stand there
//! (the light buffer of Haines & Greenberg 1986, on the faces of a cube).

use nalgebra::{Point3, Vector3};

use crate::lanes::{LANES, Vectors};
use crate::seen::SolidView;
use crate::shape::Shape;
use crate::sight::{before, between};

/// Cells along the side of a face of the cube.
const CELLS: usize = 16;

/// Objects around a lamp that cast shadows.
#[derive(Clone, Debug, Default)]
pub struct Shadows {
    solids: Vec<SolidView>,
    /// Numbers of solids, cell by cell.
    numbers: Vec<u32>,
    /// Six faces of rows of cells: where the numbers of each cell end.
    ends: Vec<u32>,
}

impl Shadows {
    /// The shadows that some solids throw.
    pub fn new<'a>(
        lamp: Point3<f64>,
        solids: impl Iterator<Item = (Option<u16>, &'a Shape)> + Clone,
    ) -> Self {
        let seen = solids.clone().map(|(_, solid)| solid.seen_from(&lamp)).collect();
        let mut shadows = Self { solids: seen, ..Self::default() };
        for face in 0..6 {
            let sights = before(solids.clone(), &lamp, &on_face(face, 0.0, 0.0));
            let row = |row| [on_face(face, -1.0, line(row)), on_face(face, 1.0, line(row))];
            let column = |c| [on_face(face, line(c), -1.0), on_face(face, line(c), 1.0)];
            // Most solids are on one face only.
            let sights = between(&sights, row(0), row(CELLS));
            let sights = between(sights, column(0), column(CELLS));
            for above in 0..CELLS {
                let strip = between(sights.iter().copied(), row(above), row(above + 1));
                for left in 0..CELLS {
                    let cell = between(strip.iter().copied(), column(left), column(left + 1));
                    shadows.numbers.extend(cell.iter().map(|sight| sight.number));
                    shadows.ends.push(shadows.numbers.len() as u32);
                }
            }
        }
        shadows
    }

    /// True if something stands in the way from the lamp to a point.
    pub fn on(&self, way: &Vector3<f64>) -> bool {
        let mut numbers = self.within(cell(way)).iter();
        numbers.any(|n| self.solids[*n as usize].meet(way).is_some_and(|t| t < 1.0))
    }

    /// Closes the `open` ways from the lamp in which something stands.
    pub fn darken(&self, ways: &Vectors, open: &mut [bool; LANES]) {
        let cells: [usize; LANES] = std::array::from_fn(|lane| cell(&ways.at(lane)));
        let mut left = *open;
        while let Some(lane) = left.iter().position(|left| *left) {
            let together: [bool; LANES] =
                std::array::from_fn(|other| left[other] && cells[other] == cells[lane]);
            let barred = barred(&self.solids, self.within(cells[lane]), ways, &together);
            for other in 0..LANES {
                open[other] &= !(together[other] && barred[other] != 0);
                left[other] &= !together[other];
            }
        }
    }

    /// The numbers of the solids in a cell.
    fn within(&self, cell: usize) -> &[u32] {
        let start = cell.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.numbers[start as usize..self.ends[cell] as usize]
    }
}

/// Returns one for each way in which some of the numbered solids stand, until none of the ways of
/// interest is left.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn barred(
    solids: &[SolidView],
    numbers: &[u32],
    ways: &Vectors,
    interest: &[bool; LANES],
) -> [u64; LANES] {
    let mut barred = [0; LANES];
    for number in numbers {
        solids[*number as usize].bar(ways, 1.0, &mut barred);
        let open = (0..LANES).filter(|lane| interest[*lane] && barred[*lane] == 0).count();
        if open == 0 {
            break;
        }
    }
    barred
}

/// Where a line between cells runs on a face, -1 to 1.
fn line(number: usize) -> f64 {
    2.0 * number as f64 / CELLS as f64 - 1.0
}

/// A point of a face of the cube of half side one. Even faces are those of
/// positive coordinates.
fn on_face(face: usize, u: f64, v: f64) -> Vector3<f64> {
    let axis = face / 2;
    let mut point = Vector3::zeros();
    point[axis] = if face.is_multiple_of(2) { 1.0 } else { -1.0 };
    point[(axis + 1) % 3] = u;
    point[(axis + 2) % 3] = v;
    point
}

/// The cell that a ray goes through.
fn cell(ray: &Vector3<f64>) -> usize {
    let axis = ray.iamax();
    let face = 2 * axis + usize::from(ray[axis] < 0.0);
    let scale = 0.5 * CELLS as f64 / ray[axis].abs();
    // A ray without length falls into some cell, and nothing is in its way.
    let along = |of: f64| ((of * scale + 0.5 * CELLS as f64) as usize).min(CELLS - 1);
    let (column, row) = (along(ray[(axis + 1) % 3]), along(ray[(axis + 2) % 3]));
    (face * CELLS + row) * CELLS + column
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;
    use crate::material::Material;
    use crate::shape::Form;

    fn solid((form, at, turn): (usize, [f64; 3], [f64; 3])) -> Shape {
        let form = match form {
            0 => Form::Ellipsoid(Vector3::new(0.3, 0.1, 0.5)),
            1 => Form::Block(Vector3::new(0.05, 0.6, 0.4)),
            _ => Form::Capsule { length: 0.9, first: 0.2, second: 0.08 },
        };
        let turn = Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
        Shape::new(form, Point3::from(at), turn, Material::plain([0.5; 3]))
    }

    fn solids() -> impl Strategy<Value = Vec<Shape>> {
        let at = prop::array::uniform3(-3.0..3.0f64);
        let turn = prop::array::uniform3(-3.0..3.0f64);
        prop::collection::vec((0..3usize, at, turn).prop_map(solid), 1..12)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn shadows_are_where_the_way_to_the_lamp_is_barred(
            solids in solids(),
            points in prop::collection::vec(prop::array::uniform3(-4.0..4.0f64), 200),
        ) {
            let lamp = Point3::new(0.3, -0.2, 0.5);
            let shadows = Shadows::new(lamp, solids.iter().map(|solid| (None, solid)));
            for point in points.into_iter().map(Point3::from) {
                let way = point - lamp;
                let barred = solids.iter().any(|s| s.meet(&lamp, &way).is_some_and(|t| t < 1.0));
                prop_assert_eq!(shadows.on(&way), barred);
            }
        }
    }
}
