//! Shadows: for each direction from a lamp, the few solids that may stand there
//! (the light buffer of Haines & Greenberg 1986, on the faces of a cube).

use nalgebra::{Point3, Vector3};

use crate::lanes::{LANES, Vectors};
use crate::seen::SolidView;
use crate::shape::Shape;
use crate::sight::{before, between};

/// Cells along the side of a face of the cube for what moves, which is sorted into them anew for
/// every image, and for what stands still.
pub const COARSE: usize = 16;
/// See [`COARSE`].
pub const FINE: usize = 2 * COARSE;

/// Objects around a lamp that cast shadows.
#[derive(Clone, Debug, Default)]
pub struct Shadows {
    /// Cells along the side of a face.
    side: usize,
    solids: Vec<SolidView>,
    /// Numbers of solids, cell by cell.
    numbers: Vec<u32>,
    /// Six faces of rows of cells: where the numbers of each cell end.
    ends: Vec<u32>,
}

impl Shadows {
    /// The shadows that some solids throw, in faces of `side` by `side` cells.
    pub fn new<'a>(
        side: usize,
        lamp: Point3<f64>,
        solids: impl Iterator<Item = (Option<u16>, &'a Shape)> + Clone,
    ) -> Self {
        let seen = solids.clone().map(|(_, solid)| solid.seen_from(&lamp)).collect();
        let mut shadows = Self { side, solids: seen, ..Self::default() };
        for face in 0..6 {
            let sights = before(solids.clone(), &lamp, &on_face(face, 0.0, 0.0));
            let line = |number| line(number, side);
            let row = |row| [on_face(face, -1.0, line(row)), on_face(face, 1.0, line(row))];
            let column = |c| [on_face(face, line(c), -1.0), on_face(face, line(c), 1.0)];
            // Most solids are on one face only.
            let sights = between(&sights, row(0), row(side));
            let sights = between(sights, column(0), column(side));
            for above in 0..side {
                let strip = between(sights.iter().copied(), row(above), row(above + 1));
                for left in 0..side {
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
        let mut numbers = self.within(cell(way, self.side) as usize).iter();
        numbers.any(|n| self.solids[*n as usize].meet(way).is_some_and(|t| t < 1.0))
    }

    /// Closes the `open` ways from the lamp in which something stands; `cells` are those that the ways
    /// go through.
    pub fn darken(&self, ways: &Vectors, cells: &[i32; LANES], open: &mut [bool; LANES]) {
        let mut left = bits(open);
        let mut dark = 0;
        while left != 0 {
            let cell = cells[left.trailing_zeros() as usize];
            let together = left & bits(&cells.map(|other| other == cell));
            let numbers = self.within(cell as usize);
            if !numbers.is_empty() {
                dark |= together & barred(&self.solids, numbers, ways, together);
            }
            left &= !together;
        }
        for (lane, open) in open.iter_mut().enumerate() {
            *open &= dark >> lane & 1 == 0;
        }
    }

    /// The numbers of the solids in a cell.
    fn within(&self, cell: usize) -> &[u32] {
        let start = cell.checked_sub(1).map_or(0, |before| self.ends[before]);
        &self.numbers[start as usize..self.ends[cell] as usize]
    }
}

/// Returns a bit for each lane.
#[inline(always)]
fn bits(of: &[bool; LANES]) -> u32 {
    of.iter().rev().fold(0, |bits, bit| bits << 1 | u32::from(*bit))
}

/// Returns the ways in which some of the numbered solids stand, until none of those of interest
/// is left; both as bits.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn barred(solids: &[SolidView], numbers: &[u32], ways: &Vectors, interest: u32) -> u32 {
    // As wide as the rays' numbers, because vector instructions convert slowly between widths.
    let interest: [u64; LANES] = std::array::from_fn(|lane| u64::from(interest >> lane & 1));
    let mut barred = [0; LANES];
    for number in numbers {
        solids[*number as usize].bar(ways, 1.0, &mut barred);
        let mut open = 0;
        for lane in 0..LANES {
            open |= interest[lane] & !barred[lane];
        }
        if open == 0 {
            break;
        }
    }
    bits(&barred.map(|barred| barred != 0))
}

/// Returns the cells that some ways go through, of faces with `side` cells along a side.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub fn cells(ways: &Vectors, side: usize) -> [i32; LANES] {
    let mut cells = [0; LANES];
    for lane in 0..LANES {
        cells[lane] = cell(&ways.at(lane), side);
    }
    cells
}

/// Returns the coarse cells in which [`FINE`] cells lie. Twice as many cells along a side are exactly
/// half as large, so that these are the ones that [`cells`] returns, without its divisions.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
pub fn coarse_cells(fine: &[i32; LANES]) -> [i32; LANES] {
    // Sides are powers of two: column, row and face are digits of the number of a cell.
    const BITS: u32 = FINE.trailing_zeros();
    const DIGIT: i32 = FINE as i32 - 1;
    let mut coarse = [0; LANES];
    for lane in 0..LANES {
        let column = (fine[lane] & DIGIT) >> 1;
        let row = ((fine[lane] >> BITS) & DIGIT) >> 1;
        let face = fine[lane] >> (2 * BITS);
        coarse[lane] = face << (2 * BITS - 2) | row << (BITS - 1) | column;
    }
    coarse
}

/// Where a line between cells runs on a face, -1 to 1.
fn line(number: usize, side: usize) -> f64 {
    2.0 * number as f64 / side as f64 - 1.0
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

/// The cell that a way goes through. Without branches, for loops over lanes.
#[inline(always)]
fn cell(way: &Vector3<f64>, side: usize) -> i32 {
    let x = way.x.abs();
    let y = way.y.abs();
    let z = way.z.abs();
    let on_x = (x >= y) & (x >= z);
    let on_y = !on_x & (y >= z);
    // A face has the two axes that follow its own.
    let pick = |on: [f64; 3]| if on_x { on[0] } else { pick_other(on_y, on[1], on[2]) };
    let main = pick([way.x, way.y, way.z]);
    let u = pick([way.y, way.z, way.x]);
    let v = pick([way.z, way.x, way.y]);
    let axis = if on_x { 0 } else { 2 - i32::from(on_y) };
    let (side, half) = (side as i32, 0.5 * side as f64);
    let scale = half / main.abs();
    // A way without length falls into some cell, and nothing is in it.
    let along = |of: f64| ((of * scale + half) as i32).max(0).min(side.wrapping_sub(1));
    let face = axis.wrapping_mul(2).wrapping_add(i32::from(main < 0.0));
    face.wrapping_mul(side).wrapping_add(along(v)).wrapping_mul(side).wrapping_add(along(u))
}

#[inline(always)]
fn pick_other(first: bool, a: f64, b: f64) -> f64 {
    if first { a } else { b }
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
        #[test]
        fn coarse_cells_are_those_of_a_coarse_cube(
            ways in prop::collection::vec(prop::array::uniform3(-4.0..4.0f64), LANES),
            flat in 0..4usize,
        ) {
            let mut side_by_side = Vectors::ZERO;
            for (lane, way) in ways.into_iter().enumerate() {
                let mut way = Vector3::from(way);
                // Ways along an axis lie on the border of cells.
                if let Some(part) = way.get_mut(flat).filter(|_| lane % 2 == 0) {
                    *part = 0.0;
                }
                side_by_side.set(lane, &way);
            }
            let fine = cells(&side_by_side, FINE);
            prop_assert_eq!(coarse_cells(&fine), cells(&side_by_side, COARSE));
        }

    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn shadows_are_where_the_way_to_the_lamp_is_barred(
            solids in solids(),
            points in prop::collection::vec(prop::array::uniform3(-4.0..4.0f64), 200),
            side in 1..40usize,
        ) {
            let lamp = Point3::new(0.3, -0.2, 0.5);
            let shadows = Shadows::new(side, lamp, solids.iter().map(|solid| (None, solid)));
            let ways: Vec<_> = points.into_iter().map(|point| Point3::from(point) - lamp).collect();
            let barred = |way: &Vector3<f64>| {
                solids.iter().any(|s| s.meet(&lamp, way).is_some_and(|t| t < 1.0))
            };
            for ways in ways.chunks_exact(LANES) {
                let mut side_by_side = Vectors::ZERO;
                (0..).zip(ways).for_each(|(lane, way)| side_by_side.set(lane, way));
                // Closed ways stay closed.
                let mut open: [bool; LANES] = std::array::from_fn(|lane| lane % 5 != 4);
                shadows.darken(&side_by_side, &cells(&side_by_side, side), &mut open);
                for (lane, (way, open)) in ways.iter().zip(open).enumerate() {
                    prop_assert_eq!(shadows.on(way), barred(way));
                    prop_assert_eq!(open, lane % 5 != 4 && !barred(way));
                }
            }
        }
    }
}
